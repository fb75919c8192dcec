"""Restrained ladders joined by MBAR against methods that restrain nothing."""

import logging
import math

import numpy as np
import pytest
from rods import molecule_chain
from short_chains import closed_ground_chain

from dnacheck.cyclization.half_chain.sampling import HalfChainOptions, half_chain
from dnacheck.cyclization.result import JStatus
from dnacheck.cyclization.umbrella.mbar import (
    RestrainedSeries,
    decorrelate,
    join_series,
    quiet_pymbar,
)
from dnacheck.cyclization.umbrella.sampling import UmbrellaOptions, metropolis, umbrella_estimate
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.numerics.outcome import InputError

SIGMAS = 3.0
CHAIN = closed_ground_chain(20, 2, 30.0)
SHORT = UmbrellaOptions(
    strengths=(0.0, 1.0, 4.0, 15.0, 50.0), samples=300, thinning=3, burn_in=40, copies=3
)


def gaussian_series(rng, strengths, samples, scale=1.0):
    """Records of a six-dimensional Gaussian of unit variance under restraints, and its density.

    The mean of a normalised Gaussian of width w about 0 is the density of variance 1 + w^2 there.
    """
    series = []
    width = 0.4
    for _ in range(2):
        points = np.array(
            [rng.standard_normal((samples, 6)) / math.sqrt(1.0 + scale * k) for k in strengths]
        )
        squares = np.sum(points**2, axis=2)
        kernel = -0.5 * squares / width**2 - 3.0 * math.log(2.0 * math.pi * width**2)
        places = (points[..., 0] > 0.0).astype(np.int64)
        series.append(RestrainedSeries(squares, (kernel, kernel - 0.1), places, places))
    return series, -3.0 * math.log(2.0 * math.pi * (1.0 + width**2))


def test_mbar_meets_an_exact_density_and_splits_it_by_link():
    strengths = np.array([0.0, 1.0, 3.0, 9.0])
    series, exact = gaussian_series(np.random.default_rng(1), strengths, 500)
    kept = [decorrelate(one)[0] for one in series]
    joined = join_series(strengths, series, kept, (0, 1))
    assert joined.errors[0] < 0.1
    assert abs(joined.log_means[0] - exact) < SIGMAS * joined.errors[0]
    assert joined.log_means[1] == pytest.approx(joined.log_means[0] - 0.1, abs=1e-9)
    for value, error in joined.links.values():
        assert abs(value - exact + math.log(2.0)) < SIGMAS * error
    # Control: samples of a wrong temperature are told apart.
    wrong, _ = gaussian_series(np.random.default_rng(1), strengths, 500, scale=1.4)
    off = join_series(strengths, wrong, [decorrelate(one)[0] for one in wrong])
    assert abs(off.log_means[0] - exact) > 5.0 * off.errors[0]


def test_correlated_records_are_thinned():
    rng = np.random.default_rng(2)
    squares = np.zeros((1, 3_000))
    noise = rng.standard_normal(3_000)
    for t in range(1, 3_000):
        squares[0, t] = 0.9 * squares[0, t - 1] + noise[t]
    places = np.zeros((1, 3_000), np.int64)
    kept, inefficiencies = decorrelate(RestrainedSeries(squares, (squares,), places, places))
    # (1 + a) / (1 - a) = 19 records for one independent one.
    assert inefficiencies[0] == pytest.approx(19.0, rel=0.4)
    assert len(kept[0]) == pytest.approx(3_000 / inefficiencies[0], abs=2.0)


@pytest.mark.parametrize(
    "moves",
    [
        {},
        {"pivots": False, "crankshafts": False},
        {"singles": False, "crankshafts": False},
    ],
    ids=["all", "single-angle", "pivot"],
)
def test_short_chain_meets_half_chains_with_any_moves(moves):
    from dataclasses import replace

    search = find_rings(CHAIN)
    reference = half_chain(search, HalfChainOptions(halves=10_000), 5)
    estimate = umbrella_estimate(search, replace(SHORT, **moves), np.random.default_rng(6))
    assert estimate.stderr < 0.4
    assert estimate.least_overlap > 0.03
    assert abs(-estimate.log_j - reference.minus_lnJ) < SIGMAS * math.hypot(
        estimate.stderr, reference.stderr
    )
    assert np.all(estimate.inefficiencies >= 1.0)
    assert np.allclose(estimate.overlap.sum(axis=1), 1.0, atol=1e-6)


def test_result_does_not_depend_on_threads_but_on_the_seed():
    from dataclasses import replace

    search = find_rings(CHAIN)
    tiny = replace(SHORT, samples=30, burn_in=8)
    runs = [
        umbrella_estimate(search, replace(tiny, threads=threads), np.random.default_rng(seed))
        for threads, seed in ((1, 1), (2, 1), (1, 2))
    ]
    assert runs[0].log_j == runs[1].log_j
    assert runs[0].copies == runs[1].copies
    assert runs[0].log_j != runs[2].log_j


def test_poor_overlap_is_reported():
    result = metropolis(
        CHAIN, UmbrellaOptions(strengths=(0.0, 60.0, 3e3), samples=40, burn_in=16, copies=2), 1
    )
    assert result.status is JStatus.TOLERANCE_NOT_MET
    assert any("overlap" in warning for warning in result.warnings)


def test_pymbar_is_quiet_and_its_logger_restored(caplog):
    logger = logging.getLogger("pymbar")
    level = logger.level
    with caplog.at_level(logging.DEBUG), quiet_pymbar() as pymbar:
        assert pymbar.MBAR is not None
    assert not caplog.records
    assert logger.level == level


@pytest.mark.parametrize(
    "bad",
    [
        {"strengths": (0.0, 1.0)},
        {"strengths": (1.0, 2.0, 3.0)},
        {"strengths": (0.0, 2.0, 1.0)},
        {"samples": 5},
        {"copies": 1},
        {"burn_in": 0},
        {"threads": 0},
        {"singles": False, "pivots": False},
    ],
)
def test_options_out_of_range_are_refused(bad):
    with pytest.raises(InputError):
        UmbrellaOptions(**bad)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["09T15", "08T15", "08A17"])
def test_best_cyclizers_meet_half_chains(name):
    search = find_rings(molecule_chain(name))
    reference = half_chain(search, HalfChainOptions(halves=40_000, threads=2), 1)
    result = metropolis(search, UmbrellaOptions(samples=800, threads=2), 2)
    assert result.stderr <= 0.15
    assert abs(result.minus_lnJ - reference.minus_lnJ) < SIGMAS * math.hypot(
        result.stderr, reference.stderr
    )
