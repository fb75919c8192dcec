"""The unknowns of one mesh, Newton on them, and their transfer to another mesh."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.continuum.collocation import Discretisation, discretise
from dnacheck.equilibria.continuum.curve import evaluate_curve
from dnacheck.equilibria.continuum.kernels import newton as kernel
from dnacheck.equilibria.continuum.kernels.condense import COLUMNS, FINE, condense
from dnacheck.equilibria.continuum.kernels.interpolate import (
    mesh_quaternions,
    slopes_on_mesh,
)
from dnacheck.equilibria.continuum.kernels.start import overlap, rolled_ring
from dnacheck.equilibria.continuum.options import ContinuumOptions

Array = NDArray[np.float64]


@dataclass
class State:
    """Unknowns and results of the last sweep on one mesh; every solve overwrites the arrays.

    Attributes
    ----------
    disc : Discretisation
    slopes : ndarray, shape (K, k, 3)
    loads : ndarray, shape (6,)
        The unknowns, see ``kernels.condense``.
    frames, centres : ndarray, shape (K + 1, 3, 3), (K + 1, 3)
    sensitivity : ndarray, shape (K + 1, 6, COLUMNS)
    stage_sensitivity : ndarray, shape (K, k, 3, COLUMNS)
    parts : ndarray, shape (K, 3)
        Bending energy, twisting energy and integral of u3 of each interval.
    began : float
        Time at which the work on this state started, by ``time.perf_counter``.
    code : int
        How the last solve ended, in the terms of ``kernels.newton``.
    """

    disc: Discretisation
    slopes: Array
    loads: Array
    frames: Array
    centres: Array
    sensitivity: Array
    stage_sensitivity: Array
    parts: Array
    code: int = kernel.ITERATION_LIMIT
    residual: float = np.inf
    pivot_ratio: float = 1.0
    iterations: int = 0
    began: float = 0.0

    @property
    def energy(self) -> float:
        """Reduced energy."""
        return float(self.parts[:, :2].sum())

    def quaternions(self) -> Array:
        """Natural frames at the mesh points, shape (K + 1, 4), continuous from (0, 0, 0, 1)."""
        out = np.empty((self.disc.h.size + 1, 4))
        mesh_quaternions(self.slopes, self.disc.h, self.disc.rule.weights, out)
        return out

    def evaluate(self, s: Array, quaternions: Array) -> tuple[Array, Array, Array]:
        """q (m, 4), r (m, 3) and the laboratory strain rate u (m, 3) at the points s."""
        return evaluate_curve(s, self.disc.mesh, self.slopes, quaternions, self.centres)


def new_state(disc: Discretisation) -> State:
    """Arrays for a mesh, starting at the laboratory frame."""
    n, k = disc.h.size, disc.rule.points.size
    frames = np.empty((n + 1, 3, 3))
    frames[0] = np.eye(3)
    return State(
        disc=disc,
        slopes=np.empty((n, k, 3)),
        loads=np.empty(6),
        frames=frames,
        centres=np.zeros((n + 1, 3)),
        sensitivity=np.zeros((n + 1, 6, COLUMNS)),
        stage_sensitivity=np.empty((n, k, 3, COLUMNS)),
        parts=np.full((n, 3), np.nan),
        began=time.perf_counter(),
    )


def start_from_perfect_ring(state: State, alpha: float, roll: float) -> None:
    """Put the perfect ring (4.12), rolled about its own axis, into the state."""
    disc = state.disc
    rolled_ring(
        alpha,
        roll,
        disc.mesh,
        disc.h,
        disc.rule.points,
        disc.rod.bend_stiffness,
        disc.rod.twist_stiffness,
        state.slopes,
        state.loads,
    )


def register_roll(disc: Discretisation, alpha: float) -> float:
    """Roll of the perfect ring that lowers the energy most to first order in the curvature.

    The opposite roll raises it most; one usually leads to the minimum, the other to the saddle.
    """
    weights = (disc.h[:, None] * disc.rule.weights).ravel()
    real, imaginary = overlap(alpha, disc.points, weights, disc.strains)
    return float(np.arctan2(imaginary, real))


def run_newton(
    state: State,
    coefficients: Array,
    alpha: float,
    options: ContinuumOptions,
    rates: Array | None = None,
) -> bool:
    """Newton from what is in the state; True if it converged.

    A step is shortened so that no mesh frame turns by more than ``options.largest_turn``.

    ``coefficients`` and ``rates`` (K, k, 4) are the rod at the collocation points and its
    derivative with respect to the active parameter (default none).
    """
    rule = state.disc.rule
    rates = np.zeros_like(coefficients) if rates is None else rates
    step = np.empty((6, 1))
    state.code = kernel.ITERATION_LIMIT
    for iteration in range(options.max_iterations + 1):
        code, state.residual = condense(
            state.slopes,
            state.loads,
            coefficients,
            rates,
            state.disc.h,
            rule.integrals,
            rule.weights,
            state.frames,
            state.centres,
            state.sensitivity,
            state.stage_sensitivity,
            state.parts,
        )
        if code != FINE:
            state.code, state.residual = kernel.NOT_FINITE, np.inf
            break
        defect, state.pivot_ratio, turn = kernel.propose(
            state.frames, state.centres, state.sensitivity, alpha, options.largest_turn, step
        )
        state.residual = max(state.residual, defect)
        neutral = state.pivot_ratio <= kernel.NEUTRAL
        if state.residual <= options.tolerance:
            state.code = kernel.NEUTRAL_MODE if neutral else kernel.CONVERGED
            break
        if not np.isfinite(state.residual + turn):
            state.code = kernel.NOT_FINITE
            break
        if neutral and turn <= options.tolerance and state.residual <= kernel.NEUTRAL_RESIDUAL:
            state.code = kernel.NEUTRAL_MODE
            break
        if iteration == options.max_iterations:
            break
        scale = min(1.0, options.largest_turn / turn) if turn > 0.0 else 1.0
        kernel.advance(state.slopes, state.loads, state.stage_sensitivity, step, scale)
        state.iterations += 1
    return state.code in (kernel.CONVERGED, kernel.NEUTRAL_MODE)


def transfer(state: State, mesh: Array) -> State:
    """The state's collocation polynomials on another mesh, as a start there."""
    disc = discretise(state.disc.rod, mesh, state.disc.rule.points.size)
    new = new_state(disc)
    quaternions = state.quaternions()
    at_mesh, _, _ = state.evaluate(mesh[:-1], quaternions)
    at_points, _, u = state.evaluate(disc.points, quaternions)
    slopes_on_mesh(mesh, disc.rule.points, at_mesh, at_points, u, new.slopes)
    new.loads[:] = state.loads
    new.iterations = state.iterations
    new.began = state.began
    return new
