"""Compiled frames of a chain of base-pair steps."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from dnacheck.numerics.rotations import NEAR_SINGULAR, wedge_angles, wedge_rotation
from dnacheck.numerics.trigonometry import arctangents

WEDGE = 0
MIDSTEP = 1

BOUND_STIFFNESS = 1e30
"""Diagonal of the stiffness of a step that a guest holds: it gives way to nothing.

Kernels leave such steps out of the unknowns (:func:`is_bound`); the number itself enters nothing.
"""
_BOUND_FROM = 1e25


class HingeSteps(NamedTuple):
    """Elastic steps of three angles about a pivot, as compiled kernels read them.

    Attributes
    ----------
    ground : ndarray, shape (N, 3)
        Unstressed tau, theta, phi in radians.
    stiffness : ndarray, shape (N, 3, 3)
        Symmetric, reduced.
    form : int
        ``WEDGE`` or ``MIDSTEP``.
    """

    ground: Any
    stiffness: Any
    form: int


@njit(cache=True, nogil=True)
def is_bound(stiffness: Any, s: int) -> bool:
    """Whether a guest holds step ``s`` at its ground values."""
    return stiffness[s, 0, 0] >= _BOUND_FROM


# Products of rotations drift from orthonormality by about one rounding error a step; one
# correction every so many steps keeps the drift at that of a single step.
_ORTHONORMALISE_EVERY = 64


@njit(cache=True, nogil=True)
def step_rotation(tau: float, theta: float, phi: float, form: int, out: Any) -> None:
    """Write the rotation of one step into ``out`` (3, 3).

    ``form`` 0 is the wedge R_tau R_theta R_phi of (2.1); 1 is the symmetrised mid-step product
    R_tau/2 R_theta/2 R_phi R_theta/2 R_tau/2, which reads the same on both strands.
    """
    if form == WEDGE:
        wedge_rotation(tau, theta, phi, out)
        return
    first = np.empty((3, 3))
    last = np.empty((3, 3))
    wedge_rotation(0.5 * tau, 0.5 * theta, phi, first)
    # R_theta/2 R_tau/2, the mirror image of the first two factors.
    ch, sh = math.cos(0.5 * theta), math.sin(0.5 * theta)
    ct, st = math.cos(0.5 * tau), math.sin(0.5 * tau)
    last[0, 0], last[0, 1], last[0, 2] = ct, -st, 0.0
    last[1, 0], last[1, 1], last[1, 2] = ch * st, ch * ct, sh
    last[2, 0], last[2, 1], last[2, 2] = -sh * st, -sh * ct, ch
    for i in range(3):
        for j in range(3):
            out[i, j] = (
                first[i, 0] * last[0, j] + first[i, 1] * last[1, j] + first[i, 2] * last[2, j]
            )


@njit(cache=True, nogil=True)
def orthonormalise(frame: Any) -> None:
    """Remove the first-order loss of orthonormality of ``frame`` (3, 3) in place."""
    old = frame.copy()
    for i in range(3):
        for j in range(3):
            total = 1.5 * old[i, j]
            for k in range(3):
                gram = old[0, k] * old[0, j] + old[1, k] * old[1, j] + old[2, k] * old[2, j]
                total -= 0.5 * old[i, k] * gram
            frame[i, j] = total


@njit(cache=True, nogil=True)
def fill_frames(angles: Any, form: int, centres: Any, frames: Any) -> None:
    """Write centres (N+1, 3) and frames (N+1, 3, 3) of a chain whose frame 0 is the identity.

    ``angles`` is (N, 3): tau, theta, phi of each step in radians. Centre i+1 lies one step length
    from centre i along d3(i); directors are the columns of a frame (equation 2.2).
    """
    n = angles.shape[0]
    step = np.empty((3, 3))
    for i in range(3):
        centres[0, i] = 0.0
        for j in range(3):
            frames[0, i, j] = 1.0 if i == j else 0.0
    for s in range(n):
        step_rotation(angles[s, 0], angles[s, 1], angles[s, 2], form, step)
        for i in range(3):
            centres[s + 1, i] = centres[s, i] + frames[s, i, 2]
            a, b, c = frames[s, i, 0], frames[s, i, 1], frames[s, i, 2]
            for j in range(3):
                frames[s + 1, i, j] = a * step[0, j] + b * step[1, j] + c * step[2, j]
        if (s + 1) % _ORTHONORMALISE_EVERY == 0:
            orthonormalise(frames[s + 1])


@njit(cache=True, nogil=True, error_model="numpy")
def fill_angles(frames: Any, form: int, angles: Any) -> None:
    """Write the step angles (N, 3) between successive frames (N+1, 3, 3)."""
    n = angles.shape[0]
    relative = np.empty((3, 3))
    if form != WEDGE:
        for s in range(n):
            _relative_rotation(frames, s, relative)
            angles[s, 0], angles[s, 1], angles[s, 2] = midstep_angles(relative)
        return
    # The entries of wedge_angles, gathered for one pass over all arctangents.
    y = np.empty((n, 3))
    x = np.empty((n, 3))
    flat = False
    for s in range(n):
        _relative_rotation(frames, s, relative)
        cosine = math.sqrt(relative[2, 0] ** 2 + relative[2, 2] ** 2)
        y[s, 0], x[s, 0] = -relative[0, 1], relative[1, 1]
        y[s, 1], x[s, 1] = -relative[2, 1], cosine
        y[s, 2], x[s, 2] = -relative[2, 0], relative[2, 2]
        flat = flat or cosine < NEAR_SINGULAR
    arctangents(y.reshape(3 * n), x.reshape(3 * n), angles.reshape(3 * n))
    if flat:
        for s in range(n):
            if x[s, 1] < NEAR_SINGULAR:
                _relative_rotation(frames, s, relative)
                angles[s, 0], angles[s, 1], angles[s, 2] = wedge_angles(relative)


@njit(cache=True, nogil=True)
def _relative_rotation(frames: Any, s: int, out: Any) -> None:
    """Frame s+1 seen from frame s, into ``out`` (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = (
                frames[s, 0, i] * frames[s + 1, 0, j]
                + frames[s, 1, i] * frames[s + 1, 1, j]
                + frames[s, 2, i] * frames[s + 1, 2, j]
            )


@njit(cache=True, nogil=True)
def midstep_angles(rotation: Any) -> tuple[float, float, float]:
    """Angles (tau, theta, phi) of the mid-step product, for bends below 180 degrees.

    With h = theta/2 the bend factor B = R_h R_phi R_h has the last column
    b = (cos h sin phi, sin h cos h (1 + cos phi), cos^2 h (1 + cos phi) - 1) and the last row
    (-b0, -b1, b2). The half twists turn the column by +tau/2 and the row by -tau/2.
    """
    u0, u1 = rotation[0, 2], rotation[1, 2]
    v0, v1 = -rotation[2, 0], -rotation[2, 1]
    if u0 * u0 + u1 * u1 < 1e-24:
        tau = math.atan2(rotation[1, 0] - rotation[0, 1], rotation[0, 0] + rotation[1, 1])
    else:
        tau = math.atan2(u1, u0) - math.atan2(v1, v0)
        tau -= 2.0 * math.pi * math.floor((tau + math.pi) / (2.0 * math.pi))
    c, s = math.cos(0.5 * tau), math.sin(0.5 * tau)
    b0 = c * u0 + s * u1
    b1 = -s * u0 + c * u1
    beyond = 1.0 + rotation[2, 2]
    theta = 2.0 * math.atan2(b1, beyond)
    phi = math.atan2(b0 / math.cos(0.5 * theta), 1.0 - b0 * b0 / max(beyond, 1e-300))
    return tau, theta, phi
