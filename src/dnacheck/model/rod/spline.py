"""Least-squares spline, three times continuously differentiable (Section VI B)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PiecewisePolynomial:
    """Piecewise polynomial curve.

    Attributes
    ----------
    breaks : ndarray, shape (p + 1,)
    coefficients : ndarray, shape (p, degree + 1, dim)
        Entry (i, n, c): coefficient of x**n of component c on piece i, x in [-1, 1] across it.
    condition : float
        Condition number of the least-squares matrix.
    rms_residual : float
        Root mean square distance between data and curve.
    """

    breaks: Array
    coefficients: Array
    condition: float
    rms_residual: float


@njit(cache=True, nogil=True, error_model="numpy")
def basis_values(x: Any, knots: Any, degree: int, rows: Any, first: Any) -> None:
    """B-spline values by the Cox-de Boor recursion.

    ``rows`` (len(x), degree + 1) receives the values that do not vanish, ``first`` (len(x),) the
    index of the first of them. ``knots`` is clamped (degree + 1 equal knots at both ends).
    """
    n_basis = knots.size - degree - 1
    span = degree
    left = np.empty(degree + 1)
    right = np.empty(degree + 1)
    for i in range(x.size):
        if x[i] < knots[span]:
            span = degree
        while span < n_basis - 1 and x[i] >= knots[span + 1]:
            span += 1
        first[i] = span - degree
        rows[i, 0] = 1.0
        for j in range(1, degree + 1):
            left[j] = x[i] - knots[span + 1 - j]
            right[j] = knots[span + j] - x[i]
            saved = 0.0
            for r in range(j):
                term = rows[i, r] / (right[r + 1] + left[j - r])
                rows[i, r] = saved + right[r + 1] * term
                saved = left[j - r] * term
            rows[i, j] = saved


def _design(x: Array, knots: Array, degree: int) -> Array:
    """Dense matrix of all B-splines at the points x, shape (len(x), n_basis)."""
    rows = np.empty((x.size, degree + 1))
    first = np.empty(x.size, dtype=np.int64)
    basis_values(np.ascontiguousarray(x), knots, degree, rows, first)
    matrix = np.zeros((x.size, knots.size - degree - 1))
    np.put_along_axis(matrix, first[:, None] + np.arange(degree + 1), rows, axis=1)
    return matrix


def fit_spline(
    x: Array, values: Array, breaks: Array, degree: int, condition_limit: float
) -> PiecewisePolynomial:
    """C3 least-squares spline of the given degree through (x, values).

    Parameters
    ----------
    x : ndarray, shape (n,)
        Increasing.
    values : ndarray, shape (n, dim)
    breaks : ndarray, shape (k + 1,)
        Ends of the k pieces; interior breaks are knots of multiplicity degree - 3.
    degree : int
        At least 4.
    condition_limit : float

    Raises
    ------
    InputError
        When there are fewer data than coefficients or the fit is singular or ill-conditioned.
    """
    k = breaks.size - 1
    n_coefficients = k * (degree - 3) + 4
    mend = "use fewer intervals, a lower degree or more padding"
    if n_coefficients > x.size:
        raise InputError(
            f"spline of {k} intervals of degree {degree} has {n_coefficients} coefficients "
            f"but only {x.size} points to fit: {mend}"
        )
    knots = np.concatenate(
        [
            np.full(degree + 1, breaks[0]),
            np.repeat(breaks[1:-1], degree - 3),
            np.full(degree + 1, breaks[-1]),
        ]
    )
    matrix = _design(x, knots, degree)
    q, r = np.linalg.qr(matrix)
    singular = np.linalg.svd(r, compute_uv=False)
    condition = float(singular[0] / singular[-1]) if singular[-1] > 0.0 else np.inf
    if not condition <= condition_limit:
        raise InputError(
            f"least-squares spline of {k} intervals of degree {degree} through {x.size} points is "
            f"ill-conditioned (condition number {condition:.1e} > {condition_limit:.1e}): {mend}"
        )
    solution = np.linalg.solve(r, q.T @ values)
    residual = values - matrix @ solution
    # Local polynomials: exact through degree + 1 Chebyshev points of each piece.
    nodes = np.cos(np.pi * (np.arange(degree + 1)[::-1] + 0.5) / (degree + 1))
    half = 0.5 * np.diff(breaks)
    local = (0.5 * (breaks[:-1] + breaks[1:]))[:, None] + half[:, None] * nodes
    at_nodes = (_design(local.ravel(), knots, degree) @ solution).reshape(k, degree + 1, -1)
    to_powers = np.linalg.inv(np.vander(nodes, increasing=True))
    return PiecewisePolynomial(
        breaks=breaks,
        coefficients=np.einsum("nj,pjc->pnc", to_powers, at_nodes),
        condition=condition,
        rms_residual=float(np.sqrt(np.mean(np.sum(residual**2, axis=1)))),
    )


def evaluate(curve: PiecewisePolynomial, piece: NDArray[np.intp], x: Array, order: int) -> Array:
    """Derivative of the given order at x, with the piece of every point given.

    ``piece`` and ``x`` share any shape; the result has one more axis, of length dim.
    """
    half = 0.5 * (curve.breaks[1:] - curve.breaks[:-1])
    local = (x - 0.5 * (curve.breaks[1:] + curve.breaks[:-1])[piece]) / half[piece]
    coefficients = curve.coefficients
    for _ in range(order):
        powers = np.arange(1, coefficients.shape[1])
        coefficients = coefficients[:, 1:] * powers[:, None] / half[:, None, None]
    taken = coefficients[piece]
    result = np.zeros((*x.shape, coefficients.shape[2]))
    for n in range(coefficients.shape[1] - 1, -1, -1):
        result = result * local[..., None] + taken[..., n, :]
    return result
