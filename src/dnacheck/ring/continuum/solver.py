"""Continuum rings: Newton on the collocation equations, homotopy where needed, mesh adaption."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dnacheck.model.rod.rod import Rod
from dnacheck.numerics.outcome import Status
from dnacheck.ring.continuum.collocation import aligned_mesh, bisect, discretise
from dnacheck.ring.continuum.kernels import newton as kernel
from dnacheck.ring.continuum.kernels.writhe import polygon_writhe
from dnacheck.ring.continuum.options import ContinuumOptions
from dnacheck.ring.continuum.ring import ContinuumRing
from dnacheck.ring.continuum.state import (
    State,
    new_state,
    register_roll,
    run_newton,
    start_from_perfect_ring,
    transfer,
)

Array = NDArray[np.float64]

_STATUS = {
    kernel.CONVERGED: Status.CONVERGED,
    kernel.NOT_FINITE: Status.NOT_FINITE,
    kernel.ITERATION_LIMIT: Status.ITERATION_LIMIT,
    kernel.SINGULAR: Status.SINGULAR,
}

# Energies are compared with at least this fraction of the flat ring's, so that a rod that closes
# by itself, with energy zero, has a scale.
_ENERGY_FLOOR = 1e-3

# Refinement halves the intervals that carry this fraction of the change in energy.
_CARRIED = 0.99


def solve_continuum_ring(
    rod: Rod,
    link: int,
    roll: float | None = None,
    options: ContinuumOptions | None = None,
) -> ContinuumRing:
    """Equilibrium ring of a rod, started from the rolled perfect ring.

    Parameters
    ----------
    rod : Rod
    link : int
        Wanted linking number; sets alpha = Omega(1) - Omega(0) + 2 pi link. An equilibrium far
        from planar can have another link of the same parity, which is then reported.
    roll : float, optional
        Register of the start in radians; default: the one that first-order perturbation selects.
    options : ContinuumOptions, optional

    Returns
    -------
    ContinuumRing
        Check ``status``: what did not converge is returned too, with its residual.
    """
    options = ContinuumOptions() if options is None else options
    alpha = rod.end_rotation + 2.0 * np.pi * link
    disc = discretise(rod, aligned_mesh(rod.breaks, options.intervals), options.degree)
    state = new_state(disc)
    if roll is None:
        roll = register_roll(disc, alpha)
    start_from_perfect_ring(state, alpha, roll)
    converged = run_newton(state, disc.coefficients(), alpha, options)
    if not converged and state.code != kernel.SINGULAR:
        converged = _homotopy(state, alpha, roll, options)
    if not converged:
        return _finish(state, alpha, _STATUS[state.code], options)
    return refine(state, alpha, options)


def refine(state: State, alpha: float, options: ContinuumOptions) -> ContinuumRing:
    """Adapt the mesh of a converged state as the options ask, and freeze the result."""
    if not options.adapt:
        return _finish(state, alpha, Status.CONVERGED, options)
    state, energy_error, shape_error = _adapt(state, alpha, options)
    reached = energy_error <= options.energy_tolerance * _energy_scale(state)
    status = Status.CONVERGED if reached else Status.MESH_LIMIT
    return _finish(state, alpha, status, options, energy_error, shape_error)


def _energy_scale(state: State) -> float:
    flat = 0.5 * state.disc.rod.bend_stiffness * (2.0 * np.pi) ** 2
    return max(state.energy, _ENERGY_FLOOR * flat)


def _homotopy(state: State, alpha: float, roll: float, options: ContinuumOptions) -> bool:
    """From the rolled perfect ring at gamma = 0 to the rod at gamma = 1.

    Each step starts from the tangent in gamma; it is halved on failure and grows on success.
    """
    full = state.disc.coefficients()
    rates = np.zeros_like(full)
    rates[..., :2] = full[..., :2]
    start_from_perfect_ring(state, alpha, roll)
    good = (state.slopes.copy(), state.loads.copy())
    gamma, step = 0.0, 0.1
    tangent: tuple[Array, Array] | None = None
    for _ in range(options.homotopy_steps):
        step = min(step, 1.0 - gamma)
        state.slopes[:], state.loads[:] = good
        if tangent is not None:
            state.slopes += step * tangent[0]
            state.loads += step * tangent[1]
        before = state.iterations
        if run_newton(state, state.disc.coefficients(gamma + step), alpha, options, rates):
            gamma += step
            good = (state.slopes.copy(), state.loads.copy())
            if gamma >= 1.0:
                return True
            last = state.sensitivity[-1]
            change = -np.linalg.solve(last[:, :6], last[:, 6])
            by_gamma = state.stage_sensitivity[..., 6]
            tangent = state.stage_sensitivity[..., :6] @ change + by_gamma, change
            if state.iterations - before <= 4:
                step *= 1.6
        else:
            step *= 0.5
            if step < 1e-4:
                break
    return False


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
    signs, logarithms = np.linalg.slogdet(state.sensitivity[1:, :, :6])
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
) -> ContinuumRing:
    """Freeze a state into a result."""
    rod = state.disc.rod
    quaternions = state.quaternions()
    link, writhe = 0, float("nan")
    conjugate: int | None = None
    bend, twist, total_twist = (float(x) for x in state.parts.sum(axis=0))
    if status in (Status.CONVERGED, Status.MESH_LIMIT):
        corners = np.arange(options.writhe_points) / options.writhe_points
        _, polygon, _ = state.evaluate(corners, quaternions)
        # w3hat = 0: D1 turns by the integral of u3, d1 by Omega(1) - Omega(0) less
        turns = (total_twist - rod.end_rotation) / (2.0 * np.pi)
        link = int(np.rint(turns + polygon_writhe(polygon)))
        writhe = link - turns
        conjugate = _conjugate_points(state)
    arrays = {
        "loads": state.loads.copy(),
        "mesh": state.disc.mesh,
        "slopes": state.slopes.copy(),
        "quaternions": quaternions,
        "centres": state.centres.copy(),
    }
    for array in arrays.values():
        array.setflags(write=False)
    return ContinuumRing(
        rod=rod,
        alpha=alpha,
        energy=bend + twist,
        bend=bend,
        twist=twist,
        link=link,
        writhe=writhe,
        end_moment=float(state.loads[2]),
        stable=None if conjugate is None else conjugate == 0,
        conjugate_points=conjugate,
        residual=state.residual,
        energy_error=energy_error,
        shape_error=shape_error,
        iterations=state.iterations,
        status=status,
        **arrays,
    )
