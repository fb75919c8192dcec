"""Compiled globalised Newton iteration for closed rings."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from dnacheck.equilibria.boundary_kernels import Boundary
from dnacheck.equilibria.discrete.kernels.kkt import (
    FIRST_SHIFT,
    MOST_SHIFTS,
    least_stable,
    positive_shift,
    solve_kkt,
)
from dnacheck.equilibria.discrete.kernels.moves import line_search, move, residuals
from dnacheck.equilibria.discrete.kernels.registers import KnownRegister, is_near
from dnacheck.equilibria.discrete.kernels.states import (
    accumulated_turn,
    evaluate,
    hold_ground,
    new_factors,
    new_state,
    substitute,
)
from dnacheck.model.chain_kernels import is_bound
from dnacheck.numerics.arrays import copy_rows

CONVERGED = 0
ITERATION_LIMIT = 1
STEP_LIMIT = 2
NOT_FINITE = 3
SINGULAR = 4
NEAR_KNOWN = 5


class NewtonLimits(NamedTuple):
    """When a solve ends and how far it may go at once; see ``NewtonOptions``."""

    tolerance: float
    max_iterations: int
    turn_cap: float
    minima_only: bool


# Positions of the figures that a solve returns.
ENERGY, RESIDUAL, CLOSURE, NEGATIVES, LOG_DET_KKT, ITERATIONS, WEAKEST_PIVOT, NEUTRAL = range(8)
N_FIGURES = 8

# Below this curvature along a rotation of the frames, relative to that of the energy of a bent
# circle, a mode costs nothing that round-off could tell from zero.
_FLAT = 1e-7
# Smallest shift, and what it grows from is at most so many times the residual: near a soft register
# a larger one would make the iteration linear.
_LEAST_SHIFT = 1e-10
_SHIFT_OF_RESIDUAL = 10.0
_MOST_ESCAPES = 4
_ESCAPE_TURN = 0.3


@njit(cache=True, nogil=True)
def _inspect(
    state: Any,
    steps: Any,
    flat: float,
    multipliers: Any,
    factors: Any,
    small: Any,
    slope: Any,
    change: Any,
    figures: Any,
) -> int:
    """Inertia and determinant at an equilibrium, into ``figures``.

    Returns the number of eigenvalues below -flat, or -1 if even a shift by ``flat`` is singular.
    """
    below, _, _ = solve_kkt(state, steps, -flat, multipliers, factors, small, slope, change)
    negatives, log_det, weakest = solve_kkt(
        state, steps, 0.0, multipliers, factors, small, slope, change
    )
    above = negatives
    if negatives != 0:
        above, _, _ = solve_kkt(state, steps, flat, multipliers, factors, small, slope, change)
    figures[NEGATIVES] = above
    figures[NEUTRAL] = below - above
    figures[LOG_DET_KKT] = log_det
    figures[WEAKEST_PIVOT] = weakest
    return above


@njit(cache=True, nogil=True, error_model="numpy")
def newton(
    angles: Any,
    multipliers: Any,
    steps: Any,
    boundary: Boundary,
    limits: NewtonLimits,
    figures: Any,
) -> int:
    """Move ``angles`` (N, c) and ``multipliers`` (6,) to an equilibrium of a boundary, in place.

    Multipliers are components in the target's frame; those of free components are minus the loads.

    Each iteration factorises the Hessian of the Lagrangian. A shift that penalises the rotation
    of frames (see :func:`factorise`) is raised until the projected Hessian is positive (only with
    ``minima_only``) and no frame turns by much more than ``turn_cap`` radians. Steps that
    :func:`line_search` shortens much raise it too; steps that do what the model predicts lower
    it. Multipliers that are all zero are estimated first. A saddle, with ``minima_only``, is left
    along its direction of least curvature.

    ``figures`` (8,) receives energy (less the work of loads), residual, closure residual, the
    number of negative eigenvalues of the projected Hessian (round-off apart), log |det KKT|,
    iterations, the weakest pivot and the number of eigenvalues that are zero to round-off. Every
    exit has a code; no loop is unbounded.
    """
    nothing = np.empty((0, 3))
    known = KnownRegister(nothing, nothing, 0.0, -1.0)
    return newton_away(angles, multipliers, steps, boundary, limits, known, figures)


@njit(cache=True, nogil=True, error_model="numpy")
def newton_away(
    angles: Any,
    multipliers: Any,
    steps: Any,
    boundary: Boundary,
    limits: NewtonLimits,
    known: KnownRegister,
    figures: Any,
) -> int:
    """:func:`newton`, given up with ``NEAR_KNOWN`` where it comes near a known ring's register."""
    stiffness = steps.stiffness
    tolerance, max_iterations = limits.tolerance, limits.max_iterations
    turn_cap, minima_only = limits.turn_cap, limits.minima_only
    n = angles.shape[0]
    state = new_state(steps, boundary)
    trial = new_state(steps, boundary)
    factors = new_factors(steps)
    small = np.empty((6, 7))
    step = np.empty(angles.shape)
    slope = np.empty(angles.shape)
    change = np.empty(6)
    target = np.empty(6)
    mean_bend = 0.0
    free = 0
    for s in range(n):
        if not is_bound(stiffness, s):
            mean_bend += 0.5 * (stiffness[s, 1, 1] + stiffness[s, 2, 2])
            free += 1
    mean_bend /= free
    # Energy of a bent circle over its length: the scale on which rolling costs energy.
    unit = 2.0 * math.pi * math.pi * mean_bend / n
    flat = _FLAT * unit
    shift, first = 0.0, 0.0
    escapes = 0

    copy_rows(angles, state.angles)
    hold_ground(steps, state.angles)
    for s in range(n):
        state.turn[0] += angles[s, 0]
    energy = evaluate(state, steps)
    unknown = True
    for i in range(6):
        if boundary.fixed[i]:
            unknown = unknown and multipliers[i] == 0.0
        else:
            multipliers[i] = -boundary.loads[i]
    if unknown:
        residuals(state, multipliers, slope)
        negatives, _, _ = solve_kkt(state, steps, 0.0, multipliers, factors, small, slope, change)
        if negatives >= 0:
            for i in range(6):
                multipliers[i] += change[i]
    code = ITERATION_LIMIT
    for iteration in range(max_iterations + 1):
        stationarity, worst = residuals(state, multipliers, slope)
        figures[ENERGY] = energy
        figures[RESIDUAL] = max(stationarity, worst)
        figures[CLOSURE] = worst
        figures[ITERATIONS] = iteration
        if not (math.isfinite(energy) and math.isfinite(stationarity) and math.isfinite(worst)):
            code = NOT_FINITE
            break
        if is_near(state.angles, known):
            code = NEAR_KNOWN
            break
        if figures[RESIDUAL] <= tolerance:
            unstable = _inspect(
                state, steps, flat, multipliers, factors, small, slope, change, figures
            )
            code = CONVERGED if unstable >= 0 else SINGULAR
            if unstable <= 0 or not minima_only or escapes == _MOST_ESCAPES:
                break
            code = ITERATION_LIMIT
            escapes += 1
            shift = positive_shift(
                state, steps, flat, unit, multipliers, factors, small, slope, change
            )
            if shift < 0.0 or not least_stable(state, factors, small, step):
                code = CONVERGED
                break
            trial.turn[0] = state.turn[0]
            move(state, step, _ESCAPE_TURN, 1.0, trial.angles)
            energy = evaluate(trial, steps)
            state, trial = trial, state
            continue
        if iteration == max_iterations:
            break

        shift = max(shift if shift > 1e-3 * first else 0.0, _LEAST_SHIFT * unit)
        first = min(FIRST_SHIFT * unit, _SHIFT_OF_RESIDUAL * stationarity)
        turn = math.inf
        for attempt in range(MOST_SHIFTS):
            negatives, _, _ = solve_kkt(
                state, steps, shift, multipliers, factors, small, slope, change
            )
            if negatives == 0 or (negatives > 0 and not minima_only):
                substitute(state, factors, change, 1.0, step)
                turn = accumulated_turn(state, step)
                if turn <= 2.0 * turn_cap or not minima_only or attempt >= 6:
                    break
                shift = 2.0 * (shift + first)
            else:
                shift = max(first, 4.0 * shift)
        if not math.isfinite(turn):
            code = SINGULAR
            break
        for i in range(6):
            target[i] = multipliers[i] + change[i]
        fraction, energy, ratio = line_search(
            state,
            trial,
            step,
            turn,
            turn_cap,
            energy,
            figures[RESIDUAL],
            target,
            steps,
        )
        if fraction == 0.0:
            code = STEP_LIMIT
            break
        if fraction < 0.3 and turn <= 2.0 * turn_cap:
            shift = max(first, 4.0 * shift)
        elif ratio > 0.8:
            shift *= 0.25
        for i in range(6):
            multipliers[i] += fraction * change[i]
        state, trial = trial, state
    copy_rows(state.angles, angles)
    return code
