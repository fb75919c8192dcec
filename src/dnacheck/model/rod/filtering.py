"""Cyclic padding and the double filter of Section VI B."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def padded_steps(n_steps: int, padding: int) -> NDArray[np.intp]:
    """Steps of the cyclically padded molecule, as indices into the molecule's own steps.

    The padded chain runs over base pairs -padding .. n_steps + 1 + padding: base pair n_steps is
    the fictitious one, n_steps + 1 the tip of its d3, which Section VI A needs for the fit.

    Returns
    -------
    ndarray, shape (n_steps + 1 + 2 padding,)
        Entry i is the molecule's step from padded base pair i - padding to the next.
    """
    return np.arange(-padding, n_steps + 1 + padding) % n_steps


def smooth(points: Array, width: int) -> Array:
    """Filter forwards and backwards with a box of ``width`` points, as FILTFILT does.

    The weights are triangular, (1, 2, .., w, .., 2, 1)/w**2. At the ends the points are continued
    by reflection through the end point (value and slope are matched), which equals FILTFILT with
    its standard extension of 3(w-1) points.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        n > width - 1.
    width : int
        w >= 1; 1 returns a copy.
    """
    reach = width - 1
    if reach == 0:
        return points.copy()
    head = 2.0 * points[0] - points[reach:0:-1]
    tail = 2.0 * points[-1] - points[-2 : -2 - reach : -1]
    extended = np.concatenate([head, points, tail])
    weights = np.convolve(np.ones(width), np.ones(width)) / width**2
    return np.stack([np.convolve(extended[:, c], weights, "valid") for c in range(3)], axis=1)


def double_filter(points: Array, width: int) -> Array:
    """Smooth, then add back the smoothed remainder (Section VI B, item 2; Figure 5)."""
    average = smooth(points, width)
    return average + smooth(points - average, width)
