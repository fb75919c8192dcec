"""Ranges of numbers, and those of a chain's parameters."""

import math

import numpy as np
import pytest

from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import embedded
from dnacheck.model.ranges import check_link
from dnacheck.numerics.outcome import InputError
from dnacheck.numerics.ranges import Range


@pytest.mark.parametrize("value", [0.5, 1, 2.0, np.float32(1.5), np.int64(2)])
def test_what_lies_inside_is_given_back(value):
    assert Range(0.5, 2.0).checked(value, "width") == value


@pytest.mark.parametrize("value", [0.4999, 2.1, math.nan, math.inf, -math.inf, 10**400, True, "1"])
def test_what_lies_outside_is_named_with_the_range(value):
    with pytest.raises(InputError, match=r"width .*: give a number from 0\.5 to 2 Å"):
        Range(0.5, 2.0, "Å").checked(value, "width")


@pytest.mark.parametrize(
    ("name", "value"),
    [("twist_ratio", 1e-10), ("persistence_length_A", 1e-5), ("rise_A", 1e10), ("rise_A", -3.4)],
)
def test_a_chain_outside_any_polymer_is_refused(name, value):
    with pytest.raises(InputError, match="give a number from"):
        build_chain(embedded("11T15"), **{name: value})


def test_a_link_turns_a_step_by_half_a_turn_at_most():
    check_link(79, 158)
    check_link(-79, 158)
    check_link("auto", 158)
    for link in (80, -80, 10**30):
        with pytest.raises(InputError, match="from -79 to 79"):
            check_link(link, 158)
