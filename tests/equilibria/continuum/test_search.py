"""The search for the lowest continuum ring."""

import numpy as np
import pytest
from rods import ANGLE_SETS, molecule_rod, random_chain, straight_chain

from dnacheck.equilibria.continuum import ContinuumOptions, lowest_continuum_ring
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.rod import build_rod
from dnacheck.numerics.outcome import InputError, SolveError, Status


def test_equilibria_are_sorted_distinct_and_stable_first():
    search = lowest_continuum_ring(molecule_rod("09T09"), links="all")
    energies = [ring.energy for ring in search.equilibria]
    assert energies == sorted(energies)
    assert np.min(np.diff(energies)) > 1e-6
    assert search.lowest.stable
    assert {14, 15} <= {ring.link for ring in search.equilibria}
    assert any(ring.status is Status.SADDLE for ring in search.equilibria)


def test_one_link_only():
    search = lowest_continuum_ring(molecule_rod("09T09"), links=15)
    assert search.links_searched == (15,)
    assert search.lowest.link == 15
    assert search.lowest.energy > lowest_continuum_ring(molecule_rod("09T09")).lowest.energy


def test_links_at_half_a_turn_are_both_searched():
    rod = build_rod(straight_chain(150, 2 * np.pi * 14.5 / 150))
    search = lowest_continuum_ring(rod)
    assert {14, 15} <= set(search.links_searched)
    a, b = (ring for ring in search.equilibria if ring.link in (14, 15))
    assert a.energy == pytest.approx(b.energy, rel=1e-9)


@pytest.mark.parametrize(
    ("ratio", "tolerance"), [(0.2, 0.06), (0.7, 0.01), (1.5, 0.01), (5.0, 0.04), (20.0, 0.06)]
)
def test_random_sequences_find_the_discrete_minimum(ratio, tolerance):
    """The discrete search, independent of the continuum, finds the same minimum.

    The tolerances are the models' own gap: it grows away from K3 = K1.
    """
    rng = np.random.default_rng(7)
    for seed in range(6):
        length = int(rng.integers(60, 400))
        chain = random_chain(seed, length, ANGLE_SETS[seed % 3], ratio)
        ring = lowest_continuum_ring(build_rod(chain)).lowest
        discrete = find_rings(chain).lowest
        assert ring.stable
        assert ring.residual < 1e-10
        assert ring.energy == pytest.approx(discrete.energy, rel=tolerance)


@pytest.mark.parametrize("links", ["some", "AUTO"])
def test_bad_links_are_refused(links):
    with pytest.raises(InputError, match="'auto', 'all' or an integer"):
        lowest_continuum_ring(molecule_rod("11T15"), links=links)


def test_nothing_found_raises_with_the_partial_search():
    options = ContinuumOptions(max_iterations=1, homotopy_steps=0)
    search = lowest_continuum_ring(molecule_rod("12A09"), options=options)
    with pytest.raises(SolveError, match="no equilibrium was found") as caught:
        _ = search.lowest
    assert caught.value.partial is search


@pytest.mark.slow
def test_wide_sample_of_random_sequences():
    """60 to 400 bp, K3/K1 from 0.05 to 20: every search ends in a stable ring."""
    rng = np.random.default_rng(11)
    for seed in range(300):
        length, ratio = int(rng.integers(60, 401)), float(np.exp(rng.uniform(-3.0, 3.0)))
        chain = random_chain(seed, length, ANGLE_SETS[seed % 3], ratio)
        ring = lowest_continuum_ring(build_rod(chain)).lowest
        assert ring.stable
        assert ring.residual < 1e-10
        above = ring.energy / find_rings(chain).lowest.energy - 1.0
        assert above < (0.05 if ratio > 0.3 else 0.15)


def test_a_bound_on_the_links_is_said():
    soft = build_rod(random_chain(3, 150, ratio=0.01))
    found = lowest_continuum_ring(soft)
    assert len(found.links_searched) == 13
    assert found.notes == ("only the 13 links nearest to the relaxed twist were searched",)
    assert lowest_continuum_ring(molecule_rod("11T15")).notes == ()
