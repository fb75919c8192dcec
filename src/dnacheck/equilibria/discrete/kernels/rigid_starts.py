"""Compiled starting shapes of rings of rigid base-pair steps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.equilibria.boundary_kernels import ring_boundary
from dnacheck.equilibria.discrete.kernels.kkt import solve_kkt
from dnacheck.equilibria.discrete.kernels.moves import residuals
from dnacheck.equilibria.discrete.kernels.states import evaluate, new_factors, new_state, substitute
from dnacheck.model.rigid_kernels import RigidSteps, fill_rigid_coordinates, mean_helix

# Registers at which the predicted energy is sampled, and finer ones for its two harmonics.
_SAMPLES = 6
_FINE = 48
# Penalty on rotations of the frames while the ring relaxes, relative to a circle's energy: below
# 0.1 the ring rolls to where it rests, far above 1 it hardly relaxes.
_HELD = 1.0


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


@njit(cache=True, nogil=True, error_model="numpy")
def rigid_registers(steps: RigidSteps, link: int, registers: Any) -> int:
    """Registers at which a ring of a link is predicted to rest, lowest first.

    The energy of the bent mean helix (:func:`fill_rigid_circle`), less what it gains by one
    constrained Newton step, is sampled over the registers. A penalty on rotations of the frames
    holds the register meanwhile. Two harmonics hold what is sampled, so there is one minimum or
    two.

    Parameters
    ----------
    registers : (2,), filled with the minima, in radians.

    Returns
    -------
    count : number of minima, 1 or 2.
    """
    n = steps.ground.shape[0]
    state = new_state(steps, ring_boundary())
    factors = new_factors(steps)
    small = np.empty((6, 7))
    slope, step = np.empty((n, 6)), np.empty((n, 6))
    multipliers, change = np.empty(6), np.empty(6)
    bend = 0.0
    for s in range(n):
        bend += 0.5 * (steps.stiffness[s, 1, 1] + steps.stiffness[s, 2, 2]) / n
    held = _HELD * 2.0 * math.pi * math.pi * bend / n
    energies = np.empty(_SAMPLES)
    for k in range(_SAMPLES):
        fill_rigid_circle(steps, link, 2.0 * math.pi * k / _SAMPLES, state.angles)
        energy = evaluate(state, steps)
        multipliers[:] = 0.0
        # The first pass finds the multipliers that the second one's Hessian needs.
        gain = 0.0
        for _ in range(2):
            residuals(state, multipliers, slope)
            negatives, _, _ = solve_kkt(
                state, steps, held, multipliers, factors, small, slope, change
            )
            if negatives != 0:
                break
            substitute(state, factors, change, 1.0, step)
            for i in range(6):
                multipliers[i] += change[i]
            gain = 0.0
            for s in range(n):
                for j in range(6):
                    gain += 0.5 * state.gradient[s, j] * step[s, j]
        energies[k] = energy + gain
    return _minima(energies, registers)


@njit(cache=True, nogil=True)
def _minima(energies: Any, registers: Any) -> int:
    """Minima of two harmonics through equidistant samples over a turn, lowest first."""
    n = energies.shape[0]
    c = np.zeros(5)
    for k in range(n):
        psi = 2.0 * math.pi * k / n
        c[0] += energies[k] / n
        c[1] += 2.0 * energies[k] * math.cos(psi) / n
        c[2] += 2.0 * energies[k] * math.sin(psi) / n
        c[3] += 2.0 * energies[k] * math.cos(2.0 * psi) / n
        c[4] += 2.0 * energies[k] * math.sin(2.0 * psi) / n
    fine = np.empty(_FINE)
    for k in range(_FINE):
        psi = 2.0 * math.pi * k / _FINE
        fine[k] = c[1] * math.cos(psi) + c[2] * math.sin(psi)
        fine[k] += c[3] * math.cos(2.0 * psi) + c[4] * math.sin(2.0 * psi)
    count = 0
    depths = np.empty(2)
    for k in range(_FINE):
        before, here, after = fine[k - 1], fine[k], fine[(k + 1) % _FINE]
        if count < 2 and before > here and here <= after:
            offset = 0.5 * (before - after) / (before - 2.0 * here + after)
            registers[count] = 2.0 * math.pi * (k + offset) / _FINE
            depths[count] = here
            count += 1
    if count == 0:
        registers[0] = 0.0
        return 1
    if count == 2 and depths[1] < depths[0]:
        registers[0], registers[1] = registers[1], registers[0]
    return count
