"""Compiled ring and Laplace J factor of one molecule, for scans of many."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.equilibria.discrete.kernels.closure import energy_gradient
from dnacheck.equilibria.discrete.kernels.newton import (
    ENERGY,
    LOG_DET_KKT,
    N_FIGURES,
    NEUTRAL,
    NewtonLimits,
)
from dnacheck.equilibria.discrete.kernels.search import minimum_from_circle
from dnacheck.equilibria.discrete.kernels.starts import circle_registers, fill_circle
from dnacheck.model.chain_kernels import HingeSteps, fill_frames
from dnacheck.numerics.curve_topology import link_of_ring

# Positions of the figures of a scanned molecule.
LOWEST_ENERGY, LOWEST_LINK, LOG_J, MINIMA, FAILED_STARTS, FREE_REGISTERS = range(6)
N_SCAN_FIGURES = 6

_TOLERANCE = 1e-8
_TURN_CAP = 0.5
_MOST_ITERATIONS = 300
_WINDOW_RT = 6.0
"""Links whose J lies further below the best (in ln J) are not searched for a second minimum."""
_PLANAR_WINDOW_RT = 10.0
"""Links whose planar ring lies further above the lowest are left out: relaxed, the gap stayed above
5 RT (0.5 % of J) in 2,500 random molecules with twist ratios from 0.3 to 3."""
_SAME_ENERGY = 1e-6


@njit(cache=True, nogil=True, error_model="numpy")
def scan_molecule(
    ground: Any, stiffness: Any, form: int, links: Any, scale: float, constant: float, figures: Any
) -> bool:
    """Lowest ring and Laplace J over the minima of the given links.

    Parameters
    ----------
    ground, stiffness : (N, 3), (N, 3, 3), reduced. links : (L,), candidates. scale : RT per reduced
    unit. constant : ln J = constant - E - ln det KKT / 2, see
    :mod:`dnacheck.cyclization.laplace.isolated`. figures : (6,), filled with the lowest reduced
    energy, its link, ln J, the number of minima,
        of starts that failed, and of minima whose register is free, for which ln J means nothing.

    Returns
    -------
    found : whether there is a stable ring.
    """
    n = ground.shape[0]
    steps = HingeSteps(ground, stiffness, form)
    limits = NewtonLimits(_TOLERANCE, _MOST_ITERATIONS, _TURN_CAP, True)
    count = links.shape[0]
    trial = np.empty((n, 3))
    gradient = np.empty((n, 3))
    centres = np.empty((n + 1, 3))
    frames = np.empty((n + 1, 3, 3))
    force = np.empty(6)
    figure = np.empty(N_FIGURES)
    rests = np.empty((count, 2))
    choices = np.empty(count, dtype=np.int64)
    planar = np.empty(count)
    parts = np.full(2 * count, -math.inf)
    energies = np.full(2 * count, math.inf)
    minima = 0
    failed = 0
    free = 0
    lowest = math.inf
    lowest_link = 0
    best = -math.inf
    for i in range(count):
        choices[i] = circle_registers(ground, stiffness, form, links[i], rests[i])
        fill_circle(ground, form, links[i], rests[i, 0], trial)
        planar[i] = energy_gradient(trial, ground, stiffness, gradient)
    least = planar.min()
    for round_ in range(5):
        if round_ >= 2 and minima > 0:
            break
        for i in range(count):
            # The last rounds, for a molecule without any minimum so far, try everything.
            if round_ < 2 and (planar[i] - least) * scale > _PLANAR_WINDOW_RT:
                continue
            if round_ == 1 and (choices[i] < 2 or not parts[i] > best - _WINDOW_RT):
                continue
            register = (
                rests[i, round_] if round_ < 2 else rests[i, 0] + 0.5 * math.pi * (round_ - 1)
            )
            if not minimum_from_circle(steps, links[i], register, limits, trial, force, figure):
                failed += 1
                continue
            known = False
            for m in range(2 * count):
                gap = abs(energies[m] - figure[ENERGY])
                known = known or gap <= _SAME_ENERGY * abs(figure[ENERGY]) + 1e-14
            if known:
                continue
            slot = i + count * (1 if round_ == 1 else 0)
            energies[slot] = figure[ENERGY]
            parts[slot] = constant - scale * figure[ENERGY] - 0.5 * figure[LOG_DET_KKT]
            best = max(best, parts[slot])
            minima += 1
            free += 1 if figure[NEUTRAL] > 0.0 else 0
            if figure[ENERGY] < lowest:
                lowest = figure[ENERGY]
                fill_frames(trial, form, centres, frames)
                lowest_link = link_of_ring(centres, frames)[0]
    total = 0.0
    for m in range(2 * count):
        if parts[m] > -math.inf:
            total += math.exp(parts[m] - best)
    figures[LOWEST_ENERGY] = lowest
    figures[LOWEST_LINK] = lowest_link
    figures[LOG_J] = best + math.log(total) if minima else math.nan
    figures[MINIMA] = minima
    figures[FAILED_STARTS] = failed
    figures[FREE_REGISTERS] = free
    return minima > 0
