"""Optimal superposition of two sets of points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def superpose(moving: Array, fixed: Array) -> tuple[Array, float]:
    """Rigidly move one set of points onto another (Kabsch) and give the rms distance left.

    Parameters
    ----------
    moving, fixed : ndarray, shape (n, 3)
        Points in the same order and the same unit of length.

    Returns
    -------
    moved : ndarray, shape (n, 3)
        ``moving`` after the best rotation and translation (no reflection).
    rms : float
        Root mean square distance between corresponding points, same unit.
    """
    moving = np.asarray(moving, dtype=float)
    fixed = np.asarray(fixed, dtype=float)
    centre_moving, centre_fixed = moving.mean(axis=0), fixed.mean(axis=0)
    u, _, vt = np.linalg.svd((moving - centre_moving).T @ (fixed - centre_fixed))
    handedness = np.sign(np.linalg.det(u @ vt))
    rotation = (u * np.array([1.0, 1.0, handedness])) @ vt
    moved = (moving - centre_moving) @ rotation + centre_fixed
    rms = float(np.sqrt(np.mean(np.sum((moved - fixed) ** 2, axis=1))))
    return moved, rms
