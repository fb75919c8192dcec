"""Compiled solutions of the equations of one Newton step (KKT system) and what they tell."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.equilibria.boundary_kernels import solve_held
from dnacheck.equilibria.discrete.kernels.states import (
    accumulated_turn,
    factorise_state,
    replace_rhs,
    substitute,
)

# First shift tried, relative to the energy of a bent circle.
FIRST_SHIFT = 0.05
MOST_SHIFTS = 40
_INVERSE_ITERATIONS = 6


@njit(cache=True, nogil=True)
def solve_kkt(
    state: Any,
    steps: Any,
    shift: float,
    multipliers: Any,
    factors: Any,
    small: Any,
    slope: Any,
    change: Any,
) -> tuple[int, float, float]:
    """Factorise the KKT matrix with a shift and solve for the ``change`` (6,) of the multipliers.

    The right-hand side is ``slope`` (N, c), the gradient of the Lagrangian. Solving for changes
    keeps the error relative to them where a pivot of H happens to be tiny; the multipliers
    themselves would carry it into every iteration.

    Returns
    -------
    negatives : number of negative eigenvalues of the projected Hessian, -1 if it is singular.
    log_det : log |det KKT|, minus infinity if it is singular.
    weakest : see :func:`dnacheck.equilibria.discrete.kernels.factorisation.factorise`.
    """
    pivots, log_pivots, weakest = factorise_state(
        state, steps, shift, multipliers, factors, small, slope
    )
    rhs = np.empty(6)
    for i in range(6):
        rhs[i] = state.closure[i] - small[i, 6]
    small_negatives, log_small = solve_held(
        state.boundary, small, rhs, float(slope.shape[0]), change
    )
    # The inertia of the KKT matrix is that of H and of minus the Schur complement.
    if small_negatives < 0:
        return -1, -math.inf, weakest
    return pivots - small_negatives, log_pivots + log_small, weakest


@njit(cache=True, nogil=True, error_model="numpy")
def least_stable(state: Any, factors: Any, small: Any, direction: Any) -> bool:
    """Direction (N, c) of least curvature, from the factors of a Hessian shifted to be positive.

    A few steps of inverse iteration, scaled so that no frame turns by more than a radian. False if
    that fails.
    """
    n, c = direction.shape
    target = np.empty(6)
    for s in range(n):
        for j in range(c):
            # Any vector serves that no symmetry of the chain makes orthogonal to the answer.
            direction[s, j] = math.sin(1.0 + 3.7 * s + 1.3 * j * j)
    turn = 1.0
    for _ in range(_INVERSE_ITERATIONS):
        replace_rhs(state, factors, direction, small)
        if solve_held(state.boundary, small, -small[:, 6], float(n), target)[0] < 0:
            return False
        substitute(state, factors, target, 1.0, direction)
        turn = accumulated_turn(state, direction)
        for s in range(n):
            for j in range(c):
                direction[s, j] /= turn
    return math.isfinite(turn)


@njit(cache=True, nogil=True)
def positive_shift(
    state: Any,
    steps: Any,
    start: float,
    unit: float,
    multipliers: Any,
    factors: Any,
    small: Any,
    slope: Any,
    change: Any,
) -> float:
    """Smallest shift tried, from ``start`` on, that makes the projected Hessian positive; or -1."""
    shift = start
    for _ in range(MOST_SHIFTS):
        negatives, _, _ = solve_kkt(state, steps, shift, multipliers, factors, small, slope, change)
        if negatives == 0:
            return shift
        shift = max(FIRST_SHIFT * unit, 4.0 * shift)
    return -1.0
