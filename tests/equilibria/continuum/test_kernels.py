"""Derivatives of the condensed collocation system against finite differences."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from rods import random_chain

from dnacheck.equilibria.continuum.collocation import aligned_mesh, bisect, discretise, gauss_rule
from dnacheck.equilibria.continuum.kernels.condense import condense
from dnacheck.equilibria.continuum.kernels.newton import solve_small
from dnacheck.equilibria.continuum.state import (
    new_state,
    register_roll,
    start_from_perfect_ring,
    transfer,
)
from dnacheck.model.rod import build_rod


def _state(seed, ratio, intervals=6, degree=3):
    rod = build_rod(random_chain(seed, 120, "trifonov", ratio))
    disc = discretise(rod, aligned_mesh(rod.breaks, intervals), degree)
    state = new_state(disc)
    start_from_perfect_ring(state, 0.8, register_roll(disc, 0.8))
    rng = np.random.default_rng(seed)
    state.slopes += rng.normal(size=state.slopes.shape)
    state.loads += 0.02 * min(1.0, ratio) * rng.normal(size=6)
    return state


def _sweep(state, coefficients, rates=None):
    rates = np.zeros_like(coefficients) if rates is None else rates
    rule = state.disc.rule
    return condense(
        state.slopes,
        state.loads,
        coefficients,
        rates,
        state.disc.h,
        rule.integrals,
        rule.weights,
        state.frames,
        state.centres,
        state.sensitivity,
        state.stage_sensitivity,
        state.parts,
    )


def _shoot(state, coefficients, sweeps=60):
    """Solve the collocation equations at fixed loads; end frame and centre."""
    for _ in range(sweeps):
        _, residual = _sweep(state, coefficients)
        if residual < 1e-14:
            break
        step = state.stage_sensitivity[..., 7]
        state.slopes += step * min(1.0, 3.0 / np.max(np.abs(step)))
    _, residual = _sweep(state, coefficients)
    return residual, state.frames[-1].copy(), state.centres[-1].copy()


def _rotation_vector(a, b):
    miss = b @ a.T
    return 0.5 * np.array(
        [miss[2, 1] - miss[1, 2], miss[0, 2] - miss[2, 0], miss[1, 0] - miss[0, 1]]
    )


@given(seed=st.integers(0, 1000), ratio=st.sampled_from([0.3, 0.7, 1.5, 20.0]))
@settings(max_examples=12)
def test_end_sensitivity_equals_finite_differences(seed, ratio):
    """d(frame, centre)(1) / d(loads, parameter), at fixed loads the slopes solved for."""
    state = _state(seed, ratio)
    base = state.disc.coefficients()
    rates = 0.3 * base * np.cos(np.arange(base.size).reshape(base.shape))
    assume(_shoot(state, base)[0] < 1e-13)
    _sweep(state, base, rates)
    got = state.sensitivity[-1][:, :7].copy()
    solved = state.slopes.copy(), state.loads.copy()
    step = 1e-6
    for column in range(7):
        ends = []
        for sign in (1.0, -1.0):
            state.slopes[:], state.loads[:] = solved
            coefficients = base
            if column < 6:
                size = step * (0.01 if column < 3 else 0.05)
                state.loads[column] += sign * size
            else:
                size = step
                coefficients = base + sign * size * rates
            residual, *end = _shoot(state, coefficients)
            assert residual < 1e-13
            ends.append(end)
        numeric = np.concatenate(
            [
                _rotation_vector(ends[1][0], ends[0][0]) / (2 * size),
                (ends[0][1] - ends[1][1]) / (2 * size),
            ]
        )
        scale = np.max(np.abs(got[:, column]))
        assert np.max(np.abs(numeric - got[:, column])) < 1e-6 * scale


@given(seed=st.integers(0, 1000))
@settings(max_examples=8)
def test_newton_correction_is_a_true_linearisation(seed):
    """The collocation residual after a fraction t of the Newton step falls as 1 - t + O(t^2)."""
    state = _state(seed, 1.5)
    coefficients = state.disc.coefficients()
    _, first = _sweep(state, coefficients)
    start, step = state.slopes.copy(), state.stage_sensitivity[..., 7].copy()
    remainders = []
    for t in (1e-2, 1e-3):
        before = _residuals(state, coefficients, start)
        after = _residuals(state, coefficients, start + t * step)
        remainders.append(np.max(np.abs(after - (1.0 - t) * before)))
    assert first > 0.0
    assert remainders[1] < 0.02 * remainders[0]
    # a wrong step (one per cent too long in one stage) leaves a first-order remainder
    wrong = step.copy()
    wrong[2, 1] *= 1.5
    after = _residuals(state, coefficients, start + 1e-3 * wrong)
    assert np.max(np.abs(after - (1.0 - 1e-3) * _residuals(state, coefficients, start))) > (
        5.0 * remainders[1]
    )


def _residuals(state, coefficients, slopes):
    """g' - f at every stage, computed here from the definitions (not by the kernel)."""
    rule, h = state.disc.rule, state.disc.h
    n = state.loads[3:]
    frame, centre = np.eye(3), np.zeros(3)
    out = np.empty_like(slopes)
    for i in range(h.size):
        g = h[i] * rule.integrals @ slopes[i]
        d = np.array([_cayley(x) @ frame for x in g])
        r = centre + h[i] * rule.integrals @ d[:, :, 2]
        for j in range(g.shape[0]):
            m = state.loads[:3] - np.cross(r[j], n)
            w1, w2, bend, twist = coefficients[i, j]
            local = d[j].T @ m
            u = d[j] @ np.array([bend * local[0] + w1, bend * local[1] + w2, twist * local[2]])
            rate = 0.5 * (u + np.cross(u, g[j]) + (u @ g[j]) * g[j])
            out[i, j] = slopes[i, j] - rate
        centre = centre + h[i] * rule.weights @ d[:, :, 2]
        frame = _cayley(h[i] * rule.weights @ slopes[i]) @ frame
    return out


def _cayley(g):
    cross = np.array([[0, -g[2], g[1]], [g[2], 0, -g[0]], [-g[1], g[0], 0]])
    return np.eye(3) + 2.0 / (1.0 + g @ g) * (cross + cross @ cross)


def test_kernel_residual_equals_the_definition():
    state = _state(5, 1.5)
    coefficients = state.disc.coefficients()
    _, residual = _sweep(state, coefficients)
    expected = _residuals(state, coefficients, state.slopes)
    rate = state.slopes - expected
    assert residual == pytest.approx(
        np.max(np.abs(expected)) / (1.0 + np.max(np.abs(rate))), rel=1e-10
    )


def test_frames_stay_orthonormal_whatever_the_slopes():
    state = _state(9, 1.5)
    state.slopes *= 3.0
    _sweep(state, state.disc.coefficients())
    product = np.swapaxes(state.frames, 1, 2) @ state.frames
    assert np.max(np.abs(product - np.eye(3))) < 1e-13


def test_not_finite_input_ends_with_a_code():
    state = _state(1, 1.5)
    state.slopes[2, 1, 0] = np.nan
    assert _sweep(state, state.disc.coefficients())[0] == 1


@given(seed=st.integers(0, 10_000))
def test_small_solver(seed):
    rng = np.random.default_rng(seed)
    a, x = rng.normal(size=(6, 6)), rng.normal(size=(6, 1))
    expected = np.linalg.solve(a, x)
    ratio = solve_small(a.copy(), (y := x.copy()), 1e-12)
    assert np.allclose(y, expected, rtol=1e-8, atol=1e-8 * np.max(np.abs(expected)))
    assert 0.0 < ratio <= 1.0


def test_small_solver_leaves_a_neutral_direction_alone():
    rng = np.random.default_rng(2)
    q, _ = np.linalg.qr(rng.normal(size=(6, 6)))
    a = q @ np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 0.0]) @ q.T
    right = a @ rng.normal(size=(6, 1))
    ratio = solve_small(a.copy(), (y := right.copy()), 1e-10)
    assert ratio < 1e-10
    assert np.allclose(a @ y, right, atol=1e-10)
    assert np.max(np.abs(y)) < 100.0


def test_gauss_rule_integrates_polynomials():
    rule = gauss_rule(4)
    for power in range(8):
        assert rule.weights @ rule.points**power == pytest.approx(1.0 / (power + 1), rel=1e-14)
    assert abs(rule.weights @ rule.points**8 - 1.0 / 9.0) > 1e-7
    assert np.allclose(rule.integrals @ rule.points**2, rule.points**3 / 3.0, atol=1e-15)


def test_meshes_hold_the_knots():
    rod = build_rod(random_chain(0, 155))
    for intervals in (14, 30, 60):
        mesh = aligned_mesh(rod.breaks, intervals)
        assert mesh.size == intervals + 1
        assert np.all(np.min(np.abs(mesh[:, None] - rod.breaks), axis=0) < 1e-15)
    assert np.allclose(np.diff(aligned_mesh(rod.breaks, 5)), 0.2)
    halved = bisect(mesh, np.arange(60) == 7)
    assert halved.size == mesh.size + 1
    assert halved[8] == pytest.approx(0.5 * (mesh[7] + mesh[8]))


def test_transfer_keeps_the_solution():
    state = _state(3, 1.5, intervals=10, degree=4)
    coefficients = state.disc.coefficients()
    _shoot(state, coefficients)
    fine = transfer(state, bisect(state.disc.mesh, np.ones(state.disc.h.size, dtype=bool)))
    _, residual = _sweep(fine, fine.disc.coefficients())
    assert np.max(np.abs(fine.frames[::2] - state.frames)) < 1e-6
    assert residual < 0.03
