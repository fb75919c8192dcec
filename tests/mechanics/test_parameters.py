"""Named mechanical parameters and the chains that they make."""

import math

import numpy as np
import pytest

from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import embedded
from dnacheck.model.named_parameters import (
    chain_derivatives,
    modified_chain,
    own_value,
    unit,
)
from dnacheck.numerics.outcome import InputError

NAMES = (
    "persistence_length_A",
    "twist_ratio",
    "twist_offset_deg",
    "bend_scale",
    "a_tract_twist_deg",
    "a_tract_bend_scale",
    "tau[CA]",
    "theta[AG]",
    "phi[CA]",
)


@pytest.fixture(scope="module")
def chain():
    return build_chain(embedded("11T15"))


def own(chain):
    return {name: own_value(chain, name) for name in NAMES}


def test_own_values_change_nothing(chain):
    same = modified_chain(chain, own(chain))
    np.testing.assert_allclose(same.ground, chain.ground, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(same.stiffness, chain.stiffness)
    assert same.persistence_length_A == chain.persistence_length_A == 463.0
    # the paper's values (Section X)
    assert own(chain)["a_tract_twist_deg"] == pytest.approx(360.0 / 10.33)
    assert own(chain)["tau[CA]"] == pytest.approx(360.0 / 10.45)


def test_each_parameter_does_what_it_says(chain):
    first, last = chain.a_tract_regions[0]
    offset = modified_chain(chain, {"twist_offset_deg": 0.5})
    np.testing.assert_allclose(offset.ground[:, 0] - chain.ground[:, 0], math.radians(0.5))
    bent = modified_chain(chain, {"bend_scale": 2.0})
    np.testing.assert_allclose(bent.ground[:, 1:], 2.0 * chain.ground[:, 1:])
    tract = modified_chain(chain, {"a_tract_twist_deg": 36.0})
    changed = np.flatnonzero(tract.ground[:, 0] != chain.ground[:, 0])
    assert changed.tolist() == list(range(first, last + 1))
    stiff = modified_chain(chain, {"persistence_length_A": 500.0, "twist_ratio": 2.0})
    assert stiff.energy_scale_RT == pytest.approx(500.0 / 3.4)
    np.testing.assert_allclose(stiff.stiffness[7], np.diag([2.0, 1.0, 1.0]))


def test_a_table_entry_keeps_the_strands_one_molecule(chain):
    made = modified_chain(chain, {"phi[CA]": 3.0})
    letters = chain.letters + chain.letters[0]
    for s in range(chain.n_steps):
        step = letters[s : s + 2]
        wanted = {"CA": math.radians(3.0), "TG": -math.radians(3.0)}.get(step, chain.ground[s, 2])
        assert made.ground[s, 2] == pytest.approx(wanted, abs=1e-15)


def test_derivatives_are_those_of_the_arrays(chain):
    """Against one-sided differences of another width; a wrong chain rule would differ by far."""
    values = {**own(chain), "bend_scale": 1.2, "twist_ratio": 1.4}
    derivatives = chain_derivatives(chain, NAMES, values)
    here = modified_chain(chain, values)
    scaled = here.energy_scale_RT * here.stiffness
    for i, name in enumerate(NAMES):
        h = 1e-6 * max(1.0, abs(values[name]))
        there = modified_chain(chain, {**values, name: values[name] + h})
        ground = (there.ground - here.ground) / h
        stiffness = (there.energy_scale_RT * there.stiffness - scaled) / h
        np.testing.assert_allclose(derivatives.ground[i], ground, atol=1e-8)
        np.testing.assert_allclose(derivatives.stiffness[i], stiffness, atol=1e-6, rtol=1e-6)
    scale, entry = NAMES.index("bend_scale"), NAMES.index("theta[AG]")
    mixed = derivatives.second_ground[scale, entry]
    assert np.abs(mixed).max() == pytest.approx(math.radians(1.0), rel=1e-9)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"twist": 1.0}, "parameter 'twist' is unknown"),
        ({"twist_ratio": 0.0}, "must be a positive number"),
        ({"bend_scale": math.nan}, "must be a finite number"),
        ({"tau[AX]": 3.0}, "is unknown"),
    ],
)
def test_bad_parameters_are_refused_in_one_line(chain, values, words):
    with pytest.raises(InputError, match="parameter") as caught:
        modified_chain(chain, values)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_units_are_said():
    assert unit("persistence_length_A") == "Å"
    assert unit("tau[AA]") == unit("twist_offset_deg") == "degree"
    assert unit("offset[old]") == "RT"
