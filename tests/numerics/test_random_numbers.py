"""The random numbers of the Metropolis kernels."""

import numpy as np
from scipy import stats

from dnacheck.numerics.random_numbers import (
    below,
    next_word,
    normal,
    random_state,
    uniform,
    unit_vector,
)

# First outputs of xoshiro256++ from the state 1, 2, 3, 4, as the authors' C code gives them.
KNOWN = (
    41943041,
    58720359,
    3588806011781223,
    3591011842654386,
    9228616714210784205,
    9973669472204895162,
)


def test_the_words_are_those_of_the_published_generator():
    state = np.array([1, 2, 3, 4], dtype=np.uint64)
    assert tuple(int(next_word(state)) for _ in KNOWN) == KNOWN


def test_streams_of_one_seed_differ_and_repeat():
    first, second = np.random.default_rng(7), np.random.default_rng(7)
    states = [random_state(first) for _ in range(3)]
    assert len({tuple(s) for s in states}) == 3
    assert np.array_equal(states[0], random_state(second))


def test_uniform_normal_and_directions_have_their_distributions():
    state = random_state(np.random.default_rng(1))
    u = np.array([uniform(state) for _ in range(20_000)])
    assert stats.kstest(u, "uniform").pvalue > 1e-3
    x = np.array([normal(state) for _ in range(20_000)])
    assert stats.kstest(x, "norm").pvalue > 1e-3
    assert stats.kstest(1.02 * x, "norm").pvalue > stats.kstest(1.1 * x, "norm").pvalue
    assert stats.kstest(1.1 * x, "norm").pvalue < 1e-3
    v = np.empty((20_000, 3))
    for row in v:
        unit_vector(state, row)
    assert np.allclose((v**2).sum(axis=1), 1.0)
    for axis in range(3):
        assert stats.kstest(v[:, axis], stats.uniform(-1.0, 2.0).cdf).pvalue > 1e-3


def test_integers_cover_their_range_evenly():
    state = random_state(np.random.default_rng(2))
    counts = np.bincount([below(state, 7) for _ in range(7_000)], minlength=7)
    assert stats.chisquare(counts).pvalue > 1e-3
