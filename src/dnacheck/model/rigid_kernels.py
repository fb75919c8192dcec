"""Compiled kinematics of rigid base-pair steps with six parameters (El Hassan & Calladine 1995).

A step's coordinates are (twist, tilt, roll, shift, slide, rise): twist first, so that the first
column of every chain's coordinates is its twist. With the bend vector beta = (tilt, roll, 0), seen
from the frame Q = frame Rz(twist/2),

    next frame = Q exp(beta) Rz(twist/2),   mid-step frame M = Q exp(beta/2),
    next centre = centre + M (shift, slide, rise).

This is Rz(twist/2 - delta) Ry(Gamma) Rz(twist/2 + delta) with tilt = Gamma sin(delta) and
roll = Gamma cos(delta), written without the angle delta, which has no value for a straight step.
Every function of Gamma below is an even power series, summed as such where Gamma is small. Angles
are in radians, lengths in the chain's unit of length.

J. Mol. Biol. 251, 648 (1995); Lu & Olson, Nucleic Acids Res. 31, 5108 (2003).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from dnacheck.model.chain_kernels import orthonormalise
from dnacheck.numerics.rotations import rotation_log
from dnacheck.numerics.trigonometry import sines_and_cosines
from dnacheck.numerics.vectors import combine, cross, dot

RIGID_COORDINATES = ("twist", "tilt", "roll", "shift", "slide", "rise")
"""Order of a rigid step's coordinates in every array of this package."""

_ORTHONORMALISE_EVERY = 64
# Below this squared bend the first seven terms of a series are exact to round-off.
_SHORT_SERIES = 0.0625


class RigidSteps(NamedTuple):
    """Elastic rigid base-pair steps, as compiled kernels read them.

    Attributes
    ----------
    ground : ndarray, shape (N, 6)
        Unstressed coordinates in the order of ``RIGID_COORDINATES``; radians and units of length.
    stiffness : ndarray, shape (N, 6, 6)
        Symmetric.
    """

    ground: Any
    stiffness: Any


class RigidKinematics(NamedTuple):
    """Where a chain of rigid steps lies and how its coordinates move it, laboratory frame.

    Attributes
    ----------
    centres, frames : ndarray, shapes (N+1, 3) and (N+1, 3, 3)
        Directors in the columns of a frame.
    axes : ndarray, shape (N, 3, 3)
        Axis about which twist, tilt and roll of a step turn everything beyond it.
    velocities : ndarray, shape (N, 6, 3)
        Derivatives of the next centre by the six coordinates. The three of the translations are
        the columns of the mid-step frame.
    local : ndarray, shape (N, 18)
        For second derivatives: the first two columns of Q, the axes by which tilt and roll turn
        the mid-step frame, and the coefficients (b, c, d) of :func:`bend_series` at Gamma and at
        Gamma/2.
    """

    centres: Any
    frames: Any
    axes: Any
    velocities: Any
    local: Any


@njit(cache=True, nogil=True)
def new_kinematics(n: int) -> RigidKinematics:
    """Room for ``n`` steps, frame 0 the identity at the origin."""
    kinematics = RigidKinematics(
        np.zeros((n + 1, 3)),
        np.zeros((n + 1, 3, 3)),
        np.empty((n, 3, 3)),
        np.empty((n, 6, 3)),
        np.empty((n, 18)),
    )
    for i in range(3):
        kinematics.frames[0, i, i] = 1.0
    return kinematics


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def bend_series(x: float) -> tuple[float, float, float, float]:
    """Functions of a bend G by its square x, free of singularities.

    Returns
    -------
    a : (1 - cos G)/G^2
    b : (G - sin G)/G^3
    c : (da/dG)/G = (G sin G - 2 (1 - cos G))/G^4
    d : (db/dG)/G = (G (1 - cos G) - 3 (G - sin G))/G^5
    """
    if x < _SHORT_SERIES:
        a = 1.0 / 3628800.0 - x * (1.0 / 479001600.0 - x / 87178291200.0)
        a = 0.5 - x * (1.0 / 24.0 - x * (1.0 / 720.0 - x * (1.0 / 40320.0 - x * a)))
        b = 1.0 / 39916800.0 - x * (1.0 / 6227020800.0 - x / 1307674368000.0)
        b = 1.0 / 6.0 - x * (1.0 / 120.0 - x * (1.0 / 5040.0 - x * (1.0 / 362880.0 - x * b)))
        c = 4.0 / 3628800.0 - x * (5.0 / 479001600.0 - x * 6.0 / 87178291200.0)
        c = -2.0 * (1.0 / 24.0 - x * (2.0 / 720.0 - x * (3.0 / 40320.0 - x * c)))
        d = 4.0 / 39916800.0 - x * (5.0 / 6227020800.0 - x * 6.0 / 1307674368000.0)
        d = -2.0 * (1.0 / 120.0 - x * (2.0 / 5040.0 - x * (3.0 / 362880.0 - x * d)))
        return a, b, c, d
    g = math.sqrt(x)
    s, h = math.sin(g), math.sin(0.5 * g)
    v = 2.0 * h * h
    return (
        v / x,
        (g - s) / (x * g),
        (g * s - 2.0 * v) / (x * x),
        (g * v - 3.0 * (g - s)) / (x * x * g),
    )


@njit(cache=True, nogil=True)
def _put(out: Any, s: int, j: int, v: Any) -> None:
    out[s, j, 0], out[s, j, 1], out[s, j, 2] = v[0], v[1], v[2]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def linearise_rigid(coordinates: Any, kinematics: RigidKinematics) -> None:
    """Fill centres, frames and first derivatives of a chain from the pose of frame 0 on.

    ``coordinates`` is (N, 6) in the order of ``RIGID_COORDINATES``. Second derivatives within a
    step are in :mod:`dnacheck.equilibria.discrete.kernels.rigid_factorisation`.
    """
    centres, frames = kinematics.centres, kinematics.frames
    axes, velocities, local = kinematics.axes, kinematics.velocities, kinematics.local
    n = coordinates.shape[0]
    half = 0.5 * coordinates[:, 0]
    cosines = np.empty(n)
    sines = np.empty(n)
    sines_and_cosines(half, sines, cosines)
    for s in range(n):
        p, r = coordinates[s, 1], coordinates[s, 2]
        square = p * p + r * r
        a, b, c, d = bend_series(square)
        ha, hb, hc, hd = bend_series(0.25 * square)
        ct, st = cosines[s], sines[s]
        f1 = (frames[s, 0, 0], frames[s, 1, 0], frames[s, 2, 0])
        f2 = (frames[s, 0, 1], frames[s, 1, 1], frames[s, 2, 1])
        z = (frames[s, 0, 2], frames[s, 1, 2], frames[s, 2, 2])
        x = (ct * f1[0] + st * f2[0], ct * f1[1] + st * f2[1], ct * f1[2] + st * f2[2])
        y = (ct * f2[0] - st * f1[0], ct * f2[1] - st * f1[1], ct * f2[2] - st * f1[2])
        # exp(beta), with sin(G)/G = 1 - b G^2 and cos(G) = 1 - a G^2.
        sn = 1.0 - b * square
        mixed = a * p * r
        n1 = combine((1.0 - a * r * r, mixed, -sn * r), x, y, z)
        n2 = combine((mixed, 1.0 - a * p * p, sn * p), x, y, z)
        n3 = combine((sn * r, -sn * p, 1.0 - a * square), x, y, z)
        for i in range(3):
            frames[s + 1, i, 0] = ct * n1[i] + st * n2[i]
            frames[s + 1, i, 1] = ct * n2[i] - st * n1[i]
            frames[s + 1, i, 2] = n3[i]
        # The mid-step frame.
        qp, qr = 0.5 * p, 0.5 * r
        sn = 1.0 - 0.25 * hb * square
        mixed = ha * qp * qr
        m1 = combine((1.0 - ha * qr * qr, mixed, -sn * qr), x, y, z)
        m2 = combine((mixed, 1.0 - ha * qp * qp, sn * qp), x, y, z)
        m3 = combine((sn * qr, -sn * qp, 1.0 - 0.25 * ha * square), x, y, z)
        arm = combine((coordinates[s, 3], coordinates[s, 4], coordinates[s, 5]), m1, m2, m3)
        # Axes: the left Jacobian of exp, applied to the two bends.
        mixed = b * p * r
        _put(axes, s, 0, (0.5 * (z[0] + n3[0]), 0.5 * (z[1] + n3[1]), 0.5 * (z[2] + n3[2])))
        _put(axes, s, 1, combine((1.0 - b * r * r, mixed, -a * r), x, y, z))
        _put(axes, s, 2, combine((mixed, 1.0 - b * p * p, a * p), x, y, z))
        mixed = 0.5 * hb * qp * qr
        mp = combine((0.5 - 0.5 * hb * qr * qr, mixed, -0.5 * ha * qr), x, y, z)
        mr = combine((mixed, 0.5 - 0.5 * hb * qp * qp, 0.5 * ha * qp), x, y, z)
        _put(velocities, s, 0, cross((0.5 * z[0], 0.5 * z[1], 0.5 * z[2]), arm))
        _put(velocities, s, 1, cross(mp, arm))
        _put(velocities, s, 2, cross(mr, arm))
        _put(velocities, s, 3, m1)
        _put(velocities, s, 4, m2)
        _put(velocities, s, 5, m3)
        for i in range(3):
            centres[s + 1, i] = centres[s, i] + arm[i]
            local[s, i], local[s, 3 + i] = x[i], y[i]
            local[s, 6 + i], local[s, 9 + i] = mp[i], mr[i]
        local[s, 12], local[s, 13], local[s, 14] = b, c, d
        local[s, 15], local[s, 16], local[s, 17] = hb, hc, hd
        if (s + 1) % _ORTHONORMALISE_EVERY == 0:
            orthonormalise(frames[s + 1])


@njit(cache=True, nogil=True)
def fill_rigid_frames(coordinates: Any, centres: Any, frames: Any) -> None:
    """Write centres (N+1, 3) and frames (N+1, 3, 3) of a chain whose frame 0 is the identity."""
    kinematics = new_kinematics(coordinates.shape[0])
    linearise_rigid(coordinates, kinematics)
    centres[:] = kinematics.centres
    frames[:] = kinematics.frames


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def fill_rigid_coordinates(centres: Any, frames: Any, coordinates: Any) -> None:
    """Write the coordinates (N, 6) of the steps between successive base pairs, bends below pi.

    Turning exp(beta) on both sides by twist/2 leaves the sum and the difference of its upper left
    block's entries such that twist = atan2(R10 - R01, R00 + R11), for every bend.
    """
    for s in range(coordinates.shape[0]):
        f1 = (frames[s, 0, 0], frames[s, 1, 0], frames[s, 2, 0])
        f2 = (frames[s, 0, 1], frames[s, 1, 1], frames[s, 2, 1])
        f3 = (frames[s, 0, 2], frames[s, 1, 2], frames[s, 2, 2])
        g1 = (frames[s + 1, 0, 0], frames[s + 1, 1, 0], frames[s + 1, 2, 0])
        g2 = (frames[s + 1, 0, 1], frames[s + 1, 1, 1], frames[s + 1, 2, 1])
        g3 = (frames[s + 1, 0, 2], frames[s + 1, 1, 2], frames[s + 1, 2, 2])
        twist = math.atan2(dot(f2, g1) - dot(f1, g2), dot(f1, g1) + dot(f2, g2))
        ct, st = math.cos(0.5 * twist), math.sin(0.5 * twist)
        x = (ct * f1[0] + st * f2[0], ct * f1[1] + st * f2[1], ct * f1[2] + st * f2[2])
        y = (ct * f2[0] - st * f1[0], ct * f2[1] - st * f1[1], ct * f2[2] - st * f1[2])
        u, v = dot(x, g3), dot(y, g3)
        sine = math.sqrt(u * u + v * v)
        ratio = 1.0 if sine < 1e-9 else math.atan2(sine, dot(f3, g3)) / sine
        p, r = -ratio * v, ratio * u
        coordinates[s, 0], coordinates[s, 1], coordinates[s, 2] = twist, p, r
        square = 0.25 * (p * p + r * r)
        ha, hb, _, _ = bend_series(square)
        qp, qr = 0.5 * p, 0.5 * r
        sn = 1.0 - hb * square
        mixed = ha * qp * qr
        arm = (
            centres[s + 1, 0] - centres[s, 0],
            centres[s + 1, 1] - centres[s, 1],
            centres[s + 1, 2] - centres[s, 2],
        )
        w = (dot(x, arm), dot(y, arm), dot(f3, arm))
        coordinates[s, 3] = (1.0 - ha * qr * qr) * w[0] + mixed * w[1] - sn * qr * w[2]
        coordinates[s, 4] = mixed * w[0] + (1.0 - ha * qp * qp) * w[1] + sn * qp * w[2]
        coordinates[s, 5] = sn * qr * w[0] - sn * qp * w[1] + (1.0 - ha * square) * w[2]


@njit(cache=True, nogil=True, error_model="numpy")
def mean_helix(ground: Any, tilted: Any, offset: Any) -> tuple[float, float]:
    """Straight helix of the mean step.

    A uniform chain of steps with the mean ground coordinates is a helix: base pair s lies at
    Rz(s W) offset + s h e3 with the frame Rz(s W) tilted.

    Parameters
    ----------
    ground : (N, 6). tilted : (3, 3), offset : (3,), filled.

    Returns
    -------
    turn, rise : W in radians and h, per step.
    """
    n = ground.shape[0]
    mean = np.zeros((1, 6))
    for s in range(n):
        for j in range(6):
            mean[0, j] += ground[s, j] / n
    step = new_kinematics(1)
    linearise_rigid(mean, step)
    axis = np.empty(3)
    rotation_log(step.frames[1], axis)
    turn = math.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
    if turn < 1e-8:
        axis[0], axis[1], axis[2] = 0.0, 0.0, 1.0
    else:
        sign = 1.0 if axis[2] >= 0.0 else -1.0
        axis *= sign / turn
        turn *= sign
    # The smallest rotation that takes the helix axis to e3.
    x, y, z = axis[0], axis[1], axis[2]
    f = 1.0 / (1.0 + z)
    tilted[0, 0], tilted[0, 1], tilted[0, 2] = 1.0 - f * x * x, -f * x * y, -x
    tilted[1, 0], tilted[1, 1], tilted[1, 2] = -f * x * y, 1.0 - f * y * y, -y
    tilted[2, 0], tilted[2, 1], tilted[2, 2] = x, y, z
    w = np.empty(3)
    for i in range(3):
        w[i] = 0.0
        for j in range(3):
            w[i] += tilted[i, j] * step.centres[1, j]
    # (Rz(W) - 1) offset = w in the plane; without turns the chain leans, which a ring cannot.
    re, im = math.cos(turn) - 1.0, math.sin(turn)
    size = re * re + im * im
    offset[:] = 0.0
    if size > 1e-6:
        offset[0] = (re * w[0] + im * w[1]) / size
        offset[1] = (re * w[1] - im * w[0]) / size
    return turn, w[2]


@njit(cache=True, nogil=True)
def relaxed_helix_turns(ground: Any) -> float:
    """Turns of the unstressed chain about the axis of its mean helix."""
    tilted, offset = np.empty((3, 3)), np.empty(3)
    turn, _ = mean_helix(ground, tilted, offset)
    return ground.shape[0] * turn / (2.0 * math.pi)
