"""Compiled linear-time factorisation for chains of rigid base-pair steps with six parameters.

Coordinate k of a step moves everything beyond it by a screw: it turns it by the axis a and moves
the chain's end by b = v + a x d, with v the velocity of the next centre and d = r_N - next centre.
For coordinates of steps j before k the Hessian of the Lagrangian is a_j . e_k with
e_k = b_k x force + a_k x moment/2, as for three angles
(:mod:`dnacheck.equilibria.discrete.kernels.factorisation`); a translation has a = 0. Within one
step it is

    n . s_jk + (a_j . c_k + a_k . c_j)/2 + [the same of the mid-step frame]

with n = d x force + moment, where s_jk is the symmetric part of the derivative of a_k by coordinate
j, c_k = (a_k x d) x force, and the mid-step frame's terms have its own axes m, the arm v in place
of d, and no moment. The translations of a step, which are stiff, are eliminated before its angles,
so each step costs operations with 3 x 3 matrices only.
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from dnacheck.model.chain_kernels import is_bound
from dnacheck.model.rigid_kernels import RigidKinematics
from dnacheck.numerics.vectors import (
    combine,
    cross,
    dot,
    less_product,
    minus,
    plus,
    product,
    sum_of,
    symmetric_inverse,
    transposed_product,
)

RIGID_FACTOR_WIDTH = 81
"""Numbers kept per step, in the order of the offsets below."""

# Translations: couplings E, D^-1 U, eliminated displacement columns W, D^-1 (lower triangle), and
# D^-1 times the block between translations and angles. Angles: E, D^-1 U, W, D^-1. Then the two
# right-hand sides.
_TE, _TZ, _TW, _TD, _TX = 0, 9, 18, 27, 33
_RE, _RZ, _RW, _RD = 42, 51, 60, 69
_TG, _RG = 75, 78


@njit(cache=True, nogil=True)
def _row(a: Any, s: int, j: int) -> Any:
    return a[s, j, 0], a[s, j, 1], a[s, j, 2]


@njit(cache=True, nogil=True)
def _kept(factors: Any, s: int, at: int) -> Any:
    return factors[s, at], factors[s, at + 1], factors[s, at + 2]


@njit(cache=True, nogil=True)
def _kept_matrix(factors: Any, s: int, at: int) -> Any:
    return _kept(factors, s, at), _kept(factors, s, at + 3), _kept(factors, s, at + 6)


@njit(cache=True, nogil=True)
def _kept_symmetric(factors: Any, s: int, at: int) -> Any:
    i00, i10, i11 = _kept(factors, s, at)
    i20, i21, i22 = _kept(factors, s, at + 3)
    return (i00, i10, i20), (i10, i11, i21), (i20, i21, i22)


@njit(cache=True, nogil=True)
def _keep(factors: Any, s: int, at: int, v: Any) -> None:
    factors[s, at], factors[s, at + 1], factors[s, at + 2] = v[0], v[1], v[2]


@njit(cache=True, nogil=True)
def _keep_matrix(factors: Any, s: int, at: int, m: Any) -> None:
    _keep(factors, s, at, m[0])
    _keep(factors, s, at + 3, m[1])
    _keep(factors, s, at + 6, m[2])


@njit(cache=True, nogil=True)
def _keep_symmetric(factors: Any, s: int, at: int, m: Any) -> None:
    _keep(factors, s, at, (m[0][0], m[1][0], m[1][1]))
    _keep(factors, s, at + 3, m[2])


@njit(cache=True, nogil=True, fastmath={"contract"})
def _times(m: Any, v: Any) -> Any:
    return dot(m[0], v), dot(m[1], v), dot(m[2], v)


@njit(cache=True, nogil=True, fastmath={"contract"})
def _bent(p: float, r: float, b: float, c: float, d: float, n: Any) -> Any:
    """n . s_jk between tilt p and roll r, in the frame Q: (tilt, tilt), (roll, tilt), (roll, roll).

    s_jk = beta (b [j = k] + d beta_j beta_k) - (b + d G^2)(e_k beta_j + e_j beta_k)/2
    + c (beta_j beta x e_k + beta_k beta x e_j)/2, of the left Jacobian of exp(beta).
    """
    square = p * p + r * r
    mean = 0.5 * (b + d * square)
    tt = -d * p * r * r * n[0] + r * (b + d * p * p) * n[1] - c * p * r * n[2]
    rr = p * (b + d * r * r) * n[0] - d * r * p * p * n[1] + c * p * r * n[2]
    rt = (d * p * p - mean) * r * n[0] + (d * r * r - mean) * p * n[1]
    return tt, rt + 0.5 * c * (p * p - r * r) * n[2], rr


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def step_block(
    s: int,
    coordinates: Any,
    kinematics: RigidKinematics,
    stiffness: Any,
    multipliers: Any,
    held: float,
) -> Any:
    """Step ``s`` in the Lagrangian's Hessian, plus ``held`` times the products of its axes.

    Returns
    -------
    a_r, b_r, e_r : of twist, tilt and roll: axes, displacements of the end, and couplings E such
        that the Hessian between an earlier coordinate j and a later one k is a_j . e_k.
    b_t, e_t : of shift, slide and rise, whose axes are zero.
    d_rr, d_rt : own block of the angles (lower triangle), and of angles (rows) with translations.
        That of the translations is the stiffness.
    """
    centres, frames = kinematics.centres, kinematics.frames
    axes, velocities, local = kinematics.axes, kinematics.velocities, kinematics.local
    n = coordinates.shape[0]
    force = (multipliers[0], multipliers[1], multipliers[2])
    moment = (multipliers[3], multipliers[4], multipliers[5])
    half = (0.5 * moment[0], 0.5 * moment[1], 0.5 * moment[2])
    d = (
        centres[n, 0] - centres[s + 1, 0],
        centres[n, 1] - centres[s + 1, 1],
        centres[n, 2] - centres[s + 1, 2],
    )
    arm = (
        centres[s + 1, 0] - centres[s, 0],
        centres[s + 1, 1] - centres[s, 1],
        centres[s + 1, 2] - centres[s, 2],
    )
    a0, a1, a2 = _row(axes, s, 0), _row(axes, s, 1), _row(axes, s, 2)
    v0, v1, v2 = _row(velocities, s, 0), _row(velocities, s, 1), _row(velocities, s, 2)
    x0, x1, x2 = cross(a0, d), cross(a1, d), cross(a2, d)
    c0, c1, c2 = cross(x0, force), cross(x1, force), cross(x2, force)
    k0, k1, k2 = cross(v0, force), cross(v1, force), cross(v2, force)
    b_r = (plus(v0, x0), plus(v1, x1), plus(v2, x2))
    h0, h1, h2 = cross(a0, half), cross(a1, half), cross(a2, half)
    e_r = (
        (c0[0] + k0[0] + h0[0] + held * a0[0], c0[1] + k0[1] + h0[1] + held * a0[1],
         c0[2] + k0[2] + h0[2] + held * a0[2]),
        (c1[0] + k1[0] + h1[0] + held * a1[0], c1[1] + k1[1] + h1[1] + held * a1[1],
         c1[2] + k1[2] + h1[2] + held * a1[2]),
        (c2[0] + k2[0] + h2[0] + held * a2[0], c2[1] + k2[1] + h2[1] + held * a2[1],
         c2[2] + k2[2] + h2[2] + held * a2[2]),
    )  # fmt: skip
    b_t = (_row(velocities, s, 3), _row(velocities, s, 4), _row(velocities, s, 5))
    e_t = (cross(b_t[0], force), cross(b_t[1], force), cross(b_t[2], force))

    # The step's own block: angles with angles, and angles (rows) with translations.
    z = (frames[s, 0, 2], frames[s, 1, 2], frames[s, 2, 2])
    z1 = (frames[s + 1, 0, 2], frames[s + 1, 1, 2], frames[s + 1, 2, 2])
    pull = plus(cross(d, force), moment)
    arm_pull = cross(arm, force)
    x, y = _kept(local, s, 0), _kept(local, s, 3)
    m0 = (0.5 * z[0], 0.5 * z[1], 0.5 * z[2])
    m1, m2 = _kept(local, s, 6), _kept(local, s, 9)
    tilt, roll = coordinates[s, 1], coordinates[s, 2]
    tt, rt, rr = _bent(
        tilt, roll, local[s, 12], local[s, 13], local[s, 14],
        (dot(x, pull), dot(y, pull), dot(z, pull)),
    )  # fmt: skip
    mtt, mrt, mrr = _bent(
        0.5 * tilt, 0.5 * roll, local[s, 15], local[s, 16], local[s, 17],
        (dot(x, arm_pull), dot(y, arm_pull), dot(z, arm_pull)),
    )  # fmt: skip
    turn = cross(pull, minus(z, z1))
    arm_turn = cross(arm_pull, z)
    k_ = stiffness[s]
    d_rr = (
        (k_[0, 0] + 0.25 * dot(pull, cross(z, z1)) + dot(a0, c0) + held * dot(a0, a0)
         + dot(m0, k0), 0.0, 0.0),
        (k_[1, 0] + 0.25 * dot(turn, a1) + 0.5 * (dot(a0, c1) + dot(a1, c0))
         + held * dot(a0, a1) + 0.25 * dot(arm_turn, m1) + 0.5 * (dot(m0, k1) + dot(m1, k0)),
         k_[1, 1] + tt + dot(a1, c1) + held * dot(a1, a1) + 0.25 * mtt + dot(m1, k1), 0.0),
        (k_[2, 0] + 0.25 * dot(turn, a2) + 0.5 * (dot(a0, c2) + dot(a2, c0))
         + held * dot(a0, a2) + 0.25 * dot(arm_turn, m2) + 0.5 * (dot(m0, k2) + dot(m2, k0)),
         k_[2, 1] + rt + 0.5 * (dot(a1, c2) + dot(a2, c1)) + held * dot(a1, a2)
         + 0.25 * mrt + 0.5 * (dot(m1, k2) + dot(m2, k1)),
         k_[2, 2] + rr + dot(a2, c2) + held * dot(a2, a2) + 0.25 * mrr + dot(m2, k2)),
    )  # fmt: skip
    d_rt = (
        (k_[0, 3] + dot(m0, e_t[0]), k_[0, 4] + dot(m0, e_t[1]), k_[0, 5] + dot(m0, e_t[2])),
        (k_[1, 3] + dot(m1, e_t[0]), k_[1, 4] + dot(m1, e_t[1]), k_[1, 5] + dot(m1, e_t[2])),
        (k_[2, 3] + dot(m2, e_t[0]), k_[2, 4] + dot(m2, e_t[1]), k_[2, 5] + dot(m2, e_t[2])),
    )
    return (a0, a1, a2), b_r, e_r, b_t, e_t, d_rr, d_rt


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def factorise_rigid(
    slope: Any,
    stiffness: Any,
    shift: float,
    coordinates: Any,
    kinematics: RigidKinematics,
    multipliers: Any,
    factors: Any,
    small: Any,
) -> tuple[int, float, float]:
    """Block factorisation of the Lagrangian's Hessian and its 6 x 6 Schur complement.

    Parameters, outputs and returned numbers are those of
    :func:`dnacheck.equilibria.discrete.kernels.factorisation.factorise`, with six coordinates a
    step: ``slope`` is (N, 6), ``factors`` (N, RIGID_FACTOR_WIDTH).
    """
    n = coordinates.shape[0]
    zero = (0.0, 0.0, 0.0)
    # Running sums over steps, as in the factorisation for three angles.
    p = (zero, zero, zero)
    q = (zero, zero, zero)
    t = (zero, zero, zero)
    r = zero
    v = zero
    negatives = 0
    log_pivots = 0.0
    running = 1.0
    weakest = 1e300
    for s in range(n):
        if is_bound(stiffness, s):
            for k in range(RIGID_FACTOR_WIDTH):
                factors[s, k] = 0.0
            continue
        held = shift * (n - s) / n
        a_r, b_r, e_r, b_t, e_t, d_rr, d_rt = step_block(
            s, coordinates, kinematics, stiffness, multipliers, held
        )
        a0, a1, a2 = a_r
        k_ = stiffness[s]

        # What earlier steps leave: U = A - E P, W = B - E Q, D = own block - E P E^T.
        u_t = (
            less_product(zero, e_t[0], p), less_product(zero, e_t[1], p),
            less_product(zero, e_t[2], p),
        )  # fmt: skip
        f_r = (
            less_product(zero, e_r[0], p), less_product(zero, e_r[1], p),
            less_product(zero, e_r[2], p),
        )  # fmt: skip
        w_t = (
            less_product(b_t[0], e_t[0], q), less_product(b_t[1], e_t[1], q),
            less_product(b_t[2], e_t[2], q),
        )  # fmt: skip
        w_r = (
            less_product(b_r[0], e_r[0], q), less_product(b_r[1], e_r[1], q),
            less_product(b_r[2], e_r[2], q),
        )  # fmt: skip
        g_t = (
            slope[s, 3] - dot(e_t[0], r), slope[s, 4] - dot(e_t[1], r), slope[s, 5] - dot(e_t[2], r)
        )  # fmt: skip
        g_r = (
            slope[s, 0] - dot(e_r[0], r), slope[s, 1] - dot(e_r[1], r), slope[s, 2] - dot(e_r[2], r)
        )  # fmt: skip
        d_tt = (
            (k_[3, 3] + dot(u_t[0], e_t[0]), 0.0, 0.0),
            (k_[4, 3] + dot(u_t[1], e_t[0]), k_[4, 4] + dot(u_t[1], e_t[1]), 0.0),
            (k_[5, 3] + dot(u_t[2], e_t[0]), k_[5, 4] + dot(u_t[2], e_t[1]),
             k_[5, 5] + dot(u_t[2], e_t[2])),
        )  # fmt: skip
        d_rt = (
            plus(d_rt[0], _times(e_t, f_r[0])),
            plus(d_rt[1], _times(e_t, f_r[1])),
            plus(d_rt[2], _times(e_t, f_r[2])),
        )

        # Translations first.
        i_t, det_t, negative_t = symmetric_inverse(d_tt)
        d_tr = (
            (d_rt[0][0], d_rt[1][0], d_rt[2][0]),
            (d_rt[0][1], d_rt[1][1], d_rt[2][1]),
            (d_rt[0][2], d_rt[1][2], d_rt[2][2]),
        )
        x_t = product(i_t, d_tr)
        z_t = product(i_t, u_t)
        y_t = product(i_t, w_t)
        # Then the angles.
        d_rr = (
            (d_rr[0][0] + dot(f_r[0], e_r[0]) - dot(d_rt[0], (x_t[0][0], x_t[1][0], x_t[2][0])),
             0.0, 0.0),
            (d_rr[1][0] + dot(f_r[1], e_r[0]) - dot(d_rt[1], (x_t[0][0], x_t[1][0], x_t[2][0])),
             d_rr[1][1] + dot(f_r[1], e_r[1]) - dot(d_rt[1], (x_t[0][1], x_t[1][1], x_t[2][1])),
             0.0),
            (d_rr[2][0] + dot(f_r[2], e_r[0]) - dot(d_rt[2], (x_t[0][0], x_t[1][0], x_t[2][0])),
             d_rr[2][1] + dot(f_r[2], e_r[1]) - dot(d_rt[2], (x_t[0][1], x_t[1][1], x_t[2][1])),
             d_rr[2][2] + dot(f_r[2], e_r[2]) - dot(d_rt[2], (x_t[0][2], x_t[1][2], x_t[2][2]))),
        )  # fmt: skip
        u_r = (
            less_product(plus(a0, f_r[0]), d_rt[0], z_t),
            less_product(plus(a1, f_r[1]), d_rt[1], z_t),
            less_product(plus(a2, f_r[2]), d_rt[2], z_t),
        )
        w_r = (
            less_product(w_r[0], d_rt[0], y_t),
            less_product(w_r[1], d_rt[1], y_t),
            less_product(w_r[2], d_rt[2], y_t),
        )
        g_r = minus(g_r, combine(g_t, x_t[0], x_t[1], x_t[2]))
        i_r, det_r, negative_r = symmetric_inverse(d_rr)
        z_r = product(i_r, u_r)
        y_r = product(i_r, w_r)

        p = sum_of(p, sum_of(transposed_product(u_t, z_t), transposed_product(u_r, z_r)))
        q = sum_of(q, sum_of(transposed_product(z_t, w_t), transposed_product(z_r, w_r)))
        t = sum_of(t, sum_of(transposed_product(w_t, y_t), transposed_product(w_r, y_r)))
        r = plus(
            r, plus(combine(g_t, z_t[0], z_t[1], z_t[2]), combine(g_r, z_r[0], z_r[1], z_r[2]))
        )
        v = plus(
            v, plus(combine(g_t, y_t[0], y_t[1], y_t[2]), combine(g_r, y_r[0], y_r[1], y_r[2]))
        )

        negatives += negative_t + negative_r
        size_t = k_[3, 3] * k_[4, 4] * k_[5, 5]
        size_r = k_[0, 0] * k_[1, 1] * k_[2, 2]
        if not abs(det_t) >= weakest * size_t:
            weakest = abs(det_t) / size_t
        if not abs(det_r) >= weakest * size_r:
            weakest = abs(det_r) / size_r
        running *= abs(det_t)
        if not 1e-150 < running < 1e150:
            log_pivots += math.log(running + 1e-300)
            running = 1.0
        running *= abs(det_r)
        if not 1e-150 < running < 1e150:
            log_pivots += math.log(running + 1e-300)
            running = 1.0
        _keep_matrix(factors, s, _TE, e_t)
        _keep_matrix(factors, s, _TZ, z_t)
        _keep_matrix(factors, s, _TW, w_t)
        _keep_symmetric(factors, s, _TD, i_t)
        _keep_matrix(factors, s, _TX, x_t)
        _keep_matrix(factors, s, _RE, e_r)
        _keep_matrix(factors, s, _RZ, z_r)
        _keep_matrix(factors, s, _RW, w_r)
        _keep_symmetric(factors, s, _RD, i_r)
        _keep(factors, s, _TG, g_t)
        _keep(factors, s, _RG, g_r)
    for i in range(3):
        small[0, i], small[1, i], small[2, i] = t[0][i], t[1][i], t[2][i]
        small[3, i], small[4, i], small[5, i] = q[0][i], q[1][i], q[2][i]
        small[3, 3 + i], small[4, 3 + i], small[5, 3 + i] = p[0][i], p[1][i], p[2][i]
        small[i, 6], small[3 + i, 6] = v[i], r[i]
    for i in range(6):
        for j in range(i):
            small[j, i] = small[i, j]
    return negatives, log_pivots + math.log(running), weakest


@njit(cache=True, nogil=True, fastmath={"contract"})
def back_substitute_rigid(factors: Any, new_multipliers: Any, weight: float, step: Any) -> None:
    """Step (N, 6) = -H^-1 (weight slope + G^T new multipliers) from :func:`factorise_rigid`."""
    m = (new_multipliers[0], new_multipliers[1], new_multipliers[2])
    t = (new_multipliers[3], new_multipliers[4], new_multipliers[5])
    n = factors.shape[0]
    for back in range(n):
        s = n - 1 - back
        g, w = _kept(factors, s, _RG), _kept_matrix(factors, s, _RW)
        x = (
            weight * g[0] + dot(w[0], m), weight * g[1] + dot(w[1], m), weight * g[2] + dot(w[2], m)
        )  # fmt: skip
        x = plus(_times(_kept_symmetric(factors, s, _RD), x),
                 _times(_kept_matrix(factors, s, _RZ), t))  # fmt: skip
        turn = (-x[0], -x[1], -x[2])
        g, w = _kept(factors, s, _TG), _kept_matrix(factors, s, _TW)
        x = (
            weight * g[0] + dot(w[0], m), weight * g[1] + dot(w[1], m), weight * g[2] + dot(w[2], m)
        )  # fmt: skip
        x = plus(_times(_kept_symmetric(factors, s, _TD), x),
                 _times(_kept_matrix(factors, s, _TZ), t))  # fmt: skip
        x = plus(x, _times(_kept_matrix(factors, s, _TX), turn))
        slide = (-x[0], -x[1], -x[2])
        for j in range(3):
            step[s, j], step[s, 3 + j] = turn[j], slide[j]
        e_r, e_t = _kept_matrix(factors, s, _RE), _kept_matrix(factors, s, _TE)
        t = plus(t, plus(combine(turn, e_r[0], e_r[1], e_r[2]),
                         combine(slide, e_t[0], e_t[1], e_t[2])))  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def eliminate_rigid(factors: Any, rhs: Any, small: Any) -> None:
    """Replace the right-hand side (N, 6) that :func:`factorise_rigid` eliminated."""
    r = (0.0, 0.0, 0.0)
    v = (0.0, 0.0, 0.0)
    for s in range(factors.shape[0]):
        e_t, e_r = _kept_matrix(factors, s, _TE), _kept_matrix(factors, s, _RE)
        g_t = minus((rhs[s, 3], rhs[s, 4], rhs[s, 5]), _times(e_t, r))
        g_r = minus((rhs[s, 0], rhs[s, 1], rhs[s, 2]), _times(e_r, r))
        x = _kept_matrix(factors, s, _TX)
        g_r = minus(g_r, combine(g_t, x[0], x[1], x[2]))
        _keep(factors, s, _TG, g_t)
        _keep(factors, s, _RG, g_r)
        y_t = _times(_kept_symmetric(factors, s, _TD), g_t)
        y_r = _times(_kept_symmetric(factors, s, _RD), g_r)
        z_t, z_r = _kept_matrix(factors, s, _TZ), _kept_matrix(factors, s, _RZ)
        w_t, w_r = _kept_matrix(factors, s, _TW), _kept_matrix(factors, s, _RW)
        r = plus(
            r, plus(combine(g_t, z_t[0], z_t[1], z_t[2]), combine(g_r, z_r[0], z_r[1], z_r[2]))
        )
        v = plus(
            v, plus(combine(y_t, w_t[0], w_t[1], w_t[2]), combine(y_r, w_r[0], w_r[1], w_r[2]))
        )
    for i in range(3):
        small[i, 6], small[3 + i, 6] = v[i], r[i]
