"""The discrete chain: frames, energies and their invariances."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from dnacheck.model.chain import (
    Chain,
    angles_of_frames,
    build_chain,
    chain_frames,
    elastic_energy,
    energy_parts,
    uniform_stiffness,
)
from dnacheck.model.molecules import embedded
from dnacheck.model.sequence import Sequence
from dnacheck.numerics.outcome import InputError

bends = arrays(float, st.tuples(st.integers(1, 30), st.just(3)), elements=st.floats(-1.4, 1.4))
forms = st.sampled_from(["wedge", "midstep"])


def step_by_scipy(angles, form):
    tau, theta, phi = angles
    turn = Rotation.from_rotvec
    if form == "wedge":
        product = turn([0, 0, tau]) * turn([-theta, 0, 0]) * turn([0, phi, 0])
    else:
        half = turn([0, 0, tau / 2]) * turn([-theta / 2, 0, 0])
        product = half * turn([0, phi, 0]) * turn([-theta / 2, 0, 0]) * turn([0, 0, tau / 2])
    return product.as_matrix()


@given(bends, forms)
def test_frames_are_products_and_centres_are_sums(angles, form):
    centres, frames = chain_frames(angles, form)
    frame, centre = np.eye(3), np.zeros(3)
    for i, step in enumerate(angles):
        centre = centre + frame[:, 2]
        frame = frame @ step_by_scipy(step, form)
        assert frames[i + 1] == pytest.approx(frame, abs=1e-13)
        assert centres[i + 1] == pytest.approx(centre, abs=1e-13)


@given(bends, forms)
def test_angles_come_back_from_frames(angles, form):
    _, frames = chain_frames(angles, form)
    assert angles_of_frames(frames, form) == pytest.approx(angles, abs=1e-12)


@given(bends, bends, forms)
def test_chains_compose(first, second, form):
    centres, frames = chain_frames(np.vstack([first, second]), form)
    (c1, f1), (c2, f2) = chain_frames(first, form), chain_frames(second, form)
    assert frames[-1] == pytest.approx(f1[-1] @ f2[-1], abs=1e-12)
    assert centres[-1] == pytest.approx(c1[-1] + f1[-1] @ c2[-1], abs=1e-12)


@given(bends)
def test_energy_adds_up_over_steps_and_parts(angles):
    n = len(angles)
    rng = np.random.default_rng(n)
    root = rng.standard_normal((n, 3, 3))
    chain = Chain("x", rng.standard_normal((n, 3)), root @ root.transpose(0, 2, 1) + np.eye(3))
    strain = angles - chain.ground
    by_hand = sum(0.5 * x @ k @ x for x, k in zip(strain, chain.stiffness, strict=True))
    assert elastic_energy(chain, angles) == pytest.approx(by_hand, rel=1e-12, abs=1e-14)
    assert sum(energy_parts(chain, angles)) == pytest.approx(by_hand, rel=1e-12, abs=1e-14)


def test_other_strand_is_the_same_shape_in_the_midstep_form_only():
    """Reading the other strand turns the molecule round; the wedge form does not (2.5 % in E)."""
    sequence = embedded("11T15").sequence
    ends = {}
    for form in ("wedge", "midstep"):
        for strand in (sequence, sequence.reverse_complement()):
            # Only the steps between the molecule's own base pairs: the closing one is not shared.
            angles = build_chain(strand, "trifonov", step_form=form).ground[:-1]
            _, frames = chain_frames(angles, form)
            ends.setdefault(form, []).append(Rotation.from_matrix(frames[-1]).magnitude())
    assert ends["midstep"][0] == pytest.approx(ends["midstep"][1], abs=1e-12)
    assert abs(ends["wedge"][0] - ends["wedge"][1]) > 1e-4


def test_long_chains_stay_orthonormal():
    angles = np.tile([0.6, 0.05, -0.03], (10_000, 1))
    _, frames = chain_frames(angles)
    assert np.abs(frames[-1].T @ frames[-1] - np.eye(3)).max() < 1e-14


def test_units_follow_section_10():
    chain = build_chain(embedded("11T15"))
    assert chain.energy_scale_RT == 463.0 / 3.4
    assert chain.n_steps == 158
    assert chain.stiffness[5] == pytest.approx(np.diag([1.5, 1.0, 1.0]))
    # Table III's torsional phasing, 15.2 turns, rounds to a tenth.
    assert chain.relaxed_turns == pytest.approx(15.2, abs=0.05)
    assert chain.with_twist_ratio(0.7).stiffness[9, 0, 0] == 0.7


def test_arrays_are_read_only():
    chain = build_chain(embedded("11T15"))
    with pytest.raises(ValueError, match="read-only"):
        chain.ground[0, 0] = 1.0


@pytest.mark.parametrize("ratio", [0.0, -1.0, np.nan, np.inf])
def test_twist_ratio_must_be_positive(ratio):
    with pytest.raises(InputError, match=r"twist ratio .*: give a number from"):
        uniform_stiffness(10, ratio)


@pytest.mark.parametrize(
    "kwargs",
    [
        {"persistence_length_A": 0.0},
        {"rise_A": np.nan},
        {"step_form": "junction"},
        {"a_tracts": "3..900"},
        {"angles": "trifonov", "a_tracts": "3..9"},
    ],
)
def test_bad_models_are_refused(kwargs):
    with pytest.raises(InputError):
        build_chain(Sequence("x", "ACGTACGTACGTACGT"), **kwargs)


def test_a_chain_of_undefined_numbers_is_refused():
    with pytest.raises(InputError, match="finite"):
        Chain("x", np.full((12, 3), np.nan), uniform_stiffness(12, 1.0))
