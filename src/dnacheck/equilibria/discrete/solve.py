"""Equilibria of closed discrete chains (Section IV A)."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.equilibria.boundary import AnyBoundary, Loop, Pull
from dnacheck.equilibria.discrete.kernels import newton as nk
from dnacheck.equilibria.ring import RING, Equilibrium, Steps
from dnacheck.model.chain import Chain, chain_frames, elastic_energy
from dnacheck.numerics.curve_topology import (
    edge_frames,
    link_of_ring,
    total_twist,
)
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
) -> Equilibrium:
    """Wrap what the compiled solver left into a :class:`Equilibrium`."""
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
    return Equilibrium(
        source=chain,
        solution=Steps(
            angles,
            multipliers,
            log_abs_det_kkt=float(figures[nk.LOG_DET_KKT]),
            closure=float(figures[nk.CLOSURE]),
        ),
        energy=energy,
        ring_link=link,
        twist_turns=twist,
        writhe=writhe,
        stable=negatives == 0 if converged and (negatives or not neutral) else None,
        negative_directions=negatives,
        residual=float(figures[nk.RESIDUAL]),
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
) -> Equilibrium:
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
