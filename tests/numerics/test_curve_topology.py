"""Link, twist and writhe of polygons."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import embedded
from dnacheck.numerics.curve_topology import (
    fuller_writhe,
    link_of_ring,
    polygon_writhe,
    total_twist,
)


def gauss_integral(points):
    """Writhe by the midpoint rule of the Gauss double integral on a refined polygon."""
    fine = np.concatenate(
        [
            p + (q - p) * np.linspace(0, 1, 8, endpoint=False)[:, None]
            for p, q in zip(points, np.roll(points, -1, axis=0), strict=True)
        ]
    )
    edge = np.roll(fine, -1, axis=0) - fine
    middle = fine + 0.5 * edge
    total = 0.0
    for i in range(len(fine)):
        gap = middle - middle[i]
        distance = np.linalg.norm(gap, axis=1)
        distance[i] = np.inf
        total += np.sum(np.einsum("ij,ij->i", np.cross(edge[i], edge), gap) / distance**3)
    return -total / (4.0 * np.pi)


def closed_curve(seed, n=60):
    """A smooth closed curve through random low harmonics."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    points = np.stack([np.cos(s), np.sin(s), np.zeros(n)], axis=1)
    for k in (2, 3):
        a, b = 0.3 * rng.standard_normal((2, 3))
        points += np.outer(np.cos(k * s), a) + np.outer(np.sin(k * s), b)
    return points


@pytest.mark.parametrize("seed", range(4))
def test_writhe_is_the_gauss_integral(seed):
    points = closed_curve(seed)
    assert polygon_writhe(points) == pytest.approx(gauss_integral(points), abs=5e-3)
    # A mirror image has the opposite writhe.
    assert polygon_writhe(points * [1.0, 1.0, -1.0]) == pytest.approx(-polygon_writhe(points))


def test_writhe_of_a_plane_curve_without_crossings_is_zero():
    s = np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False)
    radius = 1.0 + 0.4 * np.cos(3 * s)
    plane = np.stack([radius * np.cos(s), radius * np.sin(s), np.zeros(90)], axis=1)
    assert polygon_writhe(plane) == pytest.approx(0.0, abs=1e-12)


def test_writhe_of_a_trefoil():
    """The torus knot T(2,3) has a writhe near its three crossings (3.4 for this one)."""
    t = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    knot = np.stack(
        [np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], axis=1
    )
    assert abs(polygon_writhe(knot)) == pytest.approx(abs(gauss_integral(knot)), abs=1e-2)
    assert 3.0 < abs(polygon_writhe(knot)) < 4.0


@pytest.mark.parametrize("name", ["11T15", "09T09"])
def test_twist_and_writhe_of_rings_add_up_to_an_integer(name):
    chain = build_chain(embedded(name), twist_ratio=4.0)
    for ring in find_rings(chain, SearchOptions(links="all")).equilibria:
        exact = polygon_writhe(ring.centres[:-1])
        assert ring.twist_turns + exact == pytest.approx(ring.link, abs=1e-9)
        assert ring.writhe == pytest.approx(exact, abs=1e-9)
        fuller, weakest = fuller_writhe(ring.centres, ring.frames)
        if weakest > 0.5:
            assert fuller == pytest.approx(exact, abs=0.01)


@pytest.mark.parametrize("turns", [-3, 0, 2, 15])
def test_link_of_a_framed_circle(turns):
    n = 200
    around = 2.0 * np.pi * np.arange(n + 1) / n
    frames = np.empty((n + 1, 3, 3))
    for i, angle in enumerate(around):
        tangent = np.array([np.cos(angle), np.sin(angle), 0.0])
        inward = np.array([-np.sin(angle), np.cos(angle), 0.0])
        base = np.stack([inward, np.cross(tangent, inward), tangent], axis=1)
        frames[i] = base @ Rotation.from_rotvec([0.0, 0.0, turns * angle]).as_matrix()
    centres = np.vstack([np.zeros(3), np.cumsum(frames[:-1, :, 2], axis=0)])
    link, twist, writhe = link_of_ring(centres, frames)
    assert link == turns
    assert twist == pytest.approx(turns, abs=1e-9)
    assert total_twist(frames) == pytest.approx(turns, abs=1e-9)
    assert writhe == pytest.approx(0.0, abs=1e-9)
