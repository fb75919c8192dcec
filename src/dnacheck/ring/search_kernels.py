"""Compiled search for the minima of a ring over links and registers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.ring.closure_kernels import energy_gradient
from dnacheck.ring.newton_kernels import CONVERGED, ENERGY, N_FIGURES, NEGATIVES, newton
from dnacheck.ring.start_kernels import fill_circle

# Two minima are one when their energies agree to this relative precision and their angles to
# the second figure, in radians; converged solutions agree far better.
_SAME_ENERGY = 1e-7
_SAME_ANGLES = 1e-4


@njit(cache=True, nogil=True)
def best_register(ground: Any, stiffness: Any, form: int, link: int, scratch: Any) -> float:
    """Register of lowest energy of the planar ring, to first order in the ground curvature.

    The energy of the circle is a constant plus a first harmonic in the register (isotropic
    bending) plus a second one (anisotropic); four registers separate the first.
    """
    n = ground.shape[0]
    gradient = np.empty((n, 3))
    energies = np.empty(4)
    for k in range(4):
        fill_circle(ground, form, link, 0.5 * math.pi * k, scratch)
        energies[k] = energy_gradient(scratch, ground, stiffness, gradient)
    return math.atan2(energies[3] - energies[1], energies[2] - energies[0])


@njit(cache=True, nogil=True, error_model="numpy")
def search(
    ground: Any,
    stiffness: Any,
    form: int,
    links: Any,
    registers: Any,
    window: float,
    tolerance: float,
    max_iterations: int,
    turn_cap: float,
    angles: Any,
    multipliers: Any,
    figures: Any,
) -> tuple[int, int, int]:
    """Distinct minima reached from planar rings of the given links.

    Each link starts from its best register plus ``registers[0]``; links whose minimum lies within
    ``window`` (reduced energy) of the lowest start again from the other ``registers``. The minima
    fill ``angles`` (M, N, 3), ``multipliers`` (M, 6) and ``figures`` (M, 7) in order of discovery.

    Returns
    -------
    found, failed : how many distinct minima, and how many starts did not converge.
    code : last failure's code of :func:`newton`, 0 if none.
    """
    n = ground.shape[0]
    found, failed, last_code = 0, 0, 0
    trial = np.empty((n, 3))
    force = np.empty(6)
    figure = np.empty(N_FIGURES)
    base = np.empty(links.shape[0])
    energies = np.full(links.shape[0], math.inf)
    lowest = math.inf
    for round_ in range(registers.shape[0]):
        for i in range(links.shape[0]):
            if round_ == 0:
                base[i] = best_register(ground, stiffness, form, links[i], trial)
            elif not energies[i] <= lowest + window:
                continue
            fill_circle(ground, form, links[i], base[i] + registers[round_], trial)
            for j in range(6):
                force[j] = 0.0
            for j in range(N_FIGURES):
                figure[j] = 0.0
            code = newton(
                trial,
                force,
                ground,
                stiffness,
                form,
                tolerance,
                max_iterations,
                turn_cap,
                True,
                figure,
            )
            if code != CONVERGED or figure[NEGATIVES] != 0:
                failed += 1
                last_code = code
                continue
            energies[i] = min(energies[i], figure[ENERGY])
            lowest = min(lowest, figure[ENERGY])
            known = False
            for m in range(found):
                gap = abs(figures[m, ENERGY] - figure[ENERGY])
                if gap <= _SAME_ENERGY * abs(figure[ENERGY]) + 1e-14:
                    worst = 0.0
                    for s in range(n):
                        for j in range(3):
                            worst = max(worst, abs(trial[s, j] - angles[m, s, j]))
                    if worst < _SAME_ANGLES:
                        known = True
                        break
            if not known and found < angles.shape[0]:
                for s in range(n):
                    for j in range(3):
                        angles[found, s, j] = trial[s, j]
                for j in range(6):
                    multipliers[found, j] = force[j]
                for j in range(N_FIGURES):
                    figures[found, j] = figure[j]
                found += 1
    return found, failed, last_code
