"""Continuum rings: Newton on the collocation equations, homotopy where needed, mesh adaption."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.continuum.coarse_chain import CoarseRing, start_from_pieces
from dnacheck.equilibria.continuum.collocation import aligned_mesh, bisect, discretise
from dnacheck.equilibria.continuum.curve import Curve
from dnacheck.equilibria.continuum.homotopy import detours
from dnacheck.equilibria.continuum.kernels import newton as kernel
from dnacheck.equilibria.continuum.options import ContinuumOptions
from dnacheck.equilibria.continuum.state import (
    State,
    new_state,
    register_roll,
    run_newton,
    start_from_perfect_ring,
    transfer,
)
from dnacheck.equilibria.ring import Equilibrium
from dnacheck.model.rod.rod import Rod
from dnacheck.numerics.curve_topology import polygon_writhe
from dnacheck.numerics.outcome import Status

Array = NDArray[np.float64]

_STATUS = {
    kernel.CONVERGED: Status.CONVERGED,
    kernel.NOT_FINITE: Status.NOT_FINITE,
    kernel.ITERATION_LIMIT: Status.ITERATION_LIMIT,
    kernel.NEUTRAL_MODE: Status.NEUTRAL,
}

#: Statuses of a state that satisfies the equations.
SOLVED = (Status.CONVERGED, Status.SADDLE, Status.NEUTRAL, Status.MESH_LIMIT)

# Energies are compared with at least this fraction of the flat ring's, so that a rod that closes
# by itself, with energy zero, has a scale.
_ENERGY_FLOOR = 1e-3

# Refinement halves the intervals that carry this fraction of the change in energy.
_CARRIED = 0.99


def solve_continuum_ring(
    rod: Rod,
    link: int,
    turn: float = 0.0,
    options: ContinuumOptions | None = None,
) -> Equilibrium:
    """Equilibrium ring of a rod, started from the rolled perfect ring.

    Newton starts from the perfect ring (4.12) in the register that first-order perturbation in
    the intrinsic curvature selects; if that fails, the paths of ``homotopy`` are tried.

    Parameters
    ----------
    rod : Rod
    link : int
        Wanted linking number; sets alpha = Omega(1) - Omega(0) + 2 pi link. An equilibrium far
        from planar can have another link of the same parity, which is then reported.
    turn : float
        Angle in radians by which the start's register differs from the selected one; pi is the
        register that raises the energy most, and usually leads to a saddle.
    options : ContinuumOptions, optional

    Returns
    -------
    Equilibrium
        Check ``status``: what did not converge is returned too, with its residual. SADDLE is an
        equilibrium with negative directions; NEUTRAL a solution to tolerance that is not
        isolated, of which any member of the family may have been returned.
    """
    options = ContinuumOptions() if options is None else options
    ring: Equilibrium | None = None
    for ring in attempts(rod, link, turn, options):
        if ring.status in SOLVED:
            break
    assert ring is not None
    return ring


def attempts(
    rod: Rod, link: int, turn: float, options: ContinuumOptions, detour: bool = True
) -> Iterator[Equilibrium]:
    """Rings from one start by Newton, then by each path of ``homotopy``, converged or not."""
    alpha = rod.end_rotation + 2.0 * np.pi * link
    disc = discretise(rod, aligned_mesh(rod.breaks, options.intervals), options.degree)
    state = new_state(disc)
    start_from_perfect_ring(state, alpha, register_roll(disc, alpha) + turn)
    if run_newton(state, disc.coefficients(), alpha, options):
        yield refine(state, alpha, options)
    else:
        yield _finish(state, alpha, _STATUS[state.code], options)
    if not detour or options.homotopy_steps == 0:
        return
    for converged in detours(state, alpha, turn, options):
        if converged:
            yield refine(state, alpha, options)
        else:
            yield _finish(state, alpha, _STATUS[state.code], options)


def near(rod: Rod, start: CoarseRing, options: ContinuumOptions) -> Iterator[Equilibrium]:
    """The ring that Newton's method reaches from a minimum of the rod in pieces."""
    alpha = rod.end_rotation + 2.0 * np.pi * start.link
    state = start_from_pieces(rod, start, options)
    if run_newton(state, state.disc.coefficients(), alpha, options):
        yield refine(state, alpha, options)
    else:
        yield _finish(state, alpha, _STATUS[state.code], options)


def refine(state: State, alpha: float, options: ContinuumOptions) -> Equilibrium:
    """Adapt the mesh of a converged state as the options ask, and freeze the result."""
    if not options.adapt:
        return _finish(state, alpha, _STATUS[state.code], options)
    state, energy_error, shape_error = _adapt(state, alpha, options)
    reached = energy_error <= options.energy_tolerance * _energy_scale(state)
    status = _STATUS[state.code] if reached else Status.MESH_LIMIT
    return _finish(state, alpha, status, options, energy_error, shape_error)


def _energy_scale(state: State) -> float:
    flat = 0.5 * state.disc.rod.bend_stiffness * (2.0 * np.pi) ** 2
    return max(state.energy, _ENERGY_FLOOR * flat)


def _adapt(state: State, alpha: float, options: ContinuumOptions) -> tuple[State, float, float]:
    """Refine until two meshes agree; the finest state, its energy and shape errors."""
    marked = np.ones(state.disc.h.size, dtype=bool)
    energy_error = shape_error = np.inf
    while True:
        mesh = bisect(state.disc.mesh, marked)
        if mesh.size - 1 > options.max_intervals:
            break
        fine = transfer(state, mesh)
        if not run_newton(fine, fine.disc.coefficients(), alpha, options):
            break
        energy_error = abs(fine.energy - state.energy)
        shared = np.searchsorted(mesh, state.disc.mesh)
        difference = fine.frames[shared] - state.frames
        shape_error = float(np.sqrt(0.5 * np.max(np.sum(difference**2, axis=(1, 2)))))
        if energy_error <= options.energy_tolerance * _energy_scale(fine):
            return fine, energy_error, shape_error
        coarse = state.parts[:, :2].sum(axis=1)
        change = np.abs(np.add.reduceat(fine.parts[:, :2].sum(axis=1), shared[:-1]) - coarse)
        order = np.argsort(change)[::-1]
        carried = np.cumsum(change[order])
        heavy = np.zeros(change.size, dtype=bool)
        heavy[order[: int(np.searchsorted(carried, _CARRIED * carried[-1])) + 1]] = True
        marked = heavy[np.searchsorted(shared, np.arange(mesh.size - 1), side="right") - 1]
        state = fine
    return state, float(energy_error), float(shape_error)


def _conjugate_points(state: State) -> int | None:
    """Sign changes of det d(xi, r)(s)/d(m(0), n) along the mesh.

    A zero at s means that the ring cut at s, with both ends held, has a neutral perturbation; the
    number of zeros inside (0, 1) is the number of negative directions of the second variation
    under closure (Manning, Rogers & Maddocks, Proc. R. Soc. A 454, 3047 (1998)). Two zeros
    between neighbouring mesh points are not seen.
    """
    end = -1 if state.code == kernel.NEUTRAL_MODE else None  # the zero at s = 1 is not inside
    signs, logarithms = np.linalg.slogdet(state.sensitivity[1:end, :, :6])
    if not np.all(np.isfinite(logarithms)):
        return None
    return int(np.count_nonzero(signs[1:] != signs[:-1]))


def _finish(
    state: State,
    alpha: float,
    status: Status,
    options: ContinuumOptions,
    energy_error: float | None = None,
    shape_error: float | None = None,
) -> Equilibrium:
    """Freeze a state into a result."""
    rod = state.disc.rod
    quaternions = state.quaternions()
    link, writhe = 0, float("nan")
    conjugate: int | None = None
    bend, twist, total_twist = (float(x) for x in state.parts.sum(axis=0))
    if status in SOLVED:
        corners = np.arange(options.writhe_points) / options.writhe_points
        _, polygon, _ = state.evaluate(corners, quaternions)
        # w3hat = 0: D1 turns by the integral of u3, d1 by Omega(1) - Omega(0) less
        turns = (total_twist - rod.end_rotation) / (2.0 * np.pi)
        link = int(np.rint(turns + polygon_writhe(polygon)))
        writhe = link - turns
        conjugate = _conjugate_points(state)
        if status is Status.CONVERGED and conjugate:
            status = Status.SADDLE
    # a neutral direction leaves open whether the energy rises along it
    stable = None if conjugate is None else conjugate == 0
    if status is Status.NEUTRAL and stable:
        stable = None
    arrays = {
        "loads": state.loads.copy(),
        "mesh": state.disc.mesh,
        "slopes": state.slopes.copy(),
        "quaternions": quaternions,
        "centres": state.centres.copy(),
    }
    for array in arrays.values():
        array.setflags(write=False)
    return Equilibrium(
        source=rod,
        solution=Curve(
            rod=rod,
            alpha=alpha,
            bend=bend,
            twist=twist,
            end_moment=float(state.loads[2]),
            energy_error=energy_error,
            shape_error=shape_error,
            **arrays,
        ),
        energy=bend + twist,
        ring_link=link,
        twist_turns=link - writhe,
        writhe=writhe,
        stable=stable,
        negative_directions=conjugate,
        residual=state.residual,
        iterations=state.iterations,
        seconds=time.perf_counter() - state.began,
        status=status,
    )
