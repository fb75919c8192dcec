"""Energies and forces of the bead chain against the chain's own formula."""

from dataclasses import replace

import numpy as np
import pytest
from bead_chains import coupled_stiffness, ring_chain
from rods import ELEVEN, molecule_chain

from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.md.bead_chain import BeadChain, BeadEnergy, BeadOptions, sabotaged
from dnacheck.md.geometry import elastic_energies_RT, frames_of_beads, planar_ring, step_angles
from dnacheck.model.chain import Chain, uniform_stiffness
from dnacheck.numerics.outcome import InputError


def shaken_ring(chain, seed=0):
    beads = planar_ring(chain, 4, 0.3, 10.0)
    return beads + 0.3 * np.random.default_rng(seed).standard_normal(beads.shape)


def measured_energy(chain, beads, closed=True):
    angles = step_angles(frames_of_beads(beads, closed)[1], chain.step_form)
    return float(elastic_energies_RT(chain, angles))


def assert_forces_are_the_gradient(energy, beads):
    direction = np.random.default_rng(1).standard_normal(beads.shape)
    h = 1e-4
    slope = energy.energy_RT(beads + h * direction) - energy.energy_RT(beads - h * direction)
    expected = -float(np.sum(energy.forces(beads) * direction))
    assert slope / (2.0 * h) == pytest.approx(expected, rel=1e-6)


def test_energy_and_forces_of_a_shaken_ring(chain, energy):
    beads = shaken_ring(chain)
    assert energy.elastic_energy_RT(beads) == pytest.approx(
        measured_energy(chain, beads), rel=1e-12
    )
    assert_forces_are_the_gradient(energy, beads)
    assert energy.platform == "Reference"


def test_energy_does_not_see_rigid_motions(chain, energy):
    beads = shaken_ring(chain)
    rotation, _ = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    moved = beads @ rotation + [10.0, -20.0, 30.0]
    assert energy.energy_RT(moved) == pytest.approx(energy.energy_RT(beads), rel=1e-11)
    forces = energy.forces(beads)
    assert np.abs(forces.sum(axis=0)).max() < 1e-9
    assert np.abs(np.cross(beads, forces).sum(axis=0)).max() < 1e-7


def test_springs_are_at_rest_on_beads_made_of_angles(chain, energy, minima):
    beads = energy.beads.positions(minima[0].angles)
    energy.beads.set_bond_rest(energy.context, np.full(chain.n_steps, chain.rise_A))
    assert energy.energy_RT(beads) == pytest.approx(energy.elastic_energy_RT(beads), abs=1e-8)


def test_couplings_per_step_and_angles_beyond_half_a_turn_in_an_open_chain():
    n = 9
    ground = 0.4 * np.random.default_rng(4).standard_normal((n, 3))
    ground[2, 0], ground[5, 2] = 3.1, -3.1  # strains across +-pi must be wrapped
    chain = Chain("coupled", ground, coupled_stiffness(n))
    energy = BeadEnergy(BeadChain(chain, closed=False))
    change = 0.1 * np.random.default_rng(5).standard_normal((n, 3))
    change[2, 0], change[5, 2] = 0.2, -0.2
    beads = energy.beads.positions(ground + change)
    expected = (
        0.5 * chain.energy_scale_RT * np.einsum("ni,nij,nj->", change, chain.stiffness, change)
    )
    assert energy.elastic_energy_RT(beads) == pytest.approx(expected, rel=1e-11)
    assert_forces_are_the_gradient(energy, beads)


@pytest.mark.md
@pytest.mark.parametrize("coupled", [False, True])
def test_midstep_form(coupled):
    chain = replace(ring_chain(12), step_form="midstep")
    if coupled:
        chain = replace(chain, stiffness=coupled_stiffness(12))
    energy = BeadEnergy(BeadChain(chain))
    beads = shaken_ring(chain)
    assert energy.elastic_energy_RT(beads) == pytest.approx(
        measured_energy(chain, beads), rel=1e-12
    )
    assert_forces_are_the_gradient(energy, beads)


@pytest.mark.md
@pytest.mark.parametrize("form", ["wedge", "midstep"])
def test_measure_term_is_the_log_volume(form):
    from dnacheck.md.geometry import log_volume_elements

    chain = replace(ring_chain(12), step_form=form)
    beads = shaken_ring(chain)
    curved = BeadEnergy(BeadChain(chain)).elastic_energy_RT(beads)
    flat = BeadEnergy(BeadChain(chain, measure="angles")).elastic_energy_RT(beads)
    angles = step_angles(frames_of_beads(beads, True)[1], form)
    assert flat - curved == pytest.approx(float(log_volume_elements(angles, form)), rel=1e-9)


@pytest.mark.parametrize("kind", ["sign", "stiffness"])
def test_sabotage_changes_one_number(chain, kind):
    bad = sabotaged(chain, kind, 7)
    changed = int(np.sum(bad.ground != chain.ground) + np.sum(bad.stiffness != chain.stiffness))
    assert changed == 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: BeadOptions(bond_factor=0.0), "bond_factor"),
        (lambda: BeadOptions(temperature_K=float("nan")), "temperature_K"),
        (lambda: BeadChain(ring_chain(5)), "6 base pairs"),
        (lambda: BeadChain(ring_chain(), measure="flat"), "neither frames nor angles"),
        (lambda: BeadEnergy(BeadChain(ring_chain()), "Abacus"), "is not installed"),
        (lambda: sabotaged(ring_chain(), "luck", 0), "no fault"),
    ],
)
def test_bad_input_is_named(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.md
@pytest.mark.parametrize("name", ELEVEN)
def test_discrete_rings_have_their_energy_in_openmm(name):
    chain = molecule_chain(name)
    ring = find_rings(chain).lowest
    energy = BeadEnergy(BeadChain(chain))
    got = energy.elastic_energy_RT(energy.beads.positions(ring.angles))
    assert got == pytest.approx(ring.energy_RT, rel=1e-10)


def test_stiffness_units_follow_the_persistence_length():
    base = ring_chain(12)
    stiff = replace(base, persistence_length_A=2.0 * base.persistence_length_A)
    assert BeadChain(stiff).bend_RT == pytest.approx(2.0 * BeadChain(base).bend_RT)
    assert uniform_stiffness(1, 1.5)[0, 0, 0] == 1.5
