"""Compiled energy and closure of chains of rigid base-pair steps, in linear time.

Counterpart of :mod:`dnacheck.equilibria.discrete.kernels.closure` for six coordinates a step.
"""

from __future__ import annotations

from typing import Any

from numba import njit

from dnacheck.model.rigid_kernels import RigidKinematics


@njit(cache=True, nogil=True, fastmath={"contract"})
def rigid_energy_gradient(coordinates: Any, ground: Any, stiffness: Any, gradient: Any) -> float:
    """Energy 1/2 (q - ground)^T K (q - ground); its gradient (N, 6) into ``gradient``."""
    energy = 0.0
    for s in range(coordinates.shape[0]):
        x0, x1 = coordinates[s, 0] - ground[s, 0], coordinates[s, 1] - ground[s, 1]
        x2, x3 = coordinates[s, 2] - ground[s, 2], coordinates[s, 3] - ground[s, 3]
        x4, x5 = coordinates[s, 4] - ground[s, 4], coordinates[s, 5] - ground[s, 5]
        for j in range(6):
            k = stiffness[s, j]
            gradient[s, j] = k[0] * x0 + k[1] * x1 + k[2] * x2 + k[3] * x3 + k[4] * x4 + k[5] * x5
        g = gradient[s]
        angles = g[0] * x0 + g[1] * x1 + g[2] * x2
        energy += 0.5 * (angles + g[3] * x3 + g[4] * x4 + g[5] * x5)
    return energy


@njit(cache=True, nogil=True, fastmath={"contract"})
def rigid_jacobian(kinematics: RigidKinematics, out: Any) -> None:
    """Closure Jacobian (6, 6N): rows are the end's displacement (3) and rotation (3)."""
    centres, axes, velocities = kinematics.centres, kinematics.axes, kinematics.velocities
    n = axes.shape[0]
    for s in range(n):
        x = centres[n, 0] - centres[s + 1, 0]
        y = centres[n, 1] - centres[s + 1, 1]
        z = centres[n, 2] - centres[s + 1, 2]
        for j in range(3):
            a0, a1, a2 = axes[s, j, 0], axes[s, j, 1], axes[s, j, 2]
            k = 6 * s + j
            out[0, k] = velocities[s, j, 0] + a1 * z - a2 * y
            out[1, k] = velocities[s, j, 1] + a2 * x - a0 * z
            out[2, k] = velocities[s, j, 2] + a0 * y - a1 * x
            out[3, k], out[4, k], out[5, k] = a0, a1, a2
            for i in range(3):
                out[i, k + 3] = velocities[s, 3 + j, i]
                out[3 + i, k + 3] = 0.0


@njit(cache=True, nogil=True, fastmath={"contract"})
def rigid_lagrangian_gradient(
    gradient: Any, kinematics: RigidKinematics, scales: Any, multipliers: Any, out: Any
) -> float:
    """Gradient + (closure Jacobian)^T multipliers into ``out`` (N, 6); returns the largest.

    Those of the translations count by their ``scales`` (N, 3).
    """
    centres, axes, velocities = kinematics.centres, kinematics.axes, kinematics.velocities
    n = axes.shape[0]
    f0, f1, f2 = multipliers[0], multipliers[1], multipliers[2]
    worst = 0.0
    for s in range(n):
        x = centres[n, 0] - centres[s + 1, 0]
        y = centres[n, 1] - centres[s + 1, 1]
        z = centres[n, 2] - centres[s + 1, 2]
        m0 = y * f2 - z * f1 + multipliers[3]
        m1 = z * f0 - x * f2 + multipliers[4]
        m2 = x * f1 - y * f0 + multipliers[5]
        for j in range(6):
            v = velocities[s, j]
            g = gradient[s, j] + v[0] * f0 + v[1] * f1 + v[2] * f2
            if j < 3:
                g += axes[s, j, 0] * m0 + axes[s, j, 1] * m1 + axes[s, j, 2] * m2
            out[s, j] = g
            if j >= 3:
                g *= scales[s, j - 3]
            if not abs(g) <= worst:
                worst = abs(g)
    return worst
