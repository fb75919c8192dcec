"""Compiled closure projection of a linearised draw, along six fixed directions.

A draw x on the null space of the slice's seven rows is moved to q* + x + Y y, where Y = K^-1 G^T
(G K^-1 G^T)^-1 without its register column: Y keeps the register row and Newton's iteration in
the six numbers y meets closure exactly. The plane of those y may cross the closed shapes several
times; :func:`follow` keeps to the crossing that is reached from y = 0 along the ray t x, 0 <= t <=
1.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from dnacheck.equilibria.boundary_kernels import Boundary
from dnacheck.equilibria.discrete.kernels.states import evaluate, jacobian, new_state

CLOSED = 1e-9
"""Closure residual, displacement over contour length and radians, at which a shape is closed;
its effect on the energy is below 1e-6 RT."""
SAME_SOLUTION = 1e-5
"""Relative difference of y below which two solutions are one."""
_RAY_STEPS = 60
_SMALLEST_RAY_STEP = 1e-3


class Shape(NamedTuple):
    """A shape and the Jacobian of its closure; every projection overwrites it.

    Attributes
    ----------
    state : HingeState or RigidState
        With the boundary that holds its end.
    jacobian : ndarray, shape (6, cN)
    """

    state: Any
    jacobian: Any


@njit(cache=True, nogil=True)
def empty_shape(steps: Any, boundary: Boundary) -> Shape:
    """Room for a shape of a chain of ``steps``, placed for a boundary."""
    return Shape(new_state(steps, boundary), np.empty((6, steps.ground.size)))


@njit(cache=True, nogil=True, error_model="numpy")
def solve_six(matrix: Any, rhs: Any, out: Any) -> float:
    """Solve a 6 x 6 system by elimination with row exchanges; returns the determinant."""
    a = np.empty((6, 7))
    det = 1.0
    for i in range(6):
        for j in range(6):
            a[i, j] = matrix[i, j]
        a[i, 6] = rhs[i]
    for k in range(6):
        p = k
        for i in range(k + 1, 6):
            if abs(a[i, k]) > abs(a[p, k]):
                p = i
        if p != k:
            det = -det
            for j in range(k, 7):
                a[k, j], a[p, j] = a[p, j], a[k, j]
        det *= a[k, k]
        for i in range(k + 1, 6):
            f = a[i, k] / a[k, k]
            for j in range(k + 1, 7):
                a[i, j] -= f * a[k, j]
    for back in range(6):
        k = 5 - back
        total = a[k, 6]
        for j in range(k + 1, 6):
            total -= a[k, j] * out[j]
        out[k] = total / a[k, k]
    return det


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _transverse(rows: Any, directions: Any, out: Any) -> None:
    """G Y (6, 6) from G (6, cN) and Y stored as (6, cN)."""
    n = rows.shape[1]
    for i in range(6):
        g = rows[i]
        for j in range(6):
            y = directions[j]
            total = 0.0
            for k in range(n):
                total += g[k] * y[k]
            out[i, j] = total


@njit(cache=True, nogil=True, fastmath={"contract"})
def _displace(centre: Any, draw: Any, t: float, directions: Any, y: Any, out: Any) -> None:
    """out = centre + t draw + Y y, all flat (cN,)."""
    y0, y1, y2, y3, y4, y5 = y[0], y[1], y[2], y[3], y[4], y[5]
    for k in range(centre.shape[0]):
        a = (
            centre[k]
            + t * draw[k]
            + directions[0, k] * y0
            + directions[1, k] * y1
            + directions[2, k] * y2
        )
        out[k] = a + directions[3, k] * y3 + directions[4, k] * y4 + directions[5, k] * y5


@njit(cache=True, nogil=True, error_model="numpy")
def newton_projection(
    steps: Any,
    centre: Any,
    draw: Any,
    t: float,
    directions: Any,
    damped: bool,
    most: int,
    y: Any,
    shape: Any,
) -> tuple[int, float]:
    """Newton's iteration in y (6,), in place, from its given value.

    Undamped it gives up as soon as det G Y turns non-positive or the residual doubles, so that it
    stays on the branch it starts on; ``damped`` it halves steps and may end on any crossing.

    Returns
    -------
    code : iterations used, -1 if it did not converge.
    det : det G Y at the shape found, relative to its value 1 at the centre.
    """
    state = shape.state
    n = state.angles.shape[0]
    closure, fixed = state.closure, state.boundary.fixed
    matrix = np.empty((6, 6))
    step = np.empty(6)
    last = np.empty(6)
    flat = state.angles.reshape(state.angles.size)
    size_before = math.inf
    fraction = 1.0
    det = 0.0
    for iteration in range(most):
        _displace(centre, draw, t, directions, y, flat)
        evaluate(state, steps)
        size = 0.0
        for i in range(6):
            size += (closure[i] / (n if i < 3 else 1.0)) ** 2
        if not math.isfinite(size):
            return -1, 0.0
        if damped and size > CLOSED * CLOSED and size >= size_before * (1.0 - 0.2 * fraction):
            fraction *= 0.5
            if fraction < 1e-3:
                return -1, 0.0
            for i in range(6):
                y[i] = last[i] - fraction * step[i]
            continue
        if not damped and not size < 4.0 * size_before:
            return -1, 0.0
        jacobian(state, shape.jacobian)
        _transverse(shape.jacobian, directions, matrix)
        for i in range(6):
            if not fixed[i]:
                for j in range(6):
                    matrix[i, j] = 1.0 if i == j else 0.0
        det = solve_six(matrix, closure, step)
        if not damped and not det > 0.0:
            return -1, 0.0
        if size <= CLOSED * CLOSED:
            return iteration, det
        size_before = size
        fraction = 1.0
        for i in range(6):
            last[i] = y[i]
            y[i] -= step[i]
    return -1, 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def follow(
    steps: Any, centre: Any, draw: Any, directions: Any, y: Any, shape: Any
) -> tuple[bool, float]:
    """The crossing on the branch through the centre, by Newton or, failing that, along the ray.

    ``y`` (6,) and ``shape`` receive it. Returns whether it was reached and det G Y
    there. Where the branch folds (det G Y = 0) before t = 1, there is no crossing on it.
    """
    reached = 0.0
    before = 0.0
    stride = 1.0
    here = np.zeros(6)
    back = np.zeros(6)
    for _ in range(_RAY_STEPS):
        t = min(1.0, reached + stride)
        for i in range(6):
            y[i] = 0.0
            if reached > 0.0:
                y[i] = here[i] + (here[i] - back[i]) * (t - reached) / (reached - before)
        code, det = newton_projection(steps, centre, draw, t, directions, False, 8, y, shape)
        if code >= 0:
            if t >= 1.0:
                return True, det
            for i in range(6):
                back[i] = here[i]
                here[i] = y[i]
            before = reached
            reached = t
            if code <= 4:
                stride *= 1.5
        else:
            stride *= 0.4
            if stride < _SMALLEST_RAY_STEP:
                break
    return False, 0.0


@njit(cache=True, nogil=True)
def same_solution(y: Any, other: Any) -> bool:
    """Whether two corrections (6,) are one solution."""
    worst, size = 0.0, 1.0
    for i in range(6):
        worst = max(worst, abs(y[i] - other[i]))
        size = max(size, abs(other[i]))
    return worst < SAME_SOLUTION * size
