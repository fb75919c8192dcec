"""Compiled ring and Laplace J factor of one molecule, for scans of many."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.jfactor.register_kernels import register_functionals, register_of
from dnacheck.model.chain_kernels import fill_frames
from dnacheck.ring.closure_kernels import energy_gradient
from dnacheck.ring.newton_kernels import (
    CONVERGED,
    ENERGY,
    ITERATION_LIMIT,
    LOG_DET_KKT,
    N_FIGURES,
    NEGATIVES,
    newton,
)
from dnacheck.ring.start_kernels import fill_circle
from dnacheck.ring.topology_kernels import link_of_ring

# Positions of the figures of a scanned molecule.
LOWEST_ENERGY, LOWEST_LINK, LOG_J, MINIMA, FAILED_STARTS = range(5)
N_SCAN_FIGURES = 5

_TOLERANCE = 1e-8
_TURN_CAP = 0.5
_MOST_ITERATIONS = 300
_FIRST_ITERATIONS = 12
"""Iterations of a second start before it is asked whether it rolls back to the known minimum."""
_ROLLS_BACK = 1.2
"""Distance in radians of register from the known minimum below which it does."""
_SECOND_MINIMUM_RT = 2.5
"""A link is searched for a second minimum where rolling the planar ring changes its energy by less
than this amplitude: of 5,000 links of random molecules, 25 had a second minimum with more than 1 %
of J, one of them at a larger amplitude (it held 2 %)."""
_WINDOW_RT = 4.0
"""Links whose J lies further below the best (in ln J) are not searched for a second minimum."""
_PLANAR_WINDOW_RT = 10.0
"""Links whose planar ring lies further above the lowest are left out: relaxed, the gap stayed above
5 RT (0.5 % of J) in 2,500 random molecules with twist ratios from 0.3 to 3."""
_SAME_ENERGY = 1e-6


@njit(cache=True, nogil=True)
def _planar_register(
    ground: Any, stiffness: Any, form: int, link: int, scratch: Any, gradient: Any
) -> tuple[float, float, float]:
    """Register of the lowest planar ring, its energy and the amplitude of the first harmonic."""
    energies = np.empty(4)
    for k in range(4):
        fill_circle(ground, form, link, 0.5 * math.pi * k, scratch)
        energies[k] = energy_gradient(scratch, ground, stiffness, gradient)
    x, y = energies[2] - energies[0], energies[3] - energies[1]
    amplitude = 0.5 * math.hypot(x, y)
    return math.atan2(y, x), 0.25 * energies.sum() - amplitude, amplitude


@njit(cache=True, nogil=True)
def _angle_between(a: float, b: float) -> float:
    """Distance of two angles on the circle, in [0, pi]."""
    gap = abs(a - b) % (2.0 * math.pi)
    return min(gap, 2.0 * math.pi - gap)


@njit(cache=True, nogil=True, error_model="numpy")
def scan_molecule(
    ground: Any, stiffness: Any, form: int, links: Any, scale: float, constant: float, figures: Any
) -> bool:
    """Lowest ring and Laplace J over the minima of the given links.

    Parameters
    ----------
    ground, stiffness : (N, 3), (N, 3, 3), reduced.
    links : (L,), candidates. scale : RT per reduced unit.
    constant : ln J = constant - E - ln det KKT / 2, see :mod:`dnacheck.jfactor.laplace`.
    figures : (5,), filled with the lowest reduced energy, its link, ln J, the number of minima
        and of starts that failed.

    Returns
    -------
    found : whether there is a stable ring.
    """
    n = ground.shape[0]
    count = links.shape[0]
    trial = np.empty((n, 3))
    gradient = np.empty((n, 3))
    along = np.empty((n, 3))
    across = np.empty((n, 3))
    centres = np.empty((n + 1, 3))
    frames = np.empty((n + 1, 3, 3))
    force = np.empty(6)
    figure = np.empty(N_FIGURES)
    base = np.empty(count)
    planar = np.empty(count)
    amplitude = np.empty(count)
    reached = np.full(count, math.nan)
    parts = np.full(2 * count, -math.inf)
    energies = np.full(2 * count, math.inf)
    minima = 0
    failed = 0
    lowest = math.inf
    lowest_link = 0
    best = -math.inf
    for i in range(count):
        base[i], planar[i], amplitude[i] = _planar_register(
            ground, stiffness, form, links[i], trial, gradient
        )
    least = planar.min()
    for round_ in range(2):
        for i in range(count):
            if (planar[i] - least) * scale > _PLANAR_WINDOW_RT:
                continue
            if round_ == 1 and (
                amplitude[i] * scale > _SECOND_MINIMUM_RT or not parts[i] > best - _WINDOW_RT
            ):
                continue
            fill_circle(ground, form, links[i], base[i] + math.pi * round_, trial)
            for j in range(6):
                force[j] = 0.0
            for j in range(N_FIGURES):
                figure[j] = 0.0
            first = _MOST_ITERATIONS if round_ == 0 else _FIRST_ITERATIONS
            code = newton(
                trial, force, ground, stiffness, form, _TOLERANCE, first, _TURN_CAP, True, figure
            )
            register_functionals(ground, form, links[i], along, across)
            register = register_of(trial, along, across)[0]
            if round_ == 0:
                reached[i] = register
            elif code == ITERATION_LIMIT:
                if _angle_between(register, reached[i]) < _ROLLS_BACK:
                    continue
                code = newton(
                    trial,
                    force,
                    ground,
                    stiffness,
                    form,
                    _TOLERANCE,
                    _MOST_ITERATIONS,
                    _TURN_CAP,
                    True,
                    figure,
                )
            if code != CONVERGED or figure[NEGATIVES] != 0:
                failed += 1
                continue
            known = False
            for m in range(2 * count):
                gap = abs(energies[m] - figure[ENERGY])
                known = known or gap <= _SAME_ENERGY * abs(figure[ENERGY]) + 1e-14
            if known:
                continue
            slot = i + count * round_
            energies[slot] = figure[ENERGY]
            parts[slot] = constant - scale * figure[ENERGY] - 0.5 * figure[LOG_DET_KKT]
            best = max(best, parts[slot])
            minima += 1
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
    return minima > 0
