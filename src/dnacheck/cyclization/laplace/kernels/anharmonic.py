"""Compiled log-weights of closed shapes near a held ring, at scaled-down fluctuations.

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

from dnacheck.cyclization.closure.kernels.projection import follow
from dnacheck.cyclization.laplace.kernels.gaussian import draw_closed
from dnacheck.model.chain_kernels import WEDGE


@njit(cache=True, nogil=True, error_model="numpy")
def scaled_log_weights(
    rng: Any,
    scales: Any,
    stiffness: Any,
    ground: Any,
    form: int,
    centre: Any,
    direction: Any,
    extent: float,
    rows: Any,
    right: Any,
    z: Any,
    root: Any,
    projector: Any,
    schur: Any,
    fibre: Any,
    log_weights: Any,
) -> None:
    """Log-weights of antithetic pairs of draws at several scales.

    Parameters
    ----------
    scales : (T,), factors t on the draws.
    stiffness, ground, centre, direction : (N, 3, 3) in RT, (N, 3), (N, 3), (N, 3), and the rest as
        in :func:`dnacheck.cyclization.closure.kernels.draws.draw_pairs`.
    log_weights : (pairs, T, 2), filled; NaN where no closed shape was reached.
    """
    n = centre.shape[0]
    m = 3 * n
    centres = np.empty((n + 1, 3))
    frames = np.empty((n + 1, 3, 3))
    axes = np.empty((n, 3, 3))
    halves = np.empty((n if form != WEDGE else 0, 5, 3))
    jacobian = np.empty((6, m))
    angles = np.empty((n, 3))
    normals = np.empty((n, 3))
    x = np.empty((n, 3))
    draw = x.reshape(m)
    scaled = np.empty(m)
    flat_centre = centre.reshape(m)
    y = np.empty(6)
    for pair in range(log_weights.shape[0]):
        quadratic = draw_closed(rng, rows, right, z, root, projector, schur, normals, x)
        for index in range(scales.shape[0]):
            t = scales[index]
            for side in range(2):
                signed = t if side == 0 else -t
                for k in range(m):
                    scaled[k] = signed * draw[k]
                met, det = follow(
                    flat_centre, scaled, fibre, form, y, angles, centres, frames, axes, halves,
                    jacobian,
                )  # fmt: skip
                log_weights[pair, index, side] = math.nan
                if not met:
                    continue
                # Energy less its value at the centre, as a product of difference and sum: it is
                # divided by t^2 below, and a difference of energies would lose digits.
                rise, found = 0.0, 0.0
                for s in range(n):
                    for j in range(3):
                        found += direction[s, j] * angles[s, j]
                        for k in range(3):
                            change = angles[s, j] - centre[s, j]
                            mean = angles[s, k] + centre[s, k] - 2.0 * ground[s, k]
                            rise += 0.5 * change * stiffness[s, j, k] * mean
                if found > 0.0:
                    log_weights[pair, index, side] = (
                        0.5 * quadratic - rise / (t * t) - math.log(abs(det))
                        + math.log(found / extent)
                    )  # fmt: skip
