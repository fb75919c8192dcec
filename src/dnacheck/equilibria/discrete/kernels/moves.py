"""Compiled moves of a chain: how a step changes its state, and how much of a step to take.

A state is that of :mod:`dnacheck.equilibria.discrete.kernels.states`, with c coordinates a step
(three angles, or six parameters).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.equilibria.boundary_kernels import solve_held
from dnacheck.equilibria.discrete.kernels.states import (
    evaluate,
    jacobian,
    lagrangian_slope,
    turn_frames,
)

# Frames that turn by more than this (rad) are turned; the angles of smaller steps are added.
# Rolling is a rotation of frames, so even small steps along a soft register gain by it.
_TURN_FRAMES = 1e-5
_MOST_HALVINGS = 30


@njit(cache=True, nogil=True)
def residuals(state: Any, multipliers: Any, slope: Any) -> tuple[float, float]:
    """Largest entry of the Lagrangian's gradient, left in ``slope`` (N, c), and of closure."""
    worst = 0.0
    for i in range(6):
        if not abs(state.closure[i]) <= worst:
            worst = abs(state.closure[i])
    return lagrangian_slope(state, multipliers, slope), worst


@njit(cache=True, nogil=True)
def _closure_size(residual: Any, length: float) -> float:
    """Closure residual as one number: displacement over length, and rotation, in radians."""
    d = (residual[0] ** 2 + residual[1] ** 2 + residual[2] ** 2) / (length * length)
    r = residual[3] ** 2 + residual[4] ** 2 + residual[5] ** 2
    return math.sqrt(d + r)


@njit(cache=True, nogil=True)
def move(state: Any, step: Any, fraction: float, turn: float, out: Any) -> None:
    """Angles after a fraction of a step (N, c), into ``out``."""
    if fraction * turn > _TURN_FRAMES:
        turn_frames(state, step, fraction, out)
    else:
        angles = state.angles
        for s in range(angles.shape[0]):
            for j in range(angles.shape[1]):
                out[s, j] = angles[s, j] + fraction * step[s, j]


@njit(cache=True, nogil=True, error_model="numpy")
def restore(state: Any, stiffness: Any, defect: Any, mend: Any) -> bool:
    """Change (N, c) that undoes a closure ``defect`` (6,) to first order, soft modes left alone.

    It is the least change in the metric of the diagonal of the stiffness; the Hessian as metric
    would send a soft register far away. False if closure is singular.
    """
    n, c = mend.shape
    rows = np.empty((6, c * n))
    jacobian(state, rows)
    metric = np.zeros((6, 7))
    weights = np.empty(6)
    for s in range(n):
        for j in range(c):
            for i in range(6):
                pull = rows[i, c * s + j] / stiffness[s, j, j]
                for k in range(6):
                    metric[i, k] += pull * rows[k, c * s + j]
    if solve_held(state.boundary, metric, defect, float(n), weights)[0] < 0:
        return False
    for s in range(n):
        for j in range(c):
            mend[s, j] = 0.0
            for i in range(6):
                mend[s, j] -= rows[i, c * s + j] * weights[i] / stiffness[s, j, j]
    return True


@njit(cache=True, nogil=True)
def _work(state: Any, step: Any) -> float:
    """Work of the loads along a step (N, c), to first order."""
    loads = state.boundary.loads
    loaded = False
    for i in range(6):
        loaded = loaded or loads[i] != 0.0
    work = 0.0
    if loaded:
        n, c = step.shape
        rows = np.empty((6, c * n))
        jacobian(state, rows)
        for i in range(6):
            for s in range(n):
                for j in range(c):
                    work += loads[i] * rows[i, c * s + j] * step[s, j]
    return work


@njit(cache=True, nogil=True)
def line_search(
    state: Any,
    trial: Any,
    step: Any,
    turn: float,
    turn_cap: float,
    energy: float,
    residual: float,
    target: Any,
    steps: Any,
) -> tuple[float, float, float]:
    """Find a fraction of a step that improves, and leave the state there in ``trial``.

    The merit is energy (less the loads' work) + weight * closure residual, an exact penalty. Where
    the curvature of closure spoils a trial, :func:`restore` sends it back to what the linearised
    closure promised, once.

    Returns
    -------
    fraction : of the step, 0 if none improves.
    energy : of the trial.
    ratio : decrease of the merit over what the quadratic model predicts.
    """
    gradient, closure = state.gradient, state.closure
    n, c = step.shape
    length = float(n)
    mend = np.empty((n, c))
    curved = np.empty(6)
    slope = 0.0
    for s in range(n):
        for j in range(c):
            slope += gradient[s, j] * step[s, j]
    slope -= _work(state, step)
    size = _closure_size(closure, length)
    weight = 0.0
    for i in range(6):
        if state.boundary.fixed[i]:
            weight += (target[i] * (length if i < 3 else 1.0)) ** 2
    weight = 2.0 * math.sqrt(weight)
    if size > 0.0 and slope > 0.0:
        weight = max(weight, 2.0 * slope / size)
    descent = max(weight * size - slope, 0.0)
    # Round-off in the energy bounds what the merit can see.
    noise = 1e-13 * (abs(energy) + 1.0)
    fraction = 1.0 if turn <= turn_cap else turn_cap / turn
    for _ in range(_MOST_HALVINGS):
        trial.turn[0] = state.turn[0]
        move(state, step, fraction, turn, trial.angles)
        accepted = False
        trial_energy = energy
        gain = 0.0
        for attempt in range(2):
            trial_energy = evaluate(trial, steps)
            trial_size = _closure_size(trial.closure, length)
            gain = energy - trial_energy + weight * (size - trial_size)
            accepted = gain >= 1e-4 * fraction * descent - noise
            if fraction == 1.0 and attempt == 0 and not accepted:
                stationarity, worst = residuals(trial, target, mend)
                # Below the noise of the energy only the residual can judge a step.
                bound = 2.0 if turn < 1e-6 or descent < 10.0 * noise else 0.5
                accepted = max(stationarity, worst) <= bound * residual
                if accepted:
                    break
            small_enough = weight * trial_size <= 0.3 * fraction * descent
            if attempt == 1 or small_enough or (accepted and trial_size <= 0.5 * size):
                break
            for i in range(6):
                curved[i] = trial.closure[i] - (1.0 - fraction) * closure[i]
            if not trial_size < 0.5 + size or not restore(trial, steps.stiffness, curved, mend):
                break
            for s in range(n):
                for j in range(c):
                    trial.angles[s, j] += mend[s, j]
        if accepted:
            predicted = fraction * (1.0 - 0.5 * fraction) * descent
            return fraction, trial_energy, gain / predicted if predicted > 0.0 else 1.0
        fraction *= 0.5
    return 0.0, energy, 0.0
