"""Ideal rods: published formulas, their limits, and a count of discretised chains."""

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from dnacheck.cyclization.half_chain.sampling import HalfChainOptions, half_chain
from dnacheck.cyclization.result import PER_CUBIC_ANGSTROM_IN_MOLAR
from dnacheck.model.chain import Chain, uniform_stiffness
from dnacheck.numerics.outcome import InputError
from dnacheck.validation.reference.wormlike_chain import (
    aligned_ends_j,
    chain_rod_j,
    free_ends_j,
    rod_j,
    twist_factors,
    writhe_variance,
)


def straight(n: int, turns: float, twist_ratio: float = 1.5) -> Chain:
    twist = 2.0 * math.pi * turns / n
    return Chain("straight", np.tile([twist, 0.0, 0.0], (n, 1)), uniform_stiffness(n, twist_ratio))


def test_free_ends_is_the_formula_in_kuhn_lengths():
    # The same authors' form in Kuhn lengths: 28.01 x^-5 exp(-7.027/x + 0.492 x) per cubed length.
    persistence = 500.0
    for x in (0.4, 1.0, 1.7, 2.0):
        density = 28.01 * x**-5 * math.exp(-7.027 / x + 0.492 * x) / (2.0 * persistence) ** 3
        j = free_ends_j(2.0 * persistence * x, persistence)
        assert j == pytest.approx(PER_CUBIC_ANGSTROM_IN_MOLAR * density, rel=2e-3)


def test_free_ends_peaks_where_the_literature_says():
    lengths = np.linspace(200.0, 3_000.0, 400)
    best = lengths[np.argmax([free_ends_j(x, 500.0) for x in lengths])]
    assert best / 500.0 == pytest.approx(3.4, abs=0.1)


def half_rods(steps: int, variance: float, count: int, rng) -> tuple[np.ndarray, np.ndarray]:
    """Ends and tangents of isotropic rods of unit steps, by rotating a frame step by step."""
    end, frame = np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1))
    for _ in range(steps):
        end += 0.5 * frame[:, :, 2]
        bend = math.sqrt(variance) * rng.standard_normal((count, 2))
        size = np.linalg.norm(bend, axis=1)
        c, s = np.cos(size), np.sin(size)
        u, v = bend.T / size
        spin = np.empty((count, 3, 3))
        spin[:, 0, 0], spin[:, 0, 1], spin[:, 0, 2] = c + (1 - c) * u * u, (1 - c) * u * v, s * v
        spin[:, 1, 0], spin[:, 1, 1], spin[:, 1, 2] = (1 - c) * u * v, c + (1 - c) * v * v, -s * u
        spin[:, 2, 0], spin[:, 2, 1], spin[:, 2, 2] = -s * v, s * u, c
        frame = frame @ spin
        end += 0.5 * frame[:, :, 2]
    return end, frame


@pytest.mark.parametrize("ratio", [3.0, 4.0])
def test_aligned_and_free_ends_meet_counted_rods(ratio):
    """Half rods drawn in numpy, pairs counted in a window: nothing of the package is used."""
    rng = np.random.default_rng(7)
    per_length, half = 14, int(round(7 * ratio))
    length = 2.0 * half / per_length
    first, back = (half_rods(half, 1.0 / per_length, 24_000, rng) for _ in range(2))
    # The second half is followed backwards from the same origin and tangent.
    meet = np.array([1.0, 1.0, -1.0])
    end, frame = back[0] * meet, back[1] * meet[:, None] * meet
    reach, turn = 0.18 * per_length, 0.35
    pairs = cKDTree(first[0]).sparse_distance_matrix(cKDTree(end), reach, output_type="coo_matrix")
    volume = 4.0 / 3.0 * math.pi * (reach / per_length) ** 3
    free = pairs.nnz / 24_000**2 / volume
    # Backward tangents point against the contour: aligned means opposite.
    cosine = -np.einsum("pi,pi->p", first[1][pairs.row, :, 2], -frame[pairs.col, :, 2])
    aligned = np.sum(cosine > math.cos(turn)) / 24_000**2 / volume / (0.5 * (1 - math.cos(turn)))
    hits = np.sum(cosine > math.cos(turn))
    error = 4.0 / math.sqrt(hits)
    expected = aligned_ends_j(length, 1.0) / PER_CUBIC_ANGSTROM_IN_MOLAR
    assert aligned == pytest.approx(expected, rel=0.12 + error)
    assert free == pytest.approx(free_ends_j(length, 1.0) / PER_CUBIC_ANGSTROM_IN_MOLAR, rel=0.2)
    # Control: the two are told apart.
    assert free != pytest.approx(expected, rel=0.2)


def test_twist_factors_are_a_density_on_the_circle():
    for variance in (0.05, 0.7, 9.0):
        turns = np.linspace(0.0, 1.0, 2_001)[:-1]
        sums = np.array([sum(twist_factors(t, variance).values()) for t in turns])
        assert sums.mean() == pytest.approx(1.0, abs=1e-6)
    assert sum(twist_factors(14.3, 60.0).values()) == pytest.approx(1.0, abs=1e-9)
    lone = twist_factors(14.0, 0.05)
    assert max(lone, key=lone.__getitem__) == 14
    assert lone[14] == pytest.approx(math.sqrt(2.0 * math.pi / 0.05))
    half = twist_factors(14.5, 0.7)
    assert half[14] == pytest.approx(half[15])


def test_soft_twist_leaves_the_tangents_alone():
    rod = rod_j(510.0, 463.0, 1.0, 14.3)
    assert rod.minus_lnJ == pytest.approx(rod.minus_lnJ_twist_free, abs=1e-6)
    stiff = rod_j(510.0, 463.0, 695.0, 14.5)
    assert stiff.minus_lnJ > stiff.minus_lnJ_twist_free
    assert stiff.minus_lnJ_coupled < stiff.minus_lnJ
    assert -math.log(sum(math.exp(-x) for x in stiff.links.values())) == pytest.approx(
        stiff.minus_lnJ
    )


def test_writhe_variance_is_that_of_sampled_modes():
    """Tangent fluctuations drawn mode by mode, their writhe an area on the sphere."""
    ratio, modes, points = 0.3, 60, 1_024
    rng = np.random.default_rng(3)
    s = 2.0 * math.pi * np.arange(points) / points
    n = np.arange(2, modes)
    basis = np.concatenate([np.cos(n[:, None] * s), np.sin(n[:, None] * s)])
    slope = np.concatenate(
        [-n[:, None] * np.sin(n[:, None] * s), n[:, None] * np.cos(n[:, None] * s)]
    )
    out = np.sqrt(np.tile(ratio / (2.0 * math.pi**2 * (n**2 - 1.0)), 2))
    flat = np.sqrt(np.tile(ratio / (2.0 * math.pi**2 * n**2), 2))
    writhes = []
    for _ in range(4_000):
        theta = (out * rng.standard_normal(len(out))) @ basis
        bend = (flat * rng.standard_normal(len(flat))) @ slope
        writhes.append(-np.mean(np.sin(theta) * (1.0 + bend) - np.sin(theta).mean()))
    expected = writhe_variance(ratio, 1.0)
    assert np.var(writhes) == pytest.approx(expected, rel=4.0 * math.sqrt(2.0 / 4_000) + 0.03)


def test_straight_chain_meets_the_rod_with_coupling():
    chain = straight(300, 29)
    result = half_chain(chain, HalfChainOptions(halves=16_000), 3)
    rod = chain_rod_j(chain)
    assert result.stderr < 0.12
    assert abs(result.minus_lnJ - rod.minus_lnJ_coupled) < 3.0 * result.stderr + 0.05


def test_chain_rod_takes_lengths_from_the_chain():
    chain = straight(150, 14.2)
    rod = chain_rod_j(chain)
    same = rod_j(150 * 3.4, 463.0, 1.5 * 463.0, 14.2)
    assert rod.minus_lnJ == pytest.approx(same.minus_lnJ, rel=1e-12)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_lengths_must_be_positive(bad):
    with pytest.raises(InputError, match="positive"):
        free_ends_j(bad, 463.0)
    with pytest.raises(InputError, match="positive"):
        aligned_ends_j(500.0, bad)
    with pytest.raises(InputError, match="positive"):
        twist_factors(14.0, bad)
