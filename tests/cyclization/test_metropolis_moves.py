"""Each Metropolis move leaves its target as it is; the same tests catch a wrong acceptance rule."""

import math

import numpy as np
import pytest
from rods import molecule_chain
from scipy import stats
from short_chains import end_poses, exact_free_angles, soft_chain

from dnacheck.cyclization.ensembles.kernels import open_moves as mk
from dnacheck.cyclization.ensembles.metropolis import MoveOptions, sample_free_chain
from dnacheck.model.chain import Chain, chain_frames
from dnacheck.model.chain_kernels import step_rotation
from dnacheck.numerics.outcome import InputError
from dnacheck.numerics.random_numbers import random_state

LEVEL = 1e-3
SAMPLES = 5_000
MOVES = {"single": (1, 0, 0), "pivot": (0, 1, 0), "crankshaft": (0, 0, 12)}


def moved(
    chain: Chain,
    start: np.ndarray,
    use: tuple[int, int, int],
    sweeps: int,
    *,
    use_volume: bool = True,
    strength: float = 0.0,
    length: float = 1.0,
    reach: float = 0.8,
    seed: int = 5,
) -> np.ndarray:
    """Every chain of ``start`` (M, N, 3) after some sweeps of one kind of move."""
    stiffness = chain.energy_scale_RT * chain.stiffness
    state = random_state(np.random.default_rng(seed))
    accepted, mismatch = np.zeros((3, 2)), np.empty(6)
    kinds = np.array(use, dtype=np.int64)
    out = start.copy()
    for angles in out:
        for _ in range(sweeps):
            if use[2]:
                mk.crankshaft_sweep(
                    angles, chain.ground, stiffness, chain.form_code, use[2], reach, use_volume,
                    state, accepted,
                )  # fmt: skip
            if use[0] or use[1]:
                mk.local_sweep(
                    angles, chain.ground, stiffness, chain.form_code, strength, length,
                    np.full(3, reach), kinds, use_volume, state, accepted, mismatch,
                )  # fmt: skip
    tried = accepted[:, 1] > 0
    assert np.all(accepted[tried, 0] > 0.02 * accepted[tried, 1])
    return out


def smallest_p_value(chain: Chain, angles: np.ndarray) -> float:
    """Smallest p-value, corrected for their number, of whitened angles and the energy.

    Whitened angles are standard normal and independent; twice the energy and the sum of squares
    over the samples are chi-square.
    """
    roots = np.linalg.cholesky(chain.energy_scale_RT * chain.stiffness)
    x = np.einsum("sji,tsj->tsi", roots, angles - chain.ground).reshape(len(angles), -1)
    tests = [stats.kstest(column, "norm").pvalue for column in x.T]
    tests.append(stats.kstest(np.sum(x**2, axis=1), stats.chi2(x.shape[1]).cdf).pvalue)
    squares = stats.chi2(len(x)).cdf(np.sum(x**2, axis=0))
    tests += list(2.0 * np.minimum(squares, 1.0 - squares))
    pairs = x[:, :-1] * x[:, 1:]
    z = pairs.mean(axis=0) / (pairs.std(axis=0) / math.sqrt(len(x)))
    tests += list(2.0 * stats.norm.sf(np.abs(z)))
    return min(1.0, min(tests) * len(tests))


def volume_p_value(chain: Chain, start: np.ndarray, end: np.ndarray) -> float:
    """p-value of equal mean log volumes of the steps' axes before and after."""
    volumes = [
        np.array([sum(math.log(mk.step_volume(a, chain.form_code)) for a in q) for q in angles])
        for angles in (start, end)
    ]
    d = volumes[1] - volumes[0]
    return float(2.0 * stats.norm.sf(abs(d.mean()) / (d.std() / math.sqrt(len(d)))))


# Soft enough that cos(theta), the ratio of rotation measure to angles, varies by a tenth.
SOFT = soft_chain(3, 9.0)
MIDSTEP = Chain(
    "midstep", SOFT.ground, SOFT.stiffness, persistence_length_A=9.0 * 3.4, step_form="midstep"
)


@pytest.mark.parametrize("chain", [SOFT, MIDSTEP], ids=["wedge", "midstep"])
@pytest.mark.parametrize("kind", sorted(MOVES))
def test_exact_samples_stay_exact(chain, kind):
    start = exact_free_angles(chain, SAMPLES, np.random.default_rng(3))
    assert smallest_p_value(chain, start) > LEVEL
    end = moved(chain, start, MOVES[kind], 6)
    assert np.mean(np.abs(end - start)) > 0.02
    assert smallest_p_value(chain, end) > LEVEL
    assert volume_p_value(chain, start, end) > LEVEL


@pytest.mark.parametrize(
    ("chain", "kind"),
    [(SOFT, "pivot"), (MIDSTEP, "pivot"), (SOFT, "crankshaft")],
    ids=["wedge-pivot", "midstep-pivot", "wedge-crankshaft"],
)
def test_forgetting_the_rotation_measure_is_caught(chain, kind):
    start = exact_free_angles(chain, 15_000, np.random.default_rng(3))
    end = moved(chain, start, MOVES[kind], 12, use_volume=False)
    assert volume_p_value(chain, start, end) < LEVEL


@pytest.mark.parametrize("form", [0, 1])
def test_rotation_measure_is_that_of_finite_differences(form):
    rng = np.random.default_rng(4)
    for _ in range(20):
        q = rng.uniform(-0.9, 0.9, 3)
        rotations = [np.empty((3, 3)) for _ in range(7)]
        shifts = np.vstack([np.zeros(3), 1e-6 * np.eye(3), -1e-6 * np.eye(3)])
        for out, shift in zip(rotations, shifts, strict=True):
            step_rotation(*(q + shift), form, out)
        axes = []
        for k in range(3):
            spin = (rotations[1 + k] - rotations[4 + k]) / 2e-6 @ rotations[0].T
            axes.append([spin[2, 1], spin[0, 2], spin[1, 0]])
        volume = abs(np.linalg.det(axes))
        assert mk.step_volume(q, form) == pytest.approx(volume, rel=1e-8)


def test_a_wrong_temperature_is_caught():
    start = exact_free_angles(SOFT, SAMPLES, np.random.default_rng(3))
    hot = Chain("hot", SOFT.ground, SOFT.stiffness, persistence_length_A=8.0 * 3.4)
    assert smallest_p_value(SOFT, moved(hot, start, MOVES["single"], 6)) < LEVEL


def reversal_p_value(before: np.ndarray, after: np.ndarray) -> float:
    """Smallest p-value of E[f(x) g(y) - f(y) g(x)] = 0 for one move from x to y at stationarity."""
    functions = [
        lambda q: q[:, 0, 1],
        lambda q: q[:, -1, 2] ** 2,
        lambda q: np.cos(3.0 * q[:, 0, 1]),
        lambda q: np.sin(2.0 * q[:, 0, 0]) * q[:, -1, 1],
        lambda q: np.exp(0.5 * q[:, 0, 2]),
    ]
    tests = []
    for i, f in enumerate(functions):
        for g in functions[:i]:
            d = f(before) * g(after) - f(after) * g(before)
            z = d.mean() / (d.std() / math.sqrt(len(d)))
            tests.append(2.0 * stats.norm.sf(abs(z)))
    return min(1.0, min(tests) * len(tests))


@pytest.mark.parametrize(("kind", "use", "n"), [("pivot", (0, 1, 0), 1), ("crank", (0, 0, 1), 3)])
def test_single_moves_are_reversible(kind, use, n):
    chain = soft_chain(n, 9.0)
    start = exact_free_angles(chain, 30_000, np.random.default_rng(8))
    end = moved(chain, start, use, 1)
    assert reversal_p_value(start, end) > LEVEL
    # Control: a drift along one angle keeps no balance.
    drifted = end.copy()
    drifted[:, 0, 1] += 0.02
    assert reversal_p_value(start, drifted) < LEVEL


def test_restrained_moves_keep_the_restrained_target():
    chain, length, strength = soft_chain(4, 12.0), 3.0, 1.5
    rng = np.random.default_rng(1)
    free = exact_free_angles(chain, 150_000, rng)

    def squares(angles: np.ndarray) -> np.ndarray:
        end, frame = end_poses(angles)
        turn = np.arccos(np.clip(0.5 * (np.trace(frame, axis1=1, axis2=2) - 1.0), -1.0, 1.0))
        return np.sum(end**2, axis=1) / length**2 + turn**2

    keep = rng.random(len(free)) < np.exp(-0.5 * strength * (squares(free) - squares(free).min()))
    exact = free[keep]
    assert len(exact) > 3_000
    half = len(exact) // 2
    end = moved(chain, exact[:half], (1, 1, 10), 3, strength=strength, length=length, reach=0.5)

    def p_value(a: np.ndarray, b: np.ndarray) -> float:
        columns = [stats.ks_2samp(x, y).pvalue for x, y in zip(a.T, b.T, strict=True)]
        return min(1.0, min(columns) * len(columns))

    def summary(angles: np.ndarray) -> np.ndarray:
        return np.column_stack([angles.reshape(len(angles), -1), squares(angles)])

    assert p_value(summary(end), summary(exact[half:])) > LEVEL
    # Control: another strength than the samples'.
    wrong = moved(chain, exact[:half], (1, 1, 10), 3, strength=0.5, length=length, reach=0.5)
    assert p_value(summary(wrong), summary(exact[half:])) < LEVEL


def test_the_sweep_returns_the_mismatch_of_its_chain():
    chain = soft_chain(12, 9.0)
    stiffness = chain.energy_scale_RT * chain.stiffness
    angles = chain.ground.copy()
    mismatch, accepted = np.empty(6), np.zeros((3, 2))
    state = random_state(np.random.default_rng(1))
    square = mk.local_sweep(
        angles, chain.ground, stiffness, 0, 2.0, 3.0, np.full(3, 0.3), np.array([1, 1, 0]), True,
        state, accepted, mismatch,
    )  # fmt: skip
    centres, _ = chain_frames(angles)
    assert np.allclose(mismatch[:3], centres[-1], atol=1e-12)
    expected = np.sum(mismatch[:3] ** 2) / 9.0 + np.sum(mismatch[3:] ** 2)
    assert square == pytest.approx(expected, rel=1e-12)


def test_crankshafts_leave_the_end_where_it_is():
    chain = molecule_chain("09T15")
    angles = chain.ground.copy()
    before = chain_frames(angles)
    accepted = np.zeros((3, 2))
    state = random_state(np.random.default_rng(2))
    mk.crankshaft_sweep(
        angles, chain.ground, chain.energy_scale_RT * chain.stiffness, 0, 2_000, 0.2, True, state,
        accepted,
    )  # fmt: skip
    after = chain_frames(angles)
    assert accepted[mk.CRANKSHAFT, 0] > 200
    assert np.abs(before[0][70] - after[0][70]).max() > 0.1
    assert np.allclose(before[0][-1], after[0][-1], atol=1e-9)
    assert np.allclose(before[1][-1], after[1][-1], atol=1e-11)


def angle_scores(chain: Chain, shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """z-scores of mean and variance of every angle against the free chain's, from block means."""
    variance = np.linalg.inv(chain.energy_scale_RT * chain.stiffness)[:, range(3), range(3)]
    blocks = shapes.reshape(20, -1, *chain.ground.shape)
    strain = blocks - chain.ground

    def score(block_means: np.ndarray, expected: np.ndarray) -> np.ndarray:
        error = block_means.std(axis=0, ddof=1) / math.sqrt(len(block_means))
        return (block_means.mean(axis=0) - expected) / error

    return score(strain.mean(axis=1), 0.0 * variance), score((strain**2).mean(axis=1), variance)


def check_all_angles(chain: Chain, shapes: np.ndarray) -> bool:
    """Whether no angle's mean or variance is off, for Student's t with 19 degrees of freedom."""
    scores = np.concatenate([s.ravel() for s in angle_scores(chain, shapes)])
    worst = stats.t.isf(0.5 * LEVEL / scores.size, 19)
    spread = stats.chi2.isf([1.0 - LEVEL, LEVEL], scores.size) / scores.size * 19.0 / 17.0
    mean_square = np.mean(scores**2)
    return bool(np.abs(scores).max() < worst and 0.9 * spread[0] < mean_square < 1.1 * spread[1])


def test_free_chain_mean_and_variance_of_every_angle():
    chain = soft_chain(20, 60.0)
    shapes = sample_free_chain(chain, 2_000, 6, np.random.default_rng(3), MoveOptions(reach=0.4))
    assert check_all_angles(chain, shapes)
    # Control: a spread six per cent too large.
    assert not check_all_angles(chain, chain.ground + 1.06 * (shapes - chain.ground))


@pytest.mark.slow
def test_free_chain_mean_and_variance_of_every_angle_of_a_molecule():
    chain = molecule_chain("09T15")
    shapes = sample_free_chain(chain, 4_000, 8, np.random.default_rng(4), MoveOptions(reach=0.25))
    assert check_all_angles(chain, shapes)


def test_moves_out_of_range_are_refused():
    with pytest.raises(InputError, match="no move"):
        MoveOptions(singles=False, pivots=False, crankshafts=0)
    with pytest.raises(InputError, match="reach"):
        MoveOptions(reach=math.nan)
    with pytest.raises(InputError, match="negative"):
        MoveOptions(crankshafts=-1)
