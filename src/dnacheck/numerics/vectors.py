"""Algebra of 3-vectors and 3 x 3 matrices held in tuples, for compiled loops without allocation.

A matrix is given by its three rows. The compiler keeps such numbers in registers.
"""

from __future__ import annotations

from typing import Any

from numba import njit


@njit(cache=True, nogil=True, fastmath={"contract"})
def cross(a: Any, b: Any) -> Any:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@njit(cache=True, nogil=True, fastmath={"contract"})
def dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True, fastmath={"contract"})
def plus(a: Any, b: Any) -> Any:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@njit(cache=True, nogil=True, fastmath={"contract"})
def minus(a: Any, b: Any) -> Any:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit(cache=True, nogil=True, fastmath={"contract"})
def combine(c: Any, r0: Any, r1: Any, r2: Any) -> Any:
    """c0 r0 + c1 r1 + c2 r2 for row vectors."""
    return (
        c[0] * r0[0] + c[1] * r1[0] + c[2] * r2[0],
        c[0] * r0[1] + c[1] * r1[1] + c[2] * r2[1],
        c[0] * r0[2] + c[1] * r1[2] + c[2] * r2[2],
    )


@njit(cache=True, nogil=True, fastmath={"contract"})
def less_product(a: Any, e: Any, m: Any) -> Any:
    """a - e m for row vectors a, e and a matrix m."""
    return (
        a[0] - (e[0] * m[0][0] + e[1] * m[1][0] + e[2] * m[2][0]),
        a[1] - (e[0] * m[0][1] + e[1] * m[1][1] + e[2] * m[2][1]),
        a[2] - (e[0] * m[0][2] + e[1] * m[1][2] + e[2] * m[2][2]),
    )


@njit(cache=True, nogil=True, fastmath={"contract"})
def product(a: Any, b: Any) -> Any:
    """a b for two matrices."""
    return (
        combine(a[0], b[0], b[1], b[2]),
        combine(a[1], b[0], b[1], b[2]),
        combine(a[2], b[0], b[1], b[2]),
    )


@njit(cache=True, nogil=True, fastmath={"contract"})
def transposed_product(a: Any, b: Any) -> Any:
    """a^T b for two matrices."""
    return (
        combine((a[0][0], a[1][0], a[2][0]), b[0], b[1], b[2]),
        combine((a[0][1], a[1][1], a[2][1]), b[0], b[1], b[2]),
        combine((a[0][2], a[1][2], a[2][2]), b[0], b[1], b[2]),
    )


@njit(cache=True, nogil=True, fastmath={"contract"})
def sum_of(a: Any, b: Any) -> Any:
    """a + b for two matrices."""
    return plus(a[0], b[0]), plus(a[1], b[1]), plus(a[2], b[2])


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def symmetric_inverse(m: Any) -> Any:
    """Inverse of a symmetric matrix (its lower triangle counts), determinant, negative eigenvalues.

    The adjugate needs no pivot, so a tiny first element does no harm.
    """
    d00, d10, d11 = m[0][0], m[1][0], m[1][1]
    d20, d21, d22 = m[2][0], m[2][1], m[2][2]
    c0, c1, c2 = d11 * d22 - d21 * d21, d20 * d21 - d10 * d22, d10 * d21 - d11 * d20
    det = d00 * c0 + d10 * c1 + d20 * c2
    minor = d00 * d11 - d10 * d10
    negatives = 0
    if d00 < 0.0:
        negatives += 1
    if minor * d00 < 0.0:
        negatives += 1
    if det * minor < 0.0:
        negatives += 1
    f = 1.0 / det
    i0 = (f * c0, f * c1, f * c2)
    i1 = (i0[1], f * (d00 * d22 - d20 * d20), f * (d10 * d20 - d00 * d21))
    i2 = (i0[2], i1[2], f * minor)
    return (i0, i1, i2), det, negatives
