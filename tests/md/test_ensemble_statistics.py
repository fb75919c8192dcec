"""Error bars of correlated series."""

import numpy as np
import pytest

from dnacheck.md.ensemble_statistics import (
    block_means,
    block_stderr,
    estimate,
    statistical_inefficiency,
)
from dnacheck.numerics.outcome import InputError


def autoregressive(rho, shape, seed=0):
    """Series with autocorrelation rho**lag, mean 0, variance 1; inefficiency (1+rho)/(1-rho)."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal(shape)
    series = np.empty(shape)
    series[:, 0] = noise[:, 0]
    for k in range(1, shape[1]):
        series[:, k] = rho * series[:, k - 1] + np.sqrt(1.0 - rho**2) * noise[:, k]
    return series


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_inefficiency_of_an_autoregressive_series(rho):
    series = autoregressive(rho, (4, 20000))
    assert statistical_inefficiency(series) == pytest.approx((1 + rho) / (1 - rho), rel=0.2)


def test_inefficiency_is_pymbars():
    import logging
    import warnings

    logging.getLogger("pymbar").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from pymbar.timeseries import statistical_inefficiency_multiple
    series = autoregressive(0.8, (3, 3000))
    theirs = statistical_inefficiency_multiple(list(series))
    assert statistical_inefficiency(series) == pytest.approx(theirs, rel=0.05)


def test_a_constant_series_has_no_error():
    assert estimate(np.full((2, 50), 3.0)).stderr == 0.0


def test_errors_cover_the_truth():
    errors = []
    for seed in range(60):
        series = autoregressive(0.7, (2, 1000), seed)
        result = estimate(series)
        errors.append(result.mean / result.stderr)
        blocks = float(block_stderr(series))
        assert 0.4 < blocks / result.stderr < 2.0
    assert 0.8 < np.std(errors) < 1.25
    # The control: an error that forgets the correlation is far too small.
    naive = [autoregressive(0.7, (2, 1000), seed).mean() * np.sqrt(2000.0) for seed in range(60)]
    assert np.std(naive) > 1.8


def test_blocks():
    values = np.arange(24.0).reshape(2, 12)
    assert block_means(values, 3)[0] == pytest.approx(1.5)
    assert block_means(values, 5).shape == (10,)
    with pytest.raises(InputError, match="too few"):
        block_means(values, 13)
