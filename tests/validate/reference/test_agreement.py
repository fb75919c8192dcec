"""All methods on one molecule."""

import math

import numpy as np
import pytest
from rods import molecule_chain

from dnacheck.cyclization.methods import Umbrella
from dnacheck.cyclization.result import JFactor
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.validation.reference.agreement import (
    CompareOptions,
    Difference,
    compare_methods,
    differences,
)

SMALL = CompareOptions(
    closure=0.02,
    corrected=0.02,
    halves=8_000,
    umbrella=Umbrella(samples=40, burn_in=16, thinning=2),
)


def test_methods_meet_and_are_reproducible():
    search = find_rings(molecule_chain("09T15"))
    results = compare_methods(search, SMALL, 3)
    assert list(results) == [
        "laplace", "register-laplace", "corrected-laplace", "closure", "half-chain", "metropolis",
    ]  # fmt: skip
    found = differences(results)
    assert len(found) == 6
    assert found[0].sigmas < 3.0
    assert [pair.sigmas for pair in found] == sorted((p.sigmas for p in found), reverse=True)
    # Control: Laplace's own value is far outside the errors of the rest.
    gap = results["laplace"].minus_lnJ - results["closure"].minus_lnJ
    assert gap > 3.0 * math.hypot(results["closure"].stderr, results["corrected-laplace"].stderr)


def test_samplers_do_not_share_random_numbers():
    search = find_rings(molecule_chain("09T15"))
    few = CompareOptions(closure=0.05, corrected=None, halves=8_000)
    more = CompareOptions(closure=0.05, corrected=0.05, halves=8_000)
    first, second = (compare_methods(search, options, 4) for options in (few, more))
    assert "corrected-laplace" not in first
    assert first["half-chain"].minus_lnJ == second["half-chain"].minus_lnJ


def test_sigmas_are_of_standard_errors_alone():
    def result(method, value, stderr, bias):
        return JFactor("x", 10, method, value, stderr, bias_bound=bias)

    known = {
        "laplace": result("laplace", 5.0, 0.0, None),
        "closure": result("closure", 1.0, 0.3, 2.0),
        "half-chain": result("half-chain", 2.0, 0.4, 2.0),
        "corrected-laplace": result("corrected-laplace", 1.0, 0.3, 0.4),
    }
    found = {(pair.first, pair.second): pair for pair in differences(known)}
    assert len(found) == 3
    assert found["closure", "half-chain"].sigmas == pytest.approx(2.0)
    assert found["closure", "corrected-laplace"].error == pytest.approx(math.hypot(0.3, 0.5))
    assert Difference("a", "b", -3.0, 1.0).sigmas == pytest.approx(3.0)
    assert np.isfinite([pair.error for pair in found.values()]).all()
