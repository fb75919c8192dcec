"""The double filter against SciPy's FILTFILT and against its own definition."""

import numpy as np
import pytest
from scipy.signal import filtfilt

from dnacheck.model.rod.filtering import double_filter, padded_steps, smooth


@pytest.mark.parametrize("width", [1, 2, 5, 15, 25])
def test_smooth_equals_filtfilt(width):
    points = np.random.default_rng(1).normal(size=(120, 3)).cumsum(axis=0)
    if width == 1:
        assert np.array_equal(smooth(points, 1), points)
        return
    box = np.ones(width) / width
    expected = filtfilt(box, [1.0], points, axis=0, padtype="odd", padlen=3 * (width - 1))
    assert np.allclose(smooth(points, width), expected, rtol=0, atol=1e-12)
    # the extension must be the odd reflection: another one is told apart
    wrong = filtfilt(box, [1.0], points, axis=0, padtype="even", padlen=3 * (width - 1))
    assert np.max(np.abs(smooth(points, width) - wrong)) > 1e-3


def test_weights_are_the_papers_triangle():
    impulse = np.zeros((61, 3))
    impulse[30] = 1.0
    w = 4
    expected = np.array([1, 2, 3, 4, 3, 2, 1]) / w**2
    assert np.allclose(smooth(impulse, w)[27:34, 0], expected, atol=1e-15)


def test_double_filter_straightens_less():
    t = np.linspace(0.0, 2.0 * np.pi, 200)
    arc = np.stack([40.0 * np.cos(t), 40.0 * np.sin(t), 0.1 * t], axis=1)
    inner = slice(60, 140)
    once = np.max(np.linalg.norm(smooth(arc, 15) - arc, axis=1)[inner])
    twice = np.max(np.linalg.norm(double_filter(arc, 15) - arc, axis=1)[inner])
    assert twice < 0.05 * once


def test_filter_leaves_straight_lines_alone():
    line = np.arange(80.0)[:, None] * np.array([0.3, -0.2, 1.0])
    assert np.allclose(double_filter(line, 15), line, atol=1e-12)


def test_padding_is_cyclic_and_may_wrap_more_than_once():
    steps = padded_steps(7, 10)
    assert steps.size == 7 + 1 + 20
    assert list(steps[10:17]) == list(range(7))
    assert steps[17] == 0
    assert steps[0] == (-10) % 7
