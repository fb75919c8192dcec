"""Compiled Metropolis moves on closed chains.

The target is exp(-E(q)) delta(closure(q)) dq. In the coordinates x = L^T (q - q^), with L L^T the
stiffness in RT, E = |x|^2 / 2, and the target's density against the surface measure of the closed
shapes is exp(-|x|^2 / 2) / sqrt(det(G G^T)), G the closure Jacobian in x.

* Crankshafts (:func:`dnacheck.cyclization.ensembles.kernels.open_moves.crankshaft_sweep`) keep the
  closure to round-off.
* Constrained moves: a step in the tangent space, drawn about half a step of the gradient flow,
  and a step back onto the closed shapes along the normals of the point of departure. Accepted
  with the ratio of densities and of the tangent proposals, and only if the reversed move finds
  its way back (Zappa, Holmes-Cerfon & Goodman, Commun. Pure Appl. Math. 71, 2609 (2018);
  Lelievre, Rousset & Stoltz, Numer. Math. 143, 379 (2019)).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.cyclization.ensembles.kernels.open_moves import crankshaft_sweep
from dnacheck.equilibria.discrete.kernels.closure import (
    closure_jacobian,
    closure_residual,
    linearise,
)
from dnacheck.numerics.curve_topology import link_of_ring
from dnacheck.numerics.random_numbers import normal, uniform

_PROJECTION_STEPS = 12
_CLOSED = 1e-12
_BACK = 1e-7
_DIVERGED = 1e3

ACCEPTED, TRIED, NOT_PROJECTED, NOT_REVERSED = 0, 1, 2, 3


@njit(cache=True, nogil=True, error_model="numpy")
def solve_six(matrix: Any, rhs: Any, out: Any) -> float:
    """Solve a 6 x 6 system by elimination with row exchanges; returns log |det|.

    ``matrix`` (6, 6) and ``rhs`` (6,) are overwritten.
    """
    log_det = 0.0
    for k in range(6):
        pivot = k
        for i in range(k + 1, 6):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(6):
                matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
            rhs[k], rhs[pivot] = rhs[pivot], rhs[k]
        log_det += math.log(abs(matrix[k, k]))
        for i in range(k + 1, 6):
            f = matrix[i, k] / matrix[k, k]
            for j in range(k, 6):
                matrix[i, j] -= f * matrix[k, j]
            rhs[i] -= f * rhs[k]
    for k in range(5, -1, -1):
        t = rhs[k]
        for j in range(k + 1, 6):
            t -= matrix[k, j] * out[j]
        out[k] = t / matrix[k, k]
    return log_det


@njit(cache=True, nogil=True)
def angles_of_whitened(x: Any, ground: Any, inverse_roots: Any, angles: Any) -> None:
    """q = q^ + L^-T x for x (N, 3); ``inverse_roots`` (N, 3, 3) are L^-1."""
    for s in range(x.shape[0]):
        for i in range(3):
            t = ground[s, i]
            for j in range(3):
                t += inverse_roots[s, j, i] * x[s, j]
            angles[s, i] = t


@njit(cache=True, nogil=True)
def whitened_jacobian(
    angles: Any,
    form: int,
    inverse_roots: Any,
    centres: Any,
    frames: Any,
    axes: Any,
    halves: Any,
    residual: Any,
    jacobian: Any,
    scratch: Any,
) -> None:
    """Closure residual (6,) and its Jacobian (6, 3N) in the whitened coordinates."""
    linearise(angles, form, centres, frames, axes, halves)
    closure_residual(centres, frames, residual)
    closure_jacobian(centres, axes, scratch)
    for c in range(6):
        for s in range(angles.shape[0]):
            for i in range(3):
                t = 0.0
                for j in range(i + 1):
                    t += scratch[c, 3 * s + j] * inverse_roots[s, i, j]
                jacobian[c, 3 * s + i] = t


@njit(cache=True, nogil=True)
def gram(a: Any, b: Any, out: Any) -> None:
    """Products (6, 6) of the rows of a and b (6, n)."""
    for i in range(6):
        for j in range(6):
            t = 0.0
            for k in range(a.shape[1]):
                t += a[i, k] * b[j, k]
            out[i, j] = t


@njit(cache=True, nogil=True, error_model="numpy")
def to_tangent(jacobian: Any, v: Any) -> float:
    """Remove from v (n,) its part along the rows of ``jacobian``; returns log det of their Gram."""
    square, rhs, a = np.empty((6, 6)), np.zeros(6), np.empty(6)
    gram(jacobian, jacobian, square)
    for i in range(6):
        for k in range(v.shape[0]):
            rhs[i] += jacobian[i, k] * v[k]
    log_det = solve_six(square, rhs, a)
    for i in range(6):
        for k in range(v.shape[0]):
            v[k] -= a[i] * jacobian[i, k]
    return log_det


@njit(cache=True, nogil=True, error_model="numpy")
def project(
    start: Any,
    normals: Any,
    ground: Any,
    inverse_roots: Any,
    form: int,
    centres: Any,
    frames: Any,
    axes: Any,
    halves: Any,
    x: Any,
    jacobian: Any,
    scratch: Any,
) -> bool:
    """Closed shape x = start + normals^T a by Newton's method; False if it does not converge.

    ``jacobian`` (6, 3N) is left at the closed shape.
    """
    n = ground.shape[0]
    a, correction, residual = np.zeros(6), np.empty(6), np.empty(6)
    square = np.empty((6, 6))
    angles = np.empty((n, 3))
    for i in range(n):
        for j in range(3):
            x[i, j] = start[3 * i + j]
    for _ in range(_PROJECTION_STEPS):
        angles_of_whitened(x, ground, inverse_roots, angles)
        whitened_jacobian(
            angles, form, inverse_roots, centres, frames, axes, halves, residual, jacobian, scratch
        )
        worst = 0.0
        for i in range(6):
            if not abs(residual[i]) <= worst:
                worst = abs(residual[i])
        if worst < _CLOSED * n:
            return True
        if not worst < _DIVERGED:
            return False
        gram(jacobian, normals, square)
        solve_six(square, residual, correction)
        for i in range(6):
            a[i] -= correction[i]
        for s in range(n):
            for j in range(3):
                t = start[3 * s + j]
                for i in range(6):
                    t += normals[i, 3 * s + j] * a[i]
                x[s, j] = t
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def constrained_moves(
    angles: Any,
    ground: Any,
    inverse_roots: Any,
    form: int,
    moves: int,
    size: float,
    drift: float,
    use_volume: bool,
    check_reverse: bool,
    state: Any,
    counts: Any,
) -> None:
    """Constrained moves of a closed chain.

    Parameters
    ----------
    angles : (N, 3), closed, changed in place.
    inverse_roots : (N, 3, 3), L^-1 of each step's stiffness in RT.
    moves, size : number of moves, standard deviation of a step in each whitened direction.
    drift : 1 for steps about half a step of the gradient flow, 0 for a random walk.
    use_volume : whether the Gram determinant enters; False only to test the tests.
    check_reverse : whether a move that cannot be reversed is rejected; False likewise.
    counts : (4,), accepted, tried, not projected and not reversed moves, added to.
    """
    n = ground.shape[0]
    dim = 3 * n
    centres, frames = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    axes, halves = np.empty((n, 3, 3)), np.empty((n if form != 0 else 0, 5, 3))
    scratch, residual = np.empty((6, dim)), np.empty(6)
    here, there, back = np.empty((6, dim)), np.empty((6, dim)), np.empty((6, dim))
    x, y, z = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
    v, start, flow = np.empty(dim), np.empty(dim), np.empty(dim)
    new_angles = np.empty((n, 3))
    # x = L^T (q - q^), by solving with the triangular L^-1.
    for s in range(n):
        for i in range(2, -1, -1):
            t = angles[s, i] - ground[s, i]
            for j in range(i + 1, 3):
                t -= inverse_roots[s, j, i] * x[s, j]
            x[s, i] = t / inverse_roots[s, i, i]
    whitened_jacobian(
        angles, form, inverse_roots, centres, frames, axes, halves, residual, here, scratch
    )
    energy = 0.0
    for s in range(n):
        for i in range(3):
            energy += 0.5 * x[s, i] * x[s, i]
    for _ in range(moves):
        counts[TRIED] += 1
        draw = uniform(state)
        for s in range(n):
            for i in range(3):
                k = 3 * s + i
                flow[k] = -0.5 * drift * size * size * x[s, i]
                v[k] = flow[k] + size * normal(state)
        log_det = to_tangent(here, v)
        to_tangent(here, flow)
        forward = 0.0
        for s in range(n):
            for i in range(3):
                k = 3 * s + i
                forward += (v[k] - flow[k]) ** 2
                start[k] = x[s, i] + v[k]
        if not project(
            start,
            here,
            ground,
            inverse_roots,
            form,
            centres,
            frames,
            axes,
            halves,
            y,
            there,
            scratch,
        ):
            counts[NOT_PROJECTED] += 1
            continue
        new_energy = 0.0
        for s in range(n):
            for i in range(3):
                k = 3 * s + i
                v[k] = x[s, i] - y[s, i]
                flow[k] = -0.5 * drift * size * size * y[s, i]
                new_energy += 0.5 * y[s, i] * y[s, i]
        new_log_det = to_tangent(there, v)
        to_tangent(there, flow)
        backward = 0.0
        for s in range(n):
            for i in range(3):
                k = 3 * s + i
                backward += (v[k] - flow[k]) ** 2
                start[k] = y[s, i] + v[k]
        if check_reverse:
            found = project(
                start, there, ground, inverse_roots, form, centres, frames, axes, halves, z, back,
                scratch,
            )  # fmt: skip
            away = 0.0
            for s in range(n):
                for i in range(3):
                    away = max(away, abs(z[s, i] - x[s, i]))
            if not (found and away < _BACK):
                counts[NOT_REVERSED] += 1
                continue
        gain = energy - new_energy + (forward - backward) / (2.0 * size * size)
        if use_volume:
            gain += 0.5 * (log_det - new_log_det)
        if not draw < math.exp(min(gain, 0.0)):
            continue
        counts[ACCEPTED] += 1
        energy = new_energy
        for s in range(n):
            for i in range(3):
                x[s, i] = y[s, i]
        for c in range(6):
            for k in range(dim):
                here[c, k] = there[c, k]
    angles_of_whitened(x, ground, inverse_roots, new_angles)
    for s in range(n):
        for i in range(3):
            angles[s, i] = new_angles[s, i]


@njit(cache=True, nogil=True)
def run_closed(
    angles: Any,
    ground: Any,
    stiffness: Any,
    inverse_roots: Any,
    form: int,
    crankshafts: int,
    reach: float,
    constrained: int,
    size: float,
    thinning: int,
    state: Any,
    accepted: Any,
    counts: Any,
    shapes: Any,
    topology: Any,
) -> None:
    """A closed chain's states, recorded every ``thinning`` sweeps.

    A sweep is ``crankshafts`` crankshafts of at most ``reach`` radians, then ``constrained``
    constrained moves, which also take the round-off of closure away.

    Parameters
    ----------
    accepted, counts : (3, 2), (4,), of crankshafts and constrained moves, added to.
    shapes : (T, N, 3), angles, filled.
    topology : (T, 3), link, twist and writhe in turns, filled.
    """
    n = ground.shape[0]
    centres, frames = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    axes, halves = np.empty((n, 3, 3)), np.empty((n if form != 0 else 0, 5, 3))
    for t in range(shapes.shape[0]):
        for _ in range(thinning):
            if crankshafts > 0:
                crankshaft_sweep(
                    angles, ground, stiffness, form, crankshafts, reach, True, state, accepted
                )
            if constrained > 0:
                constrained_moves(
                    angles, ground, inverse_roots, form, constrained, size, 1.0, True, True, state,
                    counts,
                )  # fmt: skip
        for s in range(n):
            for i in range(3):
                shapes[t, s, i] = angles[s, i]
        linearise(angles, form, centres, frames, axes, halves)
        link, twist, writhe = link_of_ring(centres, frames)
        topology[t, 0], topology[t, 1], topology[t, 2] = link, twist, writhe
