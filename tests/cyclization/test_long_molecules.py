"""Molecules of many persistence lengths: diagnosis, the method chosen, and J from theory."""

import math
import random

import numpy as np
import pytest

from dnacheck.cyclization.methods import Auto, ClosureSampling, HalfChain
from dnacheck.cyclization.result import JStatus
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.io.sequences import parse_sequence
from dnacheck.model.chain import Chain, build_chain, uniform_stiffness
from dnacheck.numerics.statistics import summarise_weights
from dnacheck.validation.reference.wormlike_chain import long_ring_j

SIGMAS = 3.0
# -ln J of prefixes of one random molecule, by half chains drawn about rings in windows of another
# kind, three seeds each.
TILTED = {1000: (16.48, 0.01), 2000: (17.19, 0.02)}


def random_chain(n_bp: int) -> Chain:
    rng = random.Random(4361)
    letters = "".join(rng.choice("ACGT") for _ in range(n_bp))
    return build_chain(parse_sequence(letters, f"random {n_bp}"))


def straight_chain(n_bp: int) -> Chain:
    twist = 2.0 * math.pi / 10.5
    return Chain("straight", np.tile([twist, 0.0, 0.0], (n_bp, 1)), uniform_stiffness(n_bp, 1.0))


def test_a_long_straight_molecule_meets_the_gaussian_chain():
    chain = straight_chain(4361)
    result = HalfChain(halves=6_000).compute(chain, rng=1)
    bend = np.linalg.inv(chain.energy_scale_RT * chain.stiffness)[0, 1, 1]
    persistence = chain.rise_A / bend
    length = chain.n_steps * chain.rise_A
    expected = -math.log(long_ring_j(length, persistence))
    next_term = (2.0 * persistence / length) ** 2
    assert expected == pytest.approx(18.43, abs=0.01)
    assert result.stderr < 0.06
    assert result.status is JStatus.CONVERGED
    assert abs(result.minus_lnJ - expected) < SIGMAS * math.hypot(result.stderr, next_term)
    # Control: a persistence length of a fifth more.
    stiffer = -math.log(long_ring_j(length, 1.2 * persistence))
    assert abs(result.minus_lnJ - stiffer) > 5.0 * result.stderr


def test_auto_leaves_closure_sampling_where_draws_fold():
    chain = random_chain(1000)
    value, error = TILTED[1000]
    result = Auto().compute(chain, rng=2, tolerance=0.08)
    assert result.method == "half-chain"
    assert result.status is JStatus.CONVERGED
    assert result.total_error <= 0.08
    assert abs(result.minus_lnJ - value) < SIGMAS * math.hypot(result.stderr, error)
    assert [attempt.method for attempt in result.tried] == ["half-chain"]


def test_closure_sampling_knows_that_its_draws_fold():
    search = find_rings(random_chain(1000))
    result = ClosureSampling(most_draws=1).compute(search, rng=1, tolerance=0.5)
    assert result.status in (JStatus.FOLDED, JStatus.HEAVY_TAILS)
    assert not result.status.ok
    # Control: a short molecule's draws do not fold.
    short = ClosureSampling(most_draws=1).compute(random_chain(150), rng=1, tolerance=0.5)
    assert short.status is JStatus.CONVERGED


@pytest.mark.parametrize("shape", [0.3, 0.8])
def test_the_unseen_tail_is_as_large_as_means_fall_short(shape):
    # Generalised Pareto weights: the mean without what lies beyond the largest of n draws.
    rng = np.random.default_rng(5)
    runs = rng.pareto(1.0 / shape, (2_000, 1_000))
    true = 1.0 / (1.0 / shape - 1.0)
    shortfall = 1.0 - np.median(runs.mean(axis=1)) / true
    stated = np.median([summarise_weights(np.log(run)).unseen for run in runs[:200]])
    if shape < 0.5:  # the standard error covers it
        assert stated == 0.0
    else:
        assert shortfall > 0.02
        assert shortfall < stated < 10.0 * shortfall


@pytest.mark.slow
@pytest.mark.parametrize("n_bp", sorted(TILTED))
def test_auto_agrees_with_tilted_half_chains(n_bp):
    value, error = TILTED[n_bp]
    result = Auto().compute(random_chain(n_bp), rng=7, tolerance=0.05)
    assert result.total_error <= 0.05
    assert abs(result.minus_lnJ - value) < SIGMAS * math.hypot(result.stderr, error)


@pytest.mark.slow
def test_five_thousand_base_pairs_meet_a_tolerance_of_a_twentieth():
    result = Auto().compute(random_chain(5000), rng=1, tolerance=0.05)
    assert result.status is JStatus.CONVERGED
    assert result.total_error <= 0.05
    assert all(attempt.method == "half-chain" for attempt in result.tried)
