"""Equilibria of closed discrete chains (Section IV A)."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.equilibria.boundary import AnyBoundary, Loop, Pull, Ring
from dnacheck.equilibria.discrete.kernels import newton as nk
from dnacheck.equilibria.discrete.spectrum import smallest_projected_eigenvalue
from dnacheck.model.chain import Chain, chain_frames, elastic_energy, energy_parts
from dnacheck.numerics.curve_topology import (
    edge_frames,
    link_of_ring,
    total_twist,
)
from dnacheck.numerics.outcome import InputError, SolveError, Status

Array = NDArray[np.float64]

RING = Ring()

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
        in the frame of the target (the first base pair's for a ring): gradient + (closure
        Jacobian)^T multipliers = 0. Minus the loads on components that are free.
    energy : float
        Reduced elastic energy (2.3).
    ring_link : int or None
        Turns of the frames about the ring; twist + writhe. None unless the boundary is a ring.
    twist, writhe : float
        In turns, of the polygon of base-pair centres. Without a link the twist ends at the nick,
        and the writhe is not a number where the ends do not meet.
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
    boundary : Ring, NickedRing, HingedRing, Loop or Pull
    """

    chain: Chain
    angles: Array
    multipliers: Array
    energy: float
    ring_link: int | None
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
    boundary: AnyBoundary = RING

    @property
    def link(self) -> int:
        """Turns of the frames about the ring.

        Raises
        ------
        InputError
            The end is not that of a ring.
        """
        if self.ring_link is None:
            raise InputError(f"a {self.boundary.label} chain has no link; ask a ring for it")
        return self.ring_link

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
        return smallest_projected_eigenvalue(
            self.chain, self.angles, self.multipliers, self.boundary.for_chain(self.chain)
        )


def _topology(
    chain: Chain, centres: Array, frames: Array, boundary: AnyBoundary
) -> tuple[int | None, float, float]:
    """Link, twist and writhe in turns; of rigid steps, about the edges between their centres."""
    if not np.isfinite(centres).all():
        return (0 if boundary == RING else None), 0.0, 0.0
    if chain.rigid:
        along = np.empty_like(frames)
        edge_frames(centres, frames, along)
        frames = along
    if boundary == RING:
        link, twist, writhe = link_of_ring(centres, frames)
        return int(link), float(twist), float(writhe)
    if isinstance(boundary, (Loop, Pull)):
        return None, float(total_twist(frames)), math.nan
    # Any framing that closes tells the writhe of the polygon.
    closed = frames.copy()
    closed[-1] = closed[0]
    return None, float(total_twist(frames)), float(link_of_ring(centres, closed)[2])


def make_ring(
    chain: Chain,
    angles: Array,
    multipliers: Array,
    figures: Array,
    code: int,
    seconds: float,
    boundary: AnyBoundary = RING,
) -> DiscreteRing:
    """Wrap what the compiled solver left into a :class:`DiscreteRing`."""
    centres, frames = chain_frames(angles, chain.step_form)
    converged = code == nk.CONVERGED
    link, twist, writhe = _topology(chain, centres, frames, boundary)
    # What the solver lowers under loads is the energy less their work.
    energy = (
        elastic_energy(chain, angles) if isinstance(boundary, Pull) else float(figures[nk.ENERGY])
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
        energy=energy,
        ring_link=link,
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
        boundary=boundary,
    )


def solve_ring(
    chain: Chain,
    start: ArrayLike,
    options: NewtonOptions | None = None,
    *,
    boundary: AnyBoundary = RING,
    throw: bool = True,
) -> DiscreteRing:
    """Equilibrium of a chain, closed to a ring or held by another boundary, from a start.

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
        boundary.for_chain(chain),
        options.limits,
        figures,
    )
    seconds = time.perf_counter() - began
    ring = make_ring(chain, angles, multipliers, figures, code, seconds, boundary)
    if throw and not ring.status.ok:
        raise SolveError(
            f"discrete {boundary.label} of {chain.name}: residual {ring.residual:.1e} after "
            f"{ring.iterations} iterations; {ring.status.value}",
            ring,
        )
    return ring
