"""``rings``, ``diagram`` and ``twist_ratio_scan``: equilibria, and how they follow a parameter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from dnacheck.api.arguments import one_of, whole
from dnacheck.api.molecules import Target, as_chain
from dnacheck.equilibria.boundary import ENDS, AnyBoundary, Ring
from dnacheck.equilibria.ring import Equilibria
from dnacheck.model.chain import Chain
from dnacheck.model.rod import Rod
from dnacheck.numerics.outcome import InputError, SolveError

if TYPE_CHECKING:
    from dnacheck.equilibria.continuation.component import Component
    from dnacheck.equilibria.continuation.twist_ratio import RatioSweep


def checked_link(link: Any, n_bp: int) -> Any:
    """As :func:`link_choice`, within what so many base pairs can have."""
    from dnacheck.model.ranges import check_link

    chosen: Any = link_choice(link)
    check_link(chosen, n_bp)
    return chosen


def link_choice(link: Any) -> str | int:
    """An argument ``link``: "auto", "all" or an integer; None is "auto"."""
    if link is None:
        return "auto"
    if isinstance(link, str):
        return one_of("link", link, ("auto", "all"))
    try:
        return whole("link", link, -(10**9))
    except InputError:
        raise InputError(f"link must be auto, all or an integer, not {link!r}") from None


def boundary_of(ends: Any) -> AnyBoundary:
    """An argument ``ends``: a boundary or the name of one; None is a ring."""
    if ends is None:
        return Ring()
    if isinstance(ends, str):
        return ENDS[one_of("ends", ends, ENDS)]
    if isinstance(ends, AnyBoundary):
        return ends
    raise InputError(
        f"ends must be {', '.join(ENDS)} or a boundary such as dnacheck.Loop, not {ends!r}"
    )


def rings(
    source: Chain | Rod | Target,
    link: str | int | None = None,
    ends: str | AnyBoundary | None = None,
    *,
    throw: bool = True,
) -> Equilibria:
    """Equilibria of a chain or a rod, lowest energy first; closed to a ring unless ends say else.

    Parameters
    ----------
    source : Chain, Rod, or what :func:`dnacheck.chain` takes
    link : "auto", "all" or int, optional
        Links to search: those that matter for J, a wide range, or one alone.
    ends : Ring, NickedRing, HingedRing, Loop, Pull, or the name of one of the first three
        What the end of the chain is held to; a rod is closed to a ring.
    throw : bool
        Whether to raise where no minimum is found; otherwise the result's ``status`` tells.

    Returns
    -------
    Equilibria
        A sequence of :class:`Equilibrium`; ``.lowest``, ``.to_frame()``, ``.to_dict()``.

    Raises
    ------
    InputError
        One line that names the argument and the mend.
    SolveError
        No minimum was found; ``partial`` holds the search with all that it met.

    Examples
    --------
    >>> import dnacheck as dc
    >>> ring = dc.rings("11T15").lowest
    >>> round(ring.energy_RT, 2), ring.link, ring.stable
    (10.53, 15, True)
    >>> ring.coordinates_A.shape, ring.angles_deg.shape
    ((159, 3), (158, 3))
    """
    boundary = boundary_of(ends)
    if not isinstance(source, Rod):
        source = as_chain(source)
    links = checked_link(link, source.n_steps)
    if isinstance(source, Rod):
        from dnacheck.equilibria.continuum import lowest_continuum_ring

        if boundary != Ring():
            raise InputError(
                f"ends: a rod is closed to a ring alone; give the chain for {boundary.label} ends"
            )
        found = lowest_continuum_ring(source, links)
    else:
        from dnacheck.equilibria.discrete.boundary_search import find_equilibria
        from dnacheck.equilibria.discrete.search import SearchOptions

        found = find_equilibria(source, boundary, SearchOptions(links=links))
    if throw and not found.minima:
        raise SolveError(f"{found.model} {boundary.label} of {found.name}: {found.reason}", found)
    return found


def diagram(
    source: Rod | Chain | Target,
    *,
    bounds: tuple[float, float] | None = None,
    start: float | None = None,
    max_points: int = 3000,
) -> Component:
    """Bifurcation diagram of a rod: its equilibria against the end twist, from the lowest ring.

    Parameters
    ----------
    source : Rod, Chain, or what :func:`dnacheck.chain` takes
    bounds : pair of float, optional
        End twist alpha between which branches are followed, in turns.
    start : float, optional
        End twist to start from, in turns; by default that of the lowest ring.
    max_points : int
        Points per branch and direction.

    Returns
    -------
    Component
        ``.branches``, ``.to_dict()`` (the JSON of ``dnacheck diagram``), ``.to_frame()``.

    Raises
    ------
    InputError
        One line that names the argument and the mend.
    SolveError
        No equilibrium to start from.

    Examples
    --------
    >>> import dnacheck as dc
    >>> found = dc.diagram("11T15", bounds=(14.5, 15.5), max_points=40)  # doctest: +SKIP
    >>> found.to_frame()[["branch", "alpha", "energy"]]  # doctest: +SKIP
    """
    from dataclasses import replace

    from dnacheck.api.molecules import rod
    from dnacheck.equilibria.continuation.branch import BranchError
    from dnacheck.equilibria.continuation.diagram import imperfect_component, lowest_component
    from dnacheck.equilibria.continuation.follow import Bounds
    from dnacheck.equilibria.continuation.options import ContinuationOptions

    body = source if isinstance(source, Rod) else rod(source)
    turn = 2.0 * math.pi
    limits = None
    if bounds is not None:
        low, high = _pair("bounds", bounds)
        limits = Bounds(turn * low, turn * high)
    options = replace(ContinuationOptions(), max_points=whole("max_points", max_points, 1))
    try:
        if start is None:
            return lowest_component(body, limits, options)
        return imperfect_component(body, turn * float(start), bounds=limits, options=options)
    except BranchError as error:
        raise SolveError(f"diagram of {body.name}: {error}", error) from None


def _pair(name: str, value: Any) -> tuple[float, float]:
    try:
        low, high = (float(x) for x in value)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be two numbers, not {value!r}") from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise InputError(f"{name} must be two finite numbers, the smaller first, not {value!r}")
    return low, high


def twist_ratio_scan(
    source: Chain | Rod | Target,
    ratios: ArrayLike | Sequence[float],
    *,
    corrected_for: Chain | None = None,
) -> RatioSweep:
    """Ring energies with bending and twisting parts over twisting / bending stiffness.

    Parameters
    ----------
    source : Chain, Rod, or what :func:`dnacheck.chain` takes
        A chain with the uniform stiffness; its own ratio is not used.
    ratios : sequence of float, shape (R,)
        Increasing, greater than 0.
    corrected_for : Chain, optional
        Of a rod: the chain that it was made from, whose steps' own compliance corrects its
        energies.

    Returns
    -------
    RatioSweep
        ``.to_frame()`` has a row for each ratio; ``.crossings`` says where another ring becomes the
        lowest; ``.to_dict()`` is the JSON of ``dnacheck sweep``.

    Raises
    ------
    InputError
        One line that names the argument and the mend.

    Examples
    --------
    >>> import dnacheck as dc
    >>> table = dc.twist_ratio_scan("11T15", [0.5, 1.0, 1.5]).to_frame()
    >>> list(table["link"])
    [15, 15, 15]
    """
    from dnacheck.equilibria.continuation.twist_ratio import (
        check_ratios,
        sweep_continuum,
        sweep_discrete,
    )

    values = check_ratios(ratios)
    if isinstance(source, Rod):
        return sweep_continuum(source, values, corrected_for=corrected_for)
    if corrected_for is not None:
        raise InputError("corrected_for: only a rod's energies are corrected; give rod(chain)")
    return sweep_discrete(as_chain(source), values)
