"""Compiled twist, writhe and link of closed polygons with a framing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

# Fuller's formula divides by 1 + cos(angle to the reference tangent); nearer to opposite than
# this the exact double sum decides instead.
_OPPOSITE = 0.15
_ROUNDING = 0.2


@njit(cache=True, nogil=True)
def total_twist(frames: Any) -> float:
    """Twist in turns of frames (N+1, 3, 3) against parallel transport of d3 along the edges.

    With the polygon's own writhe it adds up to an integer exactly, for any step size.
    """
    twist = 0.0
    for s in range(frames.shape[0] - 1):
        a = 0.0
        b = 0.0
        for i in range(3):
            a += frames[s, i, 1] * frames[s + 1, i, 0] - frames[s, i, 0] * frames[s + 1, i, 1]
            b += frames[s, i, 0] * frames[s + 1, i, 0] + frames[s, i, 1] * frames[s + 1, i, 1]
        twist += math.atan2(a, b)
    return twist / (2.0 * math.pi)


@njit(cache=True, nogil=True, error_model="numpy")
def _plane_of_ring(centres: Any, frames: Any, e: Any) -> bool:
    """Orthonormal vectors ``e`` (2, 3) spanning the plane of the area vector; False if it is 0."""
    n = frames.shape[0] - 1
    middle = np.zeros(3)
    for s in range(n):
        for i in range(3):
            middle[i] += centres[s, i] / n
    normal = np.zeros(3)
    for s in range(n):
        x, y, z = centres[s, 0] - middle[0], centres[s, 1] - middle[1], centres[s, 2] - middle[2]
        normal[0] += y * frames[s, 2, 2] - z * frames[s, 1, 2]
        normal[1] += z * frames[s, 0, 2] - x * frames[s, 2, 2]
        normal[2] += x * frames[s, 1, 2] - y * frames[s, 0, 2]
    size = math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    if not size > 1e-9 * n:
        return False
    smallest = 0
    for i in range(3):
        normal[i] /= size
        if abs(normal[i]) < abs(normal[smallest]):
            smallest = i
    for i in range(3):
        e[0, i] = (1.0 if i == smallest else 0.0) - normal[smallest] * normal[i]
    size = math.sqrt(e[0, 0] ** 2 + e[0, 1] ** 2 + e[0, 2] ** 2)
    for i in range(3):
        e[0, i] /= size
    e[1, 0] = normal[1] * e[0, 2] - normal[2] * e[0, 1]
    e[1, 1] = normal[2] * e[0, 0] - normal[0] * e[0, 2]
    e[1, 2] = normal[0] * e[0, 1] - normal[1] * e[0, 0]
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def fuller_writhe(centres: Any, frames: Any) -> tuple[float, float]:
    """Writhe against a planar circle by Fuller's second formula, in linear time.

    Fuller, Proc. Natl. Acad. Sci. USA 75, 3557 (1978). The second value is the smallest
    1 + cos(angle between tangent and reference); the formula holds only while it stays positive.
    """
    n = frames.shape[0] - 1
    e = np.empty((2, 3))
    if not _plane_of_ring(centres, frames, e):
        return 0.0, 0.0
    real, imaginary = 0.0, 0.0
    for s in range(n):
        u, v = 0.0, 0.0
        for i in range(3):
            u += frames[s, i, 2] * e[0, i]
            v += frames[s, i, 2] * e[1, i]
        c, sn = math.cos(2.0 * math.pi * s / n), math.sin(2.0 * math.pi * s / n)
        real += u * c + v * sn
        imaginary += v * c - u * sn
    phase = math.atan2(imaginary, real)
    area = 0.0
    weakest = 2.0
    t = np.empty((2, 3))
    o = np.empty((2, 3))
    m = np.empty(3)
    r = np.empty(3)
    d = np.empty(3)
    for s in range(n + 1):
        a = phase + 2.0 * math.pi * s / n
        c, sn = math.cos(a), math.sin(a)
        new, old = s % 2, (s + 1) % 2
        cosine = 1.0
        for i in range(3):
            t[new, i] = frames[s % n, i, 2]
            o[new, i] = c * e[0, i] + sn * e[1, i]
            cosine += t[new, i] * o[new, i]
        weakest = min(weakest, cosine)
        if s > 0:
            dot = 0.0
            for i in range(3):
                m[i] = 0.5 * (t[0, i] + t[1, i])
                r[i] = 0.5 * (o[0, i] + o[1, i])
                d[i] = t[new, i] - t[old, i] + o[new, i] - o[old, i]
                dot += m[i] * r[i]
            triple = (
                (r[1] * m[2] - r[2] * m[1]) * d[0]
                + (r[2] * m[0] - r[0] * m[2]) * d[1]
                + (r[0] * m[1] - r[1] * m[0]) * d[2]
            )
            area += triple / (1.0 + dot)
    return area / (2.0 * math.pi), weakest


@njit(cache=True, nogil=True, error_model="numpy")
def _solid_angle(a: Any, b: Any, c: Any) -> float:
    """Signed solid angle of the triangle of directions a, b, c (Van Oosterom & Strackee 1983)."""
    la = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    lb = math.sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2])
    lc = math.sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2])
    ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    bc = b[0] * c[0] + b[1] * c[1] + b[2] * c[2]
    ca = c[0] * a[0] + c[1] * a[1] + c[2] * a[2]
    volume = (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )
    return 2.0 * math.atan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)


@njit(cache=True, nogil=True, error_model="numpy")
def polygon_writhe(points: Any) -> float:
    """Exact writhe of a closed polygon (N, 3): signed solid angles summed over pairs of edges.

    Klenin & Langowski, Biopolymers 54, 307 (2000), method 1. Quadratic in N.
    """
    n = points.shape[0]
    total = 0.0
    a = np.empty(3)
    b = np.empty(3)
    c = np.empty(3)
    d = np.empty(3)
    for i in range(n - 2):
        for j in range(i + 2, n):
            if i == 0 and j == n - 1:
                continue
            i2, j2 = i + 1, (j + 1) % n
            for x in range(3):
                a[x] = points[j, x] - points[i, x]
                b[x] = points[j2, x] - points[i, x]
                c[x] = points[j2, x] - points[i2, x]
                d[x] = points[j, x] - points[i2, x]
            total -= _solid_angle(a, b, c) + _solid_angle(a, c, d)
    return total / (2.0 * math.pi)


@njit(cache=True, nogil=True, error_model="numpy")
def edge_frames(centres: Any, frames: Any, out: Any) -> None:
    """Frames along the edges of a closed polygon, d1 as near as may be to the given one.

    ``out`` (N+1, 3, 3) has d3 along the edge from centre i to centre i+1 and d1 of frame i turned
    into the plane across it. With them the twist about the polygon and its link are defined also
    where the centres do not lie along d3, as long as d1 never points along the curve.
    """
    n = frames.shape[0] - 1
    d1 = np.empty(3)
    t = np.empty(3)
    for s in range(n):
        size, along = 0.0, 0.0
        for i in range(3):
            t[i] = centres[s + 1, i] - centres[s, i]
            size += t[i] * t[i]
        for i in range(3):
            t[i] /= math.sqrt(size)
            along += t[i] * frames[s, i, 0]
        size = 0.0
        for i in range(3):
            d1[i] = frames[s, i, 0] - along * t[i]
            size += d1[i] * d1[i]
        for i in range(3):
            d1[i] /= math.sqrt(size)
            out[s, i, 0], out[s, i, 2] = d1[i], t[i]
        out[s, 0, 1] = t[1] * d1[2] - t[2] * d1[1]
        out[s, 1, 1] = t[2] * d1[0] - t[0] * d1[2]
        out[s, 2, 1] = t[0] * d1[1] - t[1] * d1[0]
    for i in range(3):
        out[n, i] = out[0, i]


@njit(cache=True, nogil=True)
def link_of_ring(centres: Any, frames: Any) -> tuple[int, float, float]:
    """Link (integer), twist and writhe in turns of a closed ring.

    Twist is exact for the polygon of centres; the writhe is link minus twist, exact once the
    integer is known. Fuller's linear-time formula finds the integer; where it comes near its
    singularity or its rounding is unclear, the quadratic sum decides.
    """
    twist = total_twist(frames)
    writhe, weakest = fuller_writhe(centres, frames)
    estimate = twist + writhe
    nearest = math.floor(estimate + 0.5)
    if weakest < _OPPOSITE or abs(estimate - nearest) > _ROUNDING:
        estimate = twist + polygon_writhe(centres[: frames.shape[0] - 1])
        nearest = math.floor(estimate + 0.5)
    return int(nearest), twist, nearest - twist
