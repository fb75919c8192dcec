"""The whole conversion, on the paper's molecules and on random ones."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rods import ANGLE_SETS, ELEVEN, molecule_chain, molecule_rod, random_chain, straight_chain

from dnacheck.equilibria.continuum import solve_continuum_ring
from dnacheck.model.rod import RodOptions, build_rod
from dnacheck.numerics.outcome import InputError


@pytest.mark.parametrize("name", ELEVEN)
def test_fitted_length_and_twist_of_the_eleven(name):
    chain, rod = molecule_chain(name), molecule_rod(name)
    assert 0.9965 < rod.length_steps / chain.n_steps < 0.9985
    # the natural frame turns with the centreline, so the turns differ a little from the sum of tau
    assert rod.relaxed_turns == pytest.approx(chain.relaxed_turns, abs=0.05)
    assert rod.frame_orthogonality < 1e-10
    assert rod.frame_residual < 1e-9
    assert rod.s_frames[0] == pytest.approx(0.0, abs=1e-14)
    assert rod.s_frames[-1] == pytest.approx(1.0, abs=1e-14)
    assert np.all(np.diff(rod.s_frames) > 0.0)


def test_straight_chain_has_no_curvature_and_its_own_twist():
    rod = build_rod(straight_chain(150, 0.6))
    assert np.max(np.abs(rod.strain_series)) < 1e-9
    assert rod.end_rotation == pytest.approx(-90.0, abs=1e-9)
    assert rod.length_steps == pytest.approx(150.0, abs=1e-9)


def test_frame_angle_turns_d1_into_the_natural_frame():
    # strains in the natural frame vary on the scale of the spline's pieces, those in the true
    # frame turn with the helix; Omega holds all of that turning
    rod = molecule_rod("11A17")
    steps = np.diff(rod.omega)
    assert np.all(np.abs(steps + 2 * np.pi / 10.4) < 0.25)


@given(
    seed=st.integers(0, 10**6),
    length=st.integers(60, 400),
    angles=st.sampled_from(ANGLE_SETS),
)
@settings(max_examples=15)
def test_random_sequences_give_sound_rods(seed, length, angles):
    rod = build_rod(random_chain(seed, length, angles))
    assert 0.95 < rod.length_steps / length < 1.001
    assert rod.frame_orthogonality < 1e-6
    assert np.all(np.isfinite(rod.strain_series))
    assert not rod.strain_series.flags.writeable


@pytest.mark.parametrize("length", [10, 20, 33])
def test_molecules_shorter_than_the_padding(length):
    rod = build_rod(random_chain(3, length))
    assert np.all(np.isfinite(rod.strain_series))
    assert rod.n_steps == length


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"filter_width": 0}, "filter_width = 0: give an integer >= 1"),
        ({"filter_width": 27}, "filter width 27 reaches 52 base pairs.*raise padding"),
        ({"filter_width": 3.5}, "filter_width = 3.5"),
        ({"intervals": 0}, "intervals = 0"),
        ({"degree": 3}, "degree = 3: give an integer >= 4"),
        ({"degree": 13}, "degree = 13: at most 12"),
        ({"padding": -1}, "padding = -1"),
        ({"interval_span": "ring"}, "interval_span = 'ring'"),
        ({"condition_limit": float("nan")}, "condition_limit = nan"),
        ({"slowest_speed": 0.0}, "slowest_speed = 0.0"),
    ],
)
def test_bad_options_are_refused_with_the_mend(changes, message):
    with pytest.raises(InputError, match=message):
        RodOptions(**changes)


def test_options_are_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        RodOptions().degree = 5  # type: ignore[misc]


def test_fits_that_have_no_answer_are_refused():
    chain = molecule_chain("11T15")
    with pytest.raises(InputError, match="coefficients but only 260 points"):
        build_rod(chain, RodOptions(intervals=90))
    with pytest.raises(InputError, match="ill-conditioned"):
        build_rod(chain, RodOptions(intervals=80, condition_limit=1e3))


def test_a_filter_that_erases_the_path_is_refused():
    ground = np.zeros((100, 3))
    ground[:, 1] = 1.2  # a circle of five steps
    chain = dataclasses.replace(straight_chain(100), ground=ground)
    with pytest.raises(InputError, match="the filter erases the path"):
        build_rod(chain)


def test_a_spline_too_coarse_for_the_length_warns():
    long = random_chain(1, 1000, "trifonov")
    rod = build_rod(long)
    assert "intervals would match" in rod.warnings[0]
    better = int(rod.warnings[0].split(";")[1].split()[0])
    assert not build_rod(long, RodOptions(intervals=better)).warnings


def test_figure_10_decides_what_the_intervals_divide():
    """(15, 10, 4) is Figure 10's outlier; only k over the padded length makes it one."""
    reference = solve_continuum_ring(molecule_rod("08T15"), 15).energy_RT
    shifts = {}
    for span in ("padded", "molecule"):
        for k, m in ((10, 4), (10, 5), (10, 6), (12, 5), (15, 6), (20, 4)):
            options = RodOptions(intervals=k, degree=m, interval_span=span)
            ring = solve_continuum_ring(molecule_rod("08T15", options), 15)
            shifts[span, k, m] = ring.energy_RT - reference
    others = [v for (span, k, m), v in shifts.items() if span == "padded" and (k, m) != (10, 4)]
    assert np.max(np.abs(others)) < 0.05
    assert 0.05 < abs(shifts["padded", 10, 4]) < 0.15
    assert abs(shifts["molecule", 10, 4]) < 0.05


@pytest.mark.parametrize("width", [5, 8, 10, 15, 20, 25])
def test_figure_10_filter_widths(width):
    reference = solve_continuum_ring(molecule_rod("08T15"), 15).energy_RT
    options = RodOptions(filter_width=width)
    ring = solve_continuum_ring(molecule_rod("08T15", options), 15)
    assert abs(ring.energy_RT - reference) < 0.05
