"""Writhe of a closed polygon."""

from __future__ import annotations

import math
from typing import Any

from numba import njit


@njit(cache=True, nogil=True)
def polygon_writhe(points: Any) -> float:
    """Writhe of the closed polygon through ``points`` (n, 3), exact for the polygon.

    Sum over pairs of edges of the signed solid angle of the directions in which they cross
    (method 1a of Klenin & Langowski, Biopolymers 54, 307 (2000)), each angle from atan2.
    """
    n = points.shape[0]
    total = 0.0
    for i in range(2, n):
        a0, a1, a2 = points[i, 0], points[i, 1], points[i, 2]
        ip = (i + 1) % n
        b0, b1, b2 = points[ip, 0], points[ip, 1], points[ip, 2]
        for j in range(i - 1):
            if ip == j:
                continue
            c0, c1, c2 = points[j, 0], points[j, 1], points[j, 2]
            d0, d1, d2 = points[j + 1, 0], points[j + 1, 1], points[j + 1, 2]
            # corners of the spherical quadrilateral: directions between the edges' ends
            p0, p1, p2 = a0 - c0, a1 - c1, a2 - c2
            q0, q1, q2 = a0 - d0, a1 - d1, a2 - d2
            r0, r1, r2 = b0 - d0, b1 - d1, b2 - d2
            s0, s1, s2 = b0 - c0, b1 - c1, b2 - c2
            total += _triangle(p0, p1, p2, q0, q1, q2, r0, r1, r2)
            total += _triangle(p0, p1, p2, r0, r1, r2, s0, s1, s2)
    return total / (2.0 * math.pi)


@njit(cache=True, nogil=True, inline="always")
def _triangle(
    a0: float,
    a1: float,
    a2: float,
    b0: float,
    b1: float,
    b2: float,
    c0: float,
    c1: float,
    c2: float,
) -> float:
    """Signed solid angle of three vectors (Van Oosterom & Strackee)."""
    la = math.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
    lb = math.sqrt(b0 * b0 + b1 * b1 + b2 * b2)
    lc = math.sqrt(c0 * c0 + c1 * c1 + c2 * c2)
    volume = a0 * (b1 * c2 - b2 * c1) + a1 * (b2 * c0 - b0 * c2) + a2 * (b0 * c1 - b1 * c0)
    ab = a0 * b0 + a1 * b1 + a2 * b2
    bc = b0 * c0 + b1 * c1 + b2 * c2
    ca = c0 * a0 + c1 * a1 + c2 * a2
    base = la * lb * lc + ab * lc + bc * la + ca * lb
    if volume == 0.0 and base == 0.0:
        return 0.0
    return 2.0 * math.atan2(volume, base)
