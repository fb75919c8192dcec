"""Compiled starting shapes of rings of rigid base-pair steps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.model.rigid_kernels import RigidSteps, fill_rigid_coordinates, mean_helix


@njit(cache=True, nogil=True, error_model="numpy")
def fill_rigid_circle(steps: RigidSteps, link: int, register: float, coordinates: Any) -> None:
    """Coordinates (N, 6) of a closed ring with the given link, bent from the mean helix.

    The axis of the helix of the mean step (:func:`mean_helix`) follows a circle. The helix turns
    about it by the ground twists plus an equal share of the excess that ``link`` turns ask for; at
    the first base pair it stands at ``register`` radians from the normal that points to the middle
    of the ring.
    """
    ground = steps.ground
    n = ground.shape[0]
    tilted, offset = np.empty((3, 3)), np.empty(3)
    turn, rise = mean_helix(ground, tilted, offset)
    total = 0.0
    for s in range(n):
        total += ground[s, 0]
    mean = total / n
    excess = (2.0 * math.pi * link - n * turn) / n
    radius = rise / (2.0 * math.sin(math.pi / n))
    centres = np.empty((n + 1, 3))
    frames = np.empty((n + 1, 3, 3))
    turned = np.empty((3, 3))
    phase = register
    for s in range(n + 1):
        around = 2.0 * math.pi * s / n
        tx, ty = math.cos(around), math.sin(around)
        c, sn = math.cos(phase), math.sin(phase)
        # Columns: inward normal (-ty, tx, 0) and e3 turned by the phase, then the tangent.
        turned[0, 0], turned[1, 0], turned[2, 0] = -c * ty, c * tx, sn
        turned[0, 1], turned[1, 1], turned[2, 1] = sn * ty, -sn * tx, c
        turned[0, 2], turned[1, 2], turned[2, 2] = tx, ty, 0.0
        axis = (radius * ty, -radius * tx, 0.0)
        for i in range(3):
            centres[s, i] = axis[i]
            for j in range(3):
                centres[s, i] += turned[i, j] * offset[j]
                frames[s, i, j] = 0.0
                for k in range(3):
                    frames[s, i, j] += turned[i, k] * tilted[k, j]
        if s < n:
            phase += ground[s, 0] - mean + turn + excess
    fill_rigid_coordinates(centres, frames, coordinates)


@njit(cache=True, nogil=True)
def rigid_registers(steps: RigidSteps, link: int, registers: Any) -> int:
    """Registers from which a ring of rigid steps is sought: two, half a turn apart."""
    registers[0], registers[1] = 0.0, math.pi
    return 2
