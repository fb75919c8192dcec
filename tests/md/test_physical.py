"""Sampled distributions by the physical-validation package, with controls that must fail."""

from dataclasses import replace

import pytest
from bead_chains import ring_chain

from dnacheck.md.ensemble import EnsembleOptions, sample_ensemble
from dnacheck.md.physical import kinetic_energy_test, temperature_pair_test
from dnacheck.numerics.outcome import InputError

pytest.importorskip("physical_validation")

FRAMES = EnsembleOptions(samples=1200, replicas=1, interval=12, burn_in=30, measure="frames")


@pytest.fixture(scope="module")
def start(minima):
    return minima[0].positions


@pytest.fixture(scope="module")
def cold(start):
    return sample_ensemble(ring_chain(), start, True, FRAMES)


@pytest.fixture(scope="module")
def warm(start):
    return sample_ensemble(ring_chain(), start, True, replace(FRAMES, bath_ratio=1.08, seed=1))


@pytest.mark.md
def test_kinetic_energies_are_those_of_the_bath(cold, warm):
    for ensemble in (cold, warm):
        mean, width = kinetic_energy_test(ensemble)
        assert mean < 3.5
        assert width < 3.5


@pytest.mark.md
def test_a_bath_named_wrongly_is_noticed(cold, warm):
    """The warm ensemble passed off as one at the temperature of the cold one."""
    mean, _ = kinetic_energy_test(replace(warm, options=cold.options))
    assert mean > 5.0


@pytest.mark.md
def test_two_temperatures_have_the_ratio_of_boltzmann_weights(cold, warm):
    assert temperature_pair_test(cold, warm) < 3.5
    named_wrongly = replace(warm, options=replace(warm.options, bath_ratio=1.2))
    assert temperature_pair_test(cold, named_wrongly) > 3.5


@pytest.mark.md
def test_two_temperatures_in_the_measure_of_angles_are_refused(cold):
    flat = replace(cold, options=replace(cold.options, measure="angles"))
    with pytest.raises(InputError, match="measure 'frames'"):
        temperature_pair_test(flat, cold)
