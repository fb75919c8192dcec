"""Rotation algebra against scipy and against itself, near the places where naive code breaks."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dnacheck.numerics import rotations as rot

finite = st.floats(-1.0, 1.0)
directions = st.tuples(finite, finite, finite).filter(lambda v: np.linalg.norm(v) > 1e-3)
lengths = st.one_of(
    st.floats(0.0, np.pi),
    st.sampled_from([0.0, 1e-300, 1e-12, 1e-5, 1e-4, np.pi - 1e-4, np.pi - 1e-9, np.pi - 1e-14]),
)
angle = st.floats(-np.pi, np.pi)
bend = st.one_of(st.floats(-1.5, 1.5), st.sampled_from([-1.5707, 1.5707]))


def vector(direction, length):
    return np.array(direction) / np.linalg.norm(direction) * length


def exp(v):
    out = np.empty((3, 3))
    rot.rotation_exp(v, out)
    return out


def log(matrix):
    out = np.empty(3)
    rot.rotation_log(matrix, out)
    return out


def wedge(tau, theta, phi):
    out = np.empty((3, 3))
    rot.wedge_rotation(tau, theta, phi, out)
    return out


def arccos_log(matrix):
    """The textbook logarithm by arccos of the trace."""
    with np.errstate(all="ignore"):
        size = np.arccos((np.trace(matrix) - 1.0) / 2.0)
        axis = np.array(
            [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
        )
        return size / (2.0 * np.sin(size)) * axis


@given(directions, lengths)
@example((0.0, 0.0, 1.0), np.pi - 1e-9)
def test_log_undoes_exp(direction, length):
    v = vector(direction, length)
    # Near a half turn the sign of the axis is decided by entries of the size pi - length.
    assert log(exp(v)) == pytest.approx(v, abs=1e-14 + 1e-15 / max(np.pi - length, 1e-16))


def test_textbook_log_fails_where_ours_does_not():
    """Negative control: the comparison above does catch a poor logarithm."""
    v = vector((1.0, 2.0, 3.0), np.pi - 1e-7)
    assert np.abs(log(exp(v)) - v).max() < 1e-8
    assert not np.abs(arccos_log(exp(v)) - v).max() < 1e-8


@given(directions, lengths)
def test_exp_is_scipys(direction, length):
    v = vector(direction, length)
    assert exp(v) == pytest.approx(Rotation.from_rotvec(v).as_matrix(), abs=4e-15)


@given(angle, bend, angle)
def test_wedge_is_the_product_of_its_three_turns(tau, theta, phi):
    product = (
        Rotation.from_rotvec([0.0, 0.0, tau])
        * Rotation.from_rotvec([-theta, 0.0, 0.0])
        * Rotation.from_rotvec([0.0, phi, 0.0])
    )
    assert wedge(tau, theta, phi) == pytest.approx(product.as_matrix(), abs=4e-15)


@given(angle, bend, angle)
def test_wedge_angles_come_back(tau, theta, phi):
    matrix = wedge(tau, theta, phi)
    again = rot.wedge_angles(matrix)
    # tau and phi turn about nearly the same axis when theta nears 90 degrees.
    slack = 1e-14 / np.cos(theta) ** 2
    assert again[1] == pytest.approx(theta, abs=1e-15 / np.cos(theta) + 1e-14)
    for found, given_ in ((again[0], tau), (again[2], phi)):
        assert abs(np.remainder(found - given_ + np.pi, 2.0 * np.pi) - np.pi) <= slack
    assert wedge(*again) == pytest.approx(matrix, abs=1e-14)


@pytest.mark.parametrize("theta", [np.pi / 2, -np.pi / 2])
def test_wedge_angles_at_ninety_degrees_reproduce_the_rotation(theta):
    matrix = wedge(0.7, theta, 0.4)
    assert wedge(*rot.wedge_angles(matrix)) == pytest.approx(matrix, abs=1e-14)


def test_printed_arcsin_fails_beyond_ninety_degrees():
    """Negative control: the arcsin that Section IX prints, at a twist of 120 degrees."""
    tau = np.deg2rad(120.0)
    matrix = wedge(tau, 0.1, 0.2)
    printed = -np.arcsin(matrix[0, 1] / np.cos(-np.arcsin(matrix[2, 1])))
    assert rot.wedge_angles(matrix)[0] == pytest.approx(tau, abs=1e-14)
    assert abs(printed - tau) > 1.0


@given(directions, lengths)
def test_quaternions_are_scipys_up_to_sign_and_go_round(direction, length):
    matrix = exp(vector(direction, length))
    q = np.empty(4)
    rot.quaternion_from_matrix(matrix, q)
    reference = Rotation.from_matrix(matrix).as_quat()
    assert abs(q @ reference) == pytest.approx(1.0, abs=1e-14)
    assert q[3] >= 0.0
    again = np.empty((3, 3))
    for sign in (1.0, -1.0):
        rot.matrix_from_quaternion(sign * q, again)
        assert again == pytest.approx(matrix, abs=1e-14)


@given(directions, lengths, directions, lengths)
def test_composition_of_matrices_is_that_of_scipy(a, size_a, b, size_b):
    u, v = vector(a, size_a), vector(b, size_b)
    expected = (Rotation.from_rotvec(u) * Rotation.from_rotvec(v)).as_matrix()
    assert exp(log(exp(u) @ exp(v))) == pytest.approx(expected, abs=1e-13)
