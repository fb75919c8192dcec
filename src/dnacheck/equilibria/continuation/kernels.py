"""Compiled parts of the continuation: one bordered Newton step on the condensed system."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.equilibria.continuum.kernels.condense import COLUMNS, condense
from dnacheck.equilibria.continuum.kernels.newton import closure_defect

#: Unknowns of the bordered system when no symmetry is removed: m(0), n, the parameter.
UNKNOWNS = 7

FINE = 0
NOT_FINITE = 1

#: Entries of ``figures``, the scalar results of a step.
RESIDUAL, LEFT_OUT, SIGN, LOG_DET, TURN, FIGURES = 0, 1, 2, 3, 4, 5


@njit(cache=True, nogil=True, error_model="numpy")
def solve_bordered(a: Any, x: Any) -> tuple[float, float]:
    """Solve ``a`` (n, n) in place for the columns of ``x`` (n, c), with row pivoting.

    Returns
    -------
    sign, log_det : float
        Of the determinant; sign 0 when a pivot vanished.
    """
    n = a.shape[0]
    cols = x.shape[1]
    sign = 1.0
    log_det = 0.0
    for c in range(n):
        best = c
        for r in range(c + 1, n):
            if abs(a[r, c]) > abs(a[best, c]):
                best = r
        size = abs(a[best, c])
        if not size > 0.0 or not math.isfinite(size):
            return 0.0, -math.inf
        if best != c:
            sign = -sign
            for j in range(n):
                a[c, j], a[best, j] = a[best, j], a[c, j]
            for j in range(cols):
                x[c, j], x[best, j] = x[best, j], x[c, j]
        if a[c, c] < 0.0:
            sign = -sign
        log_det += math.log(size)
        for r in range(c + 1, n):
            f = a[r, c] / a[c, c]
            for j in range(c, n):
                a[r, j] -= f * a[c, j]
            for j in range(cols):
                x[r, j] -= f * x[c, j]
    for j in range(cols):
        for r in range(n - 1, -1, -1):
            total = x[r, j]
            for c in range(r + 1, n):
                total -= a[r, c] * x[c, j]
            x[r, j] = total / a[r, r]
    return sign, log_det


@njit(cache=True, nogil=True, error_model="numpy")
def closing_rows(
    frames: Any,
    centres: Any,
    sensitivity: Any,
    alpha: float,
    alpha_rate: float,
    symmetric: bool,
    rows: Any,
) -> float:
    """Linearised closure; returns the largest defect of (4.11) itself.

    Without symmetry the six conditions of (4.11). With it the four that make a solution which is
    symmetric about s = 0 (rotation by pi about e2) symmetric about s = 1/2 too, and thereby
    closed: r1 = r3 = 0, d3 perpendicular to e2, and e2 at the angle -alpha/2 in the frame.

    Parameters
    ----------
    frames, centres, sensitivity
        From ``condense``. With symmetry the middle mesh point is at s = 1/2.
    rows : (f, 8)
        Output, one row per condition: derivatives by the loads and the parameter, and what is
        still missing, the Newton column of the sensitivities being taken into account.
    """
    k = frames.shape[0] - 1
    end = np.empty(6)
    defect = closure_defect(frames[k], centres[k], alpha, end)
    if not symmetric:
        for i in range(6):
            for c in range(7):
                rows[i, c] = sensitivity[k, i, c]
            rows[i, 7] = end[i] - sensitivity[k, i, 7]
        rows[2, 6] -= alpha_rate
        return defect
    half = k // 2
    frame = frames[half]
    w = sensitivity[half]
    ca = math.cos(0.5 * alpha)
    sa = math.sin(0.5 * alpha)
    for c in range(8):
        rows[0, c] = w[3, c]
        rows[1, c] = w[5, c]
        rows[2, c] = w[2, c] * frame[0, 2] - w[0, c] * frame[2, 2]
        first = w[2, c] * frame[0, 0] - w[0, c] * frame[2, 0]
        second = w[2, c] * frame[0, 1] - w[0, c] * frame[2, 1]
        rows[3, c] = ca * first - sa * second
    rows[3, 6] -= 0.5 * alpha_rate * (sa * frame[1, 0] + ca * frame[1, 1])
    rows[0, 7] = -centres[half, 0] - rows[0, 7]
    rows[1, 7] = -centres[half, 2] - rows[1, 7]
    rows[2, 7] = -frame[1, 2] - rows[2, 7]
    rows[3, 7] = -(ca * frame[1, 0] - sa * frame[1, 1]) - rows[3, 7]
    return defect


@njit(cache=True, nogil=True, error_model="numpy")
def bordered_step(
    slopes: Any,
    loads: Any,
    parameter: float,
    rod: Any,
    rod_rate: Any,
    alpha: float,
    alpha_rate: float,
    h: Any,
    a: Any,
    b: Any,
    frames: Any,
    centres: Any,
    sensitivity: Any,
    stage_sensitivity: Any,
    parts: Any,
    free: Any,
    scale: Any,
    border: Any,
    level: float,
    step: Any,
    tangent: Any,
    figures: Any,
) -> int:
    """Evaluate the residual and find the Newton step and the tangent; nothing is moved.

    The unknowns are the loads with indices ``free`` and the parameter, all divided by ``scale``.
    The equations are those of ``closing_rows`` and border . unknowns = level.

    Parameters
    ----------
    slopes .. parts
        See ``condense``.
    free : (f,) int
        All six, or (0, 2, 3, 5) for the solutions symmetric about s = 0.
    scale : (7,)
        Unit of each load and of the parameter.
    border : (7,)
    step, tangent : (7,)
        Output, scaled: the Newton step, and the solution of the linearised equations with
        border . tangent = 1.
    figures : (FIGURES,)
        Output: residual of the equations in use, defect of (4.11),
        sign and logarithm of the bordered determinant, largest turn of a mesh frame in the step.
    """
    code, residual = condense(
        slopes,
        loads,
        rod,
        rod_rate,
        h,
        a,
        b,
        frames,
        centres,
        sensitivity,
        stage_sensitivity,
        parts,
    )
    if code != 0:
        return NOT_FINITE
    n_intervals = slopes.shape[0]
    f = free.size
    rows = np.empty((f, 8))
    left_out = closing_rows(frames, centres, sensitivity, alpha, alpha_rate, f < 6, rows)
    matrix = np.zeros((f + 1, f + 1))
    rhs = np.zeros((f + 1, 2))
    level_now = border[6] * parameter / scale[6]
    for i in range(6):
        level_now += border[i] * loads[i] / scale[i]
    for i in range(f):
        missing = rows[i, 7]
        rhs[i, 0] = missing
        for j in range(f):
            matrix[i, j] = rows[i, free[j]] * scale[free[j]]
        matrix[i, f] = rows[i, 6] * scale[6]
        matrix[f, i] = border[free[i]]
    if f == 6:
        residual = max(residual, left_out)
    else:
        half = frames[n_intervals // 2]
        turned = math.cos(0.5 * alpha) * half[1, 0] - math.sin(0.5 * alpha) * half[1, 1]
        residual = max(residual, abs(turned), abs(half[1, 2]))
        place = centres[n_intervals // 2]
        residual = max(residual, abs(place[0]), abs(place[2]))
    matrix[f, f] = border[6]
    rhs[f, 0] = level - level_now
    rhs[f, 1] = 1.0
    figures[RESIDUAL] = max(residual, abs(level - level_now))
    figures[LEFT_OUT] = left_out
    figures[SIGN], figures[LOG_DET] = solve_bordered(matrix, rhs)
    for i in range(7):
        step[i] = 0.0
        tangent[i] = 0.0
    for i in range(f):
        step[free[i]] = rhs[i, 0]
        tangent[free[i]] = rhs[i, 1]
    step[6] = rhs[f, 0]
    tangent[6] = rhs[f, 1]
    largest = 0.0
    for i in range(1, n_intervals + 1):
        square = 0.0
        for r in range(3):
            total = sensitivity[i, r, COLUMNS - 1]
            for c in range(7):
                total += sensitivity[i, r, c] * step[c] * scale[c]
            square += total * total
        largest = max(largest, square)
        if not math.isfinite(square):
            return NOT_FINITE
    figures[TURN] = math.sqrt(largest)
    if not math.isfinite(figures[RESIDUAL]) or figures[SIGN] == 0.0:
        return NOT_FINITE
    return FINE


@njit(cache=True, nogil=True, error_model="numpy")
def move(
    slopes: Any,
    loads: Any,
    stage_sensitivity: Any,
    scale: Any,
    step: Any,
    fraction: float,
    newton: float,
) -> None:
    """Add ``fraction`` of a scaled step to slopes and loads, with the Newton column ``newton``."""
    for c in range(6):
        loads[c] += fraction * step[c] * scale[c]
    for i in range(slopes.shape[0]):
        for j in range(slopes.shape[1]):
            for r in range(3):
                total = newton * stage_sensitivity[i, j, r, COLUMNS - 1]
                for c in range(7):
                    total += stage_sensitivity[i, j, r, c] * step[c] * scale[c]
                slopes[i, j, r] += fraction * total


@njit(cache=True, nogil=True, error_model="numpy")
def turn_rate(sensitivity: Any, scale: Any, tangent: Any) -> float:
    """Largest rotation of a mesh frame per unit of scaled arclength, radians."""
    largest = 0.0
    for i in range(1, sensitivity.shape[0]):
        square = 0.0
        for r in range(3):
            total = 0.0
            for c in range(7):
                total += sensitivity[i, r, c] * tangent[c] * scale[c]
            square += total * total
        largest = max(largest, square)
    return math.sqrt(largest)


@njit(cache=True, nogil=True, error_model="numpy")
def conjugate_points(sensitivity: Any, to_the_end: bool) -> int:
    """Sign changes of det d(xi, r)(s)/d(m(0), n) along the mesh, see the ring solver.

    ``to_the_end`` includes the interval before s = 1, where a symmetry makes the determinant
    vanish. Returns -1 when a determinant is not finite.
    """
    n_points = sensitivity.shape[0]
    last = n_points if to_the_end else n_points - 1
    matrix = np.empty((6, 6))
    nothing = np.empty((6, 0))
    changes = 0
    before = 0.0
    for i in range(1, last):
        for r in range(6):
            for c in range(6):
                matrix[r, c] = sensitivity[i, r, c]
        sign, _ = solve_bordered(matrix, nothing)
        if sign == 0.0:
            return -1
        if before * sign < 0.0:
            changes += 1
        before = sign
    return changes
