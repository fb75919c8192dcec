"""Compiled ring and Laplace J factor of one molecule, for scans of many."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.equilibria.discrete.kernels.cut import fill_shape
from dnacheck.equilibria.discrete.kernels.newton import (
    ENERGY,
    LOG_DET_KKT,
    NEUTRAL,
    NewtonLimits,
)
from dnacheck.equilibria.discrete.kernels.search import Minima, SearchPlan, search_as_cut
from dnacheck.numerics.curve_topology import edge_frames, link_of_ring

# Positions of the figures of a scanned molecule.
LOWEST_ENERGY, LOWEST_LINK, LOG_J, MINIMA, FAILED_STARTS, FREE_REGISTERS = range(6)
N_SCAN_FIGURES = 6


@njit(cache=True, nogil=True)
def link_of_shape(ring: Any, angles: Any) -> int:
    """Link of a closed shape (N, c); of rigid steps that about the edges between their centres."""
    n = ring.ground.shape[0]
    centres = np.empty((n + 1, 3))
    frames = np.empty((n + 1, 3, 3))
    fill_shape(ring, angles, centres, frames)
    if ring.ground.shape[1] > 3:
        along = np.empty((n + 1, 3, 3))
        edge_frames(centres, frames, along)
        frames = along
    return link_of_ring(centres, frames)[0]


@njit(cache=True, nogil=True, error_model="numpy")
def scan_molecule(
    ring: Any,
    plan: SearchPlan,
    limits: NewtonLimits,
    minima: Minima,
    scale: float,
    constant: float,
    figures: Any,
) -> bool:
    """Lowest ring and Laplace's J, summed over the minima of the one search.

    Parameters
    ----------
    ring : steps of the canonical cut.
    plan, limits : as :func:`dnacheck.equilibria.discrete.search.find_rings` has them.
    minima : filled with the minima found.
    scale : RT per reduced unit.
    constant : ln J = constant - E - ln det KKT / 2, see
        :mod:`dnacheck.cyclization.laplace.isolated`.
    figures : (6,), filled with the lowest reduced energy, its link, ln J, the number of minima,
        of starts that failed, and of minima whose register is free, for which ln J means nothing.

    Returns
    -------
    found : whether there is a stable ring.
    """
    found, _, failed = search_as_cut(ring, plan, limits, minima)
    figures[:] = math.nan
    figures[MINIMA], figures[FAILED_STARTS] = found, failed
    if found == 0:
        return False
    parts = np.empty(found)
    lowest, free = 0, 0
    for m in range(found):
        figure = minima.figures[m]
        parts[m] = constant - scale * figure[ENERGY] - 0.5 * figure[LOG_DET_KKT]
        free += 1 if figure[NEUTRAL] > 0.0 else 0
        if figure[ENERGY] < minima.figures[lowest, ENERGY]:
            lowest = m
    best = parts.max()
    figures[LOWEST_ENERGY] = minima.figures[lowest, ENERGY]
    figures[LOWEST_LINK] = link_of_shape(ring, minima.angles[lowest])
    figures[LOG_J] = best + math.log(np.exp(parts - best).sum())
    figures[FREE_REGISTERS] = free
    return True
