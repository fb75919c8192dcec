"""Compiled linear-time factorisation of the Hessian of the Lagrangian of a closed chain.

Between an earlier angle j and a later one k the Hessian is a_j . e_k (see
:mod:`dnacheck.ring.closure_kernels`), plus the stiffness within a step. Its block L D L^T is one
sweep with a 3 x 3 matrix P: per step D = diagonal block - E P E^T, Z = D^-1 (A - E P),
P += (A - E P)^T Z, and L between steps is E Z^T, where the rows of A and E are the axes a and the
couplings e of the step. The signs of the pivots and of the 6 x 6 Schur complement of closure give
the inertia, their logarithms the log-determinant.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.model.chain_kernels import WEDGE

FACTOR_WIDTH = 48
"""Numbers kept per step: e, z, inverse pivot, eliminated displacement and rotation columns (9
each) and the eliminated right-hand side (3)."""


@njit(cache=True, nogil=True, fastmath={"contract"})
def _coupling(axis: Any, x: float, y: float, z: float, m: Any, out: Any) -> None:
    """e = (a x d) x force + a x moment / 2 for an axis a (3,) and d = r_N - p."""
    a0, a1, a2 = axis[0], axis[1], axis[2]
    b0 = a1 * z - a2 * y
    b1 = a2 * x - a0 * z
    b2 = a0 * y - a1 * x
    out[0] = b1 * m[2] - b2 * m[1] + 0.5 * (a1 * m[5] - a2 * m[4])
    out[1] = b2 * m[0] - b0 * m[2] + 0.5 * (a2 * m[3] - a0 * m[5])
    out[2] = b0 * m[1] - b1 * m[0] + 0.5 * (a0 * m[4] - a1 * m[3])


@njit(cache=True, nogil=True, fastmath={"contract"})
def _midstep_block(halves: Any, x: float, y: float, z: float, m: Any, block: Any) -> None:
    """Second derivatives of closure within one mid-step, lower triangle of ``block`` (3, 3)."""
    e = np.empty((5, 3))
    for k in range(5):
        _coupling(halves[k], x, y, z, m, e[k])
    for i in range(3):
        for j in range(3):
            block[i, j] = 0.0
    for k in range(5):
        outer = min(k, 4 - k)
        weight_k = 1.0 if k == 2 else 0.5
        for j in range(5):
            inner = min(j, 4 - j)
            weight = weight_k * (1.0 if j == 2 else 0.5)
            lo, hi = (j, k) if j <= k else (k, j)
            h = halves[lo, 0] * e[hi, 0] + halves[lo, 1] * e[hi, 1] + halves[lo, 2] * e[hi, 2]
            block[outer, inner] += weight * h


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def factorise(
    gradient: Any,
    stiffness: Any,
    shift: float,
    form: int,
    centres: Any,
    axes: Any,
    halves: Any,
    multipliers: Any,
    factors: Any,
    small: Any,
) -> tuple[int, float, float]:
    """Block factorisation of the Lagrangian's Hessian and its 6 x 6 Schur complement.

    Parameters
    ----------
    gradient : (N, 3), energy gradient, the right-hand side that is eliminated along.
    shift : weight of the mean square frame rotation (1/N) sum |rotation of frame k|^2 / 2 that is
        added to the Lagrangian (0 for the true Hessian). Between angles of steps s <= t it adds
        shift (N - t)/N a_s . a_t, which has the same semi-separable form, so it is free; it
        holds back rolling and reorientation, which the elastic energy hardly resists.
    factors : (N, 48), filled: e (9), z (9), inverse pivot (9), then the eliminated columns of
        displacement (9), rotation (9) and gradient (3) of each step.
    small : (6, 7), filled: G H^-1 G^T and, in the last column, G H^-1 gradient.

    Returns
    -------
    negatives : number of negative pivots of H.
    log_pivots : sum of log |pivot block determinant|.
    weakest : smallest relative pivot determinant, a measure of the sweep's stability.
    """
    n = axes.shape[0]
    m = multipliers
    p = np.zeros((3, 3))
    sb = np.zeros((3, 3))
    sg = np.zeros(3)
    e = np.empty((3, 3))
    u = np.empty((3, 3))
    w = np.empty((3, 3))
    wg = np.empty(3)
    z = np.empty((3, 3))
    d = np.empty((3, 3))
    inv = np.empty((3, 3))
    ep = np.empty((3, 3))
    negatives = 0
    log_pivots = 0.0
    weakest = 1e300
    for i in range(6):
        for j in range(7):
            small[i, j] = 0.0
    rx, ry, rz = centres[n, 0], centres[n, 1], centres[n, 2]
    for s in range(n):
        x, y, zz = rx - centres[s + 1, 0], ry - centres[s + 1, 1], rz - centres[s + 1, 2]
        held = shift * (n - s) / n
        for k in range(3):
            a0, a1, a2 = axes[s, k, 0], axes[s, k, 1], axes[s, k, 2]
            b0 = a1 * zz - a2 * y
            b1 = a2 * x - a0 * zz
            b2 = a0 * y - a1 * x
            e0 = b1 * m[2] - b2 * m[1] + 0.5 * (a1 * m[5] - a2 * m[4]) + held * a0
            e1 = b2 * m[0] - b0 * m[2] + 0.5 * (a2 * m[3] - a0 * m[5]) + held * a1
            e2 = b0 * m[1] - b1 * m[0] + 0.5 * (a0 * m[4] - a1 * m[3]) + held * a2
            e[k, 0], e[k, 1], e[k, 2] = e0, e1, e2
            for j in range(3):
                ep[k, j] = e0 * p[0, j] + e1 * p[1, j] + e2 * p[2, j]
            u[k, 0], u[k, 1], u[k, 2] = a0 - ep[k, 0], a1 - ep[k, 1], a2 - ep[k, 2]
            w[k, 0] = b0 - (e0 * sb[0, 0] + e1 * sb[1, 0] + e2 * sb[2, 0])
            w[k, 1] = b1 - (e0 * sb[0, 1] + e1 * sb[1, 1] + e2 * sb[2, 1])
            w[k, 2] = b2 - (e0 * sb[0, 2] + e1 * sb[1, 2] + e2 * sb[2, 2])
            wg[k] = gradient[s, k] - (e0 * sg[0] + e1 * sg[1] + e2 * sg[2])
        if form != WEDGE:
            _midstep_block(halves[s], x, y, zz, m, d)
        for k in range(3):
            for j in range(k + 1):
                if form == WEDGE:
                    ae = axes[s, j, 0] * e[k, 0] + axes[s, j, 1] * e[k, 1]
                    d[k, j] = ae + axes[s, j, 2] * e[k, 2]
                else:
                    aa = axes[s, j, 0] * axes[s, k, 0] + axes[s, j, 1] * axes[s, k, 1]
                    d[k, j] += held * (aa + axes[s, j, 2] * axes[s, k, 2])
                d[k, j] += stiffness[s, k, j] - (
                    ep[k, 0] * e[j, 0] + ep[k, 1] * e[j, 1] + ep[k, 2] * e[j, 2]
                )
        c00 = d[1, 1] * d[2, 2] - d[2, 1] * d[2, 1]
        c01 = d[2, 0] * d[2, 1] - d[1, 0] * d[2, 2]
        c02 = d[1, 0] * d[2, 1] - d[1, 1] * d[2, 0]
        det = d[0, 0] * c00 + d[1, 0] * c01 + d[2, 0] * c02
        minor = d[0, 0] * d[1, 1] - d[1, 0] * d[1, 0]
        if d[0, 0] < 0.0:
            negatives += 1
        if minor * d[0, 0] < 0.0:
            negatives += 1
        if det * minor < 0.0:
            negatives += 1
        size = stiffness[s, 0, 0] * stiffness[s, 1, 1] * stiffness[s, 2, 2]
        weakest = min(weakest, abs(det) / size)
        log_pivots += math.log(abs(det) + 1e-300)
        f = 1.0 / det
        inv[0, 0] = f * c00
        inv[0, 1] = inv[1, 0] = f * c01
        inv[0, 2] = inv[2, 0] = f * c02
        inv[1, 1] = f * (d[0, 0] * d[2, 2] - d[2, 0] * d[2, 0])
        inv[1, 2] = inv[2, 1] = f * (d[1, 0] * d[2, 0] - d[0, 0] * d[2, 1])
        inv[2, 2] = f * minor
        for k in range(3):
            for j in range(3):
                z[k, j] = inv[k, 0] * u[0, j] + inv[k, 1] * u[1, j] + inv[k, 2] * u[2, j]
        # Schur complement: rotation columns reuse z = inverse pivot times u.
        for i in range(3):
            wi0 = inv[0, 0] * w[0, i] + inv[0, 1] * w[1, i] + inv[0, 2] * w[2, i]
            wi1 = inv[1, 0] * w[0, i] + inv[1, 1] * w[1, i] + inv[1, 2] * w[2, i]
            wi2 = inv[2, 0] * w[0, i] + inv[2, 1] * w[1, i] + inv[2, 2] * w[2, i]
            for j in range(i + 1):
                small[i, j] += wi0 * w[0, j] + wi1 * w[1, j] + wi2 * w[2, j]
                small[3 + i, 3 + j] += z[0, i] * u[0, j] + z[1, i] * u[1, j] + z[2, i] * u[2, j]
            for j in range(3):
                small[3 + j, i] += wi0 * u[0, j] + wi1 * u[1, j] + wi2 * u[2, j]
            small[i, 6] += wi0 * wg[0] + wi1 * wg[1] + wi2 * wg[2]
            small[3 + i, 6] += z[0, i] * wg[0] + z[1, i] * wg[1] + z[2, i] * wg[2]
        for i in range(3):
            for j in range(3):
                sb[i, j] += z[0, i] * w[0, j] + z[1, i] * w[1, j] + z[2, i] * w[2, j]
            for j in range(i + 1):
                p[i, j] += u[0, i] * z[0, j] + u[1, i] * z[1, j] + u[2, i] * z[2, j]
                p[j, i] = p[i, j]
            sg[i] += z[0, i] * wg[0] + z[1, i] * wg[1] + z[2, i] * wg[2]
        row = factors[s]
        for k in range(3):
            for j in range(3):
                row[3 * k + j] = e[k, j]
                row[9 + 3 * k + j] = z[k, j]
                row[18 + 3 * k + j] = inv[k, j]
                row[27 + 3 * k + j] = w[k, j]
                row[36 + 3 * k + j] = u[k, j]
            row[45 + k] = wg[k]
    for i in range(6):
        for j in range(i):
            small[j, i] = small[i, j]
    return negatives, log_pivots, weakest


@njit(cache=True, nogil=True, fastmath={"contract"})
def back_substitute(factors: Any, new_multipliers: Any, weight: float, step: Any) -> None:
    """Step (N, 3) = -H^-1 (weight gradient + G^T new multipliers) from :func:`factorise`."""
    n = factors.shape[0]
    t0, t1, t2 = 0.0, 0.0, 0.0
    m = new_multipliers
    w = np.empty(3)
    for back in range(n):
        s = n - 1 - back
        row = factors[s]
        for k in range(3):
            w[k] = -(
                weight * row[45 + k]
                + row[27 + 3 * k] * m[0]
                + row[28 + 3 * k] * m[1]
                + row[29 + 3 * k] * m[2]
                + row[36 + 3 * k] * m[3]
                + row[37 + 3 * k] * m[4]
                + row[38 + 3 * k] * m[5]
            )
        for k in range(3):
            step[s, k] = (
                row[18 + 3 * k] * w[0]
                + row[19 + 3 * k] * w[1]
                + row[20 + 3 * k] * w[2]
                - row[9 + 3 * k] * t0
                - row[10 + 3 * k] * t1
                - row[11 + 3 * k] * t2
            )
        for k in range(3):
            t0 += row[3 * k] * step[s, k]
            t1 += row[3 * k + 1] * step[s, k]
            t2 += row[3 * k + 2] * step[s, k]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def eliminate(factors: Any, rhs: Any, small: Any) -> None:
    """Replace the right-hand side (N, 3) that :func:`factorise` eliminated along the chain."""
    s0, s1, s2 = 0.0, 0.0, 0.0
    for i in range(6):
        small[i, 6] = 0.0
    for s in range(factors.shape[0]):
        row = factors[s]
        for k in range(3):
            row[45 + k] = rhs[s, k] - (
                row[3 * k] * s0 + row[3 * k + 1] * s1 + row[3 * k + 2] * s2
            )
        for k in range(3):
            s0 += row[9 + 3 * k] * row[45 + k]
            s1 += row[10 + 3 * k] * row[45 + k]
            s2 += row[11 + 3 * k] * row[45 + k]
            scaled = (
                row[18 + 3 * k] * row[45]
                + row[19 + 3 * k] * row[46]
                + row[20 + 3 * k] * row[47]
            )
            for i in range(3):
                small[i, 6] += row[27 + 3 * k + i] * scaled
    small[3, 6], small[4, 6], small[5, 6] = s0, s1, s2


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
