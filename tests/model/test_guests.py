"""Guests: where their steps come from, and what is refused."""

import math

import numpy as np
import pytest

from dnacheck.model.chain import build_chain, chain_frames
from dnacheck.model.guests import bind, bundled_guests, guest_steps, parse_site, superhelix
from dnacheck.model.molecules import embedded
from dnacheck.numerics.outcome import InputError

PAR = """   3 # base-pairs
   0 # ***local base-pair & step parameters***
#        Shear  Stretch  Stagger  Buckle  Prop-Tw  Opening  Shift  Slide  Rise  Tilt  Roll  Twist
A-T  0 0 0 0 0 0  0.0 0.0 0.0 0.0 0.0 0.0
A-T  0 0 0 0 0 0  0.1 -0.2 3.3 4.0 40.0 36.0
A-T  0 0 0 0 0 0  0.2 -0.3 3.2 -3.0 2.0 34.0
"""


def small_chain(**options):
    return build_chain(embedded("11T15"), **options)


def test_a_par_file_gives_the_steps_between_its_base_pairs(tmp_path):
    (tmp_path / "guest.par").write_text(PAR)
    guest = guest_steps(tmp_path / "guest.par")
    assert guest.offsets == (0, 1)
    degrees = np.degrees(guest.values[:, :3])
    np.testing.assert_allclose(degrees, [[36.0, 4.0, 40.0], [34.0, -3.0, 2.0]], rtol=1e-12)
    np.testing.assert_allclose(guest.values[:, 3:], [[0.1, -0.2, 3.3], [0.2, -0.3, 3.2]])


@pytest.mark.parametrize("form", ["wedge", "midstep"])
def test_three_angle_steps_take_the_rotation_of_six_parameters(tmp_path, form):
    (tmp_path / "guest.par").write_text(PAR)
    chain = bind(small_chain(step_form=form), 10, tmp_path / "guest.par")
    # Frames of the field are x = d2, y = -d1, z = d3 (docs/theory/conventions.md).
    turn = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    radians = np.radians([[36.0, 4.0, 40.0]])
    step = np.concatenate([radians, [[0.0, 0.0, 1.0]]], axis=1)
    expected = turn.T @ chain_frames(step, "rigid")[1][1] @ turn
    frames = chain_frames(chain.ground[10:11], form)[1]
    np.testing.assert_allclose(frames[1], expected, atol=1e-14)


def test_a_kink_changes_what_it_names_and_holds_its_steps():
    free = small_chain()
    chain = bind(free, 100, "roll=40@-5,6")
    assert chain.guests[0].steps == (95, 106)
    held = np.flatnonzero(chain.bound)
    np.testing.assert_array_equal(held, [95, 106])
    np.testing.assert_allclose(chain.ground[held, 1], math.radians(40.0))
    np.testing.assert_array_equal(chain.ground[held][:, [0, 2]], free.ground[held][:, [0, 2]])
    again = chain.elastic(0.0)
    np.testing.assert_array_equal(again.ground, free.ground)
    np.testing.assert_array_equal(again.stiffness, free.stiffness)


def test_a_rigid_step_takes_lengths_in_angstrom(tmp_path):
    (tmp_path / "guest.par").write_text(PAR)
    chain = bind(small_chain(angles="olson1998"), 157, tmp_path / "guest.par")
    assert chain.guests[0].steps == (157, 0)
    np.testing.assert_allclose(chain.ground[157, 3:] * chain.rise_A, [0.1, -0.2, 3.3], rtol=1e-12)
    np.testing.assert_allclose(chain.ground[0, 3:] * chain.rise_A, [0.2, -0.3, 3.2], rtol=1e-12)


def test_another_twist_ratio_leaves_the_guest_bound():
    chain = bind(small_chain(), 50, "cap").with_twist_ratio(0.8)
    np.testing.assert_array_equal(np.flatnonzero(chain.bound), [45, 55])
    assert chain.stiffness[45, 0, 0] > 1e20
    np.testing.assert_allclose(
        chain.elastic().stiffness, np.tile(np.diag([0.8, 1, 1]), (158, 1, 1))
    )


def test_cap_kinks_the_tg_steps_five_from_the_dyad_of_its_site():
    letters = embedded("11T15").sequence.letters
    chain = bind(small_chain(), letters.index("GTGAGCTAACTCAC") + 6, "cap")
    assert [letters[s : s + 2] for s in chain.guests[0].steps] == ["TG", "CA"]


def test_superhelix_has_the_radius_pitch_and_hand_it_is_given():
    steps = superhelix(147, 1.65, 41.9, 25.9, 3.4, 10.2)
    steps[:, 3:] /= 3.4
    centres = 3.4 * chain_frames(steps, "rigid")[0][12:135]
    second = centres[2:] - 2.0 * centres[1:-1] + centres[:-2]
    axes = np.linalg.svd(second, full_matrices=False)[2]
    across, axis = axes[0], axes[2]
    flat = np.column_stack([centres @ across, centres @ np.cross(axis, across)])
    fit = np.column_stack([2.0 * flat, np.ones(len(flat))])
    x, y, rest = np.linalg.lstsq(fit, (flat**2).sum(axis=1), rcond=None)[0]
    angle = np.unwrap(np.arctan2(flat[:, 1] - y, flat[:, 0] - x))
    climb = centres @ axis
    pitch = 2.0 * np.pi * (climb[-1] - climb[0]) / (angle[-1] - angle[0])
    # A polygon of 3.4 Å edges in a circle of 42 Å: relative order (3.4 / 42)^2 / 24.
    assert math.sqrt(rest + x * x + y * y) == pytest.approx(41.9, rel=1e-3)
    assert pitch == pytest.approx(-25.9, rel=1e-3)


@pytest.mark.parametrize(
    ("site", "steps", "what"),
    [
        (158, "cap", "outside"),
        (-1, "cap", "outside"),
        (True, "cap", "step number"),
        (3, "roll=40", "no steps after @"),
        (3, "rol=40@3", "'rol' is not one of"),
        (3, "roll=forty@3", "'forty' is no number"),
        (3, "roll=nan@3", "not finite"),
        (3, "roll=40@3,3", "given twice"),
        (3, "roll=40@x", "no step number"),
        (3, "roll=200@3", "180 degrees"),
        (3, "nothing.par", "check the path"),
        (3, np.zeros((2, 5)), r"array \(n, 6\)"),
        (3, np.full((2, 6), np.nan), "finite"),
        (3, np.zeros((156, 6)), "leaves 2 elastic steps"),
        (3, np.zeros((200, 6)), "only 158"),
        (3, "roll=40@0,200", "spans 201 steps"),
    ],
)
def test_bad_guests_are_refused_in_one_line(site, steps, what):
    with pytest.raises(InputError, match=what) as caught:
        bind(small_chain(), site, steps)
    assert len(str(caught.value).splitlines()) == 1


def test_overlapping_guests_are_refused_also_across_the_joint():
    chain = bind(small_chain(), 157, np.tile([0.6, 0.0, 0.0, 0.0, 0.0, 3.4], (3, 1)))
    assert chain.guests[0].steps == (157, 0, 1)
    with pytest.raises(InputError, match=r"step 1 .* held by both"):
        bind(chain, 6, "cap")
    assert len(bind(chain, 7, "cap").guests) == 2


@pytest.mark.parametrize(
    ("name", "text", "what"),
    [
        ("a.par", "", "no number base pairs, and 0 follow"),
        ("a.par", "2 # base-pairs\nA-T 1 2\n", "line 2: 3 columns"),
        ("a.par", PAR.replace("3 #", "4 #", 1), "says 4 base pairs, and 3 follow"),
        ("a.par", PAR.replace("40.0", "forty"), "line 5: 'forty' is no number"),
        ("a.toml", "steps = ", "not valid TOML"),
        ("a.toml", "name = 'x'", "either"),
        ("a.toml", "[[steps]]\nrol = 3", "unknown key 'rol'"),
        ("a.toml", "[[steps]]\nroll = '3'", "finite number"),
        ("a.toml", "[[steps]]\nat = 0.5", "step number"),
        ("a.toml", "steps = []", "no steps"),
        ("a.toml", "[superhelix]\nturns = 1", "needs base_pairs"),
        ("a.txt", "", "not a 3DNA .par"),
    ],
)
def test_bad_files_are_refused_with_their_name(tmp_path, name, text, what):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError, match=what) as caught:
        guest_steps(path)
    assert name in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_too_many_turns_for_the_base_pairs_are_refused():
    with pytest.raises(InputError, match="fewer turns"):
        superhelix(100, 1.65, 41.9, 25.9, 3.4, 10.2)


def test_sites_of_the_command_line():
    assert parse_site("12=roll=40@5,6", 158) == (12, "roll=40@5,6")
    for text in ("cap", "x=cap", "158=cap", "-1=cap", "3="):
        with pytest.raises(InputError, match="--bind"):
            parse_site(text, 158)


def test_bundled_guests_say_where_they_come_from():
    assert set(bundled_guests()) == {"cap", "nucleosome"}
    for name in bundled_guests():
        assert guest_steps(name).citation
