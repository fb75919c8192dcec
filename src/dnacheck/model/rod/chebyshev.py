"""Chebyshev series on the pieces of a curve: transform, integral, evaluation."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@lru_cache(maxsize=8)
def tables(n: int) -> tuple[Array, Array, Array]:
    """Points and matrices of a Chebyshev series with ``n`` terms.

    Returns
    -------
    points : ndarray, shape (n,)
        Increasing Chebyshev-Lobatto points of [-1, 1].
    transform : ndarray, shape (n, n)
        Values at the points to coefficients.
    integral : ndarray, shape (n, n)
        Values at the points to values of the integral from -1.
    """
    points: Array = -np.cos(np.pi * np.arange(n) / (n - 1))
    vandermonde = np.polynomial.chebyshev.chebvander(points, n)
    transform: Array = np.asarray(np.linalg.inv(vandermonde[:, :n]), dtype=float)
    lift = np.zeros((n + 1, n))
    for j in range(n):
        unit = np.zeros(n)
        unit[j] = 1.0
        series = np.polynomial.chebyshev.chebint(unit, lbnd=-1)
        lift[: series.size, j] = series
    integral: Array = np.asarray(vandermonde @ lift @ transform, dtype=float)
    for array in (points, transform, integral):
        array.setflags(write=False)
    return points, transform, integral


def differentiate(coefficients: Array) -> Array:
    """Coefficients of the derivative along axis 1 of an array (pieces, n, ...)."""
    return np.asarray(np.polynomial.chebyshev.chebder(coefficients, axis=1), dtype=float)


@njit(cache=True, nogil=True, error_model="numpy")
def evaluate_series(s: Any, breaks: Any, coefficients: Any, out: Any) -> None:
    """Evaluate piecewise Chebyshev series by Clenshaw's recurrence.

    Parameters
    ----------
    s : (m,)
        Points; those outside the breaks use the nearest piece.
    breaks : (p + 1,)
    coefficients : (p, n, c)
    out : (m, c)
    """
    n_pieces = breaks.size - 1
    n_terms = coefficients.shape[1]
    piece = 0
    for i in range(s.size):
        if s[i] < breaks[piece]:
            piece = 0
        while piece < n_pieces - 1 and s[i] >= breaks[piece + 1]:
            piece += 1
        x = (2.0 * s[i] - breaks[piece] - breaks[piece + 1]) / (breaks[piece + 1] - breaks[piece])
        for c in range(coefficients.shape[2]):
            b1 = 0.0
            b2 = 0.0
            for n in range(n_terms - 1, 0, -1):
                b1, b2 = 2.0 * x * b1 - b2 + coefficients[piece, n, c], b1
            out[i, c] = x * b1 - b2 + coefficients[piece, 0, c]
