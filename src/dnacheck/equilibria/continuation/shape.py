"""Mesh positions from the solver's unknowns, without a sweep."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from dnacheck.equilibria.continuum.kernels.condense import cayley, multiply


@njit(cache=True, nogil=True, error_model="numpy")
def mesh_centres(slopes: Any, h: Any, a: Any, b: Any, centres: Any) -> None:
    """Write the positions (K + 1, 3) at the mesh points.

    Parameters
    ----------
    slopes, h : (K, k, 3), (K,)
    a, b : (k, k), (k,)
        Gauss coefficients and weights.
    centres : (K + 1, 3)
        Output.
    """
    k = b.size
    frame = np.eye(3)
    turn = np.empty((3, 3))
    new = np.empty((3, 3))
    g = np.empty(3)
    for c in range(3):
        centres[0, c] = 0.0
    for i in range(h.size):
        for c in range(3):
            centres[i + 1, c] = centres[i, c]
        for j in range(k):
            for c in range(3):
                total = 0.0
                for p in range(k):
                    total += a[j, p] * slopes[i, p, c]
                g[c] = h[i] * total
            cayley(g[0], g[1], g[2], turn)
            for c in range(3):
                tangent = (
                    turn[c, 0] * frame[0, 2] + turn[c, 1] * frame[1, 2] + turn[c, 2] * frame[2, 2]
                )
                centres[i + 1, c] += h[i] * b[j] * tangent
        for c in range(3):
            total = 0.0
            for p in range(k):
                total += b[p] * slopes[i, p, c]
            g[c] = h[i] * total
        cayley(g[0], g[1], g[2], turn)
        multiply(turn, frame, new)
        frame[:] = new
