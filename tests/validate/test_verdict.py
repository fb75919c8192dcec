"""Verdicts from numbers with and without error bars."""

import math

import pytest

from dnacheck.validation.engine.verdict import (
    Rule,
    Verdict,
    failed,
    judge,
    must_fail,
    overall,
    skipped,
)


def verdict(got, expected, rule, tolerance=None, **more):
    return judge("n", "q", got, expected, rule, "s", "w", tolerance, **more).verdict


@pytest.mark.parametrize(
    ("got", "expected", "rule", "tolerance", "wanted"),
    [
        (1.0004, 1.0, Rule.RELATIVE, 5e-4, Verdict.PASS),
        (1.0006, 1.0, Rule.RELATIVE, 5e-4, Verdict.FAIL),
        (-1.0006, -1.0, Rule.RELATIVE, 5e-4, Verdict.FAIL),
        (0.59, 0.5, Rule.ABSOLUTE, 0.1, Verdict.PASS),
        (0.61, 0.5, Rule.ABSOLUTE, 0.1, Verdict.FAIL),
        (1.0, 1.0, Rule.AT_MOST, None, Verdict.PASS),
        (1.1, 1.0, Rule.AT_MOST, None, Verdict.FAIL),
        (0.9, 1.0, Rule.AT_LEAST, None, Verdict.FAIL),
        (15, 15, Rule.EQUAL, None, Verdict.PASS),
        (14, 15, Rule.EQUAL, None, Verdict.FAIL),
        (None, 15, Rule.EQUAL, None, Verdict.FAIL),
        (math.nan, 1.0, Rule.ABSOLUTE, 0.1, Verdict.FAIL),
        (math.inf, 1.0, Rule.AT_LEAST, None, Verdict.FAIL),
        (math.nan, 1.0, Rule.AT_MOST, None, Verdict.FAIL),
        (True, 1.0, Rule.ABSOLUTE, 0.1, Verdict.FAIL),
    ],
)
def test_rules(got, expected, rule, tolerance, wanted):
    assert verdict(got, expected, rule, tolerance) is wanted


@pytest.mark.parametrize(
    ("got", "sigma", "wanted"),
    [
        (1.05, 0.01, Verdict.PASS),
        (1.05, 0.2, Verdict.INCONCLUSIVE),  # the error bar is wider than the tolerance
        (1.12, 0.02, Verdict.INCONCLUSIVE),  # beyond, but within two standard errors
        (1.3, 0.02, Verdict.FAIL),
        (2.0, 0.2, Verdict.FAIL),  # wide, and out of reach all the same
        (1.0, math.nan, Verdict.FAIL),
    ],
)
def test_error_bars(got, sigma, wanted):
    assert verdict(got, 1.0, Rule.ABSOLUTE, 0.1, got_sigma=sigma) is wanted


def test_sigmas_needs_an_error_bar_that_is_not_too_wide():
    assert verdict(1.2, 1.0, Rule.SIGMAS, 3.0, got_sigma=0.1) is Verdict.PASS
    assert verdict(1.4, 1.0, Rule.SIGMAS, 3.0, got_sigma=0.1) is Verdict.FAIL
    assert verdict(1.0, 1.0, Rule.SIGMAS, 3.0) is Verdict.FAIL
    wide = verdict(9.0, 1.0, Rule.SIGMAS, 3.0, got_sigma=5.0, widest_sigma=0.5)
    assert wide is Verdict.INCONCLUSIVE


def test_a_rule_without_its_tolerance_is_a_mistake_of_the_check():
    with pytest.raises(ValueError, match="positive tolerance"):
        verdict(1.0, 1.0, Rule.RELATIVE)


def test_a_control_passes_only_by_being_refused():
    refused = judge("n", "q", 2.0, 1.0, Rule.ABSOLUTE, "s", "w", 0.1)
    accepted = judge("n", "q", 1.0, 1.0, Rule.ABSOLUTE, "s", "w", 0.1)
    unsure = judge("n", "q", 1.0, 1.0, Rule.ABSOLUTE, "s", "w", 0.1, got_sigma=1.0)
    assert must_fail(refused, "it is wrong").verdict is Verdict.PASS
    assert must_fail(accepted, "it is wrong").verdict is Verdict.FAIL
    assert must_fail(unsure, "it is wrong").verdict is Verdict.FAIL
    assert must_fail(accepted, "it is wrong").control


def test_overall():
    good = judge("n", "q", 1.0, 1.0, Rule.ABSOLUTE, "s", "w", 0.1)
    assert overall([good, skipped("a", "q", "absent")]) is Verdict.PASS
    assert overall([good, failed("a", "q", "broke")]) is Verdict.FAIL
    assert overall([skipped("a", "q", "absent")]) is Verdict.FAIL
    assert overall([]) is Verdict.FAIL
