"""Evaluation of the collocation polynomials, and transfer to another mesh."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.equilibria.continuum.kernels.condense import cayley


@njit(cache=True, nogil=True, error_model="numpy")
def mesh_quaternions(slopes: Any, h: Any, b: Any, out: Any) -> None:
    """Write the quaternions (K + 1, 4) at the mesh points, continuous from (0, 0, 0, 1)."""
    out[0, 0] = out[0, 1] = out[0, 2] = 0.0
    out[0, 3] = 1.0
    for i in range(h.size):
        g0 = g1 = g2 = 0.0
        for j in range(b.size):
            g0 += h[i] * b[j] * slopes[i, j, 0]
            g1 += h[i] * b[j] * slopes[i, j, 1]
            g2 += h[i] * b[j] * slopes[i, j, 2]
        apply_gibbs(g0, g1, g2, out[i], out[i + 1])


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def apply_gibbs(g0: float, g1: float, g2: float, q: Any, out: Any) -> None:
    """Write the quaternion of C(g) times that of ``q`` into ``out``."""
    f = 1.0 / math.sqrt(1.0 + g0 * g0 + g1 * g1 + g2 * g2)
    x, y, z, w = q[0], q[1], q[2], q[3]
    out[0] = f * (g0 * w + x + g1 * z - g2 * y)
    out[1] = f * (g1 * w + y + g2 * x - g0 * z)
    out[2] = f * (g2 * w + z + g0 * y - g1 * x)
    out[3] = f * (w - g0 * x - g1 * y - g2 * z)


@njit(cache=True, nogil=True, error_model="numpy")
def evaluate(
    s: Any,
    mesh: Any,
    slopes: Any,
    quaternions: Any,
    centres: Any,
    a: Any,
    to_powers: Any,
    q_out: Any,
    r_out: Any,
    u_out: Any,
) -> None:
    """Quaternion, position and laboratory strain rate u at the points ``s``.

    Parameters
    ----------
    s : (m,)
    mesh, slopes, quaternions, centres : (K + 1,), (K, k, 3), (K + 1, 4), (K + 1, 3)
    a, to_powers : (k, k)
        Gauss coefficients, and values at the Gauss points to powers.
    q_out, r_out, u_out : (m, 4), (m, 3), (m, 3)
    """
    n_intervals = mesh.size - 1
    k = slopes.shape[1]
    i = 0
    done = -1
    power = np.empty((k, 3))
    tangent_power = np.empty((k, 3))
    tangent = np.empty((k, 3))
    turn = np.empty((3, 3))
    g = np.empty(3)
    v = np.empty(3)
    for e in range(s.size):
        if s[e] < mesh[i]:
            i = 0
        while i < n_intervals - 1 and s[e] >= mesh[i + 1]:
            i += 1
        h = mesh[i + 1] - mesh[i]
        if i != done:
            done = i
            x, y, z, w = (
                quaternions[i, 0],
                quaternions[i, 1],
                quaternions[i, 2],
                quaternions[i, 3],
            )
            t0 = 2.0 * (x * z + y * w)
            t1 = 2.0 * (y * z - x * w)
            t2 = w * w + z * z - x * x - y * y
            for j in range(k):
                for c in range(3):
                    total = 0.0
                    for p in range(k):
                        total += a[j, p] * slopes[i, p, c]
                    g[c] = h * total
                cayley(g[0], g[1], g[2], turn)
                for c in range(3):
                    tangent[j, c] = turn[c, 0] * t0 + turn[c, 1] * t1 + turn[c, 2] * t2
            for p in range(k):
                for c in range(3):
                    power[p, c] = 0.0
                    tangent_power[p, c] = 0.0
                    for j in range(k):
                        power[p, c] += to_powers[p, j] * slopes[i, j, c]
                        tangent_power[p, c] += to_powers[p, j] * tangent[j, c]
        x = (s[e] - mesh[i]) / h
        for c in range(3):
            slope = 0.0
            value = 0.0
            along = 0.0
            for p in range(k - 1, -1, -1):
                slope = slope * x + power[p, c]
                value = value * x + power[p, c] / (p + 1)
                along = along * x + tangent_power[p, c] / (p + 1)
            v[c] = slope
            g[c] = h * x * value
            r_out[e, c] = centres[i, c] + h * x * along
        f = 2.0 / (1.0 + g[0] * g[0] + g[1] * g[1] + g[2] * g[2])
        u_out[e, 0] = f * (v[0] + g[1] * v[2] - g[2] * v[1])
        u_out[e, 1] = f * (v[1] + g[2] * v[0] - g[0] * v[2])
        u_out[e, 2] = f * (v[2] + g[0] * v[1] - g[1] * v[0])
        apply_gibbs(g[0], g[1], g[2], quaternions[i], q_out[e])


@njit(cache=True, nogil=True, error_model="numpy")
def slopes_on_mesh(
    mesh: Any, c: Any, q_mesh: Any, q_points: Any, u_points: Any, slopes: Any
) -> None:
    """Slopes of the local Gibbs vectors on a new mesh from quaternions and strain rates there.

    Parameters
    ----------
    mesh, c : (K + 1,), (k,)
    q_mesh : (K + 1, 4)
        Quaternions at the mesh points.
    q_points, u_points : (K k, 4), (K k, 3)
        Quaternions and laboratory strain rates at the collocation points.
    slopes : (K, k, 3)
        Output.
    """
    k = c.size
    for i in range(mesh.size - 1):
        x, y, z, w = q_mesh[i, 0], q_mesh[i, 1], q_mesh[i, 2], q_mesh[i, 3]
        for j in range(k):
            e = i * k + j
            a, b, d, f = q_points[e, 0], q_points[e, 1], q_points[e, 2], q_points[e, 3]
            scalar = f * w + a * x + b * y + d * z
            g0 = (a * w - f * x - b * z + d * y) / scalar
            g1 = (b * w - f * y - d * x + a * z) / scalar
            g2 = (d * w - f * z - a * y + b * x) / scalar
            u0, u1, u2 = u_points[e, 0], u_points[e, 1], u_points[e, 2]
            dot = u0 * g0 + u1 * g1 + u2 * g2
            slopes[i, j, 0] = 0.5 * (u0 + u1 * g2 - u2 * g1 + dot * g0)
            slopes[i, j, 1] = 0.5 * (u1 + u2 * g0 - u0 * g2 + dot * g1)
            slopes[i, j, 2] = 0.5 * (u2 + u0 * g1 - u1 * g0 + dot * g2)
