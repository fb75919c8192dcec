"""Optimal superposition against scipy and against a reflection."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dnacheck.numerics.superpose import superpose


def test_rigid_motion_is_undone():
    rng = np.random.default_rng(3)
    points = rng.standard_normal((40, 3))
    moved = Rotation.random(rng=rng).apply(points) + np.array([3.0, -2.0, 9.0])
    back, rms = superpose(moved, points)
    assert back == pytest.approx(points, abs=1e-13)
    assert rms < 1e-13


def test_rms_is_that_of_scipys_alignment():
    rng = np.random.default_rng(4)
    a, b = rng.standard_normal((2, 25, 3))
    _, rssd = Rotation.align_vectors(b - b.mean(0), a - a.mean(0))
    assert superpose(a, b)[1] == pytest.approx(rssd / np.sqrt(25), rel=1e-10)


def test_a_mirror_image_is_not_superposed():
    """Negative control: a reflection is no rigid motion."""
    rng = np.random.default_rng(5)
    points = rng.standard_normal((30, 3))
    assert superpose(points * [1.0, 1.0, -1.0], points)[1] > 0.3
