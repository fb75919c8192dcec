"""Compiled writhe of closed polygons."""

from __future__ import annotations

import math
from typing import Any

from numba import njit


@njit(cache=True, nogil=True)
def _normal(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> Any:
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-300:
        return 0.0, 0.0, 0.0
    return x / length, y / length, z / length


@njit(cache=True, nogil=True)
def _arc(a: Any, b: Any) -> float:
    product = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return math.asin(min(1.0, max(-1.0, product)))


@njit(cache=True, nogil=True)
def fill_writhe(centres: Any, out: Any) -> None:
    """Write the writhe of each closed polygon ``centres`` (n_frames, N, 3) into ``out``.

    Exact double sum of the Gauss integral over pairs of straight segments: Klenin and Langowski,
    Biopolymers 54, 307 (2000), method 1a.
    """
    n_frames, n = centres.shape[0], centres.shape[1]
    for f in range(n_frames):
        r = centres[f]
        total = 0.0
        for i in range(n - 2):
            i1 = i + 1
            for j in range(i + 2, n):
                j1 = j + 1 if j + 1 < n else 0
                if j1 == i:
                    continue
                ax, ay, az = r[j, 0] - r[i, 0], r[j, 1] - r[i, 1], r[j, 2] - r[i, 2]
                bx, by, bz = r[j1, 0] - r[i, 0], r[j1, 1] - r[i, 1], r[j1, 2] - r[i, 2]
                cx, cy, cz = r[j1, 0] - r[i1, 0], r[j1, 1] - r[i1, 1], r[j1, 2] - r[i1, 2]
                dx, dy, dz = r[j, 0] - r[i1, 0], r[j, 1] - r[i1, 1], r[j, 2] - r[i1, 2]
                ab = _normal(ax, ay, az, bx, by, bz)
                bc = _normal(bx, by, bz, cx, cy, cz)
                cd = _normal(cx, cy, cz, dx, dy, dz)
                da = _normal(dx, dy, dz, ax, ay, az)
                solid = _arc(ab, bc) + _arc(bc, cd) + _arc(cd, da) + _arc(da, ab)
                # (r_j1 - r_j) x (r_i1 - r_i) . (r_j - r_i) gives the sign of the crossing.
                ux, uy, uz = bx - ax, by - ay, bz - az
                vx, vy, vz = ax - dx, ay - dy, az - dz
                sign = (
                    (uy * vz - uz * vy) * ax + (uz * vx - ux * vz) * ay + (ux * vy - uy * vx) * az
                )
                if sign > 0.0:
                    total += solid
                elif sign < 0.0:
                    total -= solid
        out[f] = total / (2.0 * math.pi)
