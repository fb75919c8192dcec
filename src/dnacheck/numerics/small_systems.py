"""Compiled solution of the 6 x 6 system that closure leaves, with its inertia."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def solve_small(small: Any, rhs: Any, length: float, out: Any) -> tuple[int, float]:
    """Solve the 6 x 6 Schur system and count its negative eigenvalues.

    Symmetric elimination with pivots of size one or two (Bunch & Parlett). ``length`` scales
    displacements so that the two kinds of rows compare. Returns the number of negative
    eigenvalues of G H^-1 G^T and the logarithm of its absolute determinant (unscaled); the number
    is -1 if the matrix is singular or not finite.
    """
    a = np.empty((6, 7))
    top = 0.0
    for i in range(6):
        si = 1.0 / length if i < 3 else 1.0
        for j in range(6):
            a[i, j] = small[i, j] * si * (1.0 / length if j < 3 else 1.0)
            if not math.isfinite(a[i, j]):
                return -1, 0.0
            top = max(top, abs(a[i, j]))
        a[i, 6] = rhs[i] * si
    order = np.arange(6)
    sizes = np.ones(6, dtype=np.int64)
    negatives = 0
    log_det = 6.0 * math.log(length)
    k = 0
    while k < 6:
        diagonal, off, d, oi, oj = -1.0, -1.0, k, k, k
        for i in range(k, 6):
            if abs(a[i, i]) > diagonal:
                diagonal, d = abs(a[i, i]), i
            for j in range(k, i):
                if abs(a[i, j]) > off:
                    off, oi, oj = abs(a[i, j]), i, j
        if max(diagonal, off) <= 1e-15 * top:
            return -1, 0.0
        # (1 + sqrt 17) / 8 bounds the growth of the elements.
        single = diagonal >= 0.6404 * off
        if single:
            _swap(a, order, k, d)
        else:
            _swap(a, order, k, oj)
            _swap(a, order, k + 1, oi)
        if single:
            pivot = a[k, k]
            negatives += 1 if pivot < 0.0 else 0
            log_det += math.log(abs(pivot))
            for i in range(k + 1, 6):
                f = a[i, k] / pivot
                for j in range(k + 1, 7):
                    a[i, j] -= f * a[k, j]
            k += 1
        else:
            sizes[k] = 2
            det = a[k, k] * a[k + 1, k + 1] - a[k + 1, k] * a[k, k + 1]
            if det < 0.0:
                negatives += 1
            elif a[k, k] < 0.0:
                negatives += 2
            log_det += math.log(abs(det))
            for i in range(k + 2, 6):
                f = (a[i, k] * a[k + 1, k + 1] - a[i, k + 1] * a[k + 1, k]) / det
                g = (a[i, k + 1] * a[k, k] - a[i, k] * a[k, k + 1]) / det
                for j in range(k + 2, 7):
                    a[i, j] -= f * a[k, j] + g * a[k + 1, j]
            k += 2
    x = np.empty(6)
    k = 5
    while k >= 0:
        if k > 0 and sizes[k - 1] == 2:
            r0, r1 = a[k - 1, 6], a[k, 6]
            for j in range(k + 1, 6):
                r0 -= a[k - 1, j] * x[j]
                r1 -= a[k, j] * x[j]
            det = a[k - 1, k - 1] * a[k, k] - a[k, k - 1] * a[k - 1, k]
            x[k - 1] = (r0 * a[k, k] - r1 * a[k - 1, k]) / det
            x[k] = (r1 * a[k - 1, k - 1] - r0 * a[k, k - 1]) / det
            k -= 2
        else:
            r0 = a[k, 6]
            for j in range(k + 1, 6):
                r0 -= a[k, j] * x[j]
            x[k] = r0 / a[k, k]
            k -= 1
    for i in range(6):
        out[order[i]] = x[i] * (1.0 / length if order[i] < 3 else 1.0)
    return negatives, log_det


@njit(cache=True, nogil=True, fastmath={"contract"})
def _swap(a: Any, order: Any, i: int, j: int) -> None:
    """Exchange rows and columns i and j of a symmetric system (6, 7) and of its order."""
    if i == j:
        return
    for c in range(7):
        a[i, c], a[j, c] = a[j, c], a[i, c]
    for r in range(6):
        a[r, i], a[r, j] = a[r, j], a[r, i]
    order[i], order[j] = order[j], order[i]
