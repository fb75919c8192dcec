"""What the other strand gives stands beside what this one gives, where the two differ."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnacheck import cli
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.a_tracts import mirrored_region, region_steps
from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import Molecule, embedded
from dnacheck.model.sequence import parse_sequence


def run(capsys, *arguments):
    code = cli.main(list(arguments))
    captured = capsys.readouterr()
    return code, captured.out, captured.err


OWN = "CATGGGGTTTCCAAGGTAGCGATGCTCTCTAGTTCCCTCGTACTGTTATGGACGAGTTTGCACGTGTCCACGATTACCATCAGT"


def test_ring_of_the_other_strand(capsys):
    """11T15: 10.53 RT, and 10.70 read on the other strand (issue 16)."""
    code, out, _ = run(capsys, "ring", "11T15", "--model", "discrete", "--json")
    record = json.loads(out)
    assert code == 0
    assert record["step_form"] == "wedge"
    assert record["equilibria"][0]["energy_RT"] == pytest.approx(10.53, abs=0.005)
    assert record["other_strand"]["energy_RT"] == pytest.approx(10.70, abs=0.005)
    assert record["other_strand"]["link"] == record["equilibria"][0]["link"] == 15


def test_j_of_the_other_strand(capsys):
    """11T15: -ln J 16.16, and 16.32 read on the other strand (issue 16)."""
    code, out, _ = run(capsys, "jfactor", "11T15", "--method", "closure", "--json")
    record = json.loads(out)
    assert code == 0
    assert abs(record["minus_lnJ"] - 16.16) < 4.0 * record["stderr"]
    other = record["other_strand"]
    assert abs(other["minus_lnJ"] - 16.32) < 4.0 * other["stderr"]


def test_one_strand_where_that_is_asked_or_the_form_knows_none(capsys):
    for option in (["--no-other-strand"], ["--step-form", "midstep"]):
        for command in (["ring", OWN, "--model", "discrete"], ["jfactor", OWN, "--method=laplace"]):
            code, out, _ = run(capsys, *command, "--json", *option)
            assert json.loads(out)["other_strand"] is None
            assert code == 0


def test_advice_goes_with_a_molecule_of_ones_own(capsys):
    _, out, _ = run(capsys, "ring", OWN, "--model", "discrete")
    assert "other strand: " in out
    assert "--step-form midstep gives one value" in out
    _, out, _ = run(capsys, "ring", "08T15", "--model", "discrete")
    assert "other strand: " in out
    assert "midstep" not in out


@pytest.mark.parametrize("name", ["11T15", "08T15"])
def test_the_midstep_form_gives_both_strands_one_energy(name):
    molecule = embedded(name)
    chains = {form: build_chain(molecule, step_form=form) for form in ("midstep", "wedge")}
    apart = {}
    for form, chain in chains.items():
        other = build_chain(molecule.other_strand(chain.a_tract_regions), step_form=form)
        energies = [find_rings(c).lowest.energy for c in (chain, other)]
        apart[form] = abs(energies[0] - energies[1])
    assert apart["midstep"] < 1e-10
    assert apart["wedge"] > 1e-6


@settings(max_examples=50)
@given(st.text("ACGT", min_size=12, max_size=40), st.data())
def test_the_other_strand_has_the_same_steps_the_other_way(letters, data):
    """Steps (tau, theta, phi) come back as (tau, theta, -phi) in reverse order, tracts included."""
    n = len(letters)
    regions = ((data.draw(st.integers(0, n - 1)), data.draw(st.integers(0, n - 1))),)
    molecule = Molecule(parse_sequence(letters, "x"), regions)
    own = build_chain(molecule)
    other = build_chain(molecule.other_strand(own.a_tract_regions))
    steps = (n - 2 - region_steps(regions[0], n)) % n
    assert set(steps) == set(region_steps(mirrored_region(regions[0], n), n))
    back = (n - 2 - np.arange(n)) % n
    assert other.ground[back] == pytest.approx(own.ground * [1.0, 1.0, -1.0], abs=1e-12)
    twice = molecule.other_strand(regions)
    assert twice.other_strand(twice.a_tract_regions) == molecule
