"""The C3 least-squares spline."""

import numpy as np
import pytest
from scipy.interpolate import make_lsq_spline

from dnacheck.model.rod.spline import evaluate, fit_spline
from dnacheck.numerics.outcome import InputError


def _data(n=200, seed=0):
    rng = np.random.default_rng(seed)
    x = np.arange(float(n))
    return x, np.stack([np.sin(x / 17), np.cos(x / 23), x / 50], axis=1) + 0.01 * rng.normal(
        size=(n, 3)
    )


def _at(curve, x, order=0):
    piece = np.clip(np.searchsorted(curve.breaks, x, side="right") - 1, 0, len(curve.breaks) - 2)
    return evaluate(curve, piece, x, order)


@pytest.mark.parametrize("degree", [4, 5, 6])
def test_equals_scipy_least_squares_spline(degree):
    x, y = _data()
    breaks = np.linspace(0.0, 199.0, 13)
    knots = np.concatenate(
        [
            np.full(degree + 1, breaks[0]),
            np.repeat(breaks[1:-1], degree - 3),
            np.full(degree + 1, breaks[-1]),
        ]
    )
    expected = make_lsq_spline(x, y, knots, k=degree)
    curve = fit_spline(x, y, breaks, degree, 1e8)
    fine = np.linspace(0.0, 199.0, 777)
    assert np.allclose(_at(curve, fine), expected(fine), atol=1e-10)
    assert np.allclose(_at(curve, fine, 2), expected(fine, 2), atol=1e-9)


def test_reproduces_polynomials():
    x = np.arange(100.0)
    y = np.stack([(x / 50) ** 6 - x / 10, (x / 50) ** 5, np.ones_like(x)], axis=1)
    curve = fit_spline(x, y, np.linspace(0.0, 99.0, 9), 6, 1e8)
    assert curve.rms_residual < 1e-12
    # degree 5 can't
    assert fit_spline(x, y, np.linspace(0.0, 99.0, 3), 5, 1e8).rms_residual > 1e-6


@pytest.mark.parametrize("degree", [4, 6])
def test_three_derivatives_are_continuous_and_the_fourth_is_not(degree):
    x, y = _data()
    curve = fit_spline(x, y, np.linspace(0.0, 199.0, 13), degree, 1e8)
    joints = curve.breaks[1:-1]
    left = np.arange(len(joints))
    for order in range(4):
        jump = evaluate(curve, left, joints, order) - evaluate(curve, left + 1, joints, order)
        assert np.max(np.abs(jump)) < 1e-9
    jump = evaluate(curve, left, joints, 4) - evaluate(curve, left + 1, joints, 4)
    assert np.max(np.abs(jump)) > 1e-6


def test_too_many_coefficients_are_refused():
    x, y = _data(50)
    with pytest.raises(InputError, match="124 coefficients but only 50 points"):
        fit_spline(x, y, np.linspace(0.0, 49.0, 41), 6, 1e8)


def test_a_gap_in_the_data_is_refused():
    x, y = _data()
    keep = (x < 60) | (x > 110)
    with pytest.raises(InputError, match=r"ill-conditioned.*fewer intervals"):
        fit_spline(x[keep], y[keep], np.linspace(0.0, 199.0, 21), 6, 1e8)
