"""Gauss collocation of the rod equations, condensed interval by interval.

Unknowns. Because n is constant and m(s) = m(0) - r(s) x n (the moment balance integrates once),
the unknowns besides the rotation are the six numbers p = (m(0), n) in laboratory axes. On
interval i the directors are R(s) = C(g(s)) R_i, where C is the Cayley map (tan(angle/2) times axis
-> rotation); g obeys

    g' = 1/2 (u + u x g + (u.g) g),    u = S m + w1hat d1 + w2hat d2,

with S the local compliance, which is (4.9) for q written in local coordinates. g is a polynomial
of degree k that satisfies this equation at the k Gauss points; r is the quadrature of d3. The stage
slopes V = g' are the only stored unknowns; mesh frames and positions are products and sums of
them, so |q| = 1 and r' = d3 hold to round-off whatever V is.

Linearisation. A change of the slopes changes the laboratory rotation vector xi_i and the position
of the next mesh point; both start at zero, so one sweep carries the 6 x 8 matrix W_i = d(xi_i,
r_i)/d(p, lambda, 1), the last column being the Newton correction at fixed p. Each interval costs
one dense solve with 3k unknowns, and what is left at the end are six closure equations.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

#: Columns of the sensitivities: m(0) (3), n (3), the active parameter, the Newton correction.
COLUMNS = 8

FINE = 0
NOT_FINITE = 1


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def cayley(g0: float, g1: float, g2: float, out: Any) -> float:
    """Write the rotation of the Gibbs vector g into ``out`` (3, 3); return 2 / (1 + g.g)."""
    f = 2.0 / (1.0 + g0 * g0 + g1 * g1 + g2 * g2)
    out[0, 0] = 1.0 - f * (g1 * g1 + g2 * g2)
    out[1, 1] = 1.0 - f * (g0 * g0 + g2 * g2)
    out[2, 2] = 1.0 - f * (g0 * g0 + g1 * g1)
    out[0, 1] = f * (g0 * g1 - g2)
    out[1, 0] = f * (g0 * g1 + g2)
    out[0, 2] = f * (g0 * g2 + g1)
    out[2, 0] = f * (g0 * g2 - g1)
    out[1, 2] = f * (g1 * g2 - g0)
    out[2, 1] = f * (g1 * g2 + g0)
    return f


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def multiply(a: Any, b: Any, out: Any) -> None:
    """Write the product of two (3, 3) matrices into ``out``."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@njit(cache=True, nogil=True, error_model="numpy")
def factor_in_place(a: Any, n: int, pivots: Any) -> bool:
    """LU factors of the leading n x n block with row pivoting; False if singular."""
    for c in range(n):
        best = c
        size = abs(a[c, c])
        for r in range(c + 1, n):
            if abs(a[r, c]) > size:
                size = abs(a[r, c])
                best = r
        pivots[c] = best
        if not size > 0.0 or not math.isfinite(size):
            return False
        if best != c:
            for j in range(n):
                a[c, j], a[best, j] = a[best, j], a[c, j]
        inverse = 1.0 / a[c, c]
        for r in range(c + 1, n):
            f = a[r, c] * inverse
            a[r, c] = f
            for j in range(c + 1, n):
                a[r, j] -= f * a[c, j]
        a[c, c] = inverse
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def solve_columns(a: Any, n: int, pivots: Any, x: Any) -> None:
    """Overwrite ``x`` (n, COLUMNS) with the solution, given the output of the factorisation."""
    for c in range(n):
        p = pivots[c]
        if p != c:
            for j in range(COLUMNS):
                x[c, j], x[p, j] = x[p, j], x[c, j]
    for r in range(1, n):
        for c in range(r):
            f = a[r, c]
            for j in range(COLUMNS):
                x[r, j] -= f * x[c, j]
    for r in range(n - 1, -1, -1):
        for c in range(r + 1, n):
            f = a[r, c]
            for j in range(COLUMNS):
                x[r, j] -= f * x[c, j]
        f = a[r, r]
        for j in range(COLUMNS):
            x[r, j] *= f


@njit(cache=True, nogil=True, error_model="numpy")
def condense(
    slopes: Any,
    loads: Any,
    rod: Any,
    rod_rate: Any,
    h: Any,
    a: Any,
    b: Any,
    frames: Any,
    centres: Any,
    sensitivity: Any,
    stage_sensitivity: Any,
    parts: Any,
) -> tuple[int, float]:
    """One sweep: mesh frames, residuals, sensitivities and energies.

    Parameters
    ----------
    slopes : (K, k, 3)
        g' at the Gauss points.
    loads : (6,)
        m(0) and n, laboratory axes.
    rod, rod_rate : (K, k, 4)
        w1hat, w2hat, bending compliance, twisting compliance at the Gauss points, and their
        derivatives with respect to the active parameter.
    h : (K,)
        Interval lengths.
    a, b : (k, k), (k,)
        Gauss coefficients and weights on [0, 1].
    frames : (K + 1, 3, 3), centres : (K + 1, 3)
        Output; entry 0 is the start, given.
    sensitivity : (K + 1, 6, COLUMNS)
        Output, d(xi_i, r_i); entry 0 must be zero.
    stage_sensitivity : (K, k, 3, COLUMNS)
        Output, changes of the slopes.
    parts : (K, 3)
        Output, each interval's bending energy, twisting energy and integral of u3, by Gauss
        quadrature.

    Returns
    -------
    code : int
        0, or 1 when a number was not finite or an interval's matrix singular.
    residual : float
        Largest |g' - f| over all stages, relative to 1 + the largest |f|.
    """
    n_intervals = slopes.shape[0]
    k = slopes.shape[1]
    n = 3 * k
    g = np.empty((k, 3))
    turn = np.empty((k, 3, 3))  # C(g)
    axes = np.empty((k, 3, 3))  # directors
    tangent_map = np.empty((k, 3, 3))  # T: g rate -> laboratory rate
    inverse_map = np.empty((k, 3, 3))
    position = np.empty((k, 3))
    d3_by_g = np.empty((k, 3, 3))
    d3_by_xi = np.empty((k, 3, 3))
    by_g = np.empty((k, 3, 3))
    by_xi = np.empty((k, 3, 3))
    by_moment = np.empty((k, 3, 3))
    by_position = np.empty((k, 3, 3))
    s_matrix = np.empty((3, 3))
    work = np.empty((3, 3))
    work2 = np.empty((3, 3))
    matrix = np.empty((n, n))
    pivots = np.empty(n, dtype=np.int64)
    rhs = np.empty((n, COLUMNS))
    d3_xi = np.empty((k, 3, COLUMNS))
    dr = np.empty((3, COLUMNS))
    dg = np.empty((3, COLUMNS))
    n0, n1, n2 = loads[3], loads[4], loads[5]
    residual = 0.0
    largest = 0.0
    for i in range(n_intervals):
        hi = h[i]
        parts[i, 0] = parts[i, 1] = parts[i, 2] = 0.0
        for j in range(k):
            for c in range(3):
                total = 0.0
                for p in range(k):
                    total += a[j, p] * slopes[i, p, c]
                g[j, c] = hi * total
            g0, g1, g2 = g[j, 0], g[j, 1], g[j, 2]
            f = cayley(g0, g1, g2, turn[j])
            multiply(turn[j], frames[i], axes[j])
            tm = tangent_map[j]
            tm[0, 0] = tm[1, 1] = tm[2, 2] = f
            tm[0, 1] = -f * g2
            tm[1, 0] = f * g2
            tm[0, 2] = f * g1
            tm[2, 0] = -f * g1
            tm[1, 2] = -f * g0
            tm[2, 1] = f * g0
            im = inverse_map[j]
            im[0, 0] = 0.5 * (1.0 + g0 * g0)
            im[1, 1] = 0.5 * (1.0 + g1 * g1)
            im[2, 2] = 0.5 * (1.0 + g2 * g2)
            im[0, 1] = 0.5 * (g2 + g0 * g1)
            im[1, 0] = 0.5 * (-g2 + g0 * g1)
            im[0, 2] = 0.5 * (-g1 + g0 * g2)
            im[2, 0] = 0.5 * (g1 + g0 * g2)
            im[1, 2] = 0.5 * (g0 + g1 * g2)
            im[2, 1] = 0.5 * (-g0 + g1 * g2)
            t0, t1, t2 = axes[j, 0, 2], axes[j, 1, 2], axes[j, 2, 2]
            for c in range(3):
                d3_by_g[j, 0, c] = t2 * tm[1, c] - t1 * tm[2, c]
                d3_by_g[j, 1, c] = t0 * tm[2, c] - t2 * tm[0, c]
                d3_by_g[j, 2, c] = t1 * tm[0, c] - t0 * tm[1, c]
                d3_by_xi[j, 0, c] = t2 * turn[j, 1, c] - t1 * turn[j, 2, c]
                d3_by_xi[j, 1, c] = t0 * turn[j, 2, c] - t2 * turn[j, 0, c]
                d3_by_xi[j, 2, c] = t1 * turn[j, 0, c] - t0 * turn[j, 1, c]
            for r in range(3):
                for c in range(COLUMNS):
                    d3_xi[j, r, c] = (
                        d3_by_xi[j, r, 0] * sensitivity[i, 0, c]
                        + d3_by_xi[j, r, 1] * sensitivity[i, 1, c]
                        + d3_by_xi[j, r, 2] * sensitivity[i, 2, c]
                    )
        for j in range(k):
            for c in range(3):
                total = 0.0
                for p in range(k):
                    total += a[j, p] * axes[p, c, 2]
                position[j, c] = centres[i, c] + hi * total
            x0, x1, x2 = position[j, 0], position[j, 1], position[j, 2]
            m0 = loads[0] - (x1 * n2 - x2 * n1)
            m1 = loads[1] - (x2 * n0 - x0 * n2)
            m2 = loads[2] - (x0 * n1 - x1 * n0)
            w1, w2, ca, cb = rod[i, j, 0], rod[i, j, 1], rod[i, j, 2], rod[i, j, 3]
            cd = cb - ca
            t0, t1, t2 = axes[j, 0, 2], axes[j, 1, 2], axes[j, 2, 2]
            mt = m0 * t0 + m1 * t1 + m2 * t2
            square = m0 * m0 + m1 * m1 + m2 * m2
            parts[i, 0] += 0.5 * hi * b[j] * ca * (square - mt * mt)
            parts[i, 1] += 0.5 * hi * b[j] * cb * mt * mt
            parts[i, 2] += hi * b[j] * cb * mt
            v0 = w1 * axes[j, 0, 0] + w2 * axes[j, 0, 1]
            v1 = w1 * axes[j, 1, 0] + w2 * axes[j, 1, 1]
            v2 = w1 * axes[j, 2, 0] + w2 * axes[j, 2, 1]
            u0 = ca * m0 + cd * mt * t0 + v0
            u1 = ca * m1 + cd * mt * t1 + v1
            u2 = ca * m2 + cd * mt * t2 + v2
            # u changes by s_matrix . xi when the directors turn by xi
            k0 = t1 * m2 - t2 * m1
            k1 = t2 * m0 - t0 * m2
            k2 = t0 * m1 - t1 * m0
            e = cd * mt
            s_matrix[0, 0] = cd * t0 * k0
            s_matrix[0, 1] = cd * t0 * k1 + e * t2 + v2
            s_matrix[0, 2] = cd * t0 * k2 - e * t1 - v1
            s_matrix[1, 0] = cd * t1 * k0 - e * t2 - v2
            s_matrix[1, 1] = cd * t1 * k1
            s_matrix[1, 2] = cd * t1 * k2 + e * t0 + v0
            s_matrix[2, 0] = cd * t2 * k0 + e * t1 + v1
            s_matrix[2, 1] = cd * t2 * k1 - e * t0 - v0
            s_matrix[2, 2] = cd * t2 * k2
            im = inverse_map[j]
            multiply(im, s_matrix, work)
            multiply(work, tangent_map[j], by_g[j])
            multiply(work, turn[j], by_xi[j])
            g0, g1, g2 = g[j, 0], g[j, 1], g[j, 2]
            ug = 0.5 * (u0 * g0 + u1 * g1 + u2 * g2)
            bg = by_g[j]
            bg[0, 0] += ug + 0.5 * g0 * u0
            bg[0, 1] += 0.5 * (g0 * u1 - u2)
            bg[0, 2] += 0.5 * (g0 * u2 + u1)
            bg[1, 0] += 0.5 * (g1 * u0 + u2)
            bg[1, 1] += ug + 0.5 * g1 * u1
            bg[1, 2] += 0.5 * (g1 * u2 - u0)
            bg[2, 0] += 0.5 * (g2 * u0 - u1)
            bg[2, 1] += 0.5 * (g2 * u1 + u0)
            bg[2, 2] += ug + 0.5 * g2 * u2
            # inverse_map . (ca I + cd d3 d3^T)
            bm = by_moment[j]
            for r in range(3):
                along = cd * (im[r, 0] * t0 + im[r, 1] * t1 + im[r, 2] * t2)
                bm[r, 0] = ca * im[r, 0] + along * t0
                bm[r, 1] = ca * im[r, 1] + along * t1
                bm[r, 2] = ca * im[r, 2] + along * t2
                # dm = n x dr
                by_position[j, r, 0] = bm[r, 1] * n2 - bm[r, 2] * n1
                by_position[j, r, 1] = bm[r, 2] * n0 - bm[r, 0] * n2
                by_position[j, r, 2] = bm[r, 0] * n1 - bm[r, 1] * n0
            q1, q2, qa, qb = (
                rod_rate[i, j, 0],
                rod_rate[i, j, 1],
                rod_rate[i, j, 2],
                rod_rate[i, j, 3],
            )
            qd = (qb - qa) * mt
            l0 = qa * m0 + qd * t0 + q1 * axes[j, 0, 0] + q2 * axes[j, 0, 1]
            l1 = qa * m1 + qd * t1 + q1 * axes[j, 1, 0] + q2 * axes[j, 1, 1]
            l2 = qa * m2 + qd * t2 + q1 * axes[j, 2, 0] + q2 * axes[j, 2, 1]
            for r in range(3):
                for c in range(COLUMNS):
                    total = 0.0
                    for p in range(k):
                        total += a[j, p] * d3_xi[p, r, c]
                    dr[r, c] = sensitivity[i, 3 + r, c] + hi * total
            for r in range(3):
                row = 3 * j + r
                for c in range(COLUMNS):
                    rhs[row, c] = (
                        by_xi[j, r, 0] * sensitivity[i, 0, c]
                        + by_xi[j, r, 1] * sensitivity[i, 1, c]
                        + by_xi[j, r, 2] * sensitivity[i, 2, c]
                        + by_position[j, r, 0] * dr[0, c]
                        + by_position[j, r, 1] * dr[1, c]
                        + by_position[j, r, 2] * dr[2, c]
                    )
                rhs[row, 0] += bm[r, 0]
                rhs[row, 1] += bm[r, 1]
                rhs[row, 2] += bm[r, 2]
                # dm = -x cross dn
                rhs[row, 3] += bm[r, 2] * x1 - bm[r, 1] * x2
                rhs[row, 4] += bm[r, 0] * x2 - bm[r, 2] * x0
                rhs[row, 5] += bm[r, 1] * x0 - bm[r, 0] * x1
                rhs[row, 6] += im[r, 0] * l0 + im[r, 1] * l1 + im[r, 2] * l2
                f = im[r, 0] * u0 + im[r, 1] * u1 + im[r, 2] * u2
                defect = slopes[i, j, r] - f
                rhs[row, 7] -= defect
                residual = max(residual, abs(defect))
                largest = max(largest, abs(f))
        for j in range(k):
            for p in range(k):
                for r in range(3):
                    for c in range(3):
                        work2[r, c] = 0.0
                for q in range(k):
                    weight = a[j, q] * a[q, p]
                    for r in range(3):
                        for c in range(3):
                            work2[r, c] += weight * d3_by_g[q, r, c]
                first = hi * a[j, p]
                second = hi * hi
                for r in range(3):
                    for c in range(3):
                        matrix[3 * j + r, 3 * p + c] = -first * by_g[j, r, c] - second * (
                            by_position[j, r, 0] * work2[0, c]
                            + by_position[j, r, 1] * work2[1, c]
                            + by_position[j, r, 2] * work2[2, c]
                        )
            for r in range(3):
                matrix[3 * j + r, 3 * j + r] += 1.0
        if not factor_in_place(matrix, n, pivots):
            return NOT_FINITE, residual
        solve_columns(matrix, n, pivots, rhs)
        for j in range(k):
            for r in range(3):
                for c in range(COLUMNS):
                    stage_sensitivity[i, j, r, c] = rhs[3 * j + r, c]
        # step to the next mesh point
        for r in range(3):
            for c in range(COLUMNS):
                total = 0.0
                for p in range(k):
                    total += b[p] * d3_xi[p, r, c]
                dr[r, c] = sensitivity[i, 3 + r, c] + hi * total
        for q in range(k):
            for r in range(3):
                for c in range(COLUMNS):
                    total = 0.0
                    for p in range(k):
                        total += a[q, p] * rhs[3 * p + r, c]
                    dg[r, c] = hi * hi * b[q] * total
            for r in range(3):
                for c in range(COLUMNS):
                    dr[r, c] += (
                        d3_by_g[q, r, 0] * dg[0, c]
                        + d3_by_g[q, r, 1] * dg[1, c]
                        + d3_by_g[q, r, 2] * dg[2, c]
                    )
        g0 = 0.0
        g1 = 0.0
        g2 = 0.0
        for p in range(k):
            g0 += hi * b[p] * slopes[i, p, 0]
            g1 += hi * b[p] * slopes[i, p, 1]
            g2 += hi * b[p] * slopes[i, p, 2]
        for r in range(3):
            for c in range(COLUMNS):
                total = 0.0
                for p in range(k):
                    total += b[p] * rhs[3 * p + r, c]
                dg[r, c] = hi * total
        f = cayley(g0, g1, g2, work)
        multiply(work, frames[i], frames[i + 1])
        work2[0, 0] = work2[1, 1] = work2[2, 2] = f
        work2[0, 1] = -f * g2
        work2[1, 0] = f * g2
        work2[0, 2] = f * g1
        work2[2, 0] = -f * g1
        work2[1, 2] = -f * g0
        work2[2, 1] = f * g0
        for r in range(3):
            for c in range(COLUMNS):
                sensitivity[i + 1, r, c] = (
                    work2[r, 0] * dg[0, c]
                    + work2[r, 1] * dg[1, c]
                    + work2[r, 2] * dg[2, c]
                    + work[r, 0] * sensitivity[i, 0, c]
                    + work[r, 1] * sensitivity[i, 1, c]
                    + work[r, 2] * sensitivity[i, 2, c]
                )
                sensitivity[i + 1, 3 + r, c] = dr[r, c]
            total = 0.0
            for p in range(k):
                total += b[p] * axes[p, r, 2]
            centres[i + 1, r] = centres[i, r] + hi * total
        if not math.isfinite(residual + centres[i + 1, 0] + sensitivity[i + 1, 0, 7]):
            return NOT_FINITE, residual
    return FINE, residual / (1.0 + largest)
