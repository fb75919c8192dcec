"""Options of the discrete-to-continuum conversion, validated when they are made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from dnacheck.numerics.outcome import InputError

#: C3 continuity needs at least this degree (knot multiplicity degree - 3 must be at least 1).
LOWEST_DEGREE = 4
#: Above this degree the B-spline basis is no longer well conditioned enough to trust.
HIGHEST_DEGREE = 12


@dataclass(frozen=True)
class RodOptions:
    """Choices of Section VI B; the defaults are the paper's.

    Parameters
    ----------
    filter_width : int
        w: box width of FILTFILT in base pairs, i.e. triangular weights of half-width w.
        1 switches the filter off.
    intervals : int
        k: number of polynomial pieces of the least-squares spline.
    degree : int
        m: degree of the pieces; the spline is three times continuously differentiable.
    padding : int
        Base pairs added cyclically at each end before filtering and fitting.
    interval_span : {"molecule", "padded"}
        What the ``intervals`` divide. "padded", which the paper's Figure 10 supports (see
        :mod:`dnacheck.model.rod`): the padded length; "molecule": the N + 1 steps of the molecule,
        with pieces of the same length in the padding.
    chebyshev_points : int
        Points per spline piece on which arclength, natural frame and strains are represented.
    condition_limit : float
        Largest condition number of the least-squares matrix that is accepted.
    anisotropy_limit : float
        Largest relative anisotropy or bend-twist coupling that may survive the average of a
        sequence-dependent stiffness over the filter window (the continuum model is transversely
        isotropic in the natural frame).
    slowest_speed : float
        Smallest accepted speed of the fitted centreline, in steps per base pair. Far below one
        the filter has erased the path and arclength has no meaning.
    """

    filter_width: int = 15
    intervals: int = 20
    degree: int = 6
    padding: int = 50
    interval_span: Literal["molecule", "padded"] = "padded"
    chebyshev_points: int = 21
    condition_limit: float = 1e8
    anisotropy_limit: float = 0.1
    slowest_speed: float = 0.3

    def __post_init__(self) -> None:
        for name, least in (
            ("filter_width", 1),
            ("intervals", 1),
            ("degree", LOWEST_DEGREE),
            ("padding", 0),
            ("chebyshev_points", 8),
        ):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise InputError(f"rod option {name} = {value!r}: give an integer >= {least}")
        if self.degree > HIGHEST_DEGREE:
            raise InputError(f"rod option degree = {self.degree}: at most {HIGHEST_DEGREE}")
        if 2 * (self.filter_width - 1) > self.padding:
            raise InputError(
                f"filter width {self.filter_width} reaches {2 * (self.filter_width - 1)} base "
                f"pairs (filtered twice) but the padding has {self.padding}: raise padding or "
                "narrow the filter"
            )
        if self.interval_span not in ("molecule", "padded"):
            raise InputError(
                f"rod option interval_span = {self.interval_span!r}: 'molecule' or 'padded'"
            )
        for name in ("condition_limit", "anisotropy_limit", "slowest_speed"):
            value = getattr(self, name)
            if not 0.0 < value < float("inf"):
                raise InputError(f"rod option {name} = {value!r}: give a positive number")
