"""Compiled steps of a chain: its state, how a step moves it, and how much of a step to take.

A state is the tuple (angles (N, 3), centres (N+1, 3), frames (N+1, 3, 3), axes (N, 3, 3), halves,
energy gradient (N, 3), closure residual (6,)); see
:mod:`dnacheck.equilibria.discrete.kernels.closure`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.equilibria.discrete.kernels.closure import (
    closure_jacobian,
    closure_residual,
    energy_gradient,
    lagrangian_gradient,
    linearise,
)
from dnacheck.model.chain_kernels import fill_angles
from dnacheck.numerics.small_systems import solve_small

# Frames that turn by more than this (rad) are turned; the angles of smaller steps are added.
# Rolling is a rotation of frames, so even small steps along a soft register gain by it.
_TURN_FRAMES = 1e-5
_MOST_HALVINGS = 30


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
def new_state(n: int, form: int) -> Any:
    return (
        np.empty((n, 3)),
        np.empty((n + 1, 3)),
        np.empty((n + 1, 3, 3)),
        np.empty((n, 3, 3)),
        np.empty((n if form != 0 else 0, 5, 3)),
        np.empty((n, 3)),
        np.empty(6),
    )


@njit(cache=True, nogil=True)
def evaluate(state: Any, ground: Any, stiffness: Any, form: int) -> float:
    """Fill a state from its angles; returns the energy."""
    angles, centres, frames, axes, halves, gradient, closure = state
    linearise(angles, form, centres, frames, axes, halves)
    closure_residual(centres, frames, closure)
    return energy_gradient(angles, ground, stiffness, gradient)


@njit(cache=True, nogil=True)
def residuals(state: Any, multipliers: Any, slope: Any) -> tuple[float, float]:
    """Largest entry of the Lagrangian's gradient, left in ``slope`` (N, 3), and of closure."""
    _, centres, _, axes, _, gradient, closure = state
    worst = 0.0
    for i in range(6):
        if not abs(closure[i]) <= worst:
            worst = abs(closure[i])
    return lagrangian_gradient(gradient, centres, axes, multipliers, slope), worst


@njit(cache=True, nogil=True)
def _closure_size(residual: Any, length: float) -> float:
    """Closure residual as one number: displacement over length, and rotation, in radians."""
    d = (residual[0] ** 2 + residual[1] ** 2 + residual[2] ** 2) / (length * length)
    r = residual[3] ** 2 + residual[4] ** 2 + residual[5] ** 2
    return math.sqrt(d + r)


@njit(cache=True, nogil=True, error_model="numpy")
def turn_frames(state: Any, step: Any, fraction: float, form: int, out: Any) -> None:
    """Apply a step (N, 3) by turning frames instead of adding angles; new angles into ``out``.

    Frame k turns by the rotation vector that the step accumulates up to it, less the mean over
    the ring (a rigid rotation), and the new angles are read off. A roll about the ring's own axis
    is thereby followed exactly and keeps the ring closed. Where the angles so found differ much
    from the sum (a bend near 90 degrees, where they are not unique), the sum is kept.
    """
    angles, _, frames, axes, _, _, _ = state
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


@njit(cache=True, nogil=True)
def move(state: Any, step: Any, fraction: float, turn: float, form: int, out: Any) -> None:
    """Angles after a fraction of a step (N, 3), into ``out``."""
    if fraction * turn > _TURN_FRAMES:
        turn_frames(state, step, fraction, form, out)
    else:
        angles = state[0]
        for s in range(angles.shape[0]):
            for j in range(3):
                out[s, j] = angles[s, j] + fraction * step[s, j]


@njit(cache=True, nogil=True, error_model="numpy")
def restore(state: Any, stiffness: Any, defect: Any, mend: Any) -> bool:
    """Change (N, 3) that undoes a closure ``defect`` (6,) to first order, soft modes left alone.

    It is the least change in the metric of the diagonal of the stiffness; the Hessian as metric
    would send a soft register far away. False if closure is singular.
    """
    _, centres, _, axes, _, _, _ = state
    n = axes.shape[0]
    jacobian = np.empty((6, 3 * n))
    closure_jacobian(centres, axes, jacobian)
    metric = np.zeros((6, 7))
    weights = np.empty(6)
    for s in range(n):
        for j in range(3):
            for i in range(6):
                pull = jacobian[i, 3 * s + j] / stiffness[s, j, j]
                for k in range(6):
                    metric[i, k] += pull * jacobian[k, 3 * s + j]
    if solve_small(metric, defect, float(n), weights)[0] < 0:
        return False
    for s in range(n):
        for j in range(3):
            mend[s, j] = 0.0
            for i in range(6):
                mend[s, j] -= jacobian[i, 3 * s + j] * weights[i] / stiffness[s, j, j]
    return True


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
    ground: Any,
    stiffness: Any,
    form: int,
) -> tuple[float, float, float]:
    """Find a fraction of a step that improves, and leave the state there in ``trial``.

    The merit is energy + weight * closure residual, an exact penalty. Where the curvature of
    closure spoils a trial, :func:`restore` sends it back to what the linearised closure promised,
    once.

    Returns
    -------
    fraction : of the step, 0 if none improves.
    energy : of the trial.
    ratio : decrease of the merit over what the quadratic model predicts.
    """
    angles, _, _, _, _, gradient, closure = state
    n = angles.shape[0]
    length = float(n)
    mend = np.empty((n, 3))
    curved = np.empty(6)
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
    descent = max(weight * size - slope, 0.0)
    # Round-off in the energy bounds what the merit can see.
    noise = 1e-13 * (abs(energy) + 1.0)
    fraction = 1.0 if turn <= turn_cap else turn_cap / turn
    for _ in range(_MOST_HALVINGS):
        move(state, step, fraction, turn, form, trial[0])
        accepted = False
        trial_energy = energy
        gain = 0.0
        for attempt in range(2):
            trial_energy = evaluate(trial, ground, stiffness, form)
            trial_size = _closure_size(trial[6], length)
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
                curved[i] = trial[6][i] - (1.0 - fraction) * closure[i]
            if not trial_size < 0.5 + size or not restore(trial, stiffness, curved, mend):
                break
            for s in range(n):
                for j in range(3):
                    trial[0][s, j] += mend[s, j]
        if accepted:
            predicted = fraction * (1.0 - 0.5 * fraction) * descent
            return fraction, trial_energy, gain / predicted if predicted > 0.0 else 1.0
        fraction *= 0.5
    return 0.0, energy, 0.0
