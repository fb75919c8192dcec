"""Starting values: the perfect ring rolled about its own axis."""

from __future__ import annotations

import math
from typing import Any

from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def rolled_ring(
    alpha: float,
    roll: float,
    s: Any,
    h: Any,
    c: Any,
    bend: float,
    twist: float,
    slopes: Any,
    loads: Any,
) -> None:
    """Write the slopes and loads of the perfect ring (4.12), rolled by ``roll``.

    The directors are Rz(roll) Rx(2 pi s) Rz(alpha s) Rz(-roll): (4.12) seen from axes turned so
    that frame 0 is the laboratory frame. In laboratory axes u = 2 pi e + alpha d3 with e the
    ring's normal.

    Parameters
    ----------
    s : (K + 1,), h : (K,), c : (k,)
        Mesh, interval lengths, Gauss points on [0, 1].
    bend, twist : float
        K1 and K3.
    slopes : (K, k, 3), loads : (6,)
        Output.
    """
    k = c.size
    e0, e1 = math.cos(roll), math.sin(roll)
    for i in range(h.size):
        for j in range(k):
            ds = c[j] * h[i]
            start = 2.0 * math.pi * s[i]
            here = 2.0 * math.pi * (s[i] + ds)
            # relative rotation: about e by 2 pi ds, after a turn alpha ds about d3(s_i)
            d0, d1, d2 = math.sin(start) * e1, -math.sin(start) * e0, math.cos(start)
            ta = math.tan(0.5 * alpha * ds)
            tb = math.tan(math.pi * ds)
            a0, a1, a2 = ta * d0, ta * d1, ta * d2
            b0, b1 = tb * e0, tb * e1
            scale = 1.0 / (1.0 - (a0 * b0 + a1 * b1))
            g0 = scale * (a0 + b0 + b1 * a2)
            g1 = scale * (a1 + b1 - b0 * a2)
            g2 = scale * (a2 + b0 * a1 - b1 * a0)
            u0 = 2.0 * math.pi * e0 + alpha * math.sin(here) * e1
            u1 = 2.0 * math.pi * e1 - alpha * math.sin(here) * e0
            u2 = alpha * math.cos(here)
            dot = u0 * g0 + u1 * g1 + u2 * g2
            slopes[i, j, 0] = 0.5 * (u0 + u1 * g2 - u2 * g1 + dot * g0)
            slopes[i, j, 1] = 0.5 * (u1 + u2 * g0 - u0 * g2 + dot * g1)
            slopes[i, j, 2] = 0.5 * (u2 + u0 * g1 - u1 * g0 + dot * g2)
    loads[0] = 2.0 * math.pi * bend * e0
    loads[1] = 2.0 * math.pi * bend * e1
    loads[2] = twist * alpha
    loads[3] = 2.0 * math.pi * twist * alpha * e0
    loads[4] = 2.0 * math.pi * twist * alpha * e1
    loads[5] = 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def overlap(alpha: float, points: Any, weights: Any, strains: Any) -> tuple[float, float]:
    """Real and imaginary part of the integral of (w1hat + i w2hat) exp(i alpha s).

    First-order perturbation of the rolled perfect ring: its energy changes by
    -2 pi K1 Re[exp(-i roll) Z], so the roll arg(Z) is the register of least energy and the
    opposite one that of greatest.
    """
    real = 0.0
    imaginary = 0.0
    for i in range(points.size):
        c = math.cos(alpha * points[i])
        s = math.sin(alpha * points[i])
        real += weights[i] * (strains[i, 0] * c - strains[i, 1] * s)
        imaginary += weights[i] * (strains[i, 0] * s + strains[i, 1] * c)
    return real, imaginary
