"""Compiled first and second derivatives of ring closure, in linear time.

Changing one elementary angle of step i turns everything beyond it about an axis a through the far
end p of the step. The end of the chain moves by b = a x (r_N - p) and turns by a. The axes of a
step are, in the laboratory frame, a_tau = d3(i), a_theta = -R_z(tau) e1 carried by frame i, and
a_phi = d2(i+1). With multipliers (force, moment) of closure, the second derivatives of the
Lagrangian between an earlier angle j and a later one k are a_j . e_k with
e_k = b_k x force + a_k x moment / 2: a diagonal plus a semi-separable matrix of rank three, which
:mod:`dnacheck.equilibria.discrete.kernels.factorisation` factorises.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from dnacheck.model.chain_kernels import WEDGE, orthonormalise
from dnacheck.numerics.rotations import rotation_log
from dnacheck.numerics.trigonometry import sines_and_cosines

_ORTHONORMALISE_EVERY = 64


@njit(cache=True, nogil=True)
def linearise(angles: Any, form: int, centres: Any, frames: Any, axes: Any, halves: Any) -> None:
    """:func:`linearise_placed` of a chain whose frame 0 is the identity at the origin."""
    for i in range(3):
        centres[0, i] = 0.0
        for j in range(3):
            frames[0, i, j] = 1.0 if i == j else 0.0
    linearise_placed(angles, form, centres, frames, axes, halves)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def linearise_placed(
    angles: Any, form: int, centres: Any, frames: Any, axes: Any, halves: Any
) -> None:
    """Frames of a chain and the axis of every angle, in one pass.

    Parameters
    ----------
    angles : (N, 3), tau, theta, phi of each step in radians.
    form : 0 for the wedge (2.1), 1 for the symmetrised mid-step product.
    centres, frames, axes : (N+1, 3), (N+1, 3, 3), (N, 3, 3), filled, from the pose of the first
        base pair that they hold.
        ``axes[i, j]`` is the laboratory axis of angle j of step i.
    halves : (N, 5, 3) for the mid-step form, else empty; filled with the axes of its elementary
        turns tau/2, theta/2, phi, theta/2, tau/2.
    """
    n = angles.shape[0]
    turns = angles.copy()
    if form != WEDGE:
        for s in range(n):
            turns[s, 0] *= 0.5
            turns[s, 1] *= 0.5
    cosines = np.empty((n, 3))
    sines = np.empty((n, 3))
    sines_and_cosines(turns.reshape(3 * n), sines.reshape(3 * n), cosines.reshape(3 * n))
    for s in range(n):
        ct, st = cosines[s, 0], sines[s, 0]
        ch, sh = cosines[s, 1], sines[s, 1]
        cp, sp = cosines[s, 2], sines[s, 2]
        for i in range(3):
            d1, d2, d3 = frames[s, i, 0], frames[s, i, 1], frames[s, i, 2]
            x1 = ct * d1 + st * d2
            y1 = ct * d2 - st * d1
            y2 = ch * y1 - sh * d3
            z2 = sh * y1 + ch * d3
            x3 = cp * x1 - sp * z2
            z3 = sp * x1 + cp * z2
            centres[s + 1, i] = centres[s, i] + d3
            axes[s, 2, i] = y2
            if form == WEDGE:
                axes[s, 0, i] = d3
                axes[s, 1, i] = -x1
                frames[s + 1, i, 0] = x3
                frames[s + 1, i, 1] = y2
                frames[s + 1, i, 2] = z3
            else:
                y4 = ch * y2 - sh * z3
                z4 = sh * y2 + ch * z3
                axes[s, 0, i] = 0.5 * (d3 + z4)
                axes[s, 1, i] = -0.5 * (x1 + x3)
                frames[s + 1, i, 0] = ct * x3 + st * y4
                frames[s + 1, i, 1] = ct * y4 - st * x3
                frames[s + 1, i, 2] = z4
                halves[s, 0, i] = d3
                halves[s, 1, i] = -x1
                halves[s, 2, i] = y2
                halves[s, 3, i] = -x3
                halves[s, 4, i] = z4
        if (s + 1) % _ORTHONORMALISE_EVERY == 0:
            orthonormalise(frames[s + 1])


@njit(cache=True, nogil=True, fastmath={"contract"})
def energy_gradient(angles: Any, ground: Any, stiffness: Any, gradient: Any) -> float:
    """Reduced energy (2.3); its gradient (N, 3) is written into ``gradient``."""
    energy = 0.0
    for s in range(angles.shape[0]):
        x0 = angles[s, 0] - ground[s, 0]
        x1 = angles[s, 1] - ground[s, 1]
        x2 = angles[s, 2] - ground[s, 2]
        for j in range(3):
            g = stiffness[s, j, 0] * x0 + stiffness[s, j, 1] * x1 + stiffness[s, j, 2] * x2
            gradient[s, j] = g
        energy += 0.5 * (gradient[s, 0] * x0 + gradient[s, 1] * x1 + gradient[s, 2] * x2)
    return energy


@njit(cache=True, nogil=True, fastmath={"contract"})
def closure_residual(centres: Any, frames: Any, out: Any) -> None:
    """End-to-end vector in steps and end rotation vector in radians, into ``out`` (6,)."""
    n = centres.shape[0] - 1
    for i in range(3):
        out[i] = centres[n, i]
    rotation_log(frames[n], out[3:])


@njit(cache=True, nogil=True, fastmath={"contract"})
def closure_jacobian(centres: Any, axes: Any, out: Any) -> None:
    """Closure Jacobian (6, 3N): rows are the end's displacement (3) and rotation (3)."""
    n = axes.shape[0]
    for s in range(n):
        x = centres[n, 0] - centres[s + 1, 0]
        y = centres[n, 1] - centres[s + 1, 1]
        z = centres[n, 2] - centres[s + 1, 2]
        for j in range(3):
            a0, a1, a2 = axes[s, j, 0], axes[s, j, 1], axes[s, j, 2]
            k = 3 * s + j
            out[0, k] = a1 * z - a2 * y
            out[1, k] = a2 * x - a0 * z
            out[2, k] = a0 * y - a1 * x
            out[3, k] = a0
            out[4, k] = a1
            out[5, k] = a2


@njit(cache=True, nogil=True, fastmath={"contract"})
def lagrangian_gradient(
    gradient: Any, centres: Any, axes: Any, multipliers: Any, out: Any
) -> float:
    """Gradient + (closure Jacobian)^T multipliers into ``out`` (N, 3); returns the largest."""
    n = axes.shape[0]
    f0, f1, f2 = multipliers[0], multipliers[1], multipliers[2]
    worst = 0.0
    for s in range(n):
        x = centres[n, 0] - centres[s + 1, 0]
        y = centres[n, 1] - centres[s + 1, 1]
        z = centres[n, 2] - centres[s + 1, 2]
        # a . ((r_N - p) x force + moment)
        m0 = y * f2 - z * f1 + multipliers[3]
        m1 = z * f0 - x * f2 + multipliers[4]
        m2 = x * f1 - y * f0 + multipliers[5]
        for j in range(3):
            g = gradient[s, j] + axes[s, j, 0] * m0 + axes[s, j, 1] * m1 + axes[s, j, 2] * m2
            out[s, j] = g
            if not abs(g) <= worst:
                worst = abs(g)
    return worst
