"""Compiled rings as their canonical cut has them (``model.cut_kernels``), and the way back."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from dnacheck.equilibria.boundary_kernels import ring_boundary
from dnacheck.equilibria.discrete.kernels.moves import residuals
from dnacheck.equilibria.discrete.kernels.states import by_kind, evaluate, new_state
from dnacheck.model.chain_kernels import HingeSteps, fill_frames
from dnacheck.model.cut_kernels import rolled
from dnacheck.model.rigid_kernels import RigidSteps, fill_rigid_frames
from dnacheck.numerics.arrays import copy_rows, rolled_rows


@njit(cache=True, nogil=True)
def _rotated_hinges(steps: HingeSteps, cut: int) -> HingeSteps:
    ground, stiffness = rolled(steps.ground, steps.stiffness, cut)
    return HingeSteps(ground, stiffness, steps.form)


@njit(cache=True, nogil=True)
def _rotated_rigid(steps: RigidSteps, cut: int) -> RigidSteps:
    ground, stiffness = rolled(steps.ground, steps.stiffness, cut)
    return RigidSteps(ground, stiffness)


rotated = by_kind(_rotated_hinges, _rotated_rigid)
"""The ring's steps read from step ``cut`` on: (steps, cut)."""


@njit(cache=True, nogil=True)
def _hinge_shape(steps: HingeSteps, angles: Any, centres: Any, frames: Any) -> None:
    fill_frames(angles, steps.form, centres, frames)


@njit(cache=True, nogil=True)
def _rigid_shape(steps: RigidSteps, angles: Any, centres: Any, frames: Any) -> None:
    fill_rigid_frames(angles, centres, frames)


fill_shape = by_kind(_hinge_shape, _rigid_shape)
"""Centres (N+1, 3) and frames (N+1, 3, 3) of a chain: (steps, angles, centres, frames)."""


@njit(cache=True, nogil=True)
def roll_back(steps: Any, cut: int, angles: Any, multipliers: Any) -> tuple[float, float]:
    """Turn a ring found for ``rotated(steps, cut)`` into one of ``steps``, in place.

    The multipliers (force f, moment m) act at the first base pair and in its frame. Seen from
    another pair at r with frame R they are R^T f and R^T (m - r x f).

    Returns
    -------
    stationarity, closure : largest entries of the equations' residuals, as evaluated afterwards.
    """
    n = angles.shape[0]
    if cut != 0:
        centres = np.empty((n + 1, 3))
        frames = np.empty((n + 1, 3, 3))
        fill_shape(steps, angles, centres, frames)
        pair = n - cut
        rolled_rows(angles.copy(), pair, angles)
        f, m, r = multipliers[:3].copy(), multipliers[3:].copy(), centres[pair]
        m[0] -= r[1] * f[2] - r[2] * f[1]
        m[1] -= r[2] * f[0] - r[0] * f[2]
        m[2] -= r[0] * f[1] - r[1] * f[0]
        for j in range(3):
            multipliers[j], multipliers[3 + j] = 0.0, 0.0
            for i in range(3):
                multipliers[j] += frames[pair, i, j] * f[i]
                multipliers[3 + j] += frames[pair, i, j] * m[i]
    state = new_state(steps, ring_boundary())
    copy_rows(angles, state.angles)
    evaluate(state, steps)
    return residuals(state, multipliers, np.empty(angles.shape))
