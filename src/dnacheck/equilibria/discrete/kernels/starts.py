"""Compiled starting shapes: planar rings of given link and register, and which register is best."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.equilibria.boundary_kernels import ring_boundary
from dnacheck.equilibria.discrete.kernels.closure import linearise
from dnacheck.equilibria.discrete.kernels.factorisation import back_substitute, eliminate
from dnacheck.equilibria.discrete.kernels.kkt import positive_shift
from dnacheck.equilibria.discrete.kernels.registers import wrapped
from dnacheck.equilibria.discrete.kernels.states import new_factors, new_state
from dnacheck.model.chain_kernels import HingeSteps, fill_angles
from dnacheck.numerics.small_systems import solve_small

# Registers at which the predicted energy is sampled; it holds two harmonics.
_SAMPLES = 32
# Penalty on rotations of the frames while the ring relaxes, relative to a circle's energy; it
# holds the register, which costs nothing to a straight molecule.
_HELD = 0.02
# Relaxing turns no frame of a starting shape by more than this, in radians.
_LARGEST_TURN = 0.5
# Where it would turn one by more than this, the first order is no guide to the energy.
_RELIABLE_TURN = 2.0
# Registers so far (rad) from the lowest predicted one may hold another minimum.
_AWAY = 1.2


@njit(cache=True, nogil=True)
def fill_circle(ground: Any, form: int, link: int, register: float, angles: Any) -> None:
    """Angles (N, 3) of a closed planar ring with the given link.

    The centres lie on a regular N-gon. d1 turns about the edges by the ground twists plus an
    equal share of the excess that ``link`` turns ask for; at the first base pair it stands at
    ``register`` radians from the normal that points to the middle of the ring.
    """
    frames = np.empty((ground.shape[0] + 1, 3, 3))
    circle_frames(ground, link, register, frames)
    fill_angles(frames, form, angles)


@njit(cache=True, nogil=True)
def fill_relaxed(steps: HingeSteps, link: int, register: float, turns: Any, angles: Any) -> None:
    """Angles (N, 3) of the planar ring as it relaxes to first order in the ground bends.

    ``turns`` (2, N+1, 3) are those of :func:`circle_registers`. The ring is closed to first order
    only.
    """
    n = steps.ground.shape[0]
    frames = np.empty((n + 1, 3, 3))
    circle_frames(steps.ground, link, register, frames)
    c, sn = 0.5 * math.cos(register), 0.5 * math.sin(register)
    for s in range(n + 1):
        c0 = c * turns[0, s, 0] + sn * turns[1, s, 0]
        c1 = c * turns[0, s, 1] + sn * turns[1, s, 1]
        c2 = c * turns[0, s, 2] + sn * turns[1, s, 2]
        # Cayley's rotation, as in ``moves.turn_frames``.
        factor = 2.0 / (1.0 + c0 * c0 + c1 * c1 + c2 * c2)
        for j in range(3):
            v0, v1, v2 = frames[s, 0, j], frames[s, 1, j], frames[s, 2, j]
            x0 = v0 + c1 * v2 - c2 * v1
            x1 = v1 + c2 * v0 - c0 * v2
            x2 = v2 + c0 * v1 - c1 * v0
            frames[s, 0, j] = v0 + factor * (c1 * x2 - c2 * x1)
            frames[s, 1, j] = v1 + factor * (c2 * x0 - c0 * x2)
            frames[s, 2, j] = v2 + factor * (c0 * x1 - c1 * x0)
    fill_angles(frames, steps.form, angles)


@njit(cache=True, nogil=True)
def circle_frames(ground: Any, link: int, register: float, frames: Any) -> None:
    """Frames (N+1, 3, 3) of the planar ring of :func:`fill_circle`, tangent 0 along x."""
    n = ground.shape[0]
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


@njit(cache=True, nogil=True)
def circle_registers(
    steps: HingeSteps, link: int, registers: Any, turns: Any
) -> tuple[int, float, float]:
    """Registers at which a planar ring of a link is predicted to rest, lowest first.

    Rolling the molecule by a register psi inside a planar ring costs v^T Q v with
    v = (1, cos psi, sin psi): exactly, the energy of the planar ring, less what it gains when it
    relaxes, to second order in the ground bends and for their mean stiffness. Such a function has
    one minimum or two.

    Parameters
    ----------
    registers : (2,), filled with the minima, in radians.
    turns : (2, N+1, 3), filled with the rotation vectors by which the frames of the planar ring
        relax at registers 0 and pi/2, to first order, in the axes of :func:`circle_frames`.

    Returns
    -------
    count : number of minima, 1 or 2.
    lacking : what the curve lacks of another minimum away from the lowest, relative to a circle's
        energy: the least amplitude of a further term that could make one, were its slope at most
        three and its curvature six times as large.
    energy : predicted for the lowest, reduced; NaN near the instability of a twisted ring, where
        the first order is no guide.
    """
    ground, stiffness = steps.ground, steps.stiffness
    q = np.empty((3, 3))
    reliable = _roll_energy(ground, stiffness, steps.form, link, q, turns)
    # The curve is constant + a cos psi + b sin psi + c cos 2 psi + d sin 2 psi.
    a, b = q[0, 1] + q[1, 0], q[0, 2] + q[2, 0]
    c, d = 0.5 * (q[1, 1] - q[2, 2]), 0.5 * (q[1, 2] + q[2, 1])
    energies = np.empty(_SAMPLES)
    lacks = np.empty(_SAMPLES)
    lowest = 0
    for k in range(_SAMPLES):
        psi = 2.0 * math.pi * k / _SAMPLES
        x, y = math.cos(psi), math.sin(psi)
        u, v = x * x - y * y, 2.0 * x * y
        energies[k] = a * x + b * y + c * u + d * v
        slope = b * x - a * y + 2.0 * (d * u - c * v)
        bend = -a * x - b * y - 4.0 * (c * u + d * v)
        lacks[k] = max(-bend / 6.0, abs(slope) / 3.0)
        if energies[k] < energies[lowest]:
            lowest = k
    size = math.hypot(a, b) + math.hypot(c, d)
    flat = not size > 1e-9 * abs(q[0, 0])
    count = 0
    depths = np.empty(2)
    lacking = math.inf
    for k in range(_SAMPLES):
        e0, e1, e2 = energies[k - 1], energies[k], energies[(k + 1) % _SAMPLES]
        if count < 2 and e0 > e1 and e1 <= e2 and not flat:
            offset = 0.5 * (e0 - e2) / (e0 - 2.0 * e1 + e2)
            registers[count] = 2.0 * math.pi * (k + offset) / _SAMPLES
            depths[count] = e1
            count += 1
        away = abs(wrapped(2.0 * math.pi * (k - lowest) / _SAMPLES))
        if away > _AWAY:
            lacking = min(lacking, lacks[k])
    if count == 0:
        registers[0] = 0.0
        count = 1
    elif count == 2 and depths[1] < depths[0]:
        registers[0], registers[1] = registers[1], registers[0]
    circle = 0.0
    for s in range(ground.shape[0]):
        circle += 0.5 * (stiffness[s, 1, 1] + stiffness[s, 2, 2])
    circle *= 2.0 * math.pi**2 / ground.shape[0] ** 2
    mean = q[0, 0] + 0.5 * (q[1, 1] + q[2, 2])
    return count, lacking / circle, mean + energies[lowest] if reliable else math.nan


@njit(cache=True, nogil=True)
def _roll_energy(
    ground: Any, stiffness: Any, form: int, link: int, quadratic: Any, turns: Any
) -> bool:
    """Energy of a planar ring as a quadratic form (3, 3) in (1, cos psi, sin psi).

    Seen from the ring, rolling turns the ground bends and leaves everything else. The relaxation
    leaves out the roll itself, which costs nothing to the straight molecule it starts from.
    Returns whether it turns no frame by more than a first order may.
    """
    n = ground.shape[0]
    mean = np.zeros((n, 3, 3))
    mean_steps = HingeSteps(ground, mean, form)
    state = new_state(mean_steps, ring_boundary())
    angles, gradient = state.angles, state.gradient
    fill_circle(ground, form, link, 0.0, angles)
    linearise(angles, form, state.centres, state.frames, state.axes, state.halves)
    gradient[:] = 0.0
    state.closure[:] = 0.0
    quadratic[:] = 0.0
    pulls = np.zeros((2, n, 3))
    old = np.zeros((3, 3))
    strain = np.zeros((3, 3))
    roll, torque, bending = 0.0, 0.0, 0.0
    for s in range(n):
        theta, phi = angles[s, 1], angles[s, 2]
        excess = angles[s, 0] - ground[s, 0]
        strain[0, 0], strain[0, 1], strain[0, 2] = excess, -ground[s, 1], -ground[s, 2]
        strain[1, 1], strain[1, 2] = theta, phi
        strain[2, 1], strain[2, 2] = -phi, theta
        for j in range(3):
            for k in range(3):
                old[j, k] = 0.5 * (
                    stiffness[s, k, 0] * strain[j, 0]
                    + stiffness[s, k, 1] * strain[j, 1]
                    + stiffness[s, k, 2] * strain[j, 2]
                )
            for i in range(3):
                quadratic[i, j] += (
                    strain[i, 0] * old[j, 0] + strain[i, 1] * old[j, 1] + strain[i, 2] * old[j, 2]
                )
        bend = 0.5 * (stiffness[s, 1, 1] + stiffness[s, 2, 2])
        mean[s, 0, 0], mean[s, 1, 1], mean[s, 2, 2] = stiffness[s, 0, 0], bend, bend
        pulls[0, s, 1], pulls[0, s, 2] = -bend * ground[s, 1], -bend * ground[s, 2]
        pulls[1, s, 1], pulls[1, s, 2] = -bend * ground[s, 2], bend * ground[s, 1]
        roll += theta * theta + phi * phi
        torque += stiffness[s, 0, 0] * excess / n
        bending += bend * 2.0 * math.pi / (n * n)
    # Multipliers that hold a straight, twisted rod in a circle, in the frame of base pair 0, whose
    # d1 points to the middle of the ring.
    force = 2.0 * math.sin(math.pi / n) * torque
    circle = np.array([0.0, -force, 0.0, 0.5 * force, -bending, -torque])
    unit = math.pi * bending
    factors = new_factors(mean_steps)
    small = np.empty((6, 7))
    target = np.empty(6)
    step = np.empty((n, 3))
    held = positive_shift(
        state, mean_steps, _HELD * unit, unit, circle, factors, small, gradient, target
    )
    turns[:] = 0.0
    if held < 0.0:
        return False
    reliable = True
    for i in range(2):
        along = 0.0
        for s in range(n):
            along += pulls[i, s, 2] * angles[s, 1] - pulls[i, s, 1] * angles[s, 2]
        for s in range(n):
            pulls[i, s, 1] += along / roll * angles[s, 2]
            pulls[i, s, 2] -= along / roll * angles[s, 1]
    for i in range(2):
        eliminate(factors, pulls[i], small)
        solve_small(small, -small[:, 6], float(n), target)
        back_substitute(factors, target, 1.0, step)
        _accumulate(state.axes, step, turns[i])
        largest = 0.0
        for s in range(n + 1):
            for j in range(3):
                largest = max(largest, abs(turns[i, s, j]))
        if largest > _LARGEST_TURN:
            turns[i] *= _LARGEST_TURN / largest
        reliable = reliable and largest <= _RELIABLE_TURN
        for j in range(2):
            for s in range(n):
                gain = pulls[j, s, 0] * step[s, 0] + pulls[j, s, 1] * step[s, 1]
                quadratic[1 + i, 1 + j] += 0.5 * (gain + pulls[j, s, 2] * step[s, 2])
    return reliable


@njit(cache=True, nogil=True)
def _accumulate(axes: Any, step: Any, turns: Any) -> None:
    """Rotation vectors (N+1, 3) that a step gives to the frames, less their mean.

    ``axes`` are seen from frame 0, whose d1, d2, d3 are y, z, x of :func:`circle_frames`.
    """
    n = step.shape[0]
    mean = np.zeros(3)
    turns[0] = 0.0
    for s in range(n):
        for i in range(3):
            total = turns[s, (i + 1) % 3]
            for j in range(3):
                total += axes[s, j, i] * step[s, j]
            turns[s + 1, (i + 1) % 3] = total
            mean[(i + 1) % 3] += total / n
    for s in range(n + 1):
        for i in range(3):
            turns[s, i] -= mean[i]
