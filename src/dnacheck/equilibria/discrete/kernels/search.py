"""Compiled search for the minima of a ring over links and registers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.equilibria.boundary_kernels import ring_boundary
from dnacheck.equilibria.discrete.kernels.newton import (
    CONVERGED,
    ENERGY,
    N_FIGURES,
    NEGATIVES,
    NEUTRAL,
    NewtonLimits,
    newton,
)
from dnacheck.equilibria.discrete.kernels.rigid_starts import fill_rigid_circle, rigid_registers
from dnacheck.equilibria.discrete.kernels.starts import circle_registers, fill_circle
from dnacheck.equilibria.discrete.kernels.states import by_kind
from dnacheck.model.chain_kernels import HingeSteps

# Two minima are one when their energies agree to this relative precision and their angles to
# the second figure, in radians; converged solutions agree far better.
_SAME_ENERGY = 1e-7
_SAME_ANGLES = 1e-4


@njit(cache=True, nogil=True)
def _fill_hinge_start(steps: HingeSteps, link: int, register: float, angles: Any) -> None:
    fill_circle(steps.ground, steps.form, link, register, angles)


@njit(cache=True, nogil=True)
def _hinge_registers(steps: HingeSteps, link: int, registers: Any) -> int:
    return circle_registers(steps.ground, steps.stiffness, steps.form, link, registers)


fill_start = by_kind(_fill_hinge_start, fill_rigid_circle)
"""Angles (N, c) of a closed ring of a link and register: (steps, link, register, angles)."""

start_registers = by_kind(_hinge_registers, rigid_registers)
"""One or two registers to start from, into ``registers`` (2,): (steps, link, registers)."""


@njit(cache=True, nogil=True)
def best_register(steps: Any, link: int, scratch: Any) -> float:
    """Register of lowest predicted energy of the planar ring; see :func:`circle_registers`."""
    start_registers(steps, link, scratch[0])
    return scratch[0, 0]


@njit(cache=True, nogil=True)
def _known(trial: Any, energy: float, neutral: bool, found: int, angles: Any, figures: Any) -> bool:
    """Whether a ring is among those found; of a family of equal energy one stands for all."""
    for m in range(found):
        gap = abs(figures[m, ENERGY] - energy)
        if gap > _SAME_ENERGY * abs(energy) + 1e-14:
            continue
        if neutral and figures[m, NEUTRAL] > 0.0:
            return True
        worst = 0.0
        for s in range(trial.shape[0]):
            for j in range(trial.shape[1]):
                worst = max(worst, abs(trial[s, j] - angles[m, s, j]))
        if worst < _SAME_ANGLES:
            return True
    return False


@njit(cache=True, nogil=True)
def minimum_from_circle(
    steps: Any,
    link: int,
    register: float,
    limits: NewtonLimits,
    angles: Any,
    multipliers: Any,
    figures: Any,
) -> bool:
    """Whether the planar ring of a link and register leads to a minimum.

    It fills ``angles`` (N, c), ``multipliers`` (6,) and ``figures`` (8,); see :func:`newton`.
    """
    fill_start(steps, link, register, angles)
    multipliers[:] = 0.0
    figures[:] = 0.0
    code = newton(angles, multipliers, steps, ring_boundary(), limits, figures)
    return code == CONVERGED and figures[NEGATIVES] == 0


@njit(cache=True, nogil=True, error_model="numpy")
def search(
    steps: Any,
    links: Any,
    registers: Any,
    window: float,
    limits: NewtonLimits,
    angles: Any,
    multipliers: Any,
    figures: Any,
) -> tuple[int, int, int]:
    """Distinct minima reached from planar rings of the given links.

    Each link starts from the one or two registers where its planar ring is predicted to rest;
    links whose minimum lies within ``window`` (reduced energy) of the lowest start again from the
    best one plus each of ``registers``. The minima fill ``angles`` (M, N, c), ``multipliers``
    (M, 6) and ``figures`` (M, 8) in order of discovery.

    Returns
    -------
    found, starts, failed : how many distinct minima, starts, and starts that did not converge.
    """
    found, starts, failed = 0, 0, 0
    trial = np.empty(steps.ground.shape)
    force = np.empty(6)
    figure = np.empty(N_FIGURES)
    rests = np.empty((links.shape[0], 2))
    counts = np.empty(links.shape[0], dtype=np.int64)
    energies = np.full(links.shape[0], math.inf)
    lowest = math.inf
    for round_ in range(2 + registers.shape[0]):
        for i in range(links.shape[0]):
            if round_ == 0:
                counts[i] = start_registers(steps, links[i], rests[i])
            if round_ >= 2 and not energies[i] <= lowest + window:
                continue
            if round_ == 1 and counts[i] < 2:
                continue
            register = rests[i, round_] if round_ < 2 else rests[i, 0] + registers[round_ - 2]
            starts += 1
            if not minimum_from_circle(steps, links[i], register, limits, trial, force, figure):
                failed += 1
                continue
            neutral = figure[NEUTRAL] > 0.0
            energies[i] = min(energies[i], figure[ENERGY])
            lowest = min(lowest, figure[ENERGY])
            if found < angles.shape[0] and not _known(
                trial, figure[ENERGY], neutral, found, angles, figures
            ):
                angles[found] = trial
                multipliers[found] = force
                figures[found] = figure
                found += 1
    return found, starts, failed
