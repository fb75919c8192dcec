"""Compiled log-weights of closed shapes at scaled-down fluctuations about a constrained minimum.

Draws are those of :mod:`dnacheck.cyclization.closure.kernels.draws`, shrunk by a factor t. The
energy's part of the log-weight is divided by t^2, so that t^2 stands for the temperature: what is
left of the quadratic energy then vanishes with t, and its coefficients are those of the anharmonic
expansion.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.cyclization.closure.kernels.projection import empty_shape, follow
from dnacheck.cyclization.laplace.kernels.gaussian import draw_closed


@njit(cache=True, nogil=True, error_model="numpy")
def scaled_log_weights(
    rng: Any, scales: Any, steps: Any, centre: Any, factors: Any, log_weights: Any
) -> None:
    """Log-weights of antithetic pairs of draws at several scales.

    Parameters
    ----------
    scales : (T,), factors t on the draws.
    steps, centre, factors : as in :func:`dnacheck.cyclization.closure.kernels.draws.draw_pairs`.
    log_weights : (pairs, T, 2), filled; NaN where no closed shape was reached.
    """
    n, c = centre.angles.shape
    m = c * n
    shape = empty_shape(steps, centre.boundary)
    angles = shape.state.angles
    normals = np.empty((n, c))
    x = np.empty((n, c))
    draw = x.reshape(m)
    scaled = np.empty(m)
    flat_centre = centre.angles.reshape(m)
    y = np.empty(6)
    for pair in range(log_weights.shape[0]):
        quadratic = draw_closed(steps, rng, factors, normals, x)
        for index in range(scales.shape[0]):
            t = scales[index]
            for side in range(2):
                signed = t if side == 0 else -t
                for k in range(m):
                    scaled[k] = signed * draw[k]
                met, det = follow(steps, flat_centre, scaled, factors.directions, y, shape)
                log_weights[pair, index, side] = math.nan
                if not met:
                    continue
                # Energy less its value at the centre, as a product of difference and sum: it is
                # divided by t^2 below, and a difference of energies would lose digits.
                rise, found = 0.0, 0.0
                for s in range(n):
                    for j in range(c):
                        found += centre.direction[s, j] * angles[s, j]
                        for k in range(c):
                            change = angles[s, j] - centre.angles[s, j]
                            mean = angles[s, k] + centre.angles[s, k] - 2.0 * steps.ground[s, k]
                            rise += 0.5 * change * steps.stiffness[s, j, k] * mean
                if found > 0.0:
                    log_weights[pair, index, side] = (
                        0.5 * quadratic - rise / (t * t) - math.log(abs(det))
                        + math.log(found / centre.extent)
                    )  # fmt: skip
