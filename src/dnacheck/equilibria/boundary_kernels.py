"""Compiled boundaries of a chain: where its end has to be, in which components, under which loads.

A chain is placed so that the target of its end is the laboratory frame: it starts at the inverse of
the target's pose. Rows of closure, multipliers and loads are then components in the target's frame
and need no turning; for a ring nothing is placed at all.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from dnacheck.numerics.rotations import rotation_log
from dnacheck.numerics.small_systems import solve_small


class Boundary(NamedTuple):
    """What the end of a chain is held to, as compiled kernels read it.

    Attributes
    ----------
    position, rotation : ndarray, shapes (3,) and (3, 3)
        Pose of the target seen from the first base pair, in step lengths and directors in columns.
    fixed : ndarray of bool, shape (6,)
        Which components of the end are held: displacement along d1, d2, d3 of the target and
        rotation about them. Of the rotations all three, the first two (d3 stays aligned and the
        end may turn about it) or none.
    loads : ndarray, shape (6,)
        Force (reduced energy per step length) and torque (reduced energy per radian) on the free
        components, in the target's frame; of torques only that about d3 of an aligned end.
    """

    position: Any
    rotation: Any
    fixed: Any
    loads: Any


@njit(cache=True, nogil=True)
def ring_boundary() -> Boundary:
    """The end on the start, in all six components."""
    return Boundary(np.zeros(3), np.eye(3), np.ones(6, dtype=np.bool_), np.zeros(6))


@njit(cache=True, nogil=True)
def place_start(boundary: Boundary, centre: Any, frame: Any) -> None:
    """Pose of the first base pair in the target's frame, into ``centre`` (3,), ``frame`` (3, 3)."""
    for i in range(3):
        centre[i] = 0.0
        for j in range(3):
            frame[i, j] = boundary.rotation[j, i]
            centre[i] -= boundary.rotation[j, i] * boundary.position[j]


@njit(cache=True, nogil=True, error_model="numpy")
def end_residual(boundary: Boundary, centre: Any, frame: Any, turn: Any, out: Any) -> float:
    """Residual of the held components of an end into ``out`` (6,), zero for the free ones.

    The rotation is the body-frame logarithm. Where only d3 is held it is that of the rotation which
    carries the target's d3 to the end's the shortest way: the target turns about its d3 with the
    end. ``turn`` (1,) keeps that angle, counted from its last value without jumps; it is read and
    filled only under a torque.

    Returns
    -------
    work : of the loads, to be taken off the elastic energy.
    """
    work = 0.0
    fixed, loads = boundary.fixed, boundary.loads
    for i in range(3):
        out[3 + i] = 0.0
        if fixed[i]:
            out[i] = centre[i]
        else:
            out[i] = 0.0
            work += loads[i] * centre[i]
    if fixed[5]:
        rotation_log(frame, out[3:])
    elif fixed[3]:
        sine = math.hypot(frame[0, 2], frame[1, 2])
        factor = 1.0
        if sine > 1e-12 or frame[2, 2] < 0.0:
            factor = math.atan2(sine, frame[2, 2]) / sine
        out[3], out[4] = -factor * frame[1, 2], factor * frame[0, 2]
        if loads[5] != 0.0:
            angle = math.atan2(frame[1, 0] - frame[0, 1], frame[0, 0] + frame[1, 1])
            turn[0] = angle + 2.0 * math.pi * round((turn[0] - angle) / (2.0 * math.pi))
            work += loads[5] * turn[0]
    return work


@njit(cache=True, nogil=True)
def solve_held(
    boundary: Boundary, small: Any, rhs: Any, length: float, out: Any
) -> tuple[int, float]:
    """Solve the Schur system (6, 7) of the held components; see :func:`solve_small`.

    The free ones leave it: their rows of ``small`` and ``rhs`` become those of the identity and of
    zero, which adds nothing to the inertia or the determinant.
    """
    for i in range(6):
        if not boundary.fixed[i]:
            for j in range(6):
                small[i, j] = 0.0
                small[j, i] = 0.0
            small[i, i] = 1.0
            rhs[i] = 0.0
    return solve_small(small, rhs, length, out)
