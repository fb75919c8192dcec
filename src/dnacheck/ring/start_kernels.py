"""Compiled starting shapes: planar circles of given link and register."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.model.chain_kernels import fill_angles


@njit(cache=True, nogil=True)
def fill_circle(ground: Any, form: int, link: int, register: float, angles: Any) -> None:
    """Angles (N, 3) of a closed planar ring with the given link.

    The centres lie on a regular N-gon. d1 turns about the edges by the ground twists plus an
    equal share of the excess that ``link`` turns ask for; at the first base pair it stands at
    ``register`` radians from the normal that points to the middle of the ring.
    """
    n = ground.shape[0]
    frames = np.empty((n + 1, 3, 3))
    total = 0.0
    for s in range(n):
        total += ground[s, 0]
    excess = (2.0 * math.pi * link - total) / n
    phase = register
    for s in range(n + 1):
        around = 2.0 * math.pi * s / n
        tx, ty = math.cos(around), math.sin(around)
        c, sn = math.cos(phase), math.sin(phase)
        # inward normal (-ty, tx, 0); tangent x normal = (0, 0, 1).
        frames[s, 0, 0], frames[s, 1, 0], frames[s, 2, 0] = -c * ty, c * tx, sn
        frames[s, 0, 1], frames[s, 1, 1], frames[s, 2, 1] = sn * ty, -sn * tx, c
        frames[s, 0, 2], frames[s, 1, 2], frames[s, 2, 2] = tx, ty, 0.0
        if s < n:
            phase += ground[s, 0] + excess
    fill_angles(frames, form, angles)
