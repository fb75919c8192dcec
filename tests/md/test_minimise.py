"""Minima of the bead chain against the discrete solver's."""

import numpy as np
import pytest
from bead_chains import ring_chain
from rods import ELEVEN, molecule_chain

from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
from dnacheck.md.bead_chain import BeadChain, BeadEnergy
from dnacheck.md.geometry import planar_ring
from dnacheck.md.harmonic import harmonic_fluctuation, hessian
from dnacheck.md.minimise import (
    MinimiseOptions,
    _colours,
    find_minima,
    folded_order,
    minimise,
)
from dnacheck.numerics.outcome import InputError, SolveError, Status
from dnacheck.numerics.superpose import superpose


@pytest.mark.parametrize("n", [6, 7, 10, 11, 23, 42, 158])
def test_folded_order_keeps_neighbours_near(n):
    order = folded_order(n)
    assert sorted(order) == list(range(n))
    for reach in (1, 2):
        assert np.abs(order - np.roll(order, reach)).max() <= 2 * reach


@pytest.mark.parametrize("n", [6, 9, 10, 11, 14, 42, 158, 163])
def test_groups_hold_base_pairs_that_do_not_meet(n):
    colour = _colours(n)
    assert len(colour) == n
    for group in range(colour.max() + 1):
        members = np.flatnonzero(colour == group)
        gaps = np.diff(np.append(members, members[0] + n))
        assert gaps.min() >= 5


def test_own_starts_find_the_discrete_minima(chain, minima):
    search = find_rings(chain, SearchOptions(links="all"))
    rings = [ring for ring in search.equilibria if ring.stable]
    assert len(minima) >= 1
    for minimum in minima:
        assert minimum.status is Status.CONVERGED
        assert minimum.bond_error < 1e-9
        ring = min(rings, key=lambda r: abs(r.energy_RT - minimum.energy_RT))
        assert minimum.energy_RT == pytest.approx(ring.energy_RT, rel=1e-8)
        assert minimum.link == ring.link
        assert minimum.writhe == pytest.approx(ring.writhe, abs=1e-7)
        centres = chain.rise_A * ring.centres[:-1]
        assert superpose(minimum.centres_A, centres)[1] < 1e-4
    assert minima[0].energy_RT == pytest.approx(rings[0].energy_RT, rel=1e-8)


def test_a_perturbed_minimum_relaxes_back(energy, minima):
    start = minima[0].positions + 0.1 * np.random.default_rng(3).standard_normal(
        minima[0].positions.shape
    )
    again = minimise(energy, start)
    assert again.energy_RT == pytest.approx(minima[0].energy_RT, rel=1e-9)
    assert superpose(again.centres_A, minima[0].centres_A)[1] < 1e-5


def test_hessian_is_that_of_the_forces(energy, minima):
    matrix = hessian(energy, minima[0])
    assert np.allclose(matrix, matrix.T)
    direction = np.random.default_rng(4).standard_normal(minima[0].positions.shape)
    h = 1e-4
    change = energy.forces(minima[0].positions + h * direction)
    change -= energy.forces(minima[0].positions - h * direction)
    expected = -change.ravel() / (2.0 * h)
    assert matrix @ direction.ravel() == pytest.approx(expected, rel=1e-3, abs=1e-2)
    values = np.linalg.eigvalsh(matrix)
    assert np.abs(values[:6]).max() < 1e-4 * values[6:].min() + 1e-3
    assert values[6] > 0.0


def test_harmonic_fluctuation_is_that_of_gaussian_draws(energy, minima):
    matrix = hessian(energy, minima[0])
    values, vectors = np.linalg.eigh(matrix)
    rng = np.random.default_rng(5)
    # Small draws, so that superposition to first order is exact.
    size = 1e-3
    draws = rng.standard_normal((4000, len(values) - 6)) / np.sqrt(values[6:])
    beads = minima[0].positions + size * (draws @ vectors[:, 6:].T).reshape(
        -1, *minima[0].positions.shape
    )
    from dnacheck.md.geometry import per_base_pair_fluctuation

    got = per_base_pair_fluctuation(beads[:, 0::2], minima[0].centres_A) / size
    assert harmonic_fluctuation(energy, minima[0]) == pytest.approx(got, rel=0.06)


def test_a_limit_of_iterations_is_reported(chain, energy):
    start = planar_ring(chain, 4, 2.0, 10.0)
    few = MinimiseOptions(max_iterations=2)
    assert minimise(energy, start, few).status is Status.ITERATION_LIMIT
    with pytest.raises(SolveError, match="more iterations") as caught:
        find_minima(energy, np.random.default_rng(0), few)
    assert len(caught.value.partial) == 4


def test_bad_starts_are_refused(chain, energy):
    beads = planar_ring(chain, 4, 0.0, 10.0)
    with pytest.raises(InputError, match="82 beads were given"):
        minimise(energy, beads[:-2])
    beads[3, 1] = np.nan
    with pytest.raises(InputError, match="not a finite number"):
        minimise(energy, beads)
    with pytest.raises(InputError, match="rms"):
        MinimiseOptions(same_rms_A=0.0)


@pytest.mark.md
@pytest.mark.parametrize("name", ELEVEN)
def test_both_minima_of_the_eleven(name):
    chain = molecule_chain(name)
    energy = BeadEnergy(BeadChain(chain))
    found = find_minima(energy, np.random.default_rng(2))
    rings = [ring for ring in find_rings(chain).equilibria if ring.stable]
    assert len(rings) >= 1
    for ring in rings:
        centres = chain.rise_A * ring.centres[:-1]
        nearest = min(found, key=lambda m: superpose(m.centres_A, centres)[1])
        assert nearest.energy_RT == pytest.approx(ring.energy_RT, rel=1e-5)
        assert superpose(nearest.centres_A, centres)[1] < 0.02
    assert found[0].energy_RT == pytest.approx(rings[0].energy_RT, rel=1e-5)


@pytest.mark.md
def test_minimising_a_hundred_base_pairs_with_couplings():
    from bead_chains import coupled_stiffness

    base = ring_chain(100)
    from dataclasses import replace

    chain = replace(base, stiffness=coupled_stiffness(100), twist_ratio=None)
    energy = BeadEnergy(BeadChain(chain))
    found = find_minima(energy, np.random.default_rng(2))
    ring = find_rings(chain).lowest
    assert found[0].energy_RT == pytest.approx(ring.energy_RT, rel=1e-7)
