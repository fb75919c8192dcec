"""Sines, cosines and arctangents of whole arrays, several times faster than one call each.

The loops have no branches, so the compiler turns them into vector instructions. Polynomials are
the minimax ones of fdlibm (sine, cosine on [-pi/4, pi/4]) and Cephes (arctangent on
[0, sqrt 2 - 1]); results are within two units in the last place of the libraries'.
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit

# Adding and taking away 1.5 * 2^52 rounds a double to the nearest integer.
_ROUND = 6755399441055744.0
# pi/2 in three parts; the product of the first (33 bits) with any k below 2^20 is exact.
_HALF_PI_1 = 1.57079632673412561417
_HALF_PI_2 = 6.07710050630396597660e-11
_HALF_PI_3 = 2.02226624879595063154e-21
_LARGEST_REDUCED = 1e6


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def sines_and_cosines(angles: Any, sines: Any, cosines: Any) -> None:
    """Fill ``sines`` and ``cosines`` (n,) of ``angles`` (n,) in radians; NaN where not finite."""
    largest = 0.0
    for i in range(angles.size):
        largest = max(largest, abs(angles[i]))
    if not largest < _LARGEST_REDUCED:
        for i in range(angles.size):
            sines[i] = math.sin(angles[i])
            cosines[i] = math.cos(angles[i])
        return
    for i in range(angles.size):
        x = angles[i]
        k = (x * (2.0 / math.pi) + _ROUND) - _ROUND
        r = ((x - k * _HALF_PI_1) - k * _HALF_PI_2) - k * _HALF_PI_3
        z = r * r
        p = -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10
        p = 2.75573137070700676789e-06 + z * p
        p = -1.98412698298579493134e-04 + z * p
        p = 8.33333333332248946124e-03 + z * p
        sine = r + r * z * (-1.66666666666666324348e-01 + z * p)
        p = 2.08757232129817482790e-09 - z * 1.13596475577881948265e-11
        p = -2.75573143513906633035e-07 + z * p
        p = 2.48015872894767294178e-05 + z * p
        p = -1.38888888888741095749e-03 + z * p
        cosine = 1.0 - 0.5 * z + z * z * (4.16666666666666019037e-02 + z * p)
        quadrant = k - 4.0 * ((0.25 * k + _ROUND) - _ROUND)
        odd = abs(quadrant) == 1.0
        opposite = abs(quadrant) == 2.0
        first = cosine if odd else sine
        second = sine if odd else cosine
        sines[i] = -first if opposite or quadrant == -1.0 else first
        cosines[i] = -second if opposite or quadrant == 1.0 else second


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def arctangents(y: Any, x: Any, out: Any) -> None:
    """Fill ``out`` (n,) with atan2(y, x) in (-pi, pi]; 0 where both are 0, NaN where not finite."""
    for i in range(x.size):
        a, b = abs(y[i]), abs(x[i])
        low, high = min(a, b), max(a, b)
        # atan q = pi/4 + atan((q - 1)/(q + 1)) keeps the argument below sqrt 2 - 1.
        far = low > (math.sqrt(2.0) - 1.0) * high
        above = low - high if far else low
        below = low + high if far else high
        q = above / (below if below > 0.0 else 1.0)
        z = q * q
        p = -8.750608600031904122785e-1 * z - 1.615753718733365076637e1
        p = p * z - 7.500855792314704667340e1
        p = p * z - 1.228866684490136173410e2
        p = p * z - 6.485021904942025371773e1
        d = z + 2.485846490142306297962e1
        d = d * z + 1.650270098316988542046e2
        d = d * z + 4.328810604912902668951e2
        d = d * z + 4.853903996359136964868e2
        d = d * z + 1.945506571482613964425e2
        t = q + q * z * p / d
        t = t + 0.25 * math.pi if far else t
        t = 0.5 * math.pi - t if a > b else t
        t = math.pi - t if x[i] < 0.0 else t
        out[i] = (-t if y[i] < 0.0 else t) + 0.0 * (a + b)
