"""The continuum rod of a discrete chain."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.model.chain import Chain, chain_frames
from dnacheck.model.cut_kernels import least_rotation
from dnacheck.model.rod import chebyshev
from dnacheck.model.rod.filtering import double_filter, padded_steps
from dnacheck.model.rod.natural_frame import NaturalFrame, evaluate_at_parameter, natural_frame
from dnacheck.model.rod.options import RodOptions
from dnacheck.model.rod.spline import evaluate, fit_spline
from dnacheck.model.rod.stiffness import require_positive, rod_stiffness
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rod:
    """Continuum rod, 0 <= s <= 1, in its natural frame.

    Attributes
    ----------
    name : str
    n_steps : int
        N of the chain it was made from.
    breaks : ndarray, shape (p + 1,)
        Ends of the smooth pieces of the strains: the spline's knots in arclength.
    strain_series : ndarray, shape (p, n, 2)
        Chebyshev coefficients of the unstressed strains w1hat, w2hat per unit s; w3hat = 0 (6.5).
    compliance_series : ndarray, shape (p, n, 2), or None
        The same of the local bending and twisting compliance relative to the means, where the
        stiffness depends on the sequence.
    bend_stiffness, twist_stiffness : float
        K1 = K2 and K3 (5.3), reduced energy per unit s.
    s_frames : ndarray, shape (N + 1,)
        Arclength s_j of base pair j, the image of t = j + 1/2.
    omega : ndarray, shape (N + 1,)
        Omega(s_j) of (6.1), the angle from d1 to D1 about d3, continuous in j; omega[0] = 0.
    length_steps : float
        Arclength of the fitted centreline in steps.
    energy_scale_RT, rise_A : float
        Of the chain.
    options : RodOptions
    cut : int
        Base pair of the molecule at s = 0: a ring's rod is that of its canonical cut. s_frames and
        omega count from it.
    fit_rms, fit_condition : float
        Rms distance in steps of the fit from the filtered points; condition of the fit.
    frame_orthogonality, frame_residual : float
        Monitors of the natural frame, see :class:`NaturalFrame`.
    projection : float
        Largest angle in radians by which a d1 had to be turned into the normal plane.
    letters : str
        The molecule's letters, empty for a rod that no letters were given for.
    stiffness_anisotropy : float
        What an average of sequence-dependent stiffnesses left (0 for the uniform one).
    warnings : tuple of str
        What a user should know about the fit.
    """

    name: str
    n_steps: int
    breaks: Array
    strain_series: Array
    compliance_series: Array | None
    bend_stiffness: float
    twist_stiffness: float
    s_frames: Array
    omega: Array
    length_steps: float
    energy_scale_RT: float
    rise_A: float
    options: RodOptions
    cut: int = 0
    fit_rms: float = 0.0
    fit_condition: float = 1.0
    frame_orthogonality: float = 0.0
    frame_residual: float = 0.0
    projection: float = 0.0
    stiffness_anisotropy: float = 0.0
    letters: str = ""
    warnings: tuple[str, ...] = ()

    @property
    def end_rotation(self) -> float:
        """Omega(1) - Omega(0): alpha of the closed ring modulo 2 pi (Section VI C)."""
        return float(self.omega[-1] - self.omega[0])

    @property
    def relaxed_turns(self) -> float:
        """Turns of d1 about the untwisted natural frame in the unstressed shape."""
        return -self.end_rotation / (2.0 * np.pi)

    def strains(self, s: ArrayLike) -> Array:
        """Unstressed strains w1hat, w2hat at s, shape (m, 2)."""
        return self._evaluate(self.strain_series, s)

    def relative_compliance(self, s: ArrayLike) -> Array:
        """Local compliance of bending and twisting over its mean at s, shape (m, 2)."""
        s = np.atleast_1d(np.asarray(s, dtype=float))
        if self.compliance_series is None:
            return np.ones((s.size, 2))
        return self._evaluate(self.compliance_series, s)

    def frame_angle(self, s: ArrayLike) -> Array:
        """Omega at s, shape (m,): exact at the base pairs, linear in between."""
        s = np.asarray(s, dtype=float)
        return np.asarray(np.interp(s, self.s_frames, self.omega), dtype=float)

    def _evaluate(self, series: Array, s: ArrayLike) -> Array:
        s = np.ascontiguousarray(np.atleast_1d(np.asarray(s, dtype=float)))
        out = np.empty((s.size, series.shape[2]))
        chebyshev.evaluate_series(s, self.breaks, series, out)
        return out


# Rms distance of the fit in steps above which the energy of the ring begins to feel it: at 0.01
# the energy of a 155-bp ring moves by 0.005 RT, at 0.1 by 0.05 RT.
_FIT_WARNING = 0.02
# Length of the paper's pieces: 20 on 155 base pairs with 50 of padding at each end.
_PAPER_PIECE = 255.0 / 20.0


def _warnings(n_steps: int, fit_rms: float, options: RodOptions) -> tuple[str, ...]:
    if fit_rms <= _FIT_WARNING:
        return ()
    better = math.ceil((n_steps + 2 * options.padding) / _PAPER_PIECE)
    return (
        f"the spline of {options.intervals} intervals misses the filtered centreline by "
        f"{fit_rms:.2g} steps rms; {better} intervals would match the paper's resolution",
    )


def _fit_breaks(n_steps: int, options: RodOptions) -> Array:
    """Ends of the spline's pieces, from -padding to N + 1 + padding."""
    first, last = -float(options.padding), float(n_steps + 1 + options.padding)
    if options.interval_span == "padded":
        uniform: Array = np.arange(options.intervals + 1.0) / options.intervals
        return first + (last - first) * uniform
    spacing = (n_steps + 1) / options.intervals
    before = int(np.ceil(options.padding / spacing - 1e-9))
    inner: Array = spacing * np.arange(-before, options.intervals + before + 1.0)
    inner[0], inner[-1] = first, last
    # A stub of a piece at the padded end would hold too few points to fit.
    keep: NDArray[np.bool_] = np.ones(inner.size, dtype=bool)
    if before > 1 and inner[1] - inner[0] < 0.5 * spacing:
        keep[1] = keep[-2] = False
    return inner[keep]


def _omega(chain: Chain, d1: Array, natural_d1: Array, d3: Array) -> tuple[Array, float]:
    """Omega at the base pairs, and the largest angle of projection."""
    along = np.sum(d1 * d3, axis=1)
    if np.max(np.abs(along)) > 0.99:
        raise InputError(
            "a base pair's d1 points along the fitted centreline: the filter erases the path; "
            "narrow filter_width"
        )
    cosine = np.sum(d1 * natural_d1, axis=1)
    sine = np.sum(np.cross(d1, natural_d1) * d3, axis=1)
    wrapped = np.arctan2(sine, cosine)
    # From one base pair to the next Omega falls by about the step's twist.
    expected = -chain.ground[:, 0]
    change = np.diff(wrapped)
    change -= 2.0 * np.pi * np.round((change - expected) / (2.0 * np.pi))
    return np.concatenate([[0.0], np.cumsum(change)]) + wrapped[0], float(
        np.max(np.abs(np.arcsin(np.clip(along, -1.0, 1.0))))
    )


def as_cut(chain: Chain, cut: int) -> Chain:
    """The ring of a chain, read from base pair ``cut`` on."""
    if cut == 0:
        return chain
    return replace(
        chain,
        ground=np.roll(chain.ground, -cut, axis=0),
        stiffness=np.roll(chain.stiffness, -cut, axis=0),
        letters=chain.letters[cut:] + chain.letters[:cut],
        a_tract_regions=(),
    )


def build_rod(chain: Chain, options: RodOptions | None = None, cut: int | None = None) -> Rod:
    """Continuum rod of a chain: Sections V to VII.

    Parameters
    ----------
    chain : Chain
    options : RodOptions, optional
        Default: the paper's (w, k, m) = (15, 20, 6) with 50 base pairs of padding.
    cut : int, optional
        Base pair at s = 0. By default that of the canonical cut (``model.cut_kernels``), so
        that a ring has one rod whichever base pair is called the first; the spline's pieces move
        with the cut, and energies with them by about 1e-4 of their value.

    Raises
    ------
    InputError
        Too many coefficients, an ill-conditioned fit, a filter that erases the path, or a
        stiffness that a transversely isotropic rod can't represent.
    """
    options = RodOptions() if options is None else options
    chain.require_hinges("the continuum rod")
    chain.require_free("the continuum rod")
    n = chain.n_steps
    require_positive(chain.stiffness)
    cut = int(least_rotation(chain.arrays)) if cut is None else cut % n
    chain = as_cut(chain, cut)
    padded = chain.ground[padded_steps(n, options.padding)]
    centres, frames = chain_frames(padded, chain.step_form)
    if 3 * (options.filter_width - 1) >= len(centres):
        raise InputError(
            f"filter width {options.filter_width} is too wide for {len(centres)} padded points: "
            "raise padding or narrow the filter"
        )
    t = np.arange(len(centres), dtype=float) - options.padding
    breaks = _fit_breaks(n, options)
    curve = fit_spline(
        t,
        double_filter(centres, options.filter_width),
        breaks,
        options.degree,
        options.condition_limit,
    )
    true_frames = frames[options.padding : options.padding + n + 1]
    natural = natural_frame(
        curve, 0.5, n + 0.5, true_frames[0, :, 0], options.chebyshev_points, options.slowest_speed
    )
    s_frames, natural_d1, d3 = evaluate_at_parameter(natural, np.arange(n + 1.0) + 0.5)
    omega, projection = _omega(chain, true_frames[:, :, 0], natural_d1, d3)
    # The wedge's bending axes are those of its far frame, the mid-step's lie halfway.
    phase = omega[1:] if chain.step_form == "wedge" else 0.5 * (omega[1:] + omega[:-1])
    stiffness = rod_stiffness(chain.stiffness, phase, options)
    compliance = None
    if stiffness.profile is not None:
        compliance = _compliance_series(stiffness.profile, natural, breaks, options)
    arrays = [natural.s_breaks, natural.strains, s_frames, omega]
    if compliance is not None:
        arrays.append(compliance)
    for array in arrays:
        array.setflags(write=False)
    return Rod(
        name=chain.name,
        n_steps=n,
        breaks=natural.s_breaks,
        strain_series=natural.strains,
        compliance_series=compliance,
        bend_stiffness=stiffness.bend,
        twist_stiffness=stiffness.twist,
        s_frames=s_frames,
        omega=omega,
        length_steps=natural.length,
        energy_scale_RT=chain.energy_scale_RT,
        rise_A=chain.rise_A,
        options=options,
        cut=cut,
        fit_rms=curve.rms_residual,
        fit_condition=curve.condition,
        frame_orthogonality=natural.orthogonality,
        frame_residual=natural.equation_residual,
        projection=projection,
        stiffness_anisotropy=max(stiffness.anisotropy, stiffness.coupling),
        letters=chain.letters,
        warnings=_warnings(n, curve.rms_residual, options),
    )


def _compliance_series(
    profile: Array, natural: NaturalFrame, breaks: Array, options: RodOptions
) -> Array:
    """Chebyshev series of the local compliance: the centreline's own spline through the profile.

    Step i lies between t = i + 1/2 and i + 3/2, so its value belongs to t = i + 1.
    """
    steps = padded_steps(len(profile), options.padding)
    t = np.arange(steps.size, dtype=float) - options.padding + 1.0
    curve = fit_spline(t, profile[steps], breaks, options.degree, options.condition_limit)
    points, transform, _ = chebyshev.tables(options.chebyshev_points)
    basis = np.polynomial.chebyshev.chebvander(points, options.chebyshev_points - 1)
    t_grid = np.einsum("jn,pn->pj", basis, natural.parameter[:, :, 0])
    middle = 0.5 * (natural.t_breaks[1:] + natural.t_breaks[:-1])
    pieces = np.searchsorted(curve.breaks, middle) - 1
    values = evaluate(curve, np.broadcast_to(pieces[:, None], t_grid.shape), t_grid, 0)
    if not values.min() > 0.05:
        raise InputError(
            "stiffness: the smoothed compliance is not safely positive along the rod (steps of "
            "very different stiffness): widen filter_width, or use the discrete model"
        )
    return np.ascontiguousarray(np.einsum("nj,pjc->pnc", transform, values))
