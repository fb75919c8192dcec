"""Compiled Gaussian of the shapes near a closed ring of given register, in linear time.

A slice holds seven linear functions of the coordinates, c to a step (three angles or six
parameters), at first order: the six of closure (rows b and a of
:mod:`dnacheck.equilibria.discrete.kernels.closure`) and the register row v. Its rows are G (7, cN);
those of components that a boundary leaves free constrain nothing and stay as generators. The
Hessian H of the Lagrangian is indefinite, but M = H + G^T R G is positive for a large enough
positive 7 x 7 matrix R and agrees with H on the null space of G. Between coordinates j < k of
different steps

    M_jk = a_j . e_k + g_j . R g_k,   g = (b, a, v),

again semi-separable, of rank seven, with left generators g and right generators R g + (0, e, 0).
Its block L D L^T is the sweep of :mod:`dnacheck.equilibria.discrete.kernels.factorisation` with a 7
x 7 matrix P. A draw x = L^-T D^-1/2 xi followed by the projection x - B G x, B = M^-1 G^T (G M^-1
G^T)^-1, is distributed as N(0, Z (Z^T H Z)^-1 Z^T), Z an orthonormal basis of the null space of G:
the Gaussian of Laplace's approximation, whatever R. Energies are in RT, lengths in steps.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from dnacheck.equilibria.discrete.kernels.factorisation import coupling, midstep_block
from dnacheck.equilibria.discrete.kernels.rigid_factorisation import step_block
from dnacheck.equilibria.discrete.kernels.states import HingeState, RigidState, by_kind
from dnacheck.model.chain_kernels import WEDGE, HingeSteps, is_bound
from dnacheck.model.rigid_kernels import RigidSteps

ROWS = 7
"""Constraint rows of a slice: displacement (3), rotation (3), register (1)."""
WIDTH = 8
"""Columns handled together: the seven rows and one right-hand side."""
RIGID = 6
"""Coordinates of a rigid step."""


class SliceFactors(NamedTuple):
    """The Gaussian about one register-constrained minimum, as draws need it.

    Attributes
    ----------
    rows : ndarray, shape (7, cN)
        G.
    right, z : ndarray, shape (N, c, 7)
        Generators and D^-1 (g - right P), see :data:`factorise_slice`.
    root : ndarray, shape (N, c (c + 1) / 2)
        Inverse Cholesky factors of D, packed by rows as (00, 10, 11, 20, 21, 22, ...).
    projector : ndarray, shape (7, cN)
        B = M^-1 G^T (G M^-1 G^T)^-1.
    schur : ndarray, shape (7, 7)
        (G M^-1 G^T)^-1.
    directions : ndarray, shape (6, cN)
        Y of :mod:`dnacheck.cyclization.closure.kernels.projection`; G Y = 1 on the rows of closure
        and 0 on that of the register.
    """

    rows: Any
    right: Any
    z: Any
    root: Any
    projector: Any
    schur: Any
    directions: Any


@njit(cache=True, nogil=True)
def invert_small(matrix: Any, out: Any) -> float:
    """Inverse of a symmetric positive matrix (m, m) and the logarithm of its determinant.

    Returns NaN if the matrix is not positive.
    """
    m = matrix.shape[0]
    c = np.zeros((m, m))
    log_det = 0.0
    for i in range(m):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= c[i, k] * c[j, k]
            if i == j:
                if not total > 0.0:
                    return math.nan
                c[i, i] = math.sqrt(total)
                log_det += math.log(total)
            else:
                c[i, j] = total / c[j, j]
    inv = np.zeros((m, m))
    for col in range(m):
        for i in range(col, m):
            total = 1.0 if i == col else 0.0
            for k in range(col, i):
                total -= c[i, k] * inv[k, col]
            inv[i, col] = total / c[i, i]
    for i in range(m):
        for j in range(m):
            total = 0.0
            for k in range(max(i, j), m):
                total += inv[k, i] * inv[k, j]
            out[i, j] = total
    return log_det


@njit(cache=True, nogil=True)
def drop_free(fixed: Any, matrix: Any, free: float) -> None:
    """Rows and columns of a system of the seven rows become empty for components that are free.

    ``free`` takes the diagonal: 1 leaves determinant and inverse of the rest as they are, 0 leaves
    nothing of the component. ``fixed`` (6,) is that of a boundary.
    """
    for i in range(6):
        if not fixed[i]:
            for j in range(matrix.shape[1]):
                matrix[i, j] = 0.0
            for j in range(ROWS):
                matrix[j, i] = 0.0
            matrix[i, i] = free


@njit(cache=True, nogil=True)
def _hinge_rows(state: HingeState, register: Any, rows: Any) -> None:
    centres, axes = state.centres, state.axes
    n = axes.shape[0]
    for s in range(n):
        x = centres[n, 0] - centres[s + 1, 0]
        y = centres[n, 1] - centres[s + 1, 1]
        z = centres[n, 2] - centres[s + 1, 2]
        for j in range(3):
            a0, a1, a2 = axes[s, j, 0], axes[s, j, 1], axes[s, j, 2]
            rows[s, j, 0] = a1 * z - a2 * y
            rows[s, j, 1] = a2 * x - a0 * z
            rows[s, j, 2] = a0 * y - a1 * x
            rows[s, j, 3] = a0
            rows[s, j, 4] = a1
            rows[s, j, 5] = a2
            rows[s, j, 6] = register[s, j]


@njit(cache=True, nogil=True)
def _rigid_rows(state: RigidState, register: Any, rows: Any) -> None:
    centres, axes = state.kinematics.centres, state.kinematics.axes
    velocities = state.kinematics.velocities
    n = axes.shape[0]
    for s in range(n):
        x = centres[n, 0] - centres[s + 1, 0]
        y = centres[n, 1] - centres[s + 1, 1]
        z = centres[n, 2] - centres[s + 1, 2]
        for j in range(3):
            a0, a1, a2 = axes[s, j, 0], axes[s, j, 1], axes[s, j, 2]
            rows[s, j, 0] = velocities[s, j, 0] + a1 * z - a2 * y
            rows[s, j, 1] = velocities[s, j, 1] + a2 * x - a0 * z
            rows[s, j, 2] = velocities[s, j, 2] + a0 * y - a1 * x
            rows[s, j, 3], rows[s, j, 4], rows[s, j, 5] = a0, a1, a2
            for i in range(3):
                rows[s, 3 + j, i] = velocities[s, 3 + j, i]
                rows[s, 3 + j, 3 + i] = 0.0
        for j in range(RIGID):
            rows[s, j, 6] = register[s, j]


constraint_rows = by_kind(_hinge_rows, _rigid_rows)
"""Rows b, a and the register row (N, c) of a slice into (N, c, 8): (state, register, rows).

The last of the eight is not touched."""


@njit(cache=True, nogil=True, fastmath={"contract"})
def stiff_columns(rows: Any, inverse_stiffness: Any, columns: Any) -> None:
    """K^-1 times the columns (N, c, 8)."""
    n, c = rows.shape[:2]
    for s in range(n):
        for k in range(c):
            for i in range(WIDTH):
                columns[s, k, i] = inverse_stiffness[s, k, 0] * rows[s, 0, i]
            for j in range(1, c):
                value = inverse_stiffness[s, k, j]
                for i in range(WIDTH):
                    columns[s, k, i] += value * rows[s, j, i]


@njit(cache=True, nogil=True, fastmath={"contract"})
def products(rows: Any, columns: Any, out: Any) -> None:
    """out (7, 8) = products over the coordinates of the first seven rows with eight columns."""
    for i in range(ROWS):
        for j in range(WIDTH):
            out[i, j] = 0.0
    n, c = rows.shape[:2]
    for s in range(n):
        for k in range(c):
            for i in range(ROWS):
                v = rows[s, k, i]
                for j in range(WIDTH):
                    out[i, j] += v * columns[s, k, j]


@njit(cache=True, nogil=True, fastmath={"contract"})
def combine(columns: Any, matrix: Any, count: int, out: Any) -> None:
    """out[i] = sum_j matrix[j, i] columns[:, :, j] for i < count, into flat rows (count, cN)."""
    n, c = columns.shape[:2]
    for s in range(n):
        for k in range(c):
            for i in range(count):
                total = 0.0
                for j in range(ROWS):
                    total += matrix[j, i] * columns[s, k, j]
                out[i, c * s + k] = total


@njit(cache=True, nogil=True, error_model="numpy")
def _factorise_hinges(
    state: HingeState, steps: HingeSteps, multipliers: Any, rows: Any, penalty: Any, factors: Any
) -> float:
    stiffness, form = steps.stiffness, state.form
    centres, axes, halves = state.centres, state.axes, state.halves
    right, z, root = factors.right, factors.z, factors.root
    n = rows.shape[0]
    p = np.zeros((ROWS, ROWS))
    e = np.empty((3, 3))
    d = np.empty((3, 3))
    ep = np.empty((3, ROWS))
    u = np.empty((3, ROWS))
    rg = np.empty((3, ROWS))
    log_det = 0.0
    for s in range(n):
        if is_bound(stiffness, s):
            right[s], z[s], root[s] = 0.0, 0.0, 0.0
            continue
        x = centres[n, 0] - centres[s + 1, 0]
        y = centres[n, 1] - centres[s + 1, 1]
        zz = centres[n, 2] - centres[s + 1, 2]
        for k in range(3):
            coupling(axes[s, k], x, y, zz, multipliers, e[k])
            for i in range(ROWS):
                total = 0.0
                for j in range(ROWS):
                    total += penalty[i, j] * rows[s, k, j]
                rg[k, i] = total
                right[s, k, i] = total
            for i in range(3):
                right[s, k, 3 + i] += e[k, i]
            for i in range(ROWS):
                total = 0.0
                for j in range(ROWS):
                    total += right[s, k, j] * p[j, i]
                ep[k, i] = total
                u[k, i] = rows[s, k, i] - total
        if form != WEDGE:
            midstep_block(halves[s], x, y, zz, multipliers, d)
        for k in range(3):
            for j in range(k + 1):
                if form == WEDGE:
                    d[k, j] = (
                        axes[s, j, 0] * e[k, 0] + axes[s, j, 1] * e[k, 1] + axes[s, j, 2] * e[k, 2]
                    )
                total = stiffness[s, k, j]
                for i in range(ROWS):
                    total += rows[s, j, i] * rg[k, i] - ep[k, i] * right[s, j, i]
                d[k, j] += total
        if not d[0, 0] > 0.0:
            return math.nan
        c00 = math.sqrt(d[0, 0])
        c10 = d[1, 0] / c00
        c20 = d[2, 0] / c00
        t11 = d[1, 1] - c10 * c10
        if not t11 > 0.0:
            return math.nan
        c11 = math.sqrt(t11)
        c21 = (d[2, 1] - c20 * c10) / c11
        t22 = d[2, 2] - c20 * c20 - c21 * c21
        if not t22 > 0.0:
            return math.nan
        c22 = math.sqrt(t22)
        log_det += math.log(d[0, 0]) + math.log(t11) + math.log(t22)
        i00, i11, i22 = 1.0 / c00, 1.0 / c11, 1.0 / c22
        i10 = -c10 * i00 * i11
        i21 = -c21 * i11 * i22
        i20 = -(c20 * i00 + c21 * i10) * i22
        root[s, 0], root[s, 1], root[s, 2] = i00, i10, i11
        root[s, 3], root[s, 4], root[s, 5] = i20, i21, i22
        for i in range(ROWS):
            w0 = i00 * u[0, i]
            w1 = i10 * u[0, i] + i11 * u[1, i]
            w2 = i20 * u[0, i] + i21 * u[1, i] + i22 * u[2, i]
            z[s, 0, i] = i00 * w0 + i10 * w1 + i20 * w2
            z[s, 1, i] = i11 * w1 + i21 * w2
            z[s, 2, i] = i22 * w2
        for i in range(ROWS):
            for j in range(ROWS):
                p[i, j] += u[0, i] * z[s, 0, j] + u[1, i] * z[s, 1, j] + u[2, i] * z[s, 2, j]
    return log_det


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _factorise_rigid(
    state: RigidState, steps: RigidSteps, multipliers: Any, rows: Any, penalty: Any, factors: Any
) -> float:
    right, z, root = factors.right, factors.z, factors.root
    n = rows.shape[0]
    p = np.zeros((ROWS, ROWS))
    d = np.empty((RIGID, RIGID))
    rg = np.empty((RIGID, ROWS))
    u = np.empty((RIGID, ROWS))
    inverse = np.zeros((RIGID, RIGID))
    log_det = 0.0
    for s in range(n):
        if is_bound(steps.stiffness, s):
            right[s], z[s], root[s] = 0.0, 0.0, 0.0
            continue
        _, _, e_r, _, e_t, d_rr, d_rt = step_block(
            s, state.angles, state.kinematics, steps.stiffness, multipliers, 0.0
        )
        for k in range(3):
            for j in range(k + 1):
                d[3 + k, 3 + j] = steps.stiffness[s, 3 + k, 3 + j]
        d[0, 0], d[1, 0], d[1, 1] = d_rr[0][0], d_rr[1][0], d_rr[1][1]
        d[2, 0], d[2, 1], d[2, 2] = d_rr[2]
        d[3, 0], d[4, 0], d[5, 0] = d_rt[0]
        d[3, 1], d[4, 1], d[5, 1] = d_rt[1]
        d[3, 2], d[4, 2], d[5, 2] = d_rt[2]
        for k in range(RIGID):
            for i in range(ROWS):
                total = 0.0
                for j in range(ROWS):
                    total += penalty[i, j] * rows[s, k, j]
                rg[k, i] = total
                right[s, k, i] = total
        right[s, 0, 3] += e_r[0][0]
        right[s, 0, 4] += e_r[0][1]
        right[s, 0, 5] += e_r[0][2]
        right[s, 1, 3] += e_r[1][0]
        right[s, 1, 4] += e_r[1][1]
        right[s, 1, 5] += e_r[1][2]
        right[s, 2, 3] += e_r[2][0]
        right[s, 2, 4] += e_r[2][1]
        right[s, 2, 5] += e_r[2][2]
        right[s, 3, 3] += e_t[0][0]
        right[s, 3, 4] += e_t[0][1]
        right[s, 3, 5] += e_t[0][2]
        right[s, 4, 3] += e_t[1][0]
        right[s, 4, 4] += e_t[1][1]
        right[s, 4, 5] += e_t[1][2]
        right[s, 5, 3] += e_t[2][0]
        right[s, 5, 4] += e_t[2][1]
        right[s, 5, 5] += e_t[2][2]
        for k in range(RIGID):
            for i in range(ROWS):
                total = 0.0
                for j in range(ROWS):
                    total += right[s, k, j] * p[j, i]
                u[k, i] = rows[s, k, i] - total
            # Own block plus g R g^T less right P right^T.
            for j in range(k + 1):
                total = d[k, j]
                for i in range(ROWS):
                    total += rows[s, j, i] * rg[k, i]
                    total -= (rows[s, k, i] - u[k, i]) * right[s, j, i]
                d[k, j] = total
        # Cholesky factor in place, then its inverse.
        for k in range(RIGID):
            for j in range(k + 1):
                total = d[k, j]
                for i in range(j):
                    total -= d[k, i] * d[j, i]
                if j == k:
                    if not total > 0.0:
                        return math.nan
                    log_det += math.log(total)
                    d[k, k] = math.sqrt(total)
                else:
                    d[k, j] = total / d[j, j]
        for j in range(RIGID):
            inverse[j, j] = 1.0 / d[j, j]
            for k in range(j + 1, RIGID):
                total = 0.0
                for i in range(j, k):
                    total -= d[k, i] * inverse[i, j]
                inverse[k, j] = total / d[k, k]
        at = 0
        for k in range(RIGID):
            for j in range(k + 1):
                root[s, at] = inverse[k, j]
                at += 1
        for i in range(ROWS):
            for k in range(RIGID):
                z[s, k, i] = 0.0
            for k in range(RIGID):
                w = 0.0
                for j in range(k + 1):
                    w += inverse[k, j] * u[j, i]
                for j in range(k + 1):
                    z[s, j, i] += inverse[k, j] * w
        for k in range(RIGID):
            for i in range(ROWS):
                for j in range(ROWS):
                    p[i, j] += u[k, i] * z[s, k, j]
    return log_det


factorise_slice = by_kind(_factorise_hinges, _factorise_rigid)
"""Block factorisation of M: (state, steps, multipliers, rows, penalty, factors); ln det M.

NaN if M is not positive. ``steps`` are in RT, ``multipliers`` (6,) in RT per step and RT, ``rows``
(N, c, 8) those of :data:`constraint_rows`, ``penalty`` is R, (7, 7). Of the ``factors``
(:class:`SliceFactors`) it fills ``right`` with the right generators R g + (0, e, 0), ``z`` with
D^-1 (g - right P) and ``root`` with the packed inverse of the lower Cholesky factor of D. Steps
that a guest holds have none: all three are zero, and so is what they solve and draw.
"""


@njit(cache=True, nogil=True, fastmath={"contract"})
def _solve_hinges(steps: HingeSteps, factors: Any, columns: Any) -> None:
    right, z, root = factors.right, factors.z, factors.root
    n = right.shape[0]
    f = np.zeros((ROWS, WIDTH))
    for s in range(n):
        c = columns[s]
        for k in range(3):
            for i in range(ROWS):
                a = right[s, k, i]
                for j in range(WIDTH):
                    c[k, j] -= a * f[i, j]
        for i in range(ROWS):
            a0, a1, a2 = z[s, 0, i], z[s, 1, i], z[s, 2, i]
            for j in range(WIDTH):
                f[i, j] += a0 * c[0, j] + a1 * c[1, j] + a2 * c[2, j]
    for i in range(ROWS):
        for j in range(WIDTH):
            f[i, j] = 0.0
    for back in range(n):
        s = n - 1 - back
        c = columns[s]
        r0, r1, r2, r3, r4, r5 = (
            root[s, 0],
            root[s, 1],
            root[s, 2],
            root[s, 3],
            root[s, 4],
            root[s, 5],
        )
        for j in range(WIDTH):
            w0 = r0 * c[0, j]
            w1 = r1 * c[0, j] + r2 * c[1, j]
            w2 = r3 * c[0, j] + r4 * c[1, j] + r5 * c[2, j]
            c[0, j] = r0 * w0 + r1 * w1 + r3 * w2
            c[1, j] = r2 * w1 + r4 * w2
            c[2, j] = r5 * w2
        for k in range(3):
            for i in range(ROWS):
                a = z[s, k, i]
                for j in range(WIDTH):
                    c[k, j] -= a * f[i, j]
        for i in range(ROWS):
            a0, a1, a2 = right[s, 0, i], right[s, 1, i], right[s, 2, i]
            for j in range(WIDTH):
                f[i, j] += a0 * c[0, j] + a1 * c[1, j] + a2 * c[2, j]


@njit(cache=True, nogil=True, fastmath={"contract"})
def _solve_rigid(steps: RigidSteps, factors: Any, columns: Any) -> None:
    right, z, root = factors.right, factors.z, factors.root
    n = right.shape[0]
    f = np.zeros((ROWS, WIDTH))
    w = np.empty((RIGID, WIDTH))
    for s in range(n):
        c = columns[s]
        for k in range(RIGID):
            for i in range(ROWS):
                a = right[s, k, i]
                for j in range(WIDTH):
                    c[k, j] -= a * f[i, j]
        for k in range(RIGID):
            for i in range(ROWS):
                a = z[s, k, i]
                for j in range(WIDTH):
                    f[i, j] += a * c[k, j]
    f[:] = 0.0
    for back in range(n):
        s = n - 1 - back
        c = columns[s]
        w[:] = 0.0
        at = 0
        for k in range(RIGID):
            for i in range(k + 1):
                a = root[s, at]
                at += 1
                for j in range(WIDTH):
                    w[k, j] += a * c[i, j]
        for k in range(RIGID):
            for j in range(WIDTH):
                c[k, j] = 0.0
        at = 0
        for k in range(RIGID):
            for i in range(k + 1):
                a = root[s, at]
                at += 1
                for j in range(WIDTH):
                    c[i, j] += a * w[k, j]
        for k in range(RIGID):
            for i in range(ROWS):
                a = z[s, k, i]
                for j in range(WIDTH):
                    c[k, j] -= a * f[i, j]
        for k in range(RIGID):
            for i in range(ROWS):
                a = right[s, k, i]
                for j in range(WIDTH):
                    f[i, j] += a * c[k, j]


solve_slice = by_kind(_solve_hinges, _solve_rigid)
"""Solve M X = columns in place for eight columns (N, c, 8): (steps, factors, columns)."""


@njit(cache=True, nogil=True, fastmath={"contract"})
def _draw_hinges(steps: HingeSteps, factors: Any, normals: Any, out: Any) -> None:
    right, z, root = factors.right, factors.z, factors.root
    n = right.shape[0]
    f0 = f1 = f2 = f3 = f4 = f5 = f6 = 0.0
    for back in range(n):
        s = n - 1 - back
        n0, n1, n2 = normals[s, 0], normals[s, 1], normals[s, 2]
        w0 = root[s, 0] * n0 + root[s, 1] * n1 + root[s, 3] * n2
        w1 = root[s, 2] * n1 + root[s, 4] * n2
        w2 = root[s, 5] * n2
        v = z[s]
        w0 -= v[0, 0] * f0 + v[0, 1] * f1 + v[0, 2] * f2 + v[0, 3] * f3
        w0 -= v[0, 4] * f4 + v[0, 5] * f5 + v[0, 6] * f6
        w1 -= v[1, 0] * f0 + v[1, 1] * f1 + v[1, 2] * f2 + v[1, 3] * f3
        w1 -= v[1, 4] * f4 + v[1, 5] * f5 + v[1, 6] * f6
        w2 -= v[2, 0] * f0 + v[2, 1] * f1 + v[2, 2] * f2 + v[2, 3] * f3
        w2 -= v[2, 4] * f4 + v[2, 5] * f5 + v[2, 6] * f6
        r = right[s]
        f0 += r[0, 0] * w0 + r[1, 0] * w1 + r[2, 0] * w2
        f1 += r[0, 1] * w0 + r[1, 1] * w1 + r[2, 1] * w2
        f2 += r[0, 2] * w0 + r[1, 2] * w1 + r[2, 2] * w2
        f3 += r[0, 3] * w0 + r[1, 3] * w1 + r[2, 3] * w2
        f4 += r[0, 4] * w0 + r[1, 4] * w1 + r[2, 4] * w2
        f5 += r[0, 5] * w0 + r[1, 5] * w1 + r[2, 5] * w2
        f6 += r[0, 6] * w0 + r[1, 6] * w1 + r[2, 6] * w2
        out[s, 0], out[s, 1], out[s, 2] = w0, w1, w2


@njit(cache=True, nogil=True, fastmath={"contract"})
def _draw_rigid(steps: RigidSteps, factors: Any, normals: Any, out: Any) -> None:
    right, z, root = factors.right, factors.z, factors.root
    n = right.shape[0]
    f = np.zeros(ROWS)
    for back in range(n):
        s = n - 1 - back
        for k in range(RIGID):
            total = 0.0
            for i in range(ROWS):
                total -= z[s, k, i] * f[i]
            out[s, k] = total
        at = 0
        for k in range(RIGID):
            value = normals[s, k]
            for j in range(k + 1):
                out[s, j] += root[s, at] * value
                at += 1
        for k in range(RIGID):
            value = out[s, k]
            for i in range(ROWS):
                f[i] += right[s, k, i] * value


draw_slice = by_kind(_draw_hinges, _draw_rigid)
"""x = L^-T D^-1/2 xi (N, c) from standard normals xi (N, c): (steps, factors, normals, out)."""


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def dot(a: Any, b: Any) -> float:
    """Inner product of two vectors."""
    total = 0.0
    for k in range(a.shape[0]):
        total += a[k] * b[k]
    return total


@njit(cache=True, nogil=True)
def draw_closed(steps: Any, rng: Any, factors: Any, normals: Any, out: Any) -> float:
    """Draw x (N, c) from the slice's Gaussian under closure to first order; x^T H x returns.

    ``factors`` are :class:`SliceFactors`; ``normals`` (N, c) is left with the standard normals
    that were drawn.
    """
    for s in range(normals.shape[0]):
        for k in range(normals.shape[1]):
            normals[s, k] = rng.standard_normal() if factors.root[s, 0] > 0.0 else 0.0
    return closed_of_normals(steps, factors, normals, out)


@njit(cache=True, nogil=True)
def closed_of_normals(steps: Any, factors: Any, normals: Any, out: Any) -> float:
    """The draw x (N, c) that standard normals (N, c) make; x^T H x returns.

    Numbers of steps that a guest holds are not used.
    """
    quadratic = 0.0
    for s in range(normals.shape[0]):
        if not factors.root[s, 0] > 0.0:
            continue
        for k in range(normals.shape[1]):
            quadratic += normals[s, k] * normals[s, k]
    draw_slice(steps, factors, normals, out)
    flat = out.reshape(out.size)
    open_by = np.empty(ROWS)
    for i in range(ROWS):
        open_by[i] = dot(factors.rows[i], flat)
    for i in range(ROWS):
        for j in range(ROWS):
            quadratic -= open_by[i] * factors.schur[i, j] * open_by[j]
    for i in range(ROWS):
        c = open_by[i]
        b = factors.projector[i]
        for k in range(flat.shape[0]):
            flat[k] -= c * b[k]
    return quadratic
