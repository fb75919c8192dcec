"""Section IX: base pairs from a continuum ring."""

import numpy as np
import pytest
from rods import molecule_chain, molecule_rod, straight_chain

from dnacheck.equilibria.bridge.reconstruct import reconstruct, rms_difference
from dnacheck.equilibria.continuum import solve_continuum_ring
from dnacheck.model.chain import chain_frames
from dnacheck.model.rod import build_rod
from dnacheck.numerics.outcome import InputError


def test_angles_rebuild_the_frames():
    ring = solve_continuum_ring(molecule_rod("11T15"), 15)
    pairs = reconstruct(ring)
    centres, frames = chain_frames(pairs.angles)
    rebuilt = pairs.frames[0].T @ pairs.frames
    assert np.max(np.abs(frames - rebuilt)) < 1e-12
    # nearly closed, as a start has to be
    assert np.linalg.norm(centres[-1]) < 0.5
    assert pairs.step_length_spread < 0.01
    assert pairs.projection < 0.05


def test_midstep_angles_rebuild_the_frames():
    pairs = reconstruct(solve_continuum_ring(molecule_rod("11T15"), 15), "midstep")
    _, frames = chain_frames(pairs.angles, "midstep")
    assert np.max(np.abs(frames - pairs.frames[0].T @ pairs.frames)) < 1e-12


@pytest.mark.parametrize("twist", [0.6, 1.8, -2.4])
def test_atan2_is_right_beyond_ninety_degrees_and_the_printed_arcsin_is_not(twist):
    rod = build_rod(straight_chain(120, twist))
    pairs = reconstruct(solve_continuum_ring(rod, round(rod.relaxed_turns)))
    target = 2 * np.pi * round(120 * twist / (2 * np.pi)) / 120
    assert np.max(np.abs(pairs.angles[:, 0] - target)) < 0.01
    frames = pairs.frames
    relative = np.swapaxes(frames[:-1], 1, 2) @ frames[1:]
    theta = -np.arcsin(relative[:, 2, 1])
    printed = -np.arcsin(np.clip(relative[:, 0, 1] / np.cos(theta), -1.0, 1.0))
    wrong = np.max(np.abs(printed - target))
    assert (wrong < 0.01) == (abs(twist) < np.pi / 2)


def test_rms_is_that_of_the_optimal_superposition():
    ring = solve_continuum_ring(molecule_rod("11T15"), 15)
    centres = reconstruct(ring).centres
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    assert rms_difference(centres @ turn.T + [3.0, -2.0, 5.0], centres, 3.4) < 1e-10
    assert rms_difference(centres * [1, 1, -1] + 0.1 * centres, centres, 3.4) > 0.1
    with pytest.raises(InputError, match="can't be superposed"):
        rms_difference(centres[:-2], centres, 3.4)


def test_wedge_angles_are_near_the_ground_state():
    chain = molecule_chain("11T15")
    angles = reconstruct(solve_continuum_ring(molecule_rod("11T15"), 15)).angles
    assert np.max(np.abs(angles[:, 0] - chain.ground[:, 0])) < 0.05
