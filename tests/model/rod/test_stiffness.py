"""Continuum stiffnesses: the paper's rule, and the average of sequence-dependent ones."""

import numpy as np
import pytest
from rods import molecule_chain

from dnacheck.equilibria.continuum import solve_continuum_ring
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.chain import Chain
from dnacheck.model.rod import build_rod
from dnacheck.numerics.outcome import InputError


def _with_stiffness(chain, stiffness):
    return Chain(chain.name, np.array(chain.ground), stiffness)


def test_uniform_stiffness_follows_the_papers_rule():
    chain = molecule_chain("11T15")
    rod = build_rod(chain)
    assert rod.bend_stiffness == pytest.approx(1.0 / 158, rel=1e-14)
    assert rod.twist_stiffness == pytest.approx(1.5 / 158, rel=1e-14)
    assert rod.compliance_series is None


def test_bending_anisotropy_averages_to_the_mean_compliance():
    chain = molecule_chain("11T15")
    stiffness = np.tile(np.diag([1.5, 4.0 / 3.0, 0.8]), (158, 1, 1))  # mean compliance 1
    rod = build_rod(_with_stiffness(chain, stiffness))
    assert rod.bend_stiffness == pytest.approx(1.0 / 158, rel=1e-12)
    assert rod.stiffness_anisotropy < 0.04
    ring = solve_continuum_ring(rod, 15)
    discrete = find_rings(_with_stiffness(chain, stiffness)).lowest
    assert ring.energy == pytest.approx(discrete.energy, rel=0.005)
    # the mean stiffness instead of the mean compliance misses by more than that
    assert discrete.energy * (4.0 / 3.0 + 0.8) / 2 > discrete.energy * 1.02


def test_soft_stretch_agrees_with_the_discrete_chain():
    chain = molecule_chain("09T09")
    factor = np.where((np.arange(150) > 40) & (np.arange(150) < 90), 0.6, 1.2)
    stiffness = factor[:, None, None] * np.diag([1.5, 1.0, 1.0])
    soft = _with_stiffness(chain, stiffness)
    rod = build_rod(soft, cut=0)
    s = np.linspace(0, 1, 400)
    relative = rod.relative_compliance(s)
    assert relative[200, 0] > 1.3
    assert relative[10, 0] < 0.9
    discrete = find_rings(soft).lowest
    local = solve_continuum_ring(rod, discrete.link)
    assert local.energy == pytest.approx(discrete.energy, rel=0.005)
    # a uniform rod of the same mean compliance does not
    mean = np.tile(np.diag([1.5, 1.0, 1.0]) / np.mean(1 / factor), (150, 1, 1))
    uniform = solve_continuum_ring(build_rod(_with_stiffness(chain, mean)), discrete.link)
    assert abs(uniform.energy / discrete.energy - 1.0) > 0.02


def test_anisotropy_that_does_not_average_out_is_refused():
    ground = np.zeros((120, 3))
    ground[:, 2] = 0.01  # no twist: the soft direction never turns
    stiffness = np.tile(np.diag([1.5, 1.0, 2.0]), (120, 1, 1))
    with pytest.raises(InputError, match=r"bending anisotropy.*discrete model"):
        build_rod(Chain("strip", ground, stiffness))


def test_coupling_that_does_not_average_out_is_refused():
    ground = np.zeros((120, 3))
    coupled = np.array([[1.5, 0.0, 0.5], [0.0, 1.0, 0.0], [0.5, 0.0, 1.0]])
    with pytest.raises(InputError, match="bend-twist coupling"):
        build_rod(Chain("strip", ground, np.tile(coupled, (120, 1, 1))))
    twisted = np.zeros((120, 3))
    twisted[:, 0] = 0.6  # with helical twist the same coupling averages out
    rod = build_rod(Chain("helix", twisted, np.tile(coupled, (120, 1, 1))))
    # By hand: the compliances of tau, theta, phi are 0.8, 1 and 1.2, and bending takes the mean.
    assert rod.twist_stiffness == pytest.approx(1.25 / 120, rel=1e-12)
    assert rod.bend_stiffness == pytest.approx(1.0 / 1.1 / 120, rel=1e-12)


def test_a_stiffness_that_is_not_positive_is_refused():
    chain = molecule_chain("11T15")
    stiffness = np.array(chain.stiffness)
    stiffness[7] = np.diag([1.5, 1.0, 0.0])
    with pytest.raises(InputError, match="step 8: not positive definite"):
        build_rod(_with_stiffness(chain, stiffness))
