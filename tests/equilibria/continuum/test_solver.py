"""Continuum rings: Table II, meshes, error estimates, exact solutions, an independent solver."""

import csv

import numpy as np
import pytest
from oracles import scipy_bvp
from rods import ELEVEN, molecule_chain, molecule_rod, straight_chain

from dnacheck.equilibria.bridge.reconstruct import reconstruct, rms_difference
from dnacheck.equilibria.continuum import (
    ContinuumOptions,
    lowest_continuum_ring,
    solve_continuum_ring,
)
from dnacheck.equilibria.continuum.equations import perfect_energy
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.equilibria.discrete.solve import solve_ring
from dnacheck.model.data_files import data_directory
from dnacheck.model.rod import RodOptions, build_rod
from dnacheck.numerics.outcome import InputError, Status


@pytest.fixture(scope="module")
def table_two():
    with open(data_directory() / "published" / "table2_ring_energies.csv", newline="") as file:
        return {row["name"]: row for row in csv.DictReader(file)}


@pytest.fixture(scope="module")
def lowest():
    return {name: lowest_continuum_ring(molecule_rod(name)).lowest for name in ELEVEN}


@pytest.mark.parametrize("name", ELEVEN)
def test_table_two(name, table_two, lowest):
    ring, chain = lowest[name], molecule_chain(name)
    published = float(table_two[name]["E_continuum_reduced"])
    assert ring.energy == pytest.approx(published, rel=0.0015)
    assert ring.stable
    assert ring.residual < 1e-10
    assert ring.curve.energy_error < 1e-6 * ring.energy
    discrete = find_rings(chain).lowest
    assert ring.link == discrete.link
    assert ring.energy == pytest.approx(discrete.energy, rel=0.005)
    # Section IX: the reconstruction starts the discrete solver near its solution
    again = solve_ring(chain, reconstruct(ring).angles)
    assert again.energy == pytest.approx(discrete.energy, rel=1e-9)
    assert again.stable


@pytest.mark.parametrize("name", ELEVEN)
def test_table_two_rms_belongs_to_a_filter_of_20(name, table_two, lowest):
    """The published rms column needs w = 20; at the text's w = 15 all are 0.14-0.20 Å smaller."""
    published = float(table_two[name]["rms_configuration_difference_angstrom"])
    discrete = find_rings(molecule_chain(name)).lowest
    wide = solve_continuum_ring(molecule_rod(name, RodOptions(filter_width=20)), discrete.link)
    rms = rms_difference(reconstruct(wide).centres, discrete.centres, 3.4)
    assert rms == pytest.approx(published, abs=0.03)
    narrow = rms_difference(reconstruct(lowest[name]).centres, discrete.centres, 3.4)
    assert 0.13 < published - narrow < 0.21


@pytest.mark.parametrize("name", ["12A09", "11A17"])
def test_mesh_and_degree(name):
    """Section VIII: 15 to 60 intervals, degrees 4 to 6."""
    rod = molecule_rod(name)
    fine = solve_continuum_ring(rod, 15, options=ContinuumOptions(energy_tolerance=1e-9)).energy
    for intervals in (15, 20, 30, 45, 60):
        for degree in (4, 5, 6):
            options = ContinuumOptions(intervals=intervals, degree=degree, adapt=False)
            ring = solve_continuum_ring(rod, 15, options=options)
            assert ring.energy == pytest.approx(fine, rel=1e-4)
            assert ring.curve.energy_error is None


def test_order_of_the_method_needs_a_mesh_that_respects_the_knots():
    rod = molecule_rod("11T15")
    fine = solve_continuum_ring(rod, 15, options=ContinuumOptions(energy_tolerance=1e-9, degree=6))

    def error(intervals, degree):
        options = ContinuumOptions(intervals=intervals, degree=degree, adapt=False)
        return abs(solve_continuum_ring(rod, 15, options=options).energy - fine.energy)

    # Gauss points with two points an interval: order 4, a factor of 16 per halving
    assert error(56, 2) < error(28, 2) / 10.0
    assert error(112, 2) < error(56, 2) / 10.0
    # 14 pieces: 14 intervals end at the knots, 13 can't, and lose the order
    assert error(14, 6) < 1e-8
    assert error(13, 6) > 1e3 * error(14, 6)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_error_estimate_is_an_upper_bound(tolerance):
    for name in ("09T09", "08A17"):
        rod = molecule_rod(name)
        link = round(rod.relaxed_turns)
        exact = solve_continuum_ring(
            rod, link, options=ContinuumOptions(degree=8, energy_tolerance=1e-11)
        )
        options = ContinuumOptions(degree=3, energy_tolerance=tolerance)
        ring = solve_continuum_ring(rod, link, options=options)
        assert ring.status is Status.CONVERGED
        assert ring.curve.energy_error <= tolerance * ring.energy
        assert abs(ring.energy - exact.energy) <= ring.curve.energy_error + 1e-12


def test_mesh_limit_is_reported_with_the_result():
    options = ContinuumOptions(degree=2, energy_tolerance=1e-12, max_intervals=60)
    ring = solve_continuum_ring(molecule_rod("11T15"), 15, options=options)
    assert ring.status is Status.MESH_LIMIT
    assert ring.curve.energy_error > 1e-12 * ring.energy
    assert ring.energy == pytest.approx(0.0774, rel=1e-2)


@pytest.mark.parametrize(
    "name", ["09T09", *(pytest.param(n, marks=pytest.mark.oracle) for n in ELEVEN if n != "09T09")]
)
def test_equals_solve_bvp(name, lowest):
    """Independent code, the paper's fourteen variables, tol 1e-8."""
    rod, link = molecule_rod(name), lowest[name].link
    ring = solve_continuum_ring(rod, link, options=ContinuumOptions(energy_tolerance=1e-8))
    oracle = scipy_bvp.solve(rod, link, tol=1e-8)
    assert oracle.success
    assert ring.energy == pytest.approx(oracle.energy, rel=1e-7)
    assert ring.curve.end_moment == pytest.approx(oracle.end_moment, abs=1e-8)
    assert np.linalg.norm(ring.curve.loads[3:]) == pytest.approx(
        np.linalg.norm(oracle.force), rel=1e-5
    )
    s = np.linspace(0.0, 1.0, 17)
    assert np.max(np.abs(ring.curve.solution(s)[:, :3] - oracle.solution(s)[:3].T)) < 1e-6


@pytest.mark.parametrize("turns", [0.0, 0.3, 0.4999, -0.2])
@pytest.mark.parametrize("ratio", [0.05, 1.5])
def test_straight_molecule_closes_into_the_twisted_circle(turns, ratio):
    """Not isolated: any register will do, and an end twist of exactly zero is no obstacle."""
    n = 150
    rod = build_rod(straight_chain(n, 2 * np.pi * (14 - turns) / n, ratio))
    ring = solve_continuum_ring(rod, 14)
    assert ring.status is Status.NEUTRAL
    assert ring.energy == pytest.approx(
        perfect_energy(ring.curve.alpha, 1 / n, ratio / n), rel=1e-9
    )
    assert ring.curve.alpha == pytest.approx(2 * np.pi * turns, abs=1e-9)
    assert ring.stable is None
    assert ring.link == 14
    assert abs(ring.writhe) < 1e-6


def test_energy_parts_and_twist_add_up(lowest):
    for ring in lowest.values():
        assert ring.curve.bend + ring.curve.twist == pytest.approx(ring.energy, rel=1e-14)
        assert abs(ring.writhe) < 0.1
        assert ring.curve.end_moment == pytest.approx(ring.curve.loads[2])


def test_true_frames_close_and_natural_frames_do_not(lowest):
    ring = lowest["11T15"]
    true = ring.curve.true_frames([0.0, 1.0])
    assert np.max(np.abs(true[0] - true[1])) < 1e-9
    natural = ring.curve.natural_frames([0.0, 1.0])
    assert np.max(np.abs(natural[0] - natural[1])) > 0.1
    assert np.max(np.abs(ring.curve.centreline([0.0, 1.0]))) < 1e-9


@pytest.mark.parametrize("name", ["12A09", "08T15", "17A11"])
def test_conjugate_points_count_the_discrete_negative_directions(name):
    """Each stable or unstable continuum ring leads to a discrete one with the same inertia."""
    chain = molecule_chain(name)
    for ring in lowest_continuum_ring(molecule_rod(name)).equilibria:
        if ring.energy * chain.energy_scale_RT > 40.0:
            continue
        discrete = solve_ring(chain, reconstruct(ring).angles)
        if abs(discrete.energy / ring.energy - 1.0) > 0.01:
            continue  # Newton left for another equilibrium
        assert discrete.stable == (ring.negative_directions == 0)


def test_failure_carries_what_there_was():
    options = ContinuumOptions(max_iterations=1, homotopy_steps=0)
    ring = solve_continuum_ring(molecule_rod("12A09"), 15, options=options)
    assert ring.status is Status.ITERATION_LIMIT
    assert ring.residual > 1e-10
    assert np.isfinite(ring.energy)
    assert ring.stable is None
    search = lowest_continuum_ring(molecule_rod("12A09"), options=options)
    assert search.status is Status.NOT_FOUND
    assert search.failed_starts


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"intervals": 3}, "intervals = 3"),
        ({"degree": 1}, "degree = 1"),
        ({"degree": 9}, "degree = 9"),
        ({"tolerance": 1e-15}, "rounding allows"),
        ({"tolerance": float("nan")}, "tolerance = nan"),
        ({"energy_tolerance": 0.0}, "energy_tolerance"),
        ({"max_iterations": 0}, "max_iterations = 0"),
        ({"intervals": 100, "max_intervals": 50}, "raise the latter"),
    ],
)
def test_bad_options_are_refused(changes, message):
    with pytest.raises(InputError, match=message):
        ContinuumOptions(**changes)
