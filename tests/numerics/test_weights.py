"""Means of weights and their diagnostics."""

import math

import numpy as np
import pytest

from dnacheck.numerics.outcome import InputError
from dnacheck.numerics.statistics import (
    batch_error,
    checked_weights,
    pareto_shape,
    summarise_weights,
)


def test_log_normal_mean_and_error():
    rng = np.random.default_rng(1)
    sigma = 0.5
    values = rng.normal(-0.5 * sigma**2 + 700.0, sigma, 40_000)  # exp(700) would overflow squared
    summary = summarise_weights(values)
    expected = math.sqrt(math.expm1(sigma**2) / values.size)
    assert summary.stderr == pytest.approx(expected, rel=0.05)
    assert abs(summary.log_mean - 700.0) < 4 * expected
    assert summary.effective_samples == pytest.approx(values.size * math.exp(-(sigma**2)), rel=0.05)
    assert not summary.heavy


@pytest.mark.parametrize("shape", [0.3, 0.6, 1.0, 1.5])
def test_pareto_shape_recovers_the_tail(shape):
    rng = np.random.default_rng(2)
    log_weights = -shape * np.log(rng.random(100_000))
    assert pareto_shape(log_weights) == pytest.approx(shape, abs=0.12)


def test_heavy_tail_is_reported_and_a_light_one_is_not():
    rng = np.random.default_rng(3)
    assert summarise_weights(-1.2 * np.log(rng.random(5000))).heavy
    assert not summarise_weights(np.log(rng.random(5000))).heavy


def test_zero_weights_count_in_the_mean():
    summary = summarise_weights(checked_weights([0.0, 2.0, 0.0, 2.0]))
    assert summary.log_mean == pytest.approx(0.0)
    assert summary.effective_samples == pytest.approx(2.0)


@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
def test_a_bad_weight_is_an_error_never_a_number(bad):
    with pytest.raises(InputError, match="weight 1 is"):
        checked_weights([1.0, bad, 3.0])


def test_a_bad_log_weight_is_an_error():
    with pytest.raises(InputError):
        summarise_weights([0.0, math.nan])
    with pytest.raises(InputError):
        summarise_weights([])


def test_batch_error_needs_two_batches():
    assert batch_error([1.0, 3.0]) == pytest.approx(1.0)
    with pytest.raises(InputError):
        batch_error([1.0])
