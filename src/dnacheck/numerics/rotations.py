"""Rotation algebra: wedge angles, quaternions, exponential and logarithm.

All functions are compiled, take and fill arrays, and never raise. Matrices are (3, 3) with the
directors d1, d2, d3 as columns. Quaternions are (4,) with the scalar part last, as in equation
(4.8) of Manning, Maddocks & Kahn (1996). Angles are in radians.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

# Below this squared angle the Taylor series of the exponential is exact to round-off.
_SMALL_ANGLE_SQUARED = 1e-8

NEAR_SINGULAR = 1e-12
"""cos(theta) below which the wedge angles tau and phi are not separate any more."""


@njit(cache=True, nogil=True)
def wedge_rotation(tau: float, theta: float, phi: float, out: Any) -> None:
    """Write R_tau R_theta R_phi of equation (2.1) into ``out`` (3, 3).

    R_theta is a rotation by -theta about d1, R_phi by +phi about d2, R_tau by +tau about d3.
    """
    ct, st = math.cos(tau), math.sin(tau)
    ch, sh = math.cos(theta), math.sin(theta)
    cp, sp = math.cos(phi), math.sin(phi)
    out[0, 0] = cp * ct + sh * sp * st
    out[0, 1] = -ch * st
    out[0, 2] = sp * ct - sh * cp * st
    out[1, 0] = cp * st - sh * sp * ct
    out[1, 1] = ch * ct
    out[1, 2] = sp * st + sh * cp * ct
    out[2, 0] = -ch * sp
    out[2, 1] = -sh
    out[2, 2] = ch * cp


@njit(cache=True, nogil=True)
def wedge_angles(rotation: Any) -> tuple[float, float, float]:
    """Angles (tau, theta, phi) of a rotation matrix, the inverse of :func:`wedge_rotation`.

    theta lies in [-pi/2, pi/2], tau and phi in (-pi, pi]. atan2 replaces the arcsin printed in
    Section IX, which is valid only for angles within 90 degrees. At theta = +-pi/2 only
    tau -+ phi is defined; phi = 0 is returned there.
    """
    cos_theta = math.hypot(rotation[2, 0], rotation[2, 2])
    theta = math.atan2(-rotation[2, 1], cos_theta)
    if cos_theta < NEAR_SINGULAR:
        tau = math.atan2(rotation[1, 0], rotation[0, 0])
        return tau, theta, 0.0
    tau = math.atan2(-rotation[0, 1], rotation[1, 1])
    phi = math.atan2(-rotation[2, 0], rotation[2, 2])
    return tau, theta, phi


@njit(cache=True, nogil=True)
def matrix_from_quaternion(q: Any, out: Any) -> None:
    """Write the directors (4.8) of the quaternion ``q`` (4,) into the columns of ``out`` (3, 3)."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    out[0, 0] = x * x - y * y - z * z + w * w
    out[1, 0] = 2.0 * (x * y + z * w)
    out[2, 0] = 2.0 * (x * z - y * w)
    out[0, 1] = 2.0 * (x * y - z * w)
    out[1, 1] = -x * x + y * y - z * z + w * w
    out[2, 1] = 2.0 * (y * z + x * w)
    out[0, 2] = 2.0 * (x * z + y * w)
    out[1, 2] = 2.0 * (y * z - x * w)
    out[2, 2] = -x * x - y * y + z * z + w * w


@njit(cache=True, nogil=True)
def quaternion_from_matrix(rotation: Any, out: Any) -> None:
    """Write the unit quaternion of ``rotation`` (3, 3) into ``out`` (4,), scalar part >= 0.

    The largest of the four components is computed first (Shepperd's choice), so no division by a
    small number occurs anywhere on the rotation group.
    """
    xx, yy, zz = rotation[0, 0], rotation[1, 1], rotation[2, 2]
    trace = xx + yy + zz
    if trace >= xx and trace >= yy and trace >= zz:
        out[3] = 0.5 * math.sqrt(max(0.0, 1.0 + trace))
        f = 0.25 / out[3]
        out[0] = f * (rotation[2, 1] - rotation[1, 2])
        out[1] = f * (rotation[0, 2] - rotation[2, 0])
        out[2] = f * (rotation[1, 0] - rotation[0, 1])
    elif xx >= yy and xx >= zz:
        out[0] = 0.5 * math.sqrt(max(0.0, 1.0 + xx - yy - zz))
        f = 0.25 / out[0]
        out[1] = f * (rotation[0, 1] + rotation[1, 0])
        out[2] = f * (rotation[0, 2] + rotation[2, 0])
        out[3] = f * (rotation[2, 1] - rotation[1, 2])
    elif yy >= zz:
        out[1] = 0.5 * math.sqrt(max(0.0, 1.0 - xx + yy - zz))
        f = 0.25 / out[1]
        out[0] = f * (rotation[0, 1] + rotation[1, 0])
        out[2] = f * (rotation[1, 2] + rotation[2, 1])
        out[3] = f * (rotation[0, 2] - rotation[2, 0])
    else:
        out[2] = 0.5 * math.sqrt(max(0.0, 1.0 - xx - yy + zz))
        f = 0.25 / out[2]
        out[0] = f * (rotation[0, 2] + rotation[2, 0])
        out[1] = f * (rotation[1, 2] + rotation[2, 1])
        out[3] = f * (rotation[1, 0] - rotation[0, 1])
    if out[3] < 0.0:
        for i in range(4):
            out[i] = -out[i]


@njit(cache=True, nogil=True)
def rotation_log(rotation: Any, out: Any) -> None:
    """Write the rotation vector of ``rotation`` (3, 3) into ``out`` (3,); its length is in [0, pi].

    Goes through the quaternion and atan2, accurate to round-off near 0 and near pi alike.
    """
    q = np.empty(4)
    quaternion_from_matrix(rotation, q)
    length = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
    factor = 2.0 if length < 1e-150 else 2.0 * math.atan2(length, q[3]) / length
    for i in range(3):
        out[i] = factor * q[i]


@njit(cache=True, nogil=True)
def rotation_exp(vector: Any, out: Any) -> None:
    """Write the rotation matrix of the rotation vector ``vector`` (3,) into ``out`` (3, 3)."""
    x, y, z = vector[0], vector[1], vector[2]
    square = x * x + y * y + z * z
    if square < _SMALL_ANGLE_SQUARED:
        a = 1.0 - square / 6.0
        b = 0.5 - square / 24.0
    else:
        angle = math.sqrt(square)
        a = math.sin(angle) / angle
        half = math.sin(0.5 * angle)
        b = 2.0 * half * half / square
    out[0, 0] = 1.0 - b * (y * y + z * z)
    out[1, 1] = 1.0 - b * (x * x + z * z)
    out[2, 2] = 1.0 - b * (x * x + y * y)
    out[0, 1] = b * x * y - a * z
    out[1, 0] = b * x * y + a * z
    out[0, 2] = b * x * z + a * y
    out[2, 0] = b * x * z - a * y
    out[1, 2] = b * y * z - a * x
    out[2, 1] = b * y * z + a * x
