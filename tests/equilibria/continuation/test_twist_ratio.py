"""Sweeps over the twist ratio (Figures 12 to 16)."""

import numpy as np
import pytest
from rods import ANGLE_SETS, ELEVEN, molecule_chain, molecule_rod

from dnacheck.equilibria.continuation.figures import RATIOS, sweep_data, sweeps
from dnacheck.equilibria.continuation.twist_ratio import (
    SweepOptions,
    at_twist_ratio,
    check_ratios,
    sweep_continuum,
    sweep_discrete,
)
from dnacheck.equilibria.continuum import ContinuumOptions, lowest_continuum_ring
from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import embedded
from dnacheck.model.rod import build_rod
from dnacheck.numerics.outcome import InputError


@pytest.fixture(scope="module")
def crossing_chain():
    """17A11 with the De Santis angles: its lowest ring changes link within the range."""
    return build_chain(embedded("17A11"), angles="desantis")


def test_every_point_is_the_lowest_of_a_fresh_search(crossing_chain):
    """Warm starts against a search of all links from eight registers at each ratio."""
    ratios = np.array([0.5, 0.7, 0.75, 1.0, 1.5])
    sweep = sweep_discrete(crossing_chain, ratios)
    for i, ratio in enumerate(ratios):
        fresh = find_rings(crossing_chain.with_twist_ratio(ratio), SearchOptions(links="all"))
        assert sweep.energy[i] == pytest.approx(fresh.lowest.energy, rel=1e-9)
        assert sweep.link[i] == fresh.lowest.link
    assert sweep.residual.max() <= 1e-10
    assert sweep.status == "converged"


def test_continuum_points_against_the_adaptive_solver(crossing_chain):
    rod = build_rod(crossing_chain)
    ratios = np.array([0.5, 0.7, 0.75, 1.5])
    sweep = sweep_continuum(rod, ratios)
    for i, ratio in enumerate(ratios):
        fine = lowest_continuum_ring(
            at_twist_ratio(rod, ratio), options=ContinuumOptions(energy_tolerance=1e-7)
        ).lowest
        assert sweep.energy[i] == pytest.approx(fine.energy, rel=2e-5)
        assert sweep.link[i] == fine.link
    np.testing.assert_allclose(sweep.energy, sweep.bend + sweep.twist, rtol=1e-12)
    assert sweep.residual.max() <= 1e-10


def test_crossing_is_followed_and_located(crossing_chain):
    sweep = sweep_discrete(crossing_chain, np.linspace(0.5, 1.5, 16))
    (crossing,) = sweep.crossings
    assert crossing.exchanged
    assert crossing.links == (16, 15)
    assert crossing.precision <= 1e-6
    at = crossing_chain.with_twist_ratio(crossing.ratio)
    energies = [find_rings(at, SearchOptions(links=link)).lowest.energy for link in crossing.links]
    assert energies[0] == pytest.approx(energies[1], rel=1e-6)
    assert energies[0] == pytest.approx(crossing.energy, rel=1e-6)
    # the branch left behind is still there, and higher
    left = sweep.tracks[crossing.tracks[0]]
    assert left.energy[-1] > sweep.energy[-1]


def test_a_single_warm_track_would_have_missed_it(crossing_chain):
    """Negative control: following only the first lowest minimum gives another answer."""
    ratios = np.linspace(0.5, 1.5, 16)
    sweep = sweep_discrete(crossing_chain, ratios)
    only = sweep.tracks[sweep.lowest[0]]
    assert only.energy[-1] > 1.02 * sweep.energy[-1]


def test_energy_slope_is_the_twisting_energy():
    """dE/dK3 = twisting energy / K3, an identity between columns of the same sweep."""
    sweep = sweep_continuum(molecule_rod("08T15"), np.linspace(0.9, 1.1, 9))
    slope = np.gradient(sweep.energy, sweep.ratios)
    np.testing.assert_allclose(slope[1:-1], (sweep.twist / sweep.ratios)[1:-1], rtol=1e-3)


def test_reverse_order_of_search_makes_no_difference():
    ratios = np.linspace(0.5, 1.5, 6)
    chain = build_chain(embedded("12A09"), angles="trifonov")
    every = sweep_discrete(chain, ratios, SweepOptions(search_every=1))
    rare = sweep_discrete(chain, ratios, SweepOptions(search_every=100))
    np.testing.assert_allclose(every.energy, rare.energy, rtol=1e-9)
    np.testing.assert_array_equal(every.link, rare.link)


@pytest.mark.parametrize(
    ("ratios", "message"),
    [
        ([0.5, 0.0], "greater than 0"),
        ([-1.0], "greater than 0"),
        ([float("nan")], "greater than 0"),
        ([1.0, 0.5], "increase"),
        ([], "at least one"),
    ],
)
def test_bad_ratios(ratios, message):
    with pytest.raises(InputError, match=message):
        check_ratios(ratios)


def test_missing_points_are_told(crossing_chain):
    """A model that finds nothing gives a status that says what to change."""
    from dnacheck.equilibria.continuation import twist_ratio as module

    class Nothing:
        name, kind, energy_scale_RT = "none", "discrete", 1.0

        def search(self, ratio):
            return []

        def follow(self, ratio, guess, like):
            return None

    empty = module._sweep(Nothing(), check_ratios([0.5, 1.0]), SweepOptions())
    assert list(empty.missing) == [0.5, 1.0]
    assert "search_every" in empty.status
    assert np.isnan(empty.energy).all()
    with pytest.raises(InputError, match="search_every"):
        SweepOptions(search_every=0)


def test_data_of_the_figures():
    chain = molecule_chain("11T15")
    (both,) = sweeps([chain], ratios=(0.5, 1.0, 1.5))
    continuum, discrete = both["continuum"], both["discrete"]
    assert continuum["energy"][-1] == pytest.approx(0.07737 * chain.energy_scale_RT, rel=1e-3)
    np.testing.assert_allclose(continuum["energy"], discrete["energy"], rtol=0.005)
    assert len(RATIOS) == 16
    assert sweep_data(sweep_discrete(chain, [1.0]))["crossings"] == []


@pytest.mark.slow
@pytest.mark.parametrize("angles", ANGLE_SETS)
def test_all_sweeps(angles):
    for name in ELEVEN:
        chain = build_chain(embedded(name), angles=angles)
        continuum = sweep_continuum(build_rod(chain), RATIOS)
        discrete = sweep_discrete(chain, RATIOS)
        assert continuum.status == discrete.status == "converged"
        assert max(continuum.residual.max(), discrete.residual.max()) <= 1e-10
        np.testing.assert_allclose(continuum.energy, discrete.energy, rtol=0.005)
