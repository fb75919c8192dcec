"""Compiled linear-time factorisation of the Hessian of the Lagrangian of a closed chain.

Between an earlier angle j and a later one k the Hessian is a_j . e_k (see
:mod:`dnacheck.equilibria.discrete.kernels.closure`), plus the stiffness within a step. Its block L
D L^T is one sweep with a 3 x 3 matrix P: with the axes a and couplings e of a step in the rows of A
and E, U = A - E P, D = diagonal block - E P E^T, P += U^T D^-1 U. The columns of the closure
Jacobian (rotation A, displacement B) and the right-hand side are eliminated along; as the rotation
columns are A itself, P ends as their Schur complement. The signs of the pivots and of the 6 x 6
Schur complement of closure give the inertia, their logarithms the log-determinant.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.model.chain_kernels import WEDGE, is_bound
from dnacheck.numerics.vectors import combine, cross, dot, less_product, plus

FACTOR_WIDTH = 36
"""Numbers kept per step: E (9), Z = D^-1 U (9), eliminated displacement columns W (9), eliminated
right-hand side (3) and the lower triangle of D^-1 (6)."""

# Positions in a step's factors.
_Z, _W, _G, _D = 9, 18, 27, 30


@njit(cache=True, nogil=True, fastmath={"contract"})
def _couple(a: Any, b: Any, force: Any, half: Any, held: float) -> Any:
    """e = b x force + a x moment/2 + held a."""
    c, d = cross(b, force), cross(a, half)
    return c[0] + d[0] + held * a[0], c[1] + d[1] + held * a[1], c[2] + d[2] + held * a[2]


@njit(cache=True, nogil=True, fastmath={"contract"})
def _vector(a: Any, i: int, j: int) -> Any:
    return a[i, j, 0], a[i, j, 1], a[i, j, 2]


@njit(cache=True, nogil=True)
def _store(rows: Any, s: int, at: int, v: Any) -> None:
    rows[s, at], rows[s, at + 1], rows[s, at + 2] = v[0], v[1], v[2]


@njit(cache=True, nogil=True, fastmath={"contract"})
def coupling(axis: Any, x: float, y: float, z: float, m: Any, out: Any) -> None:
    """e = (a x d) x force + a x moment / 2 for an axis a (3,) and d = r_N - p."""
    a0, a1, a2 = axis[0], axis[1], axis[2]
    b0 = a1 * z - a2 * y
    b1 = a2 * x - a0 * z
    b2 = a0 * y - a1 * x
    out[0] = b1 * m[2] - b2 * m[1] + 0.5 * (a1 * m[5] - a2 * m[4])
    out[1] = b2 * m[0] - b0 * m[2] + 0.5 * (a2 * m[3] - a0 * m[5])
    out[2] = b0 * m[1] - b1 * m[0] + 0.5 * (a0 * m[4] - a1 * m[3])


@njit(cache=True, nogil=True, fastmath={"contract"})
def midstep_block(halves: Any, x: float, y: float, z: float, m: Any, block: Any) -> None:
    """Second derivatives of closure within one mid-step, lower triangle of ``block`` (3, 3)."""
    e = np.empty((5, 3))
    for k in range(5):
        coupling(halves[k], x, y, z, m, e[k])
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
    stiffness : (N, 3, 3); steps that a guest holds have no pivots.
    factors : (N, FACTOR_WIDTH), filled.
    small : (6, 7), filled: G H^-1 G^T and, in the last column, G H^-1 gradient.

    Returns
    -------
    negatives : number of negative pivots of H.
    log_pivots : sum of log |pivot block determinant|.
    weakest : smallest relative pivot determinant, a measure of the sweep's stability.
    """
    n = axes.shape[0]
    force = (multipliers[0], multipliers[1], multipliers[2])
    half = (0.5 * multipliers[3], 0.5 * multipliers[4], 0.5 * multipliers[5])
    end = (centres[n, 0], centres[n, 1], centres[n, 2])
    zero = (0.0, 0.0, 0.0)
    # Running sums over steps: U^T D^-1 U, U^T D^-1 W, U^T D^-1 g, W^T D^-1 W, W^T D^-1 g.
    p0, p1, p2 = zero, zero, zero
    q0, q1, q2 = zero, zero, zero
    r = zero
    t0, t1, t2 = zero, zero, zero
    v = zero
    block = np.empty((3, 3))
    negatives = 0
    log_pivots = 0.0
    product = 1.0
    weakest = 1e300
    for s in range(n):
        if is_bound(stiffness, s):
            for k in range(FACTOR_WIDTH):
                factors[s, k] = 0.0
            continue
        held = shift * (n - s) / n
        d = (end[0] - centres[s + 1, 0], end[1] - centres[s + 1, 1], end[2] - centres[s + 1, 2])
        a0, a1, a2 = _vector(axes, s, 0), _vector(axes, s, 1), _vector(axes, s, 2)
        b0, b1, b2 = cross(a0, d), cross(a1, d), cross(a2, d)
        e0 = _couple(a0, b0, force, half, held)
        e1 = _couple(a1, b1, force, half, held)
        e2 = _couple(a2, b2, force, half, held)
        p, q = (p0, p1, p2), (q0, q1, q2)
        u0, u1, u2 = less_product(a0, e0, p), less_product(a1, e1, p), less_product(a2, e2, p)
        w0, w1, w2 = less_product(b0, e0, q), less_product(b1, e1, q), less_product(b2, e2, q)
        g = (
            gradient[s, 0] - dot(e0, r),
            gradient[s, 1] - dot(e1, r),
            gradient[s, 2] - dot(e2, r),
        )
        # The block within a step is a_j . e_k for j <= k, so that with -e_j P e_k it is u_j . e_k.
        d00, d10, d11 = dot(u0, e0), dot(u0, e1), dot(u1, e1)
        d20, d21, d22 = dot(u0, e2), dot(u1, e2), dot(u2, e2)
        if form != WEDGE:
            midstep_block(halves[s], d[0], d[1], d[2], multipliers, block)
            d00 += block[0, 0] + held * dot(a0, a0) - dot(a0, e0)
            d10 += block[1, 0] + held * dot(a0, a1) - dot(a0, e1)
            d11 += block[1, 1] + held * dot(a1, a1) - dot(a1, e1)
            d20 += block[2, 0] + held * dot(a0, a2) - dot(a0, e2)
            d21 += block[2, 1] + held * dot(a1, a2) - dot(a1, e2)
            d22 += block[2, 2] + held * dot(a2, a2) - dot(a2, e2)
        d00 += stiffness[s, 0, 0]
        d10 += stiffness[s, 1, 0]
        d11 += stiffness[s, 1, 1]
        d20 += stiffness[s, 2, 0]
        d21 += stiffness[s, 2, 1]
        d22 += stiffness[s, 2, 2]
        c0, c1, c2 = d11 * d22 - d21 * d21, d20 * d21 - d10 * d22, d10 * d21 - d11 * d20
        det = d00 * c0 + d10 * c1 + d20 * c2
        minor = d00 * d11 - d10 * d10
        if d00 < 0.0:
            negatives += 1
        if minor * d00 < 0.0:
            negatives += 1
        if det * minor < 0.0:
            negatives += 1
        size = stiffness[s, 0, 0] * stiffness[s, 1, 1] * stiffness[s, 2, 2]
        if not abs(det) >= weakest * size:
            weakest = abs(det) / size
        product *= abs(det)
        if not 1e-150 < product < 1e150:
            log_pivots += math.log(product + 1e-300)
            product = 1.0
        f = 1.0 / det
        i0 = (f * c0, f * c1, f * c2)
        i1 = (i0[1], f * (d00 * d22 - d20 * d20), f * (d10 * d20 - d00 * d21))
        i2 = (i0[2], i1[2], f * minor)
        z0, z1, z2 = combine(i0, u0, u1, u2), combine(i1, u0, u1, u2), combine(i2, u0, u1, u2)
        p0 = plus(p0, combine((u0[0], u1[0], u2[0]), z0, z1, z2))
        p1 = plus(p1, combine((u0[1], u1[1], u2[1]), z0, z1, z2))
        p2 = plus(p2, combine((u0[2], u1[2], u2[2]), z0, z1, z2))
        q0 = plus(q0, combine((z0[0], z1[0], z2[0]), w0, w1, w2))
        q1 = plus(q1, combine((z0[1], z1[1], z2[1]), w0, w1, w2))
        q2 = plus(q2, combine((z0[2], z1[2], z2[2]), w0, w1, w2))
        r = plus(r, combine(g, z0, z1, z2))
        y0, y1, y2 = combine(i0, w0, w1, w2), combine(i1, w0, w1, w2), combine(i2, w0, w1, w2)
        t0 = plus(t0, combine((w0[0], w1[0], w2[0]), y0, y1, y2))
        t1 = plus(t1, combine((w0[1], w1[1], w2[1]), y0, y1, y2))
        t2 = plus(t2, combine((w0[2], w1[2], w2[2]), y0, y1, y2))
        v = plus(v, combine(g, y0, y1, y2))
        _store(factors, s, 0, e0)
        _store(factors, s, 3, e1)
        _store(factors, s, 6, e2)
        _store(factors, s, _Z, z0)
        _store(factors, s, _Z + 3, z1)
        _store(factors, s, _Z + 6, z2)
        _store(factors, s, _W, w0)
        _store(factors, s, _W + 3, w1)
        _store(factors, s, _W + 6, w2)
        _store(factors, s, _G, g)
        _store(factors, s, _D, (i0[0], i1[0], i1[1]))
        _store(factors, s, _D + 3, i2)
    _store(small, 0, 0, t0)
    _store(small, 1, 0, (t0[1], t1[1], t1[2]))
    _store(small, 2, 0, (t0[2], t1[2], t2[2]))
    _store(small, 3, 0, q0)
    _store(small, 4, 0, q1)
    _store(small, 5, 0, q2)
    _store(small, 3, 3, p0)
    _store(small, 4, 3, (p0[1], p1[1], p1[2]))
    _store(small, 5, 3, (p0[2], p1[2], p2[2]))
    for i in range(3):
        small[i, 6], small[3 + i, 6] = v[i], r[i]
        for j in range(3):
            small[i, 3 + j] = small[3 + j, i]
    return negatives, log_pivots + math.log(product), weakest


@njit(cache=True, nogil=True, fastmath={"contract"})
def _row(factors: Any, s: int, at: int) -> Any:
    return factors[s, at], factors[s, at + 1], factors[s, at + 2]


@njit(cache=True, nogil=True, fastmath={"contract"})
def _divide_by_pivot(factors: Any, s: int, x: Any) -> Any:
    """D^-1 x of one step."""
    i00, i10, i11 = _row(factors, s, _D)
    i20, i21, i22 = _row(factors, s, _D + 3)
    return dot((i00, i10, i20), x), dot((i10, i11, i21), x), dot((i20, i21, i22), x)


@njit(cache=True, nogil=True, fastmath={"contract"})
def back_substitute(factors: Any, new_multipliers: Any, weight: float, step: Any) -> None:
    """Step (N, 3) = -H^-1 (weight gradient + G^T new multipliers) from :func:`factorise`."""
    m = (new_multipliers[0], new_multipliers[1], new_multipliers[2])
    t = (new_multipliers[3], new_multipliers[4], new_multipliers[5])
    n = factors.shape[0]
    for back in range(n):
        s = n - 1 - back
        g = _row(factors, s, _G)
        x = (
            weight * g[0] + dot(_row(factors, s, _W), m),
            weight * g[1] + dot(_row(factors, s, _W + 3), m),
            weight * g[2] + dot(_row(factors, s, _W + 6), m),
        )
        x = _divide_by_pivot(factors, s, x)
        y = (
            -x[0] - dot(_row(factors, s, _Z), t),
            -x[1] - dot(_row(factors, s, _Z + 3), t),
            -x[2] - dot(_row(factors, s, _Z + 6), t),
        )
        _store(step, s, 0, y)
        et = combine(y, _row(factors, s, 0), _row(factors, s, 3), _row(factors, s, 6))
        t = plus(t, et)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def eliminate(factors: Any, rhs: Any, small: Any) -> None:
    """Replace the right-hand side (N, 3) that :func:`factorise` eliminated along the chain."""
    r = (0.0, 0.0, 0.0)
    v = (0.0, 0.0, 0.0)
    for s in range(factors.shape[0]):
        g = (
            rhs[s, 0] - dot(_row(factors, s, 0), r),
            rhs[s, 1] - dot(_row(factors, s, 3), r),
            rhs[s, 2] - dot(_row(factors, s, 6), r),
        )
        _store(factors, s, _G, g)
        y = _divide_by_pivot(factors, s, g)
        z0, z1, z2 = _row(factors, s, _Z), _row(factors, s, _Z + 3), _row(factors, s, _Z + 6)
        w0, w1, w2 = _row(factors, s, _W), _row(factors, s, _W + 3), _row(factors, s, _W + 6)
        r = plus(r, combine(g, z0, z1, z2))
        v = plus(v, combine(y, w0, w1, w2))
    for i in range(3):
        small[i, 6], small[3 + i, 6] = v[i], r[i]
