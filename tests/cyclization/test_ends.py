"""J factors of nicked and hinged rings and of loops, against theory and other integrals."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dnacheck.cyclization.laplace.isolated import laplace_log_j
from dnacheck.cyclization.methods import ClosureSampling, HalfChain, Laplace
from dnacheck.equilibria.boundary import HingedRing, Loop, NickedRing, Pull, Ring
from dnacheck.equilibria.discrete.boundary_search import find_equilibria
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.molecules import embedded
from dnacheck.numerics.outcome import InputError

MOLAR = 1e27 / 6.02214076e23
PERSISTENCE_A, RISE_A = 463.0, 3.4


def straight(n, ratio=1.5):
    ground = np.tile([2.0 * np.pi / 10.45, 0.0, 0.0], (n, 1))
    return Chain("straight", ground, np.tile(np.diag([ratio, 1.0, 1.0]), (n, 1, 1)))


def sampled(chain, boundary, tolerance, seed=1):
    search = find_equilibria(chain, boundary)
    return ClosureSampling().compute(search, tolerance=tolerance, rng=seed)


def aligned_and_twist_averaged(n):
    """-ln J of Shimada & Yamakawa (1984) for tangents aligned, averaged over the twist."""
    length, b = n * RISE_A, 2.0 * PERSISTENCE_A
    factor = 4.0 * math.pi**3 * b**3 / length**6
    return -math.log(factor * math.exp(-(math.pi**2) * b / length + 0.514 * length / b) * MOLAR)


def free_ends(n):
    """-ln J of Shimada & Yamakawa (1984) for ends that meet at any angle."""
    length = n * RISE_A
    k = PERSISTENCE_A / length
    return -math.log(112.04 * k**2 * math.exp(0.246 / k - 14.054 * k) / length**3 * MOLAR)


@pytest.mark.parametrize("n", [100, 150, 200])
def test_straight_nicked_ring_is_shimadas_and_yamakawas_aligned_form(n):
    result = sampled(straight(n), NickedRing(), 0.01)
    assert result.minus_lnJ == pytest.approx(aligned_and_twist_averaged(n), abs=0.05)
    # Negative control: the ring with its phase fixed is another quantity at every length.
    ring = Laplace(register=True).compute(find_rings(straight(n)))
    assert abs(ring.minus_lnJ - aligned_and_twist_averaged(n)) > 0.15


@pytest.mark.parametrize("n", [100, 150, 200])
def test_straight_hinged_ring_is_shimadas_and_yamakawas_free_form(n):
    result = sampled(straight(n), HingedRing(), 0.01)
    assert result.minus_lnJ == pytest.approx(free_ends(n), abs=0.1)
    assert abs(result.minus_lnJ - aligned_and_twist_averaged(n)) > 0.15


def over_the_turn(poses):
    """ln of the mean of J over poses of the end all around, and its relative error."""
    results = [
        ClosureSampling().compute(pose, tolerance=0.02, rng=k) for k, pose in enumerate(poses)
    ]
    errors = [result.molar * result.stderr for result in results]
    total = sum(result.molar for result in results)
    return math.log(total / len(results)), float(np.linalg.norm(errors)) / total


@pytest.mark.parametrize("form", ["wedge", "midstep"])
def test_nicked_j_is_the_integral_over_the_turn_of_the_end(form):
    """Of rings, whose first twist of the wedge form is about the start's own axis; or of loops."""
    chain = build_chain(embedded("08T15"), step_form=form)
    around = 2.0 * math.pi * (np.arange(12) + 0.5) / 12
    poses = []
    for angle in around:
        if form == "wedge":
            ground = chain.ground.copy()
            ground[0, 0] = angle - math.pi
            poses.append(replace(chain, ground=ground))
        else:
            turn = Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix()
            poses.append(find_equilibria(chain, Loop(rotation=turn)))
    log_mean, error = over_the_turn(poses)
    nicked = sampled(chain, NickedRing(), 0.006)
    assert math.hypot(nicked.stderr, error) < 0.012
    assert abs(nicked.minus_lnJ + log_mean) < 3.0 * math.hypot(nicked.stderr, error)
    # Negative control: the pose of largest J, about that of the ring, is not the mean.
    best = max(ClosureSampling().compute(p, tolerance=0.1, rng=0).molar for p in poses)
    assert math.log(best) - log_mean > 0.5


def soft_chain(form):
    """24 steps that bend round by 220 degrees and have a persistence length of 18 of them."""
    n = 24
    ground = np.tile([0.6, 0.0, 0.0], (n, 1))
    ground[:, 1] = 0.16 * np.cos(0.6 * np.arange(n))
    ground[:, 2] = 0.16 * np.sin(0.6 * np.arange(n))
    stiffness = np.tile(np.diag([1.5, 1.0, 1.0]), (n, 1, 1))
    return Chain("soft", ground, stiffness, persistence_length_A=60.0, step_form=form)


@cache
def open_ends(form, draws=40_000):
    """End poses of independent open chains, steps multiplied as the paper defines them."""
    chain = soft_chain(form)
    rng = np.random.default_rng(5)
    scale = 1.0 / np.sqrt(chain.energy_scale_RT * np.array([1.5, 1.0, 1.0]))
    frames, ends = np.tile(np.eye(3), (draws, 1, 1)), np.zeros((draws, 3))
    for step in chain.ground:
        angles = step + scale * rng.standard_normal((draws, 3))
        ends += frames[:, :, 2]
        frames = frames @ rotations(angles, chain.step_form)
    return ends, frames


def rotations(angles, form):
    """R_tau R_theta R_phi of (2.1), or its mid-step form; R_theta turns by minus theta."""

    def about(axis, angle):
        vectors = np.zeros((len(angle), 3))
        vectors[:, axis] = angle
        return Rotation.from_rotvec(vectors)

    tau, theta, phi = angles.T
    if form == "wedge":
        return (about(2, tau) * about(0, -theta) * about(1, phi)).as_matrix()
    twist, lean = about(2, 0.5 * tau), about(0, -0.5 * theta)
    return (twist * lean * about(1, phi) * lean * twist).as_matrix()


@pytest.mark.parametrize("form", ["wedge", "midstep"])
def test_hinged_j_is_the_density_of_open_ends(form):
    chain, radius = soft_chain(form), 2.0
    ends, _ = open_ends(form)
    inside = float(np.sum(np.linalg.norm(ends, axis=1) < radius))
    volume = 4.0 / 3.0 * math.pi * (radius * RISE_A) ** 3
    counted = -math.log(inside / len(ends) / volume * MOLAR)
    result = sampled(chain, HingedRing(), 0.01)
    # 0.03: the density's second derivative over the ball, a twentieth of (radius / 4 steps)^2.
    error = math.hypot(1.0 / math.sqrt(inside), result.stderr)
    assert abs(result.minus_lnJ - counted) < 3.0 * error + 0.03


@pytest.mark.parametrize("form", ["wedge", "midstep"])
def test_j_of_loops_is_the_density_of_open_poses(form):
    """Counted in a window about a pose, against the mean of J over poses in that window."""
    chain, radius, widest = soft_chain(form), 3.0, 0.6
    ends, frames = open_ends(form)
    place, turned = ends[7], frames[7]
    away = np.linalg.norm(ends - place, axis=1) < radius
    angles = Rotation.from_matrix(turned.T @ frames[away]).magnitude()
    inside = float(np.sum(angles < widest))
    # Share of all rotations by less than an angle: (angle - sin angle) / pi.
    share = (widest - math.sin(widest)) / math.pi
    volume = 4.0 / 3.0 * math.pi * (radius * RISE_A) ** 3 * share
    counted = inside / len(ends) / volume * MOLAR
    rng = np.random.default_rng(8)
    values = []
    while len(values) < 40:
        offset, axis = rng.uniform(-radius, radius, 3), rng.standard_normal(3)
        angle = rng.uniform(0.0, widest)
        # Uniform in the ball and among the rotations, whose angles have the density 1 - cos.
        rare = rng.random() * (1.0 - math.cos(widest)) > 1.0 - math.cos(angle)
        if np.linalg.norm(offset) > radius or rare:
            continue
        turn = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
        loop = find_equilibria(chain, Loop(RISE_A * (place + offset), turned @ turn))
        values.append(ClosureSampling().compute(loop, tolerance=0.1, rng=1).molar)
    mean = float(np.mean(values))
    error = float(np.std(values)) / mean / math.sqrt(len(values))
    assert abs(math.log(mean / counted)) < 3.0 * math.hypot(error, 1.0 / math.sqrt(inside))


def test_a_loop_onto_the_start_has_the_rings_j():
    chain = build_chain(embedded("08T15"))
    ring = sampled(chain, Ring(), 0.01)
    loop = sampled(chain, Loop(), 0.01, seed=2)
    assert abs(loop.minus_lnJ - ring.minus_lnJ) < 3.0 * math.hypot(ring.stderr, loop.stderr)
    assert loop.links == ()
    assert laplace_log_j(find_equilibria(chain, Loop()).lowest) == pytest.approx(
        laplace_log_j(find_rings(chain).lowest), abs=1e-8
    )


@pytest.mark.parametrize("boundary", [NickedRing(), HingedRing()])
def test_laplace_and_the_register_agree_where_the_register_is_stiff(boundary):
    search = find_equilibria(build_chain(embedded("11T15")), boundary)
    plain, register = Laplace().compute(search), Laplace(register=True).compute(search)
    assert plain.minus_lnJ == pytest.approx(register.minus_lnJ, abs=0.04)
    assert plain.links == register.links == ()


def test_what_has_no_j_is_refused_in_one_line():
    chain = build_chain(embedded("11T15"))
    with pytest.raises(InputError, match="no J factor"):
        Laplace().compute(find_equilibria(chain, Pull(1.0)))
    with pytest.raises(InputError, match="use closure"):
        HalfChain().compute(find_equilibria(chain, NickedRing()))
