"""Arclength, natural frame and unstressed strains of a fitted centreline (Sections VI D, VII)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.model.rod import chebyshev
from dnacheck.model.rod.spline import PiecewisePolynomial, evaluate
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NaturalFrame:
    """Natural frame of the true molecule, represented piece by piece.

    Attributes
    ----------
    t_breaks : ndarray, shape (p + 1,)
        Ends of the pieces in the parameter t of Section VI A, from 1/2 to N + 1/2.
    s_breaks : ndarray, shape (p + 1,)
        The same in arclength, scaled to run from 0 to 1.
    length : float
        Arclength in steps, sigma_final - sigma_init.
    strains : ndarray, shape (p, n, 2)
        Chebyshev coefficients in s of w1hat and w2hat on each piece (per unit s).
    parameter : ndarray, shape (p, n, 1)
        Chebyshev coefficients in s of t.
    frame : ndarray, shape (p, n, 6)
        Chebyshev coefficients in s of D1 (three components) and D3.
    orthogonality : float
        Largest of | |D1| - 1 | and |D1 . D3| on a grid between the points of representation.
    equation_residual : float
        Largest |D1' + (D3' . D1) D3| of (6.6) on the same grid, relative to the largest |D3'|.
    """

    t_breaks: Array
    s_breaks: Array
    length: float
    strains: Array
    parameter: Array
    frame: Array
    orthogonality: float
    equation_residual: float


def _arclength_points(
    curve: PiecewisePolynomial, pieces: NDArray[np.intp], t_breaks: Array, n: int, slowest: float
) -> tuple[Array, Array]:
    """Arclength of every piece, and t at its Chebyshev points in arclength, (p,) and (p, n)."""
    points, transform, integral = chebyshev.tables(n)
    half = 0.5 * np.diff(t_breaks)
    middle = 0.5 * (t_breaks[1:] + t_breaks[:-1])
    t = middle[:, None] + half[:, None] * points
    index = np.broadcast_to(pieces[:, None], t.shape)
    speed = np.linalg.norm(evaluate(curve, index, t, 1), axis=-1)
    if not np.all(np.isfinite(speed)) or speed.min() < slowest:
        raise InputError(
            f"the fitted centreline slows to {np.nanmin(speed):.2g} steps per base pair "
            f"(limit {slowest}): the filter erases the path; narrow filter_width or raise intervals"
        )
    arc = half[:, None] * (speed @ integral.T)
    length = arc[:, -1]
    arc_series = arc @ transform.T
    slope_series = speed @ transform.T
    target = 0.5 * length[:, None] * (points + 1.0)
    x = np.broadcast_to(points, t.shape).copy()
    basis_order = n - 1
    for _ in range(8):
        basis = np.polynomial.chebyshev.chebvander(x, basis_order)
        error = np.einsum("pjn,pn->pj", basis, arc_series) - target
        slope = half[:, None] * np.einsum("pjn,pn->pj", basis, slope_series)
        x = np.clip(x - error / slope, -1.0, 1.0)
        if np.max(np.abs(error)) < 1e-14 * length.max():
            break
    return length, middle[:, None] + half[:, None] * x


def _tangent_and_curvature(
    curve: PiecewisePolynomial, pieces: NDArray[np.intp], t: Array
) -> tuple[Array, Array]:
    """D3 and its derivative by arclength at t (p, n), both (p, n, 3)."""
    index = np.broadcast_to(pieces[:, None], t.shape)
    first = evaluate(curve, index, t, 1)
    second = evaluate(curve, index, t, 2)
    speed = np.linalg.norm(first, axis=-1, keepdims=True)
    tangent = first / speed
    along = np.sum(second * tangent, axis=-1, keepdims=True)
    return tangent, (second - along * tangent) / speed**2


def natural_frame(
    curve: PiecewisePolynomial, t_first: float, t_last: float, start: Array, n: int, slowest: float
) -> NaturalFrame:
    """Natural frame of the curve between two parameter values.

    On a piece a fixed direction e nearly perpendicular to all its tangents gives a reference frame
    A = e x D3 / |e x D3|, B = D3 x A. The natural frame differs from it by a rotation about D3
    whose angle obeys theta' = -A'.B = (e x D3').B / -|e x D3|, so that (6.6) becomes one
    quadrature: D1 is orthonormal to D3 by construction, and its error is the quadrature's.

    Parameters
    ----------
    curve : PiecewisePolynomial
        Centreline r(t) of the padded molecule, in steps.
    t_first, t_last : float
        Ends of the true molecule.
    start : ndarray, shape (3,)
        D1 at t_first, before projection onto the normal plane.
    n : int
        Chebyshev points per piece.
    slowest : float
        Least accepted |dr/dt|.

    Raises
    ------
    InputError
        The centreline nearly stops somewhere.
    """
    inside = (curve.breaks > t_first) & (curve.breaks < t_last)
    t_breaks = np.concatenate([[t_first], curve.breaks[inside], [t_last]])
    middle = 0.5 * (t_breaks[1:] + t_breaks[:-1])
    pieces = np.clip(np.searchsorted(curve.breaks, middle) - 1, 0, curve.breaks.size - 2)
    _, transform, integral = chebyshev.tables(n)
    lengths, t = _arclength_points(curve, pieces, t_breaks, n, slowest)
    tangent, curvature = _tangent_and_curvature(curve, pieces, t)

    second_moment = np.einsum("pja,pjb->pab", tangent, tangent)
    axes = np.linalg.eigh(second_moment)[1][:, :, 0]
    side = np.cross(axes[:, None, :], tangent)
    sine = np.linalg.norm(side, axis=-1, keepdims=True)
    a = side / sine
    b = np.cross(tangent, a)
    rate = -np.sum(np.cross(axes[:, None, :], curvature) * b, axis=-1) / sine[..., 0]
    theta = 0.5 * lengths[:, None] * (rate @ integral.T)
    direction = start
    for i in range(len(lengths)):
        theta[i] += np.arctan2(direction @ b[i, 0], direction @ a[i, 0])
        direction = np.cos(theta[i, -1]) * a[i, -1] + np.sin(theta[i, -1]) * b[i, -1]
    cosine, sine = np.cos(theta)[..., None], np.sin(theta)[..., None]
    d1 = cosine * a + sine * b
    d2 = cosine * b - sine * a

    length = float(lengths.sum())
    s_breaks = np.concatenate([[0.0], np.cumsum(lengths) / length])
    s_breaks[-1] = 1.0
    strains = length * np.stack(
        [-np.sum(curvature * d2, axis=-1), np.sum(curvature * d1, axis=-1)], axis=-1
    )

    def series(values: Array) -> Array:
        return np.ascontiguousarray(np.einsum("nj,pjc->pnc", transform, values))

    frame = series(np.concatenate([d1, tangent], axis=-1))
    orthogonality, residual = _monitor(frame, s_breaks)
    return NaturalFrame(
        t_breaks=t_breaks,
        s_breaks=s_breaks,
        length=length,
        strains=series(strains),
        parameter=series(t[..., None]),
        frame=frame,
        orthogonality=orthogonality,
        equation_residual=residual,
    )


def _monitor(frame: Array, s_breaks: Array) -> tuple[float, float]:
    """Orthonormality and residual of (6.6), midway between the points of representation."""
    n = frame.shape[1]
    points = chebyshev.tables(n)[0]
    between = 0.5 * (points[1:] + points[:-1])
    basis = np.polynomial.chebyshev.chebvander(between, n - 1)
    values = np.einsum("jn,pnc->pjc", basis, frame)
    slopes = np.einsum("jn,pnc->pjc", basis[:, :-1], chebyshev.differentiate(frame))
    slopes *= (2.0 / np.diff(s_breaks))[:, None, None]
    d1, d3 = values[..., :3], values[..., 3:]
    slope1, slope3 = slopes[..., :3], slopes[..., 3:]
    dot = np.sum(d1 * d3, axis=-1)
    orthogonality = max(
        float(np.max(np.abs(dot))), float(np.max(np.abs(np.linalg.norm(d1, axis=-1) - 1.0)))
    )
    bend = np.sum(slope3 * d1, axis=-1, keepdims=True)
    scale = max(float(np.max(np.linalg.norm(slope3, axis=-1))), 1.0)
    residual = float(np.max(np.linalg.norm(slope1 + bend * d3, axis=-1))) / scale
    return orthogonality, residual


def evaluate_at_parameter(natural: NaturalFrame, t: Array) -> tuple[Array, Array, Array]:
    """Arclength, D1 and D3 at given t: shapes (m,), (m, 3), (m, 3).

    t(s) is inverted by Newton's method on its series, safeguarded by the piece's ends.
    """
    breaks = natural.t_breaks
    piece = np.clip(np.searchsorted(breaks, t, side="right") - 1, 0, breaks.size - 2)
    n = natural.parameter.shape[1]
    series = natural.parameter[piece, :, 0]
    slope_series = chebyshev.differentiate(natural.parameter)[piece, :, 0]
    x = (2.0 * t - breaks[piece] - breaks[piece + 1]) / (breaks[piece + 1] - breaks[piece])
    for _ in range(8):
        basis = np.polynomial.chebyshev.chebvander(x, n - 1)
        error = np.sum(basis * series, axis=1) - t
        slope = np.sum(basis[:, :-1] * slope_series, axis=1)
        x = np.clip(x - error / slope, -1.0, 1.0)
        if np.max(np.abs(error)) < 1e-13 * max(1.0, float(breaks[-1])):
            break
    basis = np.polynomial.chebyshev.chebvander(x, n - 1)
    frame = np.einsum("mn,mnc->mc", basis, natural.frame[piece])
    s = natural.s_breaks
    arclength = s[piece] + 0.5 * (x + 1.0) * (s[piece + 1] - s[piece])
    return arclength, frame[:, :3], frame[:, 3:]
