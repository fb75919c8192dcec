"""Rings held at a register, and the Gaussian about them, against dense algebra."""

import math
from dataclasses import replace

import numpy as np
import pytest
from dense_closure import block_diagonal, closure_hessian, end_pose, jacobian, null_space
from short_chains import closed_ground_chain, soft_chain

from dnacheck.cyclization.laplace.constrained_minimum import Constrainer, RegisterOptions
from dnacheck.cyclization.laplace.isolated import laplace, register_spread
from dnacheck.cyclization.laplace.kernels import register as rk
from dnacheck.cyclization.laplace.kernels.gaussian import ROWS, draw_slice, invert_small
from dnacheck.cyclization.laplace.register import register_laplace, register_profile
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.equilibria.ring import Equilibria
from dnacheck.model.chain import Chain, build_chain, elastic_energy, uniform_stiffness
from dnacheck.model.molecules import embedded
from dnacheck.numerics.outcome import InputError, SolveError


def straight_chain(n, ratio=1.5):
    ground = np.zeros((n, 3))
    ground[:, 0] = 2 * math.pi / 10.45
    return Chain("straight", ground, uniform_stiffness(n, ratio), twist_ratio=ratio)


@pytest.fixture(scope="module", params=["wedge", "midstep"])
def held(request):
    chain = replace(soft_chain(13, 60.0), step_form=request.param)
    profile = register_profile(find_rings(chain))
    chart = profile.charts[0]
    rings = sorted(chart.rings, key=lambda ring: -ring.log_density)
    # Off the minimum, where the register multiplier is not zero.
    return chain, chart.link, rings[3]


def dense_parts(chain, ring):
    """G (7, n), Hessian of the Lagrangian and a null basis, in RT and steps."""
    form = chain.step_form
    c, s = math.cos(ring.register), math.sin(ring.register)
    along, across = np.empty_like(ring.angles), np.empty_like(ring.angles)
    rk.register_rows(chain.arrays, 1.0, along, across)
    g = np.vstack([jacobian(ring.angles, form), ring.factors.rows[6]])
    hessian = chain.energy_scale_RT * block_diagonal(chain.stiffness)
    hessian = hessian + closure_hessian(ring.angles, ring.multipliers[:6], form)
    assert math.hypot(c, s) == pytest.approx(1.0)
    return g, hessian, null_space(g)


def test_it_is_closed_stationary_and_at_its_register(held):
    chain, link, ring = held
    along, across = np.empty_like(ring.angles), np.empty_like(ring.angles)
    rk.register_rows(chain.arrays, float(link), along, across)
    register, extent = rk.register_of(ring.angles, along, across)
    assert math.cos(register - ring.register) == pytest.approx(1.0, abs=1e-10)
    assert extent == pytest.approx(ring.extent, rel=1e-10)
    assert np.abs(end_pose(ring.angles, chain.step_form)).max() < 1e-6
    strain = ring.angles - chain.ground
    gradient = chain.energy_scale_RT * np.einsum("sij,sj->si", chain.stiffness, strain).ravel()
    rows = np.vstack([jacobian(ring.angles, chain.step_form), ring.factors.rows[6]])
    assert np.abs(gradient + ring.multipliers @ rows).max() < 1e-3
    assert abs(ring.multipliers[6]) > 0.1


def test_slope_is_the_derivative_of_the_energy(held):
    chain, link, ring = held
    constrainer = Constrainer(chain, link, RegisterOptions())
    turns = ring.register / (2 * math.pi)
    low, high = (
        constrainer.minimum(turns + step, 1, ring.angles, ring.multipliers)
        for step in (-1e-4, 1e-4)
    )
    slope = (high.energy - low.energy) / (4e-4 * math.pi)
    assert ring.slope == pytest.approx(slope, rel=1e-4)


def test_density_equals_dense_algebra(held):
    chain, _, ring = held
    g, hessian, z = dense_parts(chain, ring)
    scale, n = chain.energy_scale_RT, ring.angles.size
    expected = (
        math.log(8 * math.pi**2)
        - scale * elastic_energy(chain, ring.angles)
        + 0.5 * np.linalg.slogdet(scale * block_diagonal(chain.stiffness) / (2 * math.pi))[1]
        + 0.5 * (n - 7) * math.log(2 * math.pi)
        - 0.5 * np.linalg.slogdet(z.T @ hessian @ z)[1]
        - 0.5 * np.linalg.slogdet(g @ g.T)[1]
        + math.log(ring.extent)
        - 3 * math.log(chain.rise_A)
        + math.log(1660.539)
    )
    assert ring.log_density == pytest.approx(expected, abs=2e-5)


def test_draws_have_the_covariance_of_the_projected_hessian(held):
    """The linear map from normals to draws, T, satisfies T T^T = Z (Z^T H Z)^-1 Z^T exactly."""
    chain, _, ring = held
    g, hessian, z = dense_parts(chain, ring)
    n = ring.angles.size
    columns = []
    for i in range(n):
        normals, x = np.zeros((n // 3, 3)), np.empty((n // 3, 3))
        normals.ravel()[i] = 1.0
        draw_slice(chain.arrays, ring.factors, normals, x)
        open_by = ring.factors.rows @ x.ravel()
        columns.append(x.ravel() - open_by @ ring.factors.projector)
        quadratic = 1.0 - open_by @ ring.factors.schur @ open_by
        assert columns[-1] @ hessian @ columns[-1] == pytest.approx(quadratic, abs=1e-5)
    t = np.array(columns).T
    expected = z @ np.linalg.inv(z.T @ hessian @ z) @ z.T
    np.testing.assert_allclose(t @ t.T, expected, atol=1e-6 * np.abs(expected).max() + 1e-8)
    np.testing.assert_allclose(g @ t, 0.0, atol=1e-5)


def test_directions_move_closure_and_keep_the_register(held):
    chain, _, ring = held
    np.testing.assert_allclose(
        ring.factors.rows[:6] @ ring.factors.directions.T, np.eye(6), atol=1e-8
    )
    np.testing.assert_allclose(ring.factors.rows[6] @ ring.factors.directions.T, 0.0, atol=1e-8)
    np.testing.assert_allclose(
        ring.factors.rows[:6], jacobian(ring.angles, chain.step_form), atol=1e-6
    )


def test_register_integral_meets_laplace_where_the_ring_is_stiff():
    """Both expand about the same minimum; the difference falls as the stiffness grows."""
    gaps = []
    base = soft_chain(13, 1e4)
    for scale in (1.0, 100.0):
        chain = replace(base, stiffness=scale * base.stiffness)
        search = find_rings(chain)
        gaps.append(abs(laplace(search).minus_lnJ - register_laplace(search).minus_lnJ))
    assert gaps[0] < 5e-3
    assert gaps[1] < 0.05 * gaps[0] + 1e-4


def test_trapezoid_rule_has_converged():
    search = find_rings(build_chain(embedded("12A09")))
    coarse = register_profile(search)
    fine = register_profile(search, RegisterOptions(spacing=0.4))
    assert fine.charts[0].registers > 1.5 * coarse.charts[0].registers
    assert coarse.log_j == pytest.approx(fine.log_j, abs=max(1e-5, 5 * coarse.bias_bound))


def test_rule_error_warns_of_too_few_registers():
    """Negative control: with registers two standard deviations apart the estimate says so."""
    search = find_rings(build_chain(embedded("08T15")))
    options = RegisterOptions(spacing=3.0, fewest=4, most=9)
    rough = register_profile(search, options)
    fine = register_profile(search)
    error = abs(math.expm1(rough.log_j - fine.log_j))
    assert error > 1e-4
    assert rough.charts[0].rule_error > 0.5 * error


@pytest.mark.parametrize("n", [100, 157])
def test_straight_molecule_has_the_same_density_at_every_register(n):
    profile = register_profile(straight_chain(n))
    for chart in profile.charts:
        assert len(chart.rings) == chart.registers
        assert np.ptp([ring.log_density for ring in chart.rings]) < 1e-5
    fractions = [chart.link - n / 10.45 for chart in profile.charts]
    assert min(map(abs, fractions)) < 0.5


def test_straight_molecule_of_half_a_turn_has_two_equal_links():
    n = 152
    ground = np.zeros((n, 3))
    ground[:, 0] = 2 * math.pi * 14.5 / n
    chain = Chain("straight", ground, uniform_stiffness(n, 1.5), twist_ratio=1.5)
    parts = {chart.link: chart.log_j for chart in register_profile(chain).charts}
    assert parts[14] == pytest.approx(parts[15], abs=1e-4)


def test_no_ring_at_all_is_said():
    chain = closed_ground_chain()
    search = find_rings(chain)
    with pytest.raises(SolveError, match="no stable ring"):
        register_profile(Equilibria(chain, (), (), 0, 0, 0.0, search.status))


@pytest.mark.parametrize(
    "bad",
    [{"spacing": 0.0}, {"depth": math.nan}, {"fewest": 2}, {"most": 3}, {"max_iterations": 0}],
)
def test_bad_options_are_refused(bad):
    with pytest.raises(InputError):
        RegisterOptions(**bad)


def test_small_inverse():
    rng = np.random.default_rng(0)
    root = rng.standard_normal((ROWS, ROWS))
    matrix = root @ root.T + np.eye(ROWS)
    out = np.empty((ROWS, ROWS))
    log_det = invert_small(matrix, out)
    np.testing.assert_allclose(out @ matrix, np.eye(ROWS), atol=1e-10)
    assert log_det == pytest.approx(np.linalg.slogdet(matrix)[1])
    assert math.isnan(invert_small(-matrix, out))


def test_spread_of_a_stiff_register_is_that_of_the_profile():
    """Laplace's register spread against the second moment of the integrated density."""
    search = find_rings(build_chain(embedded("11T15")))
    ring = search.lowest
    spread = register_spread(search.chain, ring.link, ring.angles, ring.multipliers)
    chart = register_profile(search).charts[0]
    weights = np.exp([r.log_density - chart.rings[0].log_density for r in chart.rings])
    registers = np.array([r.register for r in chart.rings])
    mean = np.angle(weights @ np.exp(1j * registers))
    offsets = np.angle(np.exp(1j * (registers - mean)))
    measured = math.sqrt(weights @ offsets**2 / weights.sum())
    assert measured == pytest.approx(spread, rel=0.1)
