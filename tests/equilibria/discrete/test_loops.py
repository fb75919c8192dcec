"""Loops between two sites against the elastica and against one another; their poses and sites."""

import math

import numpy as np
import pytest
from scipy.special import ellipeinc, ellipkinc

from dnacheck import cli
from dnacheck.cyclization.methods import ClosureSampling, HalfChain, Laplace
from dnacheck.equilibria.boundary import Loop
from dnacheck.equilibria.discrete.boundary_search import find_equilibria
from dnacheck.equilibria.discrete.solve import solve_ring
from dnacheck.equilibria.ring import Equilibria
from dnacheck.io.poses import read_pose
from dnacheck.model.chain import Chain, build_chain, chain_frames
from dnacheck.model.guests import GuestSteps, bind
from dnacheck.model.molecules import embedded
from dnacheck.model.segments import between
from dnacheck.numerics.outcome import InputError

BACK = ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))
"""Half a turn about d2."""


def straight(n):
    stiffness = np.tile(np.diag([1.5, 1.0, 1.0]), (n, 1, 1))
    return Chain("rod", np.zeros((n, 3)), stiffness)


def elastica(m):
    """Energy times length, and distance over length, of a planar rod that ends beside its start.

    Its tangent turns by half a turn in the plane, under a force along the line of the two ends:
    theta'^2 = a + b sin(theta), m = 2 b / (a + b), half the angle from the middle being the
    amplitude.
    """
    first, second = ellipkinc(math.pi / 4.0, m), ellipeinc(math.pi / 4.0, m)
    root = 4.0 * first
    energy = 2.0 * root * second
    if m == 0.0:
        return energy, 2.0 / math.pi
    a, b = root**2 * (1.0 - 0.5 * m), 0.5 * m * root**2
    return energy, (4.0 * root * second - a) / b


@pytest.mark.parametrize("m", [0.0, 0.3, -0.4])
def test_a_straight_rod_led_half_a_turn_round_is_the_elastica(m):
    energy, distance = elastica(m)
    sizes = np.array([50, 100, 200])
    values = []
    for n in sizes:
        target = Loop((distance * n * 3.4, 0.0, 0.0), BACK)
        loop = find_equilibria(straight(int(n)), target).lowest
        assert loop.stable
        values.append(n * loop.energy)
    # Hinges differ from a rod in even powers of 1/N.
    extrapolated = np.polynomial.polynomial.polyfit(1.0 / sizes**2, values, 2)[0]
    assert extrapolated == pytest.approx(energy, rel=1e-6)
    # Negative control: not yet at the largest N.
    assert abs(values[-1] / energy - 1.0) > 1e-5


def test_j_of_a_loop_by_three_methods():
    """Laplace with its next order, exact closure of the loop, and half chains of a ring.

    The ring's other steps are held by a guest, which takes its end to the pose of the loop.
    """
    whole = build_chain(embedded("11T15"))
    loose = 128
    # The guest keeps the shape that its steps have unstressed.
    own = np.full((whole.n_steps - loose, 6), np.nan)
    ring = bind(whole, loose, GuestSteps("own", tuple(range(len(own))), own))
    centres, frames = chain_frames(ring.ground[loose:], ring.step_form)
    pose = Loop(-whole.rise_A * frames[-1].T @ centres[-1], frames[-1].T)
    search = find_equilibria(between(whole, 0, loose), pose)
    closed = solve_ring(ring, np.concatenate([search.lowest.angles, ring.ground[loose:]]))
    assert closed.energy == pytest.approx(search.lowest.energy, rel=1e-9)
    rings = Equilibria(ring, (closed,), (closed.link,), 1, 0, 0.0, closed.status)
    counted = HalfChain(halves=40_000).compute(rings, tolerance=0.03, rng=3)
    assert 0.0 < counted.stderr < 0.1
    corrected = Laplace(register=True, order=1).compute(search, rng=1)
    sampled = ClosureSampling().compute(search, tolerance=0.01, rng=2)
    for other in (corrected, counted):
        error = math.hypot(other.stderr, sampled.stderr)
        assert abs(other.minus_lnJ - sampled.minus_lnJ) < 3.0 * error
    # Negative control: Laplace alone is off by more than the errors of all three.
    assert abs(Laplace().compute(search).minus_lnJ - sampled.minus_lnJ) > 3.0 * sampled.stderr


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("position_A = [1.0, 2.0]", "3 finite numbers"),
        ("position_A = [1.0, 2.0, nan]", "finite"),
        ("rotation = [[1,0,0],[0,1,0],[0,0,1]]", "position_A is missing"),
        ("position_A = [1.0, 2.0, 3.0]\nrotaton = 1", "unknown 'rotaton'"),
        ("position_A = [1.0, 2.0", "no TOML"),
        ("position_A = [0, 0, 9]\nrotation = [[1,0,0],[0,1,0],[0,0,-1]]", "no rotation"),
        ("position_A = [0, 0, 9000]", "reach"),
    ],
)
def test_a_bad_pose_is_one_line_and_exit_code_2(tmp_path, capsys, text, words):
    path = tmp_path / "pose.toml"
    path.write_text(text)
    code = cli.main(["loop", "11T15", "--sites", "20,112", "--pose", str(path)])
    captured = capsys.readouterr()
    assert code == 2
    assert captured.out == ""
    assert words in captured.err
    assert len(captured.err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("sites", "words"),
    [("20,400", "site 400"), ("-3,50", "site -3"), ("50,52", "beyond"), ("20", "two base pairs")],
)
def test_a_bad_site_is_one_line_and_exit_code_2(tmp_path, capsys, sites, words):
    path = tmp_path / "pose.toml"
    path.write_text("position_A = [0, 0, 9]")
    code = cli.main(["loop", "11T15", f"--sites={sites}", "--pose", str(path)])
    captured = capsys.readouterr()
    assert code == 2
    assert words in captured.err


def test_a_rotation_vector_is_a_rotation(tmp_path):
    path = tmp_path / "pose.toml"
    path.write_text("position_A = [1, 2, 3]\nrotation_vector_deg = [0, 180, 0]")
    position, rotation = read_pose(path)
    assert position == pytest.approx([1.0, 2.0, 3.0])
    assert rotation == pytest.approx(np.array(BACK), abs=1e-15)
    with pytest.raises(InputError, match="No such file"):
        read_pose(tmp_path / "none.toml")
