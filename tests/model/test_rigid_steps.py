"""Kinematics of rigid base-pair steps against the textbook form in many digits."""

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rigid_steps import LagrangianInManyDigits, step_in_many_digits

from dnacheck.equilibria.discrete.kernels.rigid_closure import rigid_jacobian
from dnacheck.equilibria.discrete.kernels.rigid_factorisation import (
    RIGID_FACTOR_WIDTH,
    back_substitute_rigid,
    factorise_rigid,
)
from dnacheck.model.chain import chain_frames, rigid_coordinates
from dnacheck.model.rigid_kernels import linearise_rigid, new_kinematics

BENDS = (1e-12, 1e-8, 1e-4, 0.03, 0.249, 0.251, 0.6, 1.0)

angle = st.floats(-1.0, 1.0)
steps = st.tuples(
    st.floats(-3.0, 3.0), angle, angle, angle, angle, st.floats(0.5, 1.5)
)  # fmt: skip


def random_steps(rng, n, bend):
    phase = rng.uniform(0.0, 2.0 * np.pi, n)
    return np.column_stack(
        [rng.uniform(0.3, 0.8, n), bend * np.sin(phase), bend * np.cos(phase),
         *rng.uniform(-0.3, 0.3, (2, n)), rng.uniform(0.8, 1.2, n)]
    )  # fmt: skip


@pytest.mark.parametrize("bend", BENDS)
def test_a_step_is_that_of_el_hassan_and_calladine(bend):
    rng = np.random.default_rng(1)
    for coordinates in random_steps(rng, 5, bend):
        centres, frames = chain_frames(coordinates[None], "rigid")
        rotation, centre = step_in_many_digits(coordinates)
        assert frames[1] == pytest.approx(np.array(rotation.tolist(), dtype=float), abs=1e-15)
        assert centres[1] == pytest.approx(
            np.array(centre.tolist(), dtype=float).ravel(), abs=1e-15
        )


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.lists(steps, min_size=1, max_size=6))
def test_coordinates_are_read_back_from_frames(chain):
    coordinates = np.array(chain)
    centres, frames = chain_frames(coordinates, "rigid")
    assert np.abs(frames.transpose(0, 2, 1) @ frames - np.eye(3)).max() < 1e-14
    assert rigid_coordinates(centres, frames) == pytest.approx(coordinates, abs=2e-13)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(steps)
def test_the_other_strand_changes_the_signs_of_tilt_and_shift(step):
    """Base pair seen from the other strand: d2 and d3 turn about, d1 stays."""
    coordinates = np.array([step])
    centres, frames = chain_frames(coordinates, "rigid")
    flip = np.diag([1.0, -1.0, -1.0])
    other = rigid_coordinates(centres[::-1].copy(), (frames @ flip)[::-1].copy())
    signs = np.array([1.0, -1.0, 1.0, -1.0, 1.0, 1.0])
    assert other == pytest.approx(coordinates * signs, abs=1e-13)


@pytest.mark.parametrize("bend", BENDS)
def test_gradient_and_hessian_of_closure(bend):
    """Against differences in sixty digits; the own block of a step too."""
    rng = np.random.default_rng(7)
    n = 3
    coordinates = random_steps(rng, n, bend)
    multipliers = rng.uniform(-1.0, 1.0, 6)
    reference = LagrangianInManyDigits(coordinates, multipliers)

    kinematics = new_kinematics(n)
    linearise_rigid(coordinates, kinematics)
    rows = np.empty((6, 6 * n))
    rigid_jacobian(kinematics, rows)
    assert multipliers @ rows == pytest.approx(reference.gradient(), rel=1e-12, abs=1e-13)

    # Factors give H^-1 x; H H^-1 x = x tells H. The stiffness keeps it away from singular.
    root = 0.3 * rng.standard_normal((n, 6, 6))
    stiffness = 4.0 * np.eye(6) + root @ root.transpose(0, 2, 1)
    hessian = reference.hessian()
    for s in range(n):
        hessian[6 * s : 6 * s + 6, 6 * s : 6 * s + 6] += stiffness[s]
    factors, small = np.empty((n, RIGID_FACTOR_WIDTH)), np.empty((6, 7))
    solved, inverse = np.empty((n, 6)), np.empty((6 * n, 6 * n))
    for k in range(6 * n):
        rhs = np.zeros(6 * n)
        rhs[k] = -1.0
        negatives, log_pivots, _ = factorise_rigid(
            rhs.reshape(n, 6), stiffness, 0.0, coordinates, kinematics, multipliers, factors, small
        )
        back_substitute_rigid(factors, np.zeros(6), 1.0, solved)
        inverse[:, k] = solved.ravel()
    assert np.linalg.inv(inverse) == pytest.approx(hessian, abs=1e-11)
    assert negatives == int((np.linalg.eigvalsh(hessian) < 0.0).sum())
    assert log_pivots == pytest.approx(np.linalg.slogdet(hessian)[1], abs=1e-11)
    assert small[:, :6] == pytest.approx(rows @ np.linalg.solve(hessian, rows.T), abs=1e-11)


def test_the_reference_tells_a_wrong_own_block():
    """Negative control: without the second derivatives within a step the check fails by far."""
    rng = np.random.default_rng(7)
    coordinates = random_steps(rng, 3, 0.3)
    hessian = LagrangianInManyDigits(coordinates, rng.uniform(-1.0, 1.0, 6)).hessian()
    own = np.abs([hessian[6 * s : 6 * s + 6, 6 * s : 6 * s + 6] for s in range(3)])
    assert own.max() > 1e-2
    assert own[:, 3:, 3:].max() < 1e-15
    assert mp.mp.dps == 15
