"""Rigid steps in OpenMM: energies from positions, forces along the coordinates, wrong chains."""

from dataclasses import replace

import numpy as np
import pytest

from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.md.rigid_beads import RigidBeads
from dnacheck.model.chain import Chain, build_chain, elastic_energy
from dnacheck.model.sequence import Sequence
from dnacheck.numerics.outcome import InputError

LETTERS = "AGATC"
SPREAD = np.array([0.15, 0.1, 0.1, 0.2, 0.2, 0.2])


def olson(letters=LETTERS):
    return build_chain(Sequence("open", letters), "olson1998")


def shaken(chain, seed):
    return chain.ground + SPREAD * np.random.default_rng(seed).standard_normal(chain.ground.shape)


@pytest.fixture(scope="module")
def beads():
    return RigidBeads(olson(), closed=False)


@pytest.mark.parametrize("seed", range(5))
def test_energies_of_random_shapes(beads, seed):
    shape = shaken(beads.chain, seed)
    expected = elastic_energy(beads.chain, shape)
    assert beads.energy_RT(beads.positions(shape)) == pytest.approx(expected, rel=1e-12)


def test_energy_does_not_see_rigid_motions(beads):
    positions = beads.positions(shaken(beads.chain, 7))
    rotation, _ = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    moved = positions @ rotation + [10.0, -20.0, 30.0]
    assert beads.energy_RT(moved) == pytest.approx(beads.energy_RT(positions), rel=1e-10)


def test_work_of_the_forces_is_the_stiffness_times_the_strain(beads):
    chain = beads.chain
    shape = shaken(chain, 3)
    forces = beads.forces(beads.positions(shape))
    stress = np.einsum("nij,nj->ni", chain.stiffness, shape - chain.ground)
    direction = np.random.default_rng(4).standard_normal(shape.shape)
    h = 1e-5
    moved = beads.positions(shape + h * direction) - beads.positions(shape - h * direction)
    assert -np.sum(forces * moved) / (2.0 * h) == pytest.approx(
        np.sum(stress * direction), rel=1e-7
    )


def test_a_rings_minimum_has_its_energy_and_balances_every_pair():
    chain = olson("AGATCCGTACGGTTACGATC")
    # So short a ring has no minimum but a soft one.
    soft = Chain("soft", chain.ground, 0.05 * chain.stiffness, step_form="rigid",
                 rise_A=chain.rise_A, persistence_length_A=chain.rise_A)  # fmt: skip
    ring = find_rings(soft).lowest
    beads = RigidBeads(soft, closed=True)
    positions = beads.positions(ring.angles)
    assert beads.energy_RT(positions) == pytest.approx(ring.energy_RT, rel=1e-10)
    largest = np.abs(beads.forces(positions)).max()
    assert out_of_balance(beads, positions) < 1e-9 * largest
    # Negative control: one step's twist is off by 1e-6.
    other = ring.angles.copy()
    other[3, 0] += 1e-6
    assert out_of_balance(beads, beads.positions(other)) > 1e-8 * largest


def out_of_balance(beads, positions):
    """Largest net force and torque (over the arm) on the beads of a base pair, RT/A."""
    forces = beads.forces(positions).reshape(-1, 4, 3)
    places = positions.reshape(-1, 4, 3)
    arms = places - places[:, :1]
    torques = np.cross(arms, forces).sum(axis=1) / beads.options.groove_distance_A
    return max(np.abs(forces.sum(axis=1)).max(), np.abs(torques).max())


@pytest.mark.parametrize("fault", ["sign", "unit", "strand"])
def test_wrong_chains_are_refused(beads, fault):
    """Negative control: the witness must see a sign, a unit and a reversed mixed constant."""
    chain, shape = beads.chain, shaken(beads.chain, 1)
    ground, stiffness = chain.ground.copy(), chain.stiffness.copy()
    if fault == "sign":
        ground[0, 1] *= -1.0
    elif fault == "unit":
        ground[0, 3:] *= chain.rise_A
    else:
        stiffness[0, 1, 2] = stiffness[0, 2, 1] = -stiffness[0, 1, 2]
    wrong = elastic_energy(replace(chain, ground=ground, stiffness=stiffness), shape)
    assert wrong != pytest.approx(beads.energy_RT(beads.positions(shape)), rel=1e-6)


def test_wedges_are_refused():
    with pytest.raises(InputError, match="not a chain of rigid steps"):
        RigidBeads(build_chain(Sequence("w", LETTERS)), closed=False)
