"""Frames, angles and topology of bead positions, without OpenMM."""

import numpy as np
import pytest
from bead_chains import ring_chain
from hypothesis import given
from hypothesis import strategies as st

from dnacheck.md import geometry
from dnacheck.md.writhe_kernels import fill_writhe
from dnacheck.model.chain import Chain, angles_of_frames, chain_frames, uniform_stiffness
from dnacheck.model.chain_kernels import step_rotation


def open_chain(angles, form="wedge"):
    return Chain("open", angles, uniform_stiffness(len(angles), 1.5), step_form=form)


def writhe_of(centres):
    out = np.empty(1)
    fill_writhe(np.ascontiguousarray(centres)[None], out)
    return float(out[0])


def random_angles(seed, n_steps=12, size=1.2):
    return size * (2.0 * np.random.default_rng(seed).random((n_steps, 3)) - 1.0)


@pytest.mark.parametrize("form", ["wedge", "midstep"])
@given(seed=st.integers(0, 2**32 - 1))
def test_beads_give_back_the_angles_they_were_made_of(form, seed):
    angles = random_angles(seed)
    beads = geometry.beads_of_angles(open_chain(angles, form), angles, False, 10.0)
    centres, frames = geometry.frames_of_beads(beads, closed=False)
    assert np.allclose(geometry.step_angles(frames, form), angles, rtol=0.0, atol=1e-12)
    # The chain's compiled formulas are a second opinion.
    assert np.allclose(angles_of_frames(frames, form), angles, rtol=0.0, atol=1e-12)
    assert np.allclose(centres, 3.4 * chain_frames(angles, form)[0], rtol=0.0, atol=1e-11)


@given(seed=st.integers(0, 2**32 - 1), tilt=st.floats(-3.0, 3.0), arm=st.floats(2.0, 30.0))
def test_the_groove_beads_tilt_and_distance_do_not_matter(seed, tilt, arm):
    angles = random_angles(seed)
    beads = geometry.beads_of_angles(open_chain(angles), angles, False, arm)
    axis = np.diff(beads[0::2], axis=0) / 3.4
    beads[1::2] += tilt * axis[: len(beads[1::2])]
    _, frames = geometry.frames_of_beads(beads, closed=False)
    assert np.allclose(geometry.step_angles(frames), angles, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("link", [-3, 0, 4])
@given(seed=st.integers(0, 2**32 - 1), register=st.floats(-4.0, 4.0))
def test_twist_and_writhe_of_a_shaken_ring_add_up_to_its_link(link, seed, register):
    chain = ring_chain()
    beads = geometry.planar_ring(chain, link, register, 10.0)
    beads += 0.4 * np.random.default_rng(seed).standard_normal(beads.shape)
    _, frames = geometry.frames_of_beads(beads, closed=True)
    assert geometry.twist_turns(frames) + writhe_of(beads[0::2]) == pytest.approx(link, abs=1e-9)


def test_a_planar_ring_has_bonds_of_the_rise_and_no_writhe():
    beads = geometry.planar_ring(ring_chain(), 4, 0.3, 10.0)
    centres = beads[0::2]
    assert np.linalg.norm(np.roll(centres, -1, 0) - centres, axis=1) == pytest.approx(3.4)
    assert np.linalg.norm(beads[1::2] - centres, axis=1) == pytest.approx(10.0)
    assert writhe_of(centres) == pytest.approx(0.0, abs=1e-12)


def test_writhe_of_a_trefoil_and_of_its_mirror_image():
    t = 2.0 * np.pi * np.arange(600) / 600
    radius = 1.0 + 0.35 * np.cos(3.0 * t)
    knot = np.stack([radius * np.cos(2 * t), radius * np.sin(2 * t), 0.35 * np.sin(3 * t)], 1)
    # From above the trefoil has three crossings of one sign; the ideal one has writhe 3.4.
    value = writhe_of(knot)
    assert 3.0 < abs(value) < 3.7
    assert writhe_of(knot * [1.0, 1.0, -1.0]) == pytest.approx(-value, abs=1e-12)


@pytest.mark.parametrize("form", ["wedge", "midstep"])
@given(seed=st.integers(0, 2**32 - 1))
def test_volume_elements_are_those_of_the_rotation_group(form, seed):
    """Rotation vectors of small changes of the angles span the volume element."""
    code = 0 if form == "wedge" else 1

    def element(q):
        axes, h = np.empty((3, 3)), 1e-5
        here, there, back = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
        step_rotation(*q, code, here)
        for k in range(3):
            d = h * np.eye(3)[k]
            step_rotation(*(q + d), code, there)
            step_rotation(*(q - d), code, back)
            spin = (there - back) @ here.T / (2.0 * h)
            axes[k] = spin[2, 1], spin[0, 2], spin[1, 0]
        return abs(np.linalg.det(axes))

    q = random_angles(seed, 1)
    expected = np.log(element(q[0])) - np.log(element(np.zeros(3)))
    assert geometry.log_volume_elements(q, form) == pytest.approx(expected, abs=1e-8)


def test_fluctuation_ignores_tumbling_and_finds_displacements():
    rng = np.random.default_rng(0)
    ring = geometry.planar_ring(ring_chain(), 4, 0.0, 10.0)[0::2]
    frames = np.empty((400, *ring.shape))
    for i in range(len(frames)):
        rotation, _ = np.linalg.qr(rng.standard_normal((3, 3)))
        rotation *= np.sign(np.linalg.det(rotation))
        frames[i] = ring @ rotation + 50.0 * rng.standard_normal(3)
    assert np.all(geometry.per_base_pair_fluctuation(frames, ring) < 1e-9)
    shaken = ring + 0.1 * rng.standard_normal(frames.shape)
    got = geometry.per_base_pair_fluctuation(shaken, ring)
    # Superposition takes out 6 of 3N displacements.
    expected = 0.1 * np.sqrt(3.0 * (1.0 - 6.0 / ring.size))
    assert got.mean() == pytest.approx(expected, rel=0.02)


def test_strains_are_wrapped():
    ground = np.array([[3.1, 0.0, -3.1]])
    angles = np.array([[-3.1, 0.1, 3.1]])
    assert geometry.strain(angles, ground) == pytest.approx(
        np.array([[2.0 * np.pi - 6.2, 0.1, 6.2 - 2.0 * np.pi]])
    )
