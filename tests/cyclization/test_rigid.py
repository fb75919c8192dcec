"""J factors of rigid base-pair steps: brute force, the limit of hinges, and one another."""

import math

import numpy as np
import pytest
from dense_closure import brute_force_log_j
from scipy.spatial.transform import Rotation

from dnacheck.cyclization.closure.sampling import ClosureOptions, ClosureSampler, sample_closure
from dnacheck.cyclization.half_chain.kernels.pairs import half_poses
from dnacheck.cyclization.laplace.isolated import laplace
from dnacheck.cyclization.laplace.register import register_profile
from dnacheck.cyclization.methods import METHODS
from dnacheck.equilibria.discrete.kernels.search import fill_start
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.molecules import embedded
from dnacheck.model.sequence import Sequence


def olson(seed, n):
    letters = "".join(np.random.default_rng(seed).choice(list("ACGT"), n))
    return build_chain(Sequence("random", letters), "olson1998")


def soft_ring(n=12, link=2, stiffness_RT=15.0, seed=2):
    """A chain that rests nearly closed, with a full random stiffness on every step."""
    rng = np.random.default_rng(seed)
    straight = np.zeros((n, 6))
    straight[:, 0], straight[:, 5] = 2.0 * np.pi * link / n, 1.0
    chain = Chain("straight", straight, np.tile(np.eye(6), (n, 1, 1)), step_form="rigid",
                  rise_A=3.4, persistence_length_A=3.4)  # fmt: skip
    ground = np.empty((n, 6))
    fill_start(chain.arrays, link, 0.3, ground)
    root = np.eye(6) + 0.2 * rng.standard_normal((n, 6, 6))
    return Chain("soft", ground + rng.normal(0.0, 0.1, (n, 6)),
                 stiffness_RT * root @ root.transpose(0, 2, 1), step_form="rigid",
                 rise_A=3.4, persistence_length_A=3.4)  # fmt: skip


def turn(axis, angle):
    """Rotations (M, 3, 3) about a coordinate axis."""
    out = np.zeros((len(angle), 3, 3))
    j, k = (axis + 1) % 3, (axis + 2) % 3
    out[:, axis, axis] = 1.0
    out[:, j, j] = out[:, k, k] = np.cos(angle)
    out[:, k, j], out[:, j, k] = np.sin(angle), -np.sin(angle)
    return out


def end_poses(steps):
    """Ends (M, 3) and end frames of chains (M, N, 6), in the textbook form with the bend's axis."""
    end, frame = np.zeros((len(steps), 3)), np.tile(np.eye(3), (len(steps), 1, 1))
    for s in range(steps.shape[1]):
        twist, tilt, roll = steps[:, s, :3].T
        bend, phase = np.hypot(tilt, roll), np.arctan2(tilt, roll)
        first = turn(2, 0.5 * twist - phase)
        middle = first @ turn(1, 0.5 * bend) @ turn(2, phase)
        end = end + np.einsum("mij,mjk,mk->mi", frame, middle, steps[:, s, 3:])
        frame = frame @ first @ turn(1, bend) @ turn(2, 0.5 * twist + phase)
    return end, frame


def free_steps(chain, samples, rng):
    roots = np.linalg.cholesky(np.linalg.inv(chain.stiffness))
    normals = rng.standard_normal((samples, *chain.ground.shape))
    return chain.ground + np.einsum("sij,tsj->tsi", roots, normals)


def brute_force(chain, halves=12_000, batches=6):
    """-ln J at vanishing window and its standard error, by counting pairs of free half chains."""
    windows = [(0.6, 0.6), (0.45, 0.45), (0.3, 0.3)]
    squares = np.square([w[0] for w in windows])
    values = []
    n = chain.n_steps
    for batch in range(batches):
        rng = np.random.default_rng(batch)
        first = end_poses(free_steps(chain, halves, rng)[:, : n // 2])
        second = end_poses(free_steps(chain, halves, rng)[:, n // 2 :])
        counts = -brute_force_log_j(chain, first, second, windows)
        values.append(np.polyfit(squares, counts, 1)[-1])
    return float(np.mean(values)), float(np.std(values, ddof=1) / math.sqrt(batches))


def test_meets_brute_force_on_a_soft_short_chain():
    chain = soft_ring()
    expected, error = brute_force(chain)
    result = sample_closure(chain, ClosureOptions(tolerance=0.008), seed=1)
    assert abs(result.minus_lnJ - expected) < 3.5 * math.hypot(error, result.stderr)
    assert error < 0.05
    # Laplace's value lies outside these errors, so the agreement says something.
    assert abs(laplace(chain).minus_lnJ - expected) > 5.0 * error


def hinge_limit(chain, factor=1e8):
    """Rigid steps with the bends and twists of a mid-step chain, translations so much stiffer."""
    n = chain.n_steps
    ground = np.zeros((n, 6))
    # R_theta turns by -theta about d1, R_phi by phi about d2.
    ground[:, :3] = chain.ground * [1.0, -1.0, 1.0]
    ground[:, 5] = 1.0
    stiffness = np.zeros((n, 6, 6))
    stiffness[:, :3, :3] = chain.energy_scale_RT * chain.stiffness
    stiffness[:, [3, 4, 5], [3, 4, 5]] = factor * chain.energy_scale_RT
    return Chain("limit", ground, stiffness, step_form="rigid", rise_A=chain.rise_A,
                 persistence_length_A=chain.rise_A)  # fmt: skip


@pytest.mark.parametrize("name", ["09T09", "11A17", "08T15"])
def test_ln_j_of_the_limit_is_that_of_the_midstep_chain(name):
    """The two chains differ in second order of a step's bend (product of the bends, edge)."""
    chain = build_chain(embedded(name), step_form="midstep")
    hinges, rigid = find_rings(chain), find_rings(hinge_limit(chain))
    assert rigid.lowest.residual < 1e-10
    assert rigid.lowest.energy_RT == pytest.approx(hinges.lowest.energy_RT, rel=5e-5)
    assert laplace(rigid).minus_lnJ == pytest.approx(laplace(hinges).minus_lnJ, abs=0.02)


def test_the_limit_and_the_midstep_chain_differ_in_second_order_of_a_bend():
    """Relative difference of the energies of straight molecules: as 1/N^2, the bend squared."""
    scaled = []
    for n in (80, 320):
        ground = np.zeros((n, 3))
        ground[:, 0] = np.tile(np.random.default_rng(4).uniform(0.55, 0.65, 20), n // 20)
        chain = Chain("straight", ground, np.tile(np.diag([1.5, 1.0, 1.0]), (n, 1, 1)),
                      step_form="midstep")  # fmt: skip
        hinges = find_rings(chain).equilibria[0].energy_RT
        rigid = find_rings(hinge_limit(chain)).equilibria[0].energy_RT
        scaled.append((rigid / hinges - 1.0) * n**2)
    assert scaled[0] == pytest.approx(scaled[1], rel=0.05)
    assert abs(scaled[0]) < 1.0


def test_other_signs_of_the_bends_are_another_molecule():
    """Negative control of the limit: theta taken for tilt with its sign."""
    chain = build_chain(embedded("09T09"), step_form="midstep")
    rigid = hinge_limit(chain)
    wrong = rigid.ground * [1.0, -1.0, 1.0, 1.0, 1.0, 1.0]
    other = Chain("wrong", wrong, rigid.stiffness, step_form="rigid", rise_A=3.4,
                  persistence_length_A=3.4)  # fmt: skip
    energy = find_rings(rigid).lowest.energy_RT
    assert abs(find_rings(other).lowest.energy_RT - energy) > 0.01


@pytest.mark.parametrize("seed", range(3))
def test_methods_agree_and_both_strands_have_one_j(seed):
    chain = olson(seed, 130 + 20 * seed)
    profile = register_profile(chain)
    closure = METHODS["closure"]().compute(profile, rng=1)
    corrected = METHODS["corrected-laplace"]().compute(profile, rng=2)
    error = math.hypot(closure.stderr, corrected.total_error)
    assert abs(closure.minus_lnJ - corrected.minus_lnJ) < 3.0 * error
    assert closure.stderr < 0.02
    assert closure.effective_samples > 0.3 * closure.samples
    letters = Sequence("random", chain.letters).reverse_complement().letters
    other = build_chain(Sequence("other", letters), "olson1998")
    assert laplace(other).minus_lnJ == pytest.approx(laplace(chain).minus_lnJ, abs=1e-6)


def test_draws_are_closed():
    sampler = ClosureSampler(register_profile(olson(5, 120)), ClosureOptions(), 3)
    record = sampler.draw().record
    assert np.mean(record.codes == 0) > 0.9


def test_poses_of_halves_are_those_of_the_textbook():
    chain = soft_ring(9)
    steps = free_steps(chain, 40, np.random.default_rng(0))
    end, frame = end_poses(steps)
    poses = {}
    for backward in (False, True):
        poses[backward] = np.empty((40, 7))
        roots = np.tile(np.eye(6), (9, 1, 1))
        half_poses(chain.arrays, steps - chain.ground, roots, np.array(chain.ground), backward,
                   poses[backward])  # fmt: skip
    assert poses[False][:, :3] == pytest.approx(end, abs=1e-12)
    turned = Rotation.from_quat(poses[False][:, 3:]).as_matrix()
    assert turned == pytest.approx(frame, abs=1e-12)
    back = np.einsum("mji,mj->mi", frame, end)
    assert poses[True][:, :3] == pytest.approx(-back, abs=1e-12)
    inverse = Rotation.from_quat(poses[True][:, 3:]).as_matrix()
    assert inverse @ frame == pytest.approx(np.tile(np.eye(3), (40, 1, 1)), abs=1e-12)
