"""Pieces of Newton's method on the condensed collocation system, at fixed parameters.

The loop is in ``state.run_newton``: a compiled loop would hold a second copy of the sweep, which
costs more to compile than the calls from Python cost to run.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.equilibria.continuum.kernels.condense import COLUMNS
from dnacheck.numerics.rotations import rotation_log

#: Below this ratio of pivots of the closure matrix at a solution a direction counts as neutral.
NEUTRAL = 1e-10
#: Below this ratio a direction is left out of a step that it would make too large: on the way to a
#: neutral solution the matrix is only as singular as the residual is small.
_SOFT = 1e-5

#: A neutral direction comes with a conserved quantity that makes one closure equation redundant;
#: the discretisation satisfies it to its own accuracy only, so this much may be left over.
NEUTRAL_RESIDUAL = 1e-6

CONVERGED = 0
NOT_FINITE = 1
ITERATION_LIMIT = 2
NEUTRAL_MODE = 3


@njit(cache=True, nogil=True, error_model="numpy")
def solve_small(a: Any, x: Any, neutral: float) -> float:
    """Solve ``a`` (n, n) in place for ``x`` (n, c), full pivoting; return the pivot ratio.

    The ratio of the smallest to the largest pivot measures how nearly singular the matrix is.
    Where a pivot falls below ``neutral`` times the largest, the unknowns left are set to zero:
    a neutral direction, such as the register of a straight rod, takes no step.
    """
    n = a.shape[0]
    cols = x.shape[1]
    order = np.arange(n)
    largest = 0.0
    smallest = math.inf
    rank = n
    for c in range(n):
        bi = c
        bj = c
        size = -1.0
        for i in range(c, n):
            for j in range(c, n):
                if abs(a[i, j]) > size:
                    size = abs(a[i, j])
                    bi = i
                    bj = j
        if not math.isfinite(size):
            return 0.0
        largest = max(largest, size)
        smallest = min(smallest, size)
        if not size > neutral * largest:
            rank = c
            break
        for j in range(n):
            a[c, j], a[bi, j] = a[bi, j], a[c, j]
        for j in range(cols):
            x[c, j], x[bi, j] = x[bi, j], x[c, j]
        for i in range(n):
            a[i, c], a[i, bj] = a[i, bj], a[i, c]
        order[c], order[bj] = order[bj], order[c]
        for i in range(c + 1, n):
            f = a[i, c] / a[c, c]
            for j in range(c, n):
                a[i, j] -= f * a[c, j]
            for j in range(cols):
                x[i, j] -= f * x[c, j]
    y = np.zeros((n, cols))
    for i in range(rank - 1, -1, -1):
        for j in range(cols):
            total = x[i, j]
            for c in range(i + 1, rank):
                total -= a[i, c] * y[c, j]
            y[i, j] = total / a[i, i]
    for i in range(n):
        for j in range(cols):
            x[order[i], j] = y[i, j]
    return smallest / largest if largest > 0.0 else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def closure_defect(frame: Any, centre: Any, alpha: float, out: Any) -> float:
    """What the end must still move by: rotation vector and translation, (6,); returns its size.

    The end conditions are those of (4.11): centre at the origin, frame turned by alpha about e3.
    """
    ca = math.cos(alpha)
    sa = math.sin(alpha)
    miss = np.empty((3, 3))
    for j in range(3):
        miss[0, j] = ca * frame[j, 0] - sa * frame[j, 1]
        miss[1, j] = sa * frame[j, 0] + ca * frame[j, 1]
        miss[2, j] = frame[j, 2]
    rotation_log(miss, out[:3])
    size = 0.0
    for i in range(3):
        out[3 + i] = -centre[i]
    for i in range(6):
        size = max(size, abs(out[i]))
    return size


@njit(cache=True, nogil=True, error_model="numpy")
def _step(last: Any, end: Any, neutral: float, matrix: Any, step: Any) -> float:
    """Write the change of the loads that closes the linearised ring into ``step`` (6, 1)."""
    for r in range(6):
        for c in range(6):
            matrix[r, c] = last[r, c]
        step[r, 0] = end[r] - last[r, COLUMNS - 1]
    return solve_small(matrix, step, neutral)


@njit(cache=True, nogil=True, error_model="numpy")
def _largest_turn(sensitivity: Any, step: Any) -> float:
    """Largest rotation of a mesh frame in a step, radians."""
    largest = 0.0
    for i in range(1, sensitivity.shape[0]):
        square = 0.0
        for r in range(3):
            total = sensitivity[i, r, COLUMNS - 1]
            for c in range(6):
                total += sensitivity[i, r, c] * step[c, 0]
            square += total * total
        if not square <= largest:
            largest = square
    return math.sqrt(largest)


@njit(cache=True, nogil=True, error_model="numpy")
def propose(
    frames: Any,
    centres: Any,
    sensitivity: Any,
    alpha: float,
    largest_turn: float,
    step: Any,
) -> tuple[float, float, float]:
    """Closure defect of a swept state and the Newton step that removes it.

    Parameters
    ----------
    frames, centres, sensitivity
        From ``condense``.
    alpha : float
        End twist of (4.11).
    largest_turn : float
        A nearly neutral direction that would turn a mesh frame by more than this is left out.
    step : (6, 1)
        Output, the change of the loads.

    Returns
    -------
    defect : float
    pivot_ratio : float
        Smallest over largest pivot of the 6 x 6 closure matrix.
    turn : float
        Largest rotation of a mesh frame in the step, radians.
    """
    end = np.empty(6)
    matrix = np.empty((6, 6))
    n_intervals = frames.shape[0] - 1
    defect = closure_defect(frames[n_intervals], centres[n_intervals], alpha, end)
    last = sensitivity[n_intervals]
    ratio = 1.0
    turn = math.inf
    threshold = NEUTRAL
    for _ in range(2):
        found = _step(last, end, threshold, matrix, step)
        turn = _largest_turn(sensitivity, step)
        if threshold == NEUTRAL:
            ratio = found
        if turn <= largest_turn or ratio >= _SOFT:
            break
        threshold = _SOFT
    return defect, ratio, turn


@njit(cache=True, nogil=True, error_model="numpy")
def advance(slopes: Any, loads: Any, stage_sensitivity: Any, step: Any, scale: float) -> None:
    """Move the unknowns by ``scale`` times the Newton step whose loads are ``step`` (6, 1)."""
    for c in range(6):
        loads[c] += scale * step[c, 0]
    for i in range(slopes.shape[0]):
        for j in range(slopes.shape[1]):
            for r in range(3):
                total = stage_sensitivity[i, j, r, COLUMNS - 1]
                for c in range(6):
                    total += stage_sensitivity[i, j, r, c] * step[c, 0]
                slopes[i, j, r] += scale * total
