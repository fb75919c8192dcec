"""Equilibria of closed discrete chains (Section IV A)."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.equilibria.discrete.kernels import newton as nk
from dnacheck.equilibria.discrete.spectrum import smallest_projected_eigenvalue
from dnacheck.model.chain import Chain, chain_frames, energy_parts
from dnacheck.numerics.curve_topology import edge_frames, link_of_ring
from dnacheck.numerics.outcome import InputError, SolveError, Status

Array = NDArray[np.float64]

_STATUS = {
    nk.CONVERGED: Status.CONVERGED,
    nk.ITERATION_LIMIT: Status.ITERATION_LIMIT,
    nk.STEP_LIMIT: Status.STEP_LIMIT,
    nk.NOT_FINITE: Status.NOT_FINITE,
    nk.SINGULAR: Status.SINGULAR,
}


@dataclass(frozen=True)
class NewtonOptions:
    """How a ring is solved.

    Attributes
    ----------
    tolerance : float
        Bound on the largest entry of the Lagrangian's gradient (reduced energy per radian) and of
        the closure residual (steps, radians).
    max_iterations : int
        Bound on Newton iterations.
    turn_cap : float
        Largest rotation of any frame in one iteration, in radians.
    minima_only : bool
        Whether to descend to a minimum; otherwise the nearest equilibrium is sought, saddles
        included, as from a continuum guess.
    """

    tolerance: float = 1e-10
    max_iterations: int = 500
    turn_cap: float = 0.5
    minima_only: bool = True

    def __post_init__(self) -> None:
        if not (np.isfinite(self.tolerance) and self.tolerance > 0.0):
            raise InputError(f"tolerance must be positive, not {self.tolerance}")
        if self.max_iterations < 1:
            raise InputError(f"max_iterations must be at least 1, not {self.max_iterations}")
        if not 0.0 < self.turn_cap <= np.pi:
            raise InputError(f"turn_cap must lie in (0, pi], not {self.turn_cap}")

    @property
    def limits(self) -> nk.NewtonLimits:
        """The same for compiled kernels."""
        return nk.NewtonLimits(
            float(self.tolerance),
            int(self.max_iterations),
            float(self.turn_cap),
            bool(self.minima_only),
        )


@dataclass(frozen=True)
class DiscreteRing:
    """A closed equilibrium of a chain, or the point where its search ended.

    Attributes
    ----------
    chain : Chain
        The molecule.
    angles : ndarray, shape (N, c)
        Coordinates of each step: tau, theta, phi in radians, or the six of a rigid step; read-only.
    multipliers : ndarray, shape (6,)
        Force (reduced energy per step length) and moment (reduced energy per radian) of closure,
        in the frame of the first base pair: gradient + (closure Jacobian)^T multipliers = 0.
    energy : float
        Reduced elastic energy (2.3).
    link : int
        Turns of the frames about the ring; twist + writhe.
    twist, writhe : float
        In turns, of the polygon of base-pair centres.
    stable : bool or None
        Whether the projected Hessian is positive; None where the search did not converge, or
        where an eigenvalue is zero to round-off (``status`` tells which).
    negative_eigenvalues : int
        Of the projected Hessian, round-off apart.
    log_abs_det_kkt : float
        log |det| of the matrix [[H, G^T], [G, 0]], for the Laplace J factor; of no use where an
        eigenvalue is zero.
    residual, closure : float
        Largest entry of all equations, and of the closure equations alone.
    iterations : int
    seconds : float
        Wall time of the solve.
    status : Status
    """

    chain: Chain
    angles: Array
    multipliers: Array
    energy: float
    link: int
    twist: float
    writhe: float
    stable: bool | None
    negative_eigenvalues: int
    log_abs_det_kkt: float
    residual: float
    closure: float
    iterations: int
    seconds: float
    status: Status

    @property
    def energy_RT(self) -> float:
        """Elastic energy in RT."""
        return self.energy * self.chain.energy_scale_RT

    @cached_property
    def parts(self) -> tuple[float, float]:
        """Reduced bending and twisting parts of the energy."""
        return energy_parts(self.chain, self.angles)

    @property
    def bend_RT(self) -> float:
        """Bending part of the energy in RT."""
        return self.parts[0] * self.chain.energy_scale_RT

    @property
    def twist_RT(self) -> float:
        """Twisting part of the energy in RT."""
        return self.parts[1] * self.chain.energy_scale_RT

    @cached_property
    def shape(self) -> tuple[Array, Array]:
        """Centres (N+1, 3) in steps and frames (N+1, 3, 3), frame 0 at the origin."""
        return chain_frames(self.angles, self.chain.step_form)

    @property
    def centres(self) -> Array:
        """Base-pair centres (N+1, 3) in steps; the last coincides with the first."""
        return self.shape[0]

    @property
    def frames(self) -> Array:
        """Frames (N+1, 3, 3), directors in columns."""
        return self.shape[1]

    @cached_property
    def smallest_eigenvalue(self) -> float:
        """Smallest eigenvalue of the projected Hessian, reduced energy per square radian."""
        return smallest_projected_eigenvalue(self.chain, self.angles, self.multipliers)


def _topology(chain: Chain, centres: Array, frames: Array) -> tuple[int, float, float]:
    """Link, twist and writhe in turns; of rigid steps, about the edges between their centres."""
    if chain.rigid:
        along = np.empty_like(frames)
        edge_frames(centres, frames, along)
        frames = along
    link, twist, writhe = link_of_ring(centres, frames)
    return int(link), float(twist), float(writhe)


def make_ring(
    chain: Chain, angles: Array, multipliers: Array, figures: Array, code: int, seconds: float
) -> DiscreteRing:
    """Wrap what the compiled solver left into a :class:`DiscreteRing`."""
    centres, frames = chain_frames(angles, chain.step_form)
    converged = code == nk.CONVERGED
    link, twist, writhe = (
        _topology(chain, centres, frames) if np.isfinite(centres).all() else (0, 0.0, 0.0)
    )
    negatives = int(figures[nk.NEGATIVES])
    neutral = converged and figures[nk.NEUTRAL] > 0.0
    status = _STATUS[code]
    if converged and negatives:
        status = Status.SADDLE
    elif neutral:
        status = Status.NEUTRAL
    angles.setflags(write=False)
    multipliers.setflags(write=False)
    return DiscreteRing(
        chain=chain,
        angles=angles,
        multipliers=multipliers,
        energy=float(figures[nk.ENERGY]),
        link=link,
        twist=twist,
        writhe=writhe,
        stable=negatives == 0 if converged and (negatives or not neutral) else None,
        negative_eigenvalues=negatives,
        log_abs_det_kkt=float(figures[nk.LOG_DET_KKT]),
        residual=float(figures[nk.RESIDUAL]),
        closure=float(figures[nk.CLOSURE]),
        iterations=int(figures[nk.ITERATIONS]),
        seconds=seconds,
        status=status,
    )


def solve_ring(
    chain: Chain,
    start: ArrayLike,
    options: NewtonOptions | None = None,
    *,
    throw: bool = True,
) -> DiscreteRing:
    """Closed equilibrium of a chain from a starting shape.

    Parameters
    ----------
    start : array_like, shape (N, c)
        Coordinates of the steps; need not be closed.
    throw : bool
        Whether to raise when the search does not converge; otherwise the status tells.

    Raises
    ------
    InputError
        The start has the wrong shape or is not finite.
    SolveError
        Not converged; its ``partial`` is the ring as far as it came.
    """
    options = options or NewtonOptions()
    angles = np.array(start, dtype=float, order="C")
    if angles.shape != chain.ground.shape:
        raise InputError(f"starting angles need the shape {chain.ground.shape}")
    if not np.isfinite(angles).all():
        raise InputError("starting angles must be finite")
    multipliers = np.zeros(6)
    figures = np.zeros(nk.N_FIGURES)
    began = time.perf_counter()
    code = nk.newton(
        angles,
        multipliers,
        chain.arrays,
        options.limits,
        figures,
    )
    ring = make_ring(chain, angles, multipliers, figures, code, time.perf_counter() - began)
    if throw and not ring.status.ok:
        raise SolveError(
            f"discrete ring of {chain.name}: residual {ring.residual:.1e} after "
            f"{ring.iterations} iterations; {ring.status.value}",
            ring,
        )
    return ring
