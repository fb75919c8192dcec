"""The first anharmonic term of Laplace's approximation."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rods import molecule_chain

from dnacheck.cyclization.closure.sampling import ClosureOptions, sample_closure
from dnacheck.cyclization.laplace import anharmonic
from dnacheck.cyclization.laplace.anharmonic import (
    AnharmonicOptions,
    anharmonic_term,
    corrected_laplace,
)
from dnacheck.cyclization.laplace.register import register_profile
from dnacheck.cyclization.result import JStatus
from dnacheck.model.chain import Chain, uniform_stiffness
from dnacheck.numerics.outcome import InputError


def straight(n: int) -> Chain:
    ground = np.zeros((n, 3))
    ground[:, 0] = 2.0 * math.pi / 10.45
    return Chain(f"straight {n}", ground, uniform_stiffness(n, 1.5), twist_ratio=1.5)


@pytest.mark.parametrize(
    ("chain", "bias"),
    [(molecule_chain("09T15"), 0.26), (straight(100), 0.17), (straight(200), 0.34)],
    ids=["09T15", "straight-100", "straight-200"],
)
def test_meets_exact_closure_where_laplace_does_not(chain, bias):
    profile = register_profile(chain)
    exact = sample_closure(profile, ClosureOptions(tolerance=0.008), seed=2)
    corrected = corrected_laplace(profile, seed=1)
    sigma = math.hypot(exact.stderr, corrected.total_error)
    assert sigma < 0.02
    assert abs(corrected.minus_lnJ - exact.minus_lnJ) < 3.5 * sigma
    assert abs(-profile.log_j - exact.minus_lnJ - bias) < 0.05


def test_the_term_is_linear_in_the_temperature():
    """At half the temperature the same draws give half the term, and a quarter of the next."""
    warm = molecule_chain("09T15")
    cold = replace(warm, persistence_length_A=2.0 * warm.persistence_length_A)
    options = AnharmonicOptions(tolerance=10.0, first_pairs=400)
    terms = [anharmonic_term(register_profile(chain), options, 5) for chain in (warm, cold)]
    noise = math.hypot(terms[0].stderr, 2.0 * terms[1].stderr)
    assert noise < 0.012
    assert terms[0].value == pytest.approx(2.0 * terms[1].value, abs=4.0 * noise)
    # Control: Laplace's bias would not pass for linear with a term left out.
    assert terms[0].value > 10.0 * noise


def test_leaving_out_the_squared_cubic_terms_is_seen(monkeypatch):
    profile = register_profile(straight(300))
    exact = sample_closure(profile, ClosureOptions(tolerance=0.01), seed=2)
    drawn = anharmonic._Drawer(profile, 1).draw(1500)
    whole = anharmonic._term(drawn)
    even = np.repeat(drawn.mean(axis=2, keepdims=True), 2, axis=2)
    part = anharmonic._term(even)
    sigma = math.hypot(exact.stderr, whole.stderr, whole.next_term)
    laplace_is_off_by = -profile.log_j - exact.minus_lnJ
    assert abs(whole.value - laplace_is_off_by) < 3.5 * sigma
    assert abs(part.value - laplace_is_off_by) > 3.0 * sigma


def test_draws_go_on_until_the_tolerance():
    profile = register_profile(molecule_chain("12A09"))
    few = anharmonic_term(profile, AnharmonicOptions(tolerance=1.0), 1)
    many = anharmonic_term(profile, AnharmonicOptions(tolerance=0.5 * few.stderr), 1)
    assert few.pairs == 200
    assert many.stderr <= 0.5 * few.stderr
    assert many.pairs > 3 * few.pairs
    again = anharmonic_term(profile, AnharmonicOptions(tolerance=1.0), 1)
    assert again == few


def test_a_tolerance_out_of_reach_is_said():
    options = AnharmonicOptions(tolerance=1e-4, first_pairs=16, most_pairs=32)
    result = corrected_laplace(molecule_chain("09T15"), options)
    assert result.status is JStatus.TOLERANCE_NOT_MET
    assert result.method == "corrected-laplace"
    assert result.total_error > 1e-4


@pytest.mark.parametrize(
    "bad",
    [
        {"tolerance": 0.0},
        {"tolerance": math.nan},
        {"first_pairs": 4},
        {"first_pairs": 100, "most_pairs": 50},
    ],
)
def test_options_out_of_range_are_refused(bad):
    with pytest.raises(InputError):
        AnharmonicOptions(**bad)
