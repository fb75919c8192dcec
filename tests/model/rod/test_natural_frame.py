"""Arclength and natural frame against closed forms and against the paper's own equation (6.6)."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dnacheck.model.rod import chebyshev
from dnacheck.model.rod.natural_frame import evaluate_at_parameter, natural_frame
from dnacheck.model.rod.spline import evaluate, fit_spline
from dnacheck.numerics.outcome import InputError


def _helix(radius, pitch, n=120):
    """Helix of unit speed; curvature and torsion in closed form."""
    length = np.hypot(radius, pitch)
    t = np.arange(float(n))
    angle = t / length
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), pitch * angle], axis=1)
    return t, points, radius / length**2, pitch / length**2


def _curve(t, points, pieces=14):
    return fit_spline(t, points, np.linspace(t[0], t[-1], pieces + 1), 8, 1e8)


def test_helix_has_constant_curvature_and_turns_at_minus_its_torsion():
    t, points, curvature, torsion = _helix(12.0, 5.0)
    frame = natural_frame(_curve(t, points), 10.5, 100.5, np.array([1.0, 0, 0]), 21, 0.3)
    s = np.linspace(0.0, 1.0, 201)
    w = np.empty((201, 2))
    chebyshev.evaluate_series(s, frame.s_breaks, frame.strains, w)
    assert frame.length == pytest.approx(90.0, abs=1e-7)
    assert np.allclose(np.hypot(*w.T), curvature * frame.length, rtol=1e-6)
    # In the Frenet frame the curvature vector is fixed; the natural frame turns against it.
    phase = np.unwrap(np.arctan2(w[:, 1], w[:, 0]))
    assert (phase[-1] - phase[0]) == pytest.approx(torsion * frame.length, rel=1e-6)


def test_equals_the_papers_differential_equation():
    rng = np.random.default_rng(4)
    t = np.arange(150.0)
    bends = rng.normal(size=(3, 3, 1)) * 3.0
    points = np.stack(
        [sum(b * np.sin(t / (25.0 + 9 * j)) for j, b in enumerate(bends[c])) for c in range(3)],
        axis=1,
    )
    points[:, 2] += t
    curve = _curve(t, points, 15)
    frame = natural_frame(curve, 20.5, 120.5, np.array([1.0, 0, 0]), 21, 0.3)

    def tangent(x):
        piece = np.clip(np.searchsorted(curve.breaks, [x]) - 1, 0, len(curve.breaks) - 2)
        first = evaluate(curve, piece, np.array([x]), 1)[0]
        second = evaluate(curve, piece, np.array([x]), 2)[0]
        speed = np.linalg.norm(first)
        d3 = first / speed
        return d3, (second - (second @ d3) * d3) / speed

    def rate(x, d1):
        d3, slope = tangent(x)
        return -(slope @ d1) * d3

    d3, _ = tangent(20.5)
    d1 = np.array([1.0, 0, 0])
    d1 = d1 - (d1 @ d3) * d3
    d1 /= np.linalg.norm(d1)
    at = np.linspace(20.5, 120.5, 11)
    solution = solve_ivp(
        rate, (20.5, 120.5), d1, rtol=1e-11, atol=1e-12, t_eval=at, method="DOP853"
    )
    _, first, third = evaluate_at_parameter(frame, at)
    assert np.max(np.abs(first - solution.y.T)) < 1e-8
    assert np.max(np.abs(np.sum(first * third, axis=1))) < 1e-12
    # the Frenet-like frame that ignores (6.6) is far from it
    assert np.max(np.abs(np.sum(first * solution.y.T[::-1], axis=1) - 1.0)) > 1e-3


def test_monitors_report_a_frame_that_is_resolved_and_one_that_is_not():
    t, points, _, _ = _helix(6.0, 2.0)
    curve = _curve(t, points, 12)
    good = natural_frame(curve, 10.5, 100.5, np.array([1.0, 0, 0]), 25, 0.3)
    assert good.orthogonality < 1e-9
    assert good.equation_residual < 1e-8
    poor = natural_frame(curve, 10.5, 100.5, np.array([1.0, 0, 0]), 8, 0.3)
    assert poor.orthogonality > 1e-7
    assert poor.equation_residual > 1e-6


def test_a_centreline_that_stops_is_refused():
    t = np.arange(100.0)
    points = np.stack([np.zeros(100), np.zeros(100), np.abs(t - 50.0)], axis=1)
    with pytest.raises(InputError, match="slows to"):
        natural_frame(_curve(t, points), 10.5, 90.5, np.array([1.0, 0, 0]), 21, 0.3)
