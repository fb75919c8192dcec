"""Compiled globalised Newton iteration for closed rings, and the spectrum at its end."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.model.chain_kernels import fill_angles
from dnacheck.ring.closure_kernels import (
    closure_residual,
    energy_gradient,
    lagrangian_residual,
    linearise,
)
from dnacheck.ring.schur_kernels import solve_small
from dnacheck.ring.sweep_kernels import FACTOR_WIDTH, back_substitute, factorise

CONVERGED = 0
ITERATION_LIMIT = 1
STEP_LIMIT = 2
NOT_FINITE = 3
SINGULAR = 4

# Positions of the figures that a solve returns.
ENERGY, RESIDUAL, CLOSURE, NEGATIVES, LOG_DET_KKT, ITERATIONS, WEAKEST_PIVOT = range(7)
N_FIGURES = 7


@njit(cache=True, nogil=True)
def accumulated_turn(axes: Any, step: Any) -> float:
    """Largest rotation that a step (N, 3) gives to any frame, to first order, in radians."""
    x, y, z, worst = 0.0, 0.0, 0.0, 0.0
    for s in range(step.shape[0]):
        for j in range(3):
            x += axes[s, j, 0] * step[s, j]
            y += axes[s, j, 1] * step[s, j]
            z += axes[s, j, 2] * step[s, j]
        square = x * x + y * y + z * z
        if not square <= worst:
            worst = square
    return math.sqrt(worst)


@njit(cache=True, nogil=True)
def _closure_size(residual: Any, length: float) -> float:
    """Closure residual as one number: displacement over length, and rotation, in radians."""
    d = (residual[0] ** 2 + residual[1] ** 2 + residual[2] ** 2) / (length * length)
    r = residual[3] ** 2 + residual[4] ** 2 + residual[5] ** 2
    return math.sqrt(d + r)


@njit(cache=True, nogil=True, error_model="numpy")
def _retract(
    angles: Any, axes: Any, frames: Any, step: Any, fraction: float, form: int, out: Any
) -> None:
    """Apply a step (N, 3) by turning frames instead of adding angles.

    Frame k turns by the rotation vector that the step accumulates up to it, less the mean over
    the ring (a rigid rotation), and the new angles are read off. A roll about the ring's own axis
    is thereby followed exactly and keeps the ring closed. Where the angles so found differ much
    from the sum (a bend near 90 degrees, where they are not unique), the sum is kept.
    """
    n = angles.shape[0]
    mean = np.zeros(3)
    turn = np.zeros(3)
    for s in range(n):
        for i in range(3):
            for j in range(3):
                turn[i] += axes[s, j, i] * step[s, j]
            mean[i] += turn[i] / n
    turned = np.empty((n + 1, 3, 3))
    for i in range(3):
        turn[i] = -mean[i]
    half = 0.5 * fraction
    for s in range(n + 1):
        # Cayley's rotation by c: v -> v + 2/(1 + c.c) c x (v + c x v), near exp(2 c).
        c0, c1, c2 = half * turn[0], half * turn[1], half * turn[2]
        factor = 2.0 / (1.0 + c0 * c0 + c1 * c1 + c2 * c2)
        for j in range(3):
            v0, v1, v2 = frames[s, 0, j], frames[s, 1, j], frames[s, 2, j]
            x0 = v0 + c1 * v2 - c2 * v1
            x1 = v1 + c2 * v0 - c0 * v2
            x2 = v2 + c0 * v1 - c1 * v0
            turned[s, 0, j] = v0 + factor * (c1 * x2 - c2 * x1)
            turned[s, 1, j] = v1 + factor * (c2 * x0 - c0 * x2)
            turned[s, 2, j] = v2 + factor * (c0 * x1 - c1 * x0)
        if s < n:
            for i in range(3):
                for j in range(3):
                    turn[i] += axes[s, j, i] * step[s, j]
    fill_angles(turned, form, out)
    for s in range(n):
        close = True
        for j in range(3):
            plain = angles[s, j] + fraction * step[s, j]
            if j != 1:
                out[s, j] += 2.0 * math.pi * round((plain - out[s, j]) / (2.0 * math.pi))
            if not abs(out[s, j] - plain) < 0.5:
                close = False
        if not close:
            for j in range(3):
                out[s, j] = angles[s, j] + fraction * step[s, j]


@njit(cache=True, nogil=True, error_model="numpy")
def newton(
    angles: Any,
    multipliers: Any,
    ground: Any,
    stiffness: Any,
    form: int,
    tolerance: float,
    max_iterations: int,
    turn_cap: float,
    minima_only: bool,
    figures: Any,
) -> int:
    """Move ``angles`` (N, 3) and ``multipliers`` (6,) to a closed equilibrium, in place.

    Each iteration factorises the Hessian of the Lagrangian. A shift that penalises the rotation
    of frames (see :func:`factorise`) is raised until the projected Hessian is positive (only with
    ``minima_only``) and no frame turns by more than ``turn_cap`` radians; large steps are applied
    by turning frames. Steps are accepted when they lower energy + weight * closure residual (an
    exact penalty), or halve the residual of all equations. ``figures`` (7,) receives energy,
    residual, closure residual, negative eigenvalues of the projected Hessian, log |det KKT|,
    iterations and the weakest pivot. Every exit has a code; no loop is unbounded.
    """
    n = angles.shape[0]
    length = float(n)
    centres = np.empty((n + 1, 3))
    frames = np.empty((n + 1, 3, 3))
    axes = np.empty((n, 3, 3))
    halves = np.empty((n if form != 0 else 0, 5, 3))
    new_centres = np.empty((n + 1, 3))
    new_frames = np.empty((n + 1, 3, 3))
    new_axes = np.empty((n, 3, 3))
    new_gradient = np.empty((n, 3))
    gradient = np.empty((n, 3))
    factors = np.empty((n, FACTOR_WIDTH))
    small = np.empty((6, 7))
    step = np.empty((n, 3))
    mend = np.empty((n, 3))
    trial = np.empty((n, 3))
    closure = np.empty(6)
    rhs = np.empty(6)
    target = np.empty(6)
    blend = np.empty(6)

    mean_bend = 0.0
    for s in range(n):
        mean_bend += 0.5 * (stiffness[s, 1, 1] + stiffness[s, 2, 2]) / n
    # Energy of a bent circle over its length: the scale on which rolling costs energy.
    unit = 2.0 * math.pi * math.pi * mean_bend / n
    shift = 0.0

    linearise(angles, form, centres, frames, axes, halves)
    energy = energy_gradient(angles, ground, stiffness, gradient)
    closure_residual(centres, frames, closure)
    known = False
    for i in range(6):
        known = known or multipliers[i] != 0.0
    if not known:
        factorise(
            gradient, stiffness, 0.0, form, centres, axes, halves, multipliers, factors, small
        )
        for i in range(6):
            rhs[i] = closure[i] - small[i, 6]
        if solve_small(small, rhs, length, target)[0] >= 0:
            for i in range(6):
                multipliers[i] = target[i]
    for iteration in range(max_iterations + 1):
        figures[ITERATIONS] = iteration
        stationarity = lagrangian_residual(gradient, centres, axes, multipliers)
        worst = 0.0
        for i in range(6):
            if not abs(closure[i]) <= worst:
                worst = abs(closure[i])
        figures[ENERGY] = energy
        figures[RESIDUAL] = max(stationarity, worst)
        figures[CLOSURE] = worst
        if not (math.isfinite(energy) and math.isfinite(stationarity) and math.isfinite(worst)):
            return NOT_FINITE
        done = stationarity <= tolerance and worst <= tolerance
        if not done and iteration == max_iterations:
            return ITERATION_LIMIT
        if done or shift < 1e-3 * unit:
            shift = 0.0

        usable = False
        negatives = 0
        log_det = 0.0
        weakest = 0.0
        turn = 0.0
        for attempt in range(40):
            pivots, log_pivots, weakest = factorise(
                gradient, stiffness, shift, form, centres, axes, halves, multipliers, factors, small
            )
            for i in range(6):
                rhs[i] = closure[i] - small[i, 6]
            small_negatives, log_small = solve_small(small, rhs, length, target)
            # inertia of the KKT matrix: pivots of H, then of minus the Schur complement.
            negatives = pivots - small_negatives
            log_det = log_pivots + log_small
            if done:
                figures[NEGATIVES] = negatives
                figures[LOG_DET_KKT] = log_det
                figures[WEAKEST_PIVOT] = weakest
                return CONVERGED if small_negatives >= 0 else SINGULAR
            if small_negatives >= 0 and (negatives == 0 or not minima_only):
                back_substitute(factors, target, 1.0, step)
                turn = accumulated_turn(axes, step)
                usable = math.isfinite(turn)
                if usable and (turn <= 2.0 * turn_cap or not minima_only or attempt >= 6):
                    break
                shift = (shift + 0.05 * unit) * 2.0
            else:
                shift = max(0.05 * unit, 4.0 * shift)
        if not usable:
            return SINGULAR
        fraction = 1.0 if turn <= turn_cap else turn_cap / turn

        slope = 0.0
        for s in range(n):
            for j in range(3):
                slope += gradient[s, j] * step[s, j]
        size = _closure_size(closure, length)
        weight = 0.0
        for i in range(6):
            weight += (target[i] * (length if i < 3 else 1.0)) ** 2
        weight = 2.0 * math.sqrt(weight)
        if size > 0.0 and slope > 0.0:
            weight = max(weight, 2.0 * slope / size)
        merit = energy + weight * size
        descent = min(slope - weight * size, 0.0)
        # Round-off in the energy bounds what a line search can see.
        noise = 1e-13 * (abs(energy) + 1.0)
        accepted = False
        whole = fraction == 1.0
        trial_energy = energy
        for _halving in range(30):
            if fraction * turn > 0.15:
                _retract(angles, axes, frames, step, fraction, form, trial)
            else:
                for s in range(n):
                    for j in range(3):
                        trial[s, j] = angles[s, j] + fraction * step[s, j]
            first_merit = math.inf
            for evaluation in range(3):
                linearise(trial, form, new_centres, new_frames, new_axes, halves)
                trial_energy = energy_gradient(trial, ground, stiffness, new_gradient)
                closure_residual(new_centres, new_frames, rhs)
                trial_size = _closure_size(rhs, length)
                trial_merit = trial_energy + weight * trial_size
                accepted = trial_merit <= merit + 1e-4 * fraction * descent + noise
                if evaluation == 2 or (evaluation == 1 and trial_merit <= first_merit):
                    break
                if evaluation == 0:
                    if whole and not accepted and math.isfinite(trial_merit):
                        trial_residual = lagrangian_residual(
                            new_gradient, new_centres, new_axes, target
                        )
                        for i in range(6):
                            trial_residual = max(trial_residual, abs(rhs[i]))
                        # Below the noise of the energy only the residual can judge a step.
                        near = 2.0 if turn < 1e-6 else 0.5
                        accepted = trial_residual <= near * figures[RESIDUAL]
                        if accepted:
                            break
                    if accepted and (
                        trial_size <= 0.5 * size or weight * trial_size <= -0.3 * fraction * descent
                    ):
                        break
                    # The step followed the linearised closure; undo what curvature made of it.
                    first_merit = trial_merit if accepted else math.inf
                    if not trial_size < 0.5 or solve_small(small, rhs, length, blend)[0] < 0:
                        break
                    back_substitute(factors, blend, 0.0, mend)
                sign = 1.0 if evaluation == 0 else -1.0
                for s in range(n):
                    for j in range(3):
                        trial[s, j] += sign * mend[s, j]
            if accepted:
                break
            whole = False
            fraction *= 0.5
        if not accepted:
            return STEP_LIMIT
        # Trust in the quadratic model decides how much the next step is held back.
        predicted = -fraction * (1.0 - 0.5 * fraction) * descent
        ratio = (merit - trial_merit) / predicted if predicted > 0.0 else 1.0
        if fraction < 0.3 and turn <= 2.0 * turn_cap:
            shift = max(0.05 * unit, 4.0 * shift)
        elif ratio > 0.5:
            shift *= 0.125
        energy = trial_energy
        part = 1.0 if fraction > 0.1 else fraction
        for s in range(n):
            for j in range(3):
                angles[s, j] = trial[s, j]
                gradient[s, j] = new_gradient[s, j]
        for i in range(6):
            closure[i] = rhs[i]
            multipliers[i] += part * (target[i] - multipliers[i])
        centres, new_centres = new_centres, centres
        frames, new_frames = new_frames, frames
        axes, new_axes = new_axes, axes
    return ITERATION_LIMIT
