"""Continuum rings know no first base pair, and no second minimum depends on it."""

import numpy as np
import pytest

from dnacheck.equilibria.bridge.reconstruct import reconstruct, rms_difference
from dnacheck.equilibria.continuum import lowest_continuum_ring, solve_continuum_ring
from dnacheck.equilibria.continuum.coarse_chain import chain_of_pieces, coarse_minima
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.chain import build_chain
from dnacheck.model.rod import build_rod
from dnacheck.model.sequence import Sequence

SETS = ("trifonov2", "trifonov", "desantis")
# Of 21 cuts of this ring six ended in the upper of its two minima.
TWO_MINIMA = "TTGCCTCGCGGGAGTGGTTAGTGCTGTACAGATGGTTCTACGTTTAATTCTCACGCCATTTGAAAATTTAGCCTTGAGGTTTGA"
# The spline's pieces move with the cut: energies of one ring over its cuts (RT), as measured.
FIT_ERROR = 0.02


def chain_of(letters, cut=0, **arguments):
    return build_chain(Sequence("ring", letters[cut:] + letters[:cut]), **arguments)


def test_both_minima_are_found_from_every_cut():
    """Also where the rod is that of the cut as written."""
    for cut in range(0, len(TWO_MINIMA), 12):
        chain = chain_of(TWO_MINIMA, cut, a_tracts="none")
        discrete = [ring.energy_RT for ring in find_rings(chain).equilibria]
        for start in (None, 0):
            found = lowest_continuum_ring(build_rod(chain, cut=start))
            energies = [ring.energy_RT for ring in found.minima[:2]]
            assert energies == pytest.approx([32.062, 32.241], abs=FIT_ERROR)
            assert energies == pytest.approx(discrete, rel=2e-3)


def check_cuts(count, seed, slow_cuts):
    rng = np.random.default_rng(seed)
    gaps = []
    for i in range(count):
        letters = "".join(rng.choice(list("ACGT"), int(rng.integers(60, 151))))
        chain = chain_of(letters, angles=SETS[i % 3])
        reference = lowest_continuum_ring(build_rod(chain)).lowest
        pairs = reconstruct(reference)
        for cut in rng.integers(1, len(letters), slow_cuts):
            other = chain_of(letters, int(cut), angles=SETS[i % 3])
            ring = lowest_continuum_ring(build_rod(other)).lowest
            assert ring.energy == pytest.approx(reference.energy, rel=1e-9)
            # Base pair by base pair it is the same shape, read from another one.
            turned = np.roll(pairs.angles, -int(cut), axis=0)
            assert np.abs(reconstruct(ring).angles - turned).max() < 1e-6
            written = lowest_continuum_ring(build_rod(other, cut=0)).lowest
            gaps.append(abs(written.energy_RT - reference.energy_RT))
    return gaps


def test_random_molecules_are_the_same_from_every_cut():
    gaps = check_cuts(9, 41, 1)
    assert max(gaps) < FIT_ERROR * 2.0


@pytest.mark.slow
def test_three_hundred_random_molecules_are_the_same_from_every_cut():
    gaps = np.sort(check_cuts(300, 42, 1))
    assert gaps[int(0.99 * len(gaps))] < FIT_ERROR * 2.0


def test_pieces_have_the_energy_of_the_rod():
    """The error of the pieces falls with the square of their length."""
    rod = build_rod(chain_of(TWO_MINIMA))
    chain = chain_of_pieces(rod)
    assert chain.relaxed_turns == pytest.approx(rod.relaxed_turns, abs=1e-12)
    lowest = coarse_minima(rod, (8,), 0, np.inf)[0]
    ring = lowest_continuum_ring(rod).lowest
    assert lowest.link == ring.link
    assert lowest.energy == pytest.approx(ring.energy, rel=1e-3)
    # Newton from the rolled perfect ring, another start altogether, meets the same equilibria.
    same = solve_continuum_ring(rod, 8)
    energies = [found.energy for found in lowest_continuum_ring(rod, 8).equilibria]
    assert min(abs(same.energy - energy) for energy in energies) < 1e-6 * same.energy


def test_base_pairs_of_a_rod_are_those_of_the_molecule():
    """The discrete ring, labelled as the molecule is written, is near pair by pair."""
    chain = chain_of(TWO_MINIMA, 5)
    rod = build_rod(chain)
    assert rod.cut != 0
    ring = lowest_continuum_ring(rod).lowest
    discrete = find_rings(chain).lowest
    gap = np.abs(reconstruct(ring).angles - discrete.angles).max()
    assert gap < 0.15
    # Negative control: read from another base pair it is not.
    assert np.abs(np.roll(reconstruct(ring).angles, 3, axis=0) - discrete.angles).max() > 2.0 * gap
    assert rms_difference(reconstruct(ring).centres, discrete.centres, chain.rise_A) < 1.0
