"""Closed rings: two kinds of moves that share no argument must give one ensemble."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rods import molecule_chain
from scipy.spatial import cKDTree
from short_chains import closed_ground_chain, end_poses, exact_free_angles

from dnacheck.cyclization.ensembles.kernels import closed_moves as ck
from dnacheck.cyclization.ensembles.kernels.open_moves import crankshaft_sweep
from dnacheck.cyclization.ensembles.metropolis import (
    ClosedRingOptions,
    closed_ring_ensemble,
    mean_structure,
    observable,
)
from dnacheck.cyclization.half_chain.proposals import close_chain, linearised_closure
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.chain import Chain, chain_frames
from dnacheck.numerics.outcome import InputError
from dnacheck.numerics.random_numbers import random_state

SIGMAS = 4.0


def soft_ring() -> Chain:
    """Ten soft steps: closed shapes bend far, so det(G G^T) and cos(theta) vary."""
    return closed_ground_chain(10, 1, 20.0)


def series(chain: Chain, seed: int, *, crankshafts: int, constrained: int):
    """Statistics (T, 6) of a closed chain under one kind of move, and the final angles.

    The last two are the measures that each move must carry: log volume of the steps' axes, and
    log det G G^T.
    """
    stiffness = chain.energy_scale_RT * chain.stiffness
    roots = np.linalg.inv(np.linalg.cholesky(stiffness))
    angles, state = chain.ground.copy(), random_state(np.random.default_rng(seed))
    accepted, counts, rows = np.zeros((3, 2)), np.zeros(4), []
    for _ in range(1_500):
        if crankshafts:
            crankshaft_sweep(
                angles, chain.ground, stiffness, 0, crankshafts, 0.9, True, state, accepted
            )
        if constrained:
            ck.constrained_moves(
                angles, chain.ground, roots, 0, constrained, 0.8, 1.0, True, True, state,
                counts,
            )  # fmt: skip
        x = angles - chain.ground
        energy = 0.5 * np.einsum("si,sij,sj->", x, stiffness, x)
        centres = chain_frames(angles)[0]
        radius = np.mean(np.sum((centres[:-1] - centres[:-1].mean(axis=0)) ** 2, axis=1))
        volume = np.log(np.cos(angles[:, 1])).sum()
        gram = np.linalg.slogdet(linearised_closure(chain, angles).spread)[1]
        rows.append([energy, radius, np.sum(x[:, 0] ** 2), np.sum(x[:, 1] ** 2), volume, gram])
    if constrained:
        assert counts[ck.ACCEPTED] > 0.1 * counts[ck.TRIED]
    return np.array(rows[100:]), angles


def worst_score(a: np.ndarray, b: np.ndarray) -> float:
    """Largest z-score between two series' means, errors from blocks."""
    scores = []
    for x, y in zip(a.T, b.T, strict=True):
        blocks = [s[: 20 * (len(s) // 20)].reshape(20, -1).mean(axis=1) for s in (x, y)]
        error = math.hypot(*(v.std(ddof=1) / math.sqrt(20.0) for v in blocks))
        scores.append(abs(blocks[0].mean() - blocks[1].mean()) / error)
    return max(scores)


def test_crankshafts_and_constrained_moves_give_one_ensemble():
    chain = soft_ring()
    turned, last = series(chain, 1, crankshafts=30, constrained=0)
    projected, closed = series(chain, 2, crankshafts=0, constrained=12)
    assert worst_score(turned, projected) < SIGMAS
    for angles, tolerance in ((last, 1e-9), (closed, 1e-10)):
        centres, frames = chain_frames(angles)
        assert np.abs(centres[-1]).max() < tolerance
        assert np.abs(frames[-1] - np.eye(3)).max() < tolerance


def windowed_rings(chain: Chain, count: int, reach: float, turn: float, seed: int) -> np.ndarray:
    """Chains (T, N, 3) from exact draws of two halves that meet within a small window."""
    rng = np.random.default_rng(seed)
    half = chain.n_steps // 2
    draws = exact_free_angles(chain, count, rng)
    first, frames = end_poses(draws[:, :half])
    draws_b = exact_free_angles(chain, count, rng)
    end, last = end_poses(draws_b[:, half:])
    back = -np.einsum("mij,mi->mj", last, end)
    pairs = cKDTree(first).sparse_distance_matrix(cKDTree(back), reach, output_type="coo_matrix")
    trace = np.einsum("pij,pji->p", frames[pairs.row], last[pairs.col])
    near = np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0)) < turn
    return np.concatenate([draws[pairs.row[near], :half], draws_b[pairs.col[near], half:]], axis=1)


def test_constrained_moves_meet_exact_draws_that_nearly_close():
    """Seven soft steps, where det(G G^T) varies by a factor of two."""
    chain = closed_ground_chain(7, 1, 4.0)
    exact = windowed_rings(chain, 60_000, 0.2, 0.2, 3)
    assert len(exact) > 8_000

    def statistics(shapes: np.ndarray) -> np.ndarray:
        strain = shapes - chain.ground
        energy = (
            0.5
            * chain.energy_scale_RT
            * np.einsum("tsi,sij,tsj->t", strain, chain.stiffness, strain)
        )
        gram = [np.linalg.slogdet(linearised_closure(chain, q).spread)[1] for q in shapes]
        return np.column_stack([energy, gram, np.abs(strain).sum(axis=(1, 2))])

    def sampled(seed: int, use_volume: bool) -> np.ndarray:
        roots = np.linalg.inv(np.linalg.cholesky(chain.energy_scale_RT * chain.stiffness))
        angles, state = chain.ground.copy(), random_state(np.random.default_rng(seed))
        counts, shapes = np.zeros(4), []
        for _ in range(8_000):
            ck.constrained_moves(
                angles, chain.ground, roots, 0, 10, 0.8, 1.0, use_volume, True, state, counts
            )
            shapes.append(angles.copy())
        assert counts[ck.ACCEPTED] > 0.2 * counts[ck.TRIED]
        return statistics(np.array(shapes))

    reference = statistics(np.random.default_rng(0).permutation(exact)[:8_000])
    assert worst_score(reference, sampled(5, True)) < SIGMAS
    assert worst_score(reference, sampled(6, False)) > SIGMAS


def test_a_move_that_leaves_no_way_back_is_rejected():
    chain = closed_ground_chain(8, 1, 6.0)
    stiffness = chain.energy_scale_RT * chain.stiffness
    roots = np.linalg.inv(np.linalg.cholesky(stiffness))
    angles, state = chain.ground.copy(), random_state(np.random.default_rng(1))
    counts = np.zeros(4)
    ck.constrained_moves(angles, chain.ground, roots, 0, 2_000, 1.8, 0.0, True, True, state, counts)
    assert counts[ck.TRIED] == 2_000
    assert counts[ck.NOT_PROJECTED] > 0
    assert counts[ck.NOT_REVERSED] > 0


def test_six_equations_are_solved_with_their_determinant():
    rng = np.random.default_rng(0)
    matrix, rhs, out = rng.standard_normal((6, 6)), rng.standard_normal(6), np.empty(6)
    matrix[0, 0] = 0.0
    log_det = ck.solve_six(matrix.copy(), rhs.copy(), out)
    assert np.allclose(out, np.linalg.solve(matrix, rhs), atol=1e-12)
    assert log_det == pytest.approx(np.linalg.slogdet(matrix)[1], abs=1e-12)


def test_molecule_has_the_energy_that_equipartition_says():
    chain = molecule_chain("09T15")
    ring = find_rings(chain).lowest
    options = ClosedRingOptions(samples=400, copies=4, burn_in=16, thinning=4)
    ensemble = closed_ring_ensemble(chain, ring, options, 1)
    expected = ring.energy_RT + 0.5 * (3 * chain.n_steps - 6)
    # The anharmonic term of ln J, 0.3, is of first order in the temperature: the mean energy has
    # twice as much of it.
    error = ensemble.energy_RT.stderr
    assert error < 0.5
    assert abs(ensemble.energy_RT.mean - expected) < 3.0 * error + 0.6
    spread = math.sqrt(0.5 * (3 * chain.n_steps - 6))
    assert ensemble.energy_RT.deviation == pytest.approx(spread, rel=0.25)
    assert ensemble.links == {ring.link: 1600}
    assert ensemble.writhe.mean + ensemble.twist.mean == pytest.approx(ring.link, abs=1e-9)
    free = np.sqrt(np.linalg.inv(chain.energy_scale_RT * chain.stiffness)[:, range(3), range(3)])
    assert np.mean(ensemble.angle_deviation / free) == pytest.approx(1.0, abs=0.05)
    assert ensemble.fluctuation_A.shape == (chain.n_steps,)
    assert 4.0 < ensemble.fluctuation_A.mean() < 20.0
    # Control: six modes more, those of a chain that closure does not bind.
    assert abs(ensemble.energy_RT.mean - (expected + 3.0)) > 3.0 * error + 0.6


def test_ensemble_does_not_depend_on_threads():
    chain = closed_ground_chain(16, 2, 30.0)
    ring = find_rings(chain).lowest
    runs = [
        closed_ring_ensemble(
            chain, ring, ClosedRingOptions(samples=20, copies=2, burn_in=8, threads=threads), 3
        )
        for threads in (1, 2)
    ]
    assert np.array_equal(runs[0].energies_RT, runs[1].energies_RT)
    assert runs[0].fluctuation_A.tobytes() == runs[1].fluctuation_A.tobytes()


def test_error_of_a_correlated_series_is_that_of_its_theory():
    # First-order autoregression: the variance of the mean is (1 + a)/(1 - a) times naive.
    rng = np.random.default_rng(2)
    noise, a = rng.standard_normal((4, 6_000)), 0.8
    values = np.zeros_like(noise)
    for t in range(1, noise.shape[1]):
        values[:, t] = a * values[:, t - 1] + noise[:, t]
    found = observable(values)
    true = math.sqrt((1 + a) / (1 - a) / (1 - a * a) / values.size)
    assert 0.6 * true < found.stderr < 2.5 * true
    assert found.effective_samples == pytest.approx(values.size * (1 - a) / (1 + a), rel=0.3)


def test_mean_structure_undoes_tumbling():
    rng = np.random.default_rng(4)
    shape = rng.standard_normal((12, 3)) * 10.0
    copies = []
    for _ in range(60):
        q, r = np.linalg.qr(rng.standard_normal((3, 3)))
        q *= np.sign(np.diag(r))
        q[:, 0] *= np.linalg.det(q)
        copies.append(
            (shape + 0.1 * rng.standard_normal(shape.shape)) @ q.T + rng.standard_normal(3)
        )
    _, fluctuation, _ = mean_structure(np.array(copies, dtype=np.float32))
    assert np.all(np.abs(fluctuation - 0.1 * math.sqrt(3.0)) < 0.05)


def test_closing_a_chain_moves_it_least_in_the_norm_of_its_stiffness():
    chain = closed_ground_chain()
    rng = np.random.default_rng(5)
    open_angles = chain.ground + 0.02 * rng.standard_normal(chain.ground.shape)
    closed = close_chain(chain, open_angles)
    assert closed is not None
    centres, frames = chain_frames(closed)
    assert np.abs(centres[-1]).max() < 1e-9
    assert np.abs(frames[-1] - np.eye(3)).max() < 1e-9
    assert close_chain(chain, np.full_like(open_angles, np.nan)) is None


def test_open_start_and_empty_moves_are_refused():
    chain = closed_ground_chain()
    ring = find_rings(chain).lowest
    broken = replace(ring, solution=replace(ring.steps, closure=0.1))
    with pytest.raises(InputError, match="closed ring"):
        closed_ring_ensemble(chain, broken)
    with pytest.raises(InputError, match="no move"):
        ClosedRingOptions(crankshafts=0, constrained=0)
    with pytest.raises(InputError, match="two copies"):
        ClosedRingOptions(copies=1)
