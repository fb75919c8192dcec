"""Half chains: pairs, weights, windows and errors, each against an independent count."""

import itertools
import math

import numpy as np
import pytest
from rods import molecule_chain
from scipy.integrate import quad
from scipy.spatial.transform import Rotation
from short_chains import closed_ground_chain, end_poses, exact_free_angles, soft_chain

from dnacheck.cyclization.half_chain.kernels.pairs import Halves, half_poses, log_volume_factor
from dnacheck.cyclization.half_chain.proposals import ring_tilts
from dnacheck.cyclization.half_chain.sampling import (
    HalfChainOptions,
    HalfSampler,
    half_chain,
    half_chain_estimate,
    matched,
    sorted_into_cells,
)
from dnacheck.cyclization.half_chain.window import crossed_error, polynomial_weights
from dnacheck.cyclization.result import PER_CUBIC_ANGSTROM_IN_MOLAR, JStatus
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.equilibria.ring import Equilibria
from dnacheck.model.chain import Chain, uniform_stiffness
from dnacheck.numerics.outcome import InputError, SolveError

SIGMAS = 3.0
# -ln J by exact-closure sampling with a separate prototype.
CLOSURE_SAMPLING = {"09T15": (15.531, 0.010), "08T15": (15.762, 0.011)}


def drawn_poses(chain: Chain, angles: np.ndarray, backward: bool) -> np.ndarray:
    n = angles.shape[1]
    poses = np.empty((len(angles), 7))
    ground, roots = np.array(chain.ground[:n]), np.tile(np.eye(3), (n, 1, 1))
    steps = chain.arrays._replace(ground=ground, stiffness=np.array(chain.stiffness[:n]))
    half_poses(steps, angles - ground, roots, ground, backward, poses)
    return poses


def test_poses_of_halves_are_those_of_matrix_products():
    chain = soft_chain(9, 8.0)
    angles = exact_free_angles(chain, 50, np.random.default_rng(0))
    end, frame = end_poses(angles)
    forward = drawn_poses(chain, angles, backward=False)
    assert np.allclose(forward[:, :3], end, atol=1e-12)
    assert np.allclose(Rotation.from_quat(forward[:, 3:]).as_matrix(), frame, atol=1e-12)
    # Backward: the inverse motion, so that forward after backward is the identity.
    backward = drawn_poses(chain, angles, backward=True)
    inverse = Rotation.from_quat(backward[:, 3:])
    assert np.allclose(inverse.as_matrix() @ frame, np.eye(3), atol=1e-12)
    assert np.allclose(backward[:, :3] + inverse.apply(end), 0.0, atol=1e-12)


def test_rotation_measure_is_normalised():
    total, _ = quad(
        lambda w: 4.0 * math.pi * w**2 / math.exp(log_volume_factor(w * w)), 0.0, math.pi
    )
    assert total == pytest.approx(1.0, abs=1e-9)
    for w2 in (1e-8, 0.9e-6, 1.1e-6, 1e-3):
        exact = 2.0 * (1.0 - math.cos(math.sqrt(w2))) / w2 if w2 > 1e-7 else 1.0
        assert math.exp(log_volume_factor(w2)) == pytest.approx(8 * math.pi**2 / exact, rel=1e-6)


@pytest.mark.parametrize(("degree", "exact"), [(0, False), (1, True), (2, True)])
def test_extrapolation_is_exact_for_densities_of_its_degree(degree, exact):
    shells = 12
    edges = np.linspace(0.0, 1.0, shells + 1)
    # Shell contents of the density 2 - 1.3 s in a 6-ball, s the squared radius.
    content = 2.0 * np.diff(edges**3) - 1.3 * 0.75 * np.diff(edges**4)
    value = polynomial_weights(shells, degree) @ content
    assert (abs(value - 2.0) < 1e-12) == exact


def test_error_of_crossed_sets_is_unbiased_and_that_of_independent_pairs_is_not():
    rng = np.random.default_rng(3)
    a, b, runs = 8, 8, 4_000
    rows = rng.standard_normal((runs, a, 1))
    columns = 0.7 * rng.standard_normal((runs, 1, b))
    tables = rows + columns + 0.5 * rng.standard_normal((runs, a, b))
    true = tables.mean(axis=(1, 2)).var()
    crossed = np.mean([crossed_error(t) ** 2 for t in tables])
    naive = np.mean(tables.reshape(runs, -1).var(axis=1, ddof=1) / (a * b))
    assert crossed == pytest.approx(true, rel=0.08)
    assert naive < 0.3 * true


def brute_force(first, second, tilts, radius):
    """Sum of pair weights within the window, pair by pair with scipy's rotations."""
    total = 0.0
    for i, j in itertools.product(range(len(first.poses)), range(len(second.poses))):
        shares = np.log([tilt.share for tilt in tilts])
        own = tilts[int(np.argmax(shares + second.scores[j]))].window
        both = tilts[int(np.argmax(shares + first.scores[i] + second.scores[j]))].at_joint
        back = Rotation.from_quat(second.poses[j, 3:]).inv()
        c = np.concatenate(
            [
                back.apply(first.poses[i, :3] - second.poses[j, :3]),
                (back * Rotation.from_quat(first.poses[i, 3:])).as_rotvec(),
            ]
        )
        if c @ np.linalg.solve(own, c) >= radius**2:
            continue
        w = np.linalg.norm(c[3:])
        measure = 2.0 * (1.0 - math.cos(w)) / w**2 / (8.0 * math.pi**2)
        weight = math.exp(
            first.log_weights[i]
            + second.log_weights[j]
            - both.multipliers @ c
            + 0.5 * c @ both.curvature @ c
        )
        total += weight / (measure * math.sqrt(np.linalg.det(own)))
    return total


@pytest.mark.parametrize("tilted", [True, False])
def test_matching_finds_every_pair_once(tilted):
    chain = closed_ground_chain()
    search = find_rings(chain)
    tilts = ring_tilts(search, 15)
    rng = np.random.default_rng(5)
    sides = [HalfSampler(chain, tilts, s, tilted) for s in (slice(0, 15), slice(15, 30))]
    first, second = (side.draw(60, rng) for side in sides)
    options = HalfChainOptions(halves=80, batches=4, radius=1.3, tilted=tilted)
    reach = 1.3 * max(math.sqrt(np.linalg.eigvalsh(t.window[:3, :3])[-1]) for t in tilts)
    in_cells, cells = sorted_into_cells(first, np.repeat(np.arange(4), 15), reach)
    parts = [Halves(*(np.ascontiguousarray(array[k::4]) for array in second)) for k in range(4)]
    sums = matched(in_cells, cells, parts, tilts, options)
    expected = brute_force(first, second, tilts, 1.3)
    assert sums.counts.sum() > 8
    assert sums.table.sum() == pytest.approx(expected, rel=1e-9)
    assert sums.rows.sum() == pytest.approx(expected, rel=1e-9)
    assert sums.columns.sum() == pytest.approx(expected, rel=1e-9)


def test_mixture_weights_average_to_one_only_with_the_mixture_density():
    chain = molecule_chain("09T15")
    tilts = ring_tilts(find_rings(chain), 78)
    # Ten steps, so that tilted and free chains overlap and the mean converges.
    sampler = HalfSampler(chain, tilts, slice(0, 10), True)
    halves = sampler.draw(40_000, np.random.default_rng(2))
    weights = np.exp(halves.log_weights)
    error = weights.std() / math.sqrt(len(weights))
    assert abs(weights.mean() - 1.0) < SIGMAS * error
    # Control: the density of the lowest tilt alone instead of the mixture's.
    wrong = np.exp(-halves.scores[:, 0])
    assert abs(wrong.mean() - 1.0) > 5.0 * wrong.std() / math.sqrt(len(wrong))


def full_chain_log_j(chain: Chain, samples: int, position: float, turn: float, seed: int):
    """ln J from whole chains counted in a window, and its error: no halves, no weights."""
    rng = np.random.default_rng(seed)
    hits = 0
    for _ in range(samples // 50_000):
        end, frame = end_poses(exact_free_angles(chain, 50_000, rng))
        angle = np.arccos(np.clip(0.5 * (np.trace(frame, axis1=1, axis2=2) - 1.0), -1.0, 1.0))
        hits += int(np.sum((np.linalg.norm(end, axis=1) < position) & (angle < turn)))
    volume = 4.0 / 3.0 * math.pi * position**3 * (turn - math.sin(turn)) / math.pi
    density = hits / samples / volume
    log_j = math.log(density * PER_CUBIC_ANGSTROM_IN_MOLAR / chain.rise_A**3)
    return log_j, 1.0 / math.sqrt(hits)


def test_plain_tilted_and_whole_chains_agree():
    chain = closed_ground_chain(20, 2, 30.0)
    search = find_rings(chain)
    tilted = half_chain(search, HalfChainOptions(halves=6_000), 1)
    plain = half_chain(search, HalfChainOptions(halves=6_000, tilted=False), 2)
    log_j, error = full_chain_log_j(chain, 200_000, 1.2, 0.4, 3)
    assert tilted.stderr < 0.06
    assert abs(tilted.minus_lnJ - plain.minus_lnJ) < SIGMAS * math.hypot(
        tilted.stderr, plain.stderr
    )
    # The counting window has a bias of a few per cent that nothing corrects.
    assert abs(-tilted.minus_lnJ - log_j) < SIGMAS * math.hypot(tilted.stderr, error) + 0.08


@pytest.mark.parametrize("name", sorted(CLOSURE_SAMPLING))
def test_best_cyclizers_meet_the_published_sampling(name):
    result = half_chain(molecule_chain(name), HalfChainOptions(halves=16_000), 11)
    value, error = CLOSURE_SAMPLING[name]
    assert result.stderr < 0.08
    assert result.status is JStatus.CONVERGED
    assert abs(result.minus_lnJ - value) < SIGMAS * math.hypot(result.stderr, error)


def test_result_does_not_depend_on_threads_but_on_the_seed():
    search = find_rings(closed_ground_chain())
    runs = [
        half_chain_estimate(
            search, HalfChainOptions(halves=800, threads=threads), np.random.default_rng(seed)
        )
        for threads, seed in ((1, 4), (2, 4), (1, 5))
    ]
    assert runs[0].log_j == runs[1].log_j
    assert runs[0].windows == runs[1].windows
    assert runs[0].log_j != runs[2].log_j


def test_a_mixture_without_the_soft_mode_is_worse():
    chain = molecule_chain("09T15")
    search = find_rings(chain)
    tilts = ring_tilts(search, 78)
    assert len(tilts) > 4
    assert sum(tilt.share for tilt in tilts) == pytest.approx(1.0)
    assert tilts[0].energy_RT == pytest.approx(search.lowest.energy_RT, abs=1e-9)


def test_heavy_tails_are_reported():
    chain = molecule_chain("12A09")
    result = half_chain(chain, HalfChainOptions(halves=20_000, radius=1.0, tilted=False), 0)
    assert result.status is JStatus.HEAVY_TAILS
    assert any("one half carries" in warning for warning in result.warnings)


def test_no_pair_and_no_ring_are_errors():
    chain = molecule_chain("12A09")
    with pytest.raises(SolveError, match="draw more halves"):
        half_chain(chain, HalfChainOptions(halves=80, batches=4, radius=0.05, tilted=False), 0)
    none = find_rings(chain)
    empty = Equilibria(chain, (), none.links_searched, none.starts, 0, 0.0, none.status)
    with pytest.raises(SolveError, match="no stable ring"):
        half_chain(empty)


def test_fewer_halves_than_tilts_are_refused():
    with pytest.raises(InputError, match="tilts; draw"):
        half_chain(molecule_chain("09T15"), HalfChainOptions(halves=160, batches=16), 0)


@pytest.mark.parametrize(
    "bad",
    [
        {"halves": 10},
        {"batches": 2},
        {"radius": 0.0},
        {"radius": math.nan},
        {"shells": 2},
        {"threads": 0},
        {"windows": (1.5,)},
    ],
)
def test_options_out_of_range_are_refused(bad):
    with pytest.raises(InputError):
        HalfChainOptions(**bad)


def test_free_register_is_covered():
    # Straight molecule whose register is free; the search itself finds no isolated minimum.
    n = 150
    twist = 2.0 * math.pi * 14 / n
    chain = Chain("straight", np.tile([twist, 0.0, 0.0], (n, 1)), uniform_stiffness(n, 1.5))
    tilts = ring_tilts(find_rings(chain), n // 2)
    normals = np.array([np.cross(*chain_plane(tilt.angles)) for tilt in tilts])
    azimuth = np.sort(np.arctan2(normals[:, 1], normals[:, 0]))
    gaps = np.diff(np.append(azimuth, azimuth[0] + 2.0 * math.pi))
    assert len(tilts) > 8
    assert gaps.max() < 1.0
    result = half_chain(chain, HalfChainOptions(halves=8_000), 1)
    assert result.status is JStatus.CONVERGED


def chain_plane(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two vectors in the plane of a ring: to a quarter and to half of the way round."""
    quarter, _ = end_poses(angles[None, : len(angles) // 4])
    half, _ = end_poses(angles[None, : len(angles) // 2])
    return quarter[0], half[0]


@pytest.mark.slow
def test_the_error_holds_the_long_run_value_as_often_as_it_says():
    search = find_rings(molecule_chain("09T15"))
    runs = [half_chain(search, HalfChainOptions(halves=3_000), seed) for seed in range(200)]
    long = half_chain(search, HalfChainOptions(halves=150_000, threads=2), 999)
    held = np.mean([abs(r.minus_lnJ - long.minus_lnJ) <= r.stderr for r in runs])
    assert 0.60 <= held <= 0.76
    # Control: half the error would not.
    short = np.mean([abs(r.minus_lnJ - long.minus_lnJ) <= 0.5 * r.stderr for r in runs])
    assert short < 0.60


@pytest.mark.slow
@pytest.mark.parametrize("name", ["09T15", "08T15", "08A17"])
def test_plain_agrees_with_tilted_on_the_best_cyclizers(name):
    search = find_rings(molecule_chain(name))
    tilted = half_chain(search, HalfChainOptions(halves=40_000), 1)
    plain = half_chain(search, HalfChainOptions(halves=400_000, tilted=False, threads=2), 2)
    assert plain.stderr < 0.25
    assert abs(plain.minus_lnJ - tilted.minus_lnJ) < SIGMAS * math.hypot(
        plain.stderr, tilted.stderr
    )
