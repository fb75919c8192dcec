"""Continuum energy with the steps' own compliance, against discrete rings."""

import numpy as np
import pytest
from rods import ELEVEN, molecule_chain, molecule_rod, random_chain, straight_chain

from dnacheck.equilibria.bridge.homogenise import corrected_energy, step_axes
from dnacheck.equilibria.continuation.twist_ratio import sweep_continuum, sweep_discrete
from dnacheck.equilibria.continuum import ContinuumOptions, lowest_continuum_ring
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.chain import build_chain, chain_frames
from dnacheck.model.molecules import embedded
from dnacheck.model.rod import RodOptions, build_rod
from dnacheck.numerics.outcome import InputError

FINE = ContinuumOptions(energy_tolerance=1e-7)


def gaps(chain, rod=None):
    """Relative distances from the discrete energy: isotropic rod, corrected."""
    discrete = find_rings(chain).lowest
    rod = build_rod(chain) if rod is None else rod
    ring = lowest_continuum_ring(rod, links=discrete.link, options=FINE).lowest
    corrected = corrected_energy(ring, chain)
    return corrected.fitted / discrete.energy - 1.0, corrected.energy / discrete.energy - 1.0


def test_the_eleven():
    table = np.array([gaps(molecule_chain(name), molecule_rod(name)) for name in ELEVEN])
    assert 0.0025 < np.abs(table[:, 0]).max() < 0.0045  # the paper's gap is there
    assert np.abs(table[:, 1]).max() <= 0.0003


@pytest.mark.parametrize("seed", range(4))
def test_random_sequences(seed):
    assert abs(gaps(random_chain(seed, 120 + 20 * seed))[1]) <= 0.001


@pytest.mark.slow
def test_fifty_random_sequences():
    rng = np.random.default_rng(11)
    lengths = rng.integers(120, 200, size=50)
    table = np.array([gaps(random_chain(100 + i, int(n))) for i, n in enumerate(lengths)])
    assert np.abs(table[:, 1]).max() <= 0.001
    assert np.median(np.abs(table[:, 1])) < 0.2 * np.median(np.abs(table[:, 0]))


def test_the_coupling_is_the_wedges_lack_of_strand_symmetry():
    """The mid-step form has no first-order coupling, and no such gap to begin with."""
    chain = build_chain(embedded("11A17"), step_form="midstep")
    wedge = molecule_chain("11A17")
    coupling = []
    for each in (chain, wedge):
        ring = lowest_continuum_ring(build_rod(each), options=FINE).lowest
        found = corrected_energy(ring, each)
        coupling.append(abs(found.coupling) / found.fitted)
        parts = found.spacing + found.twist + found.bend + found.coupling
        assert found.energy == pytest.approx(found.fitted + parts, rel=1e-12)
    assert coupling[0] < 3e-4
    assert coupling[1] > 3e-3


def test_axes_are_those_of_the_chain():
    """Axes in the natural frame against finite differences of the chain's own frames."""
    chain = molecule_chain("08T15")
    axes = step_axes(chain, molecule_rod("08T15")).axes
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1.0, atol=1e-12)
    step, h = 40, 1e-6
    gram = np.empty((3, 3))
    turned = []
    for k in range(3):
        angles = chain.ground.copy()
        angles[step, k] += h
        before = chain_frames(chain.ground)[1][step + 1]
        change = (chain_frames(angles)[1][step + 1] - before) @ before.T / h
        turned.append([change[2, 1], change[0, 2], change[1, 0]])
    gram = np.array(turned) @ np.array(turned).T
    np.testing.assert_allclose(axes[step].T @ axes[step], gram, atol=1e-5)


def test_straight_chain_needs_no_correction():
    chain = straight_chain(60)
    ring = lowest_continuum_ring(build_rod(chain, RodOptions()), options=FINE).lowest
    corrected = corrected_energy(ring, chain)
    assert corrected.energy == pytest.approx(corrected.fitted, rel=1e-8)


def test_sweep_with_correction():
    chain, rod = molecule_chain("11A17"), molecule_rod("11A17")
    ratios = [0.5, 1.0, 1.5]
    corrected = sweep_continuum(rod, ratios, corrected_for=chain)
    discrete = sweep_discrete(chain, ratios)
    plain = sweep_continuum(rod, ratios)
    assert np.abs(corrected.energy / discrete.energy - 1.0).max() <= 0.001
    assert np.abs(plain.energy / discrete.energy - 1.0).max() > 0.002


def test_chain_of_another_length():
    with pytest.raises(InputError, match="steps"):
        step_axes(molecule_chain("08T15"), molecule_rod("11T15"))
