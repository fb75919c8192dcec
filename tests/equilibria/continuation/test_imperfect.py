"""Imperfect diagrams (Figure 7): marked rings, stability, loops, other components, parameters."""

import numpy as np
import pytest
from rods import ELEVEN, molecule_chain, molecule_rod

from dnacheck.equilibria.bridge.reconstruct import reconstruct
from dnacheck.equilibria.continuation import (
    Bounds,
    BranchError,
    Conditions,
    ContinuationOptions,
    End,
    Kind,
    components,
    curvature_branch,
    custom,
    imperfect_component,
    lowest_component,
    ratio_branch,
)
from dnacheck.equilibria.continuation.diagram import mesh_for, start_walker
from dnacheck.equilibria.continuation.figures import (
    branch_data,
    component_data,
    figure_7,
    marked_rings,
    ring_shape,
    robustness,
)
from dnacheck.equilibria.continuation.follow import follow_branch
from dnacheck.equilibria.continuum import (
    ContinuumOptions,
    lowest_continuum_ring,
    solve_continuum_ring,
)
from dnacheck.equilibria.continuum.state import new_state
from dnacheck.equilibria.discrete.solve import NewtonOptions, solve_ring
from dnacheck.numerics.outcome import InputError

TURN = 2.0 * np.pi


@pytest.fixture(scope="module")
def rod():
    return molecule_rod("11T15")


@pytest.fixture(scope="module")
def component(rod):
    return lowest_component(rod)


def test_figure_seven(rod, component):
    """A closed loop on which d1 turns two links on, with two marked rings."""
    branch = component.branches[0]
    assert component.ok
    assert branch.closed
    span = branch.parameter[-1] - branch.parameter[0]
    assert span == pytest.approx(2.0 * TURN, abs=1e-6)
    assert branch.residual.max() <= 1e-10
    marks = component.of_kind(Kind.MARK)
    assert len(marks) == 2
    for mark in marks:
        turns = (mark.parameter - rod.end_rotation) / TURN
        assert turns == pytest.approx(round(turns), abs=1e-12)
    assert [mark.negative_directions for mark in marks] == [0, 0]
    folds = branch.of_kind(Kind.FOLD)
    assert len(folds) == 2
    assert all(fold.precision < 1e-7 for fold in folds)


def test_marked_rings_reconstruct_to_discrete_equilibria(component):
    chain = molecule_chain("11T15")
    rings = marked_rings(component)
    assert [ring.link for ring in rings] == [15, 16]
    for ring in rings:
        start = reconstruct(ring).angles
        discrete = solve_ring(chain, start, NewtonOptions(minima_only=False))
        assert discrete.link == ring.link
        assert ring.energy == pytest.approx(discrete.energy, rel=0.005)
        assert discrete.negative_directions == ring.negative_directions == 0


def test_saddle_of_another_component_has_the_right_inertia(rod):
    chain = molecule_chain("11T15")
    ring = solve_continuum_ring(rod, 15, turn=np.pi)
    assert ring.stable is False
    found = imperfect_component(
        rod, ring, bounds=Bounds(ring.curve.alpha - 1.0, ring.curve.alpha + 1.0)
    )
    (mark,) = [p for p in found.of_kind(Kind.MARK) if abs(p.parameter - ring.curve.alpha) < 1e-9]
    assert mark.negative_directions == 1
    same = found.branches[0].ring(mark)
    discrete = solve_ring(chain, reconstruct(same).angles, NewtonOptions(minima_only=False))
    assert discrete.negative_directions == 1
    assert same.energy == pytest.approx(discrete.energy, rel=0.005)


def test_points_are_solutions_of_the_ring_solver(component, rod):
    """Points of the branch re-solved from scratch by the other driver, on its own mesh."""
    branch = component.branches[0]
    mark = component.of_kind(Kind.MARK)[0]
    ring = lowest_continuum_ring(rod, options=ContinuumOptions(energy_tolerance=1e-8)).lowest
    assert mark.energy == pytest.approx(ring.energy, rel=2e-5)
    assert mark.end_moment == pytest.approx(ring.curve.end_moment, rel=1e-3)
    middle = len(branch) // 3
    point = branch.ring(middle)
    assert point.energy == pytest.approx(branch.energy[middle], rel=1e-12)
    assert point.residual <= 1e-10


def test_energy_changes_by_the_end_moment(component):
    """dE/d alpha = m3 at the end: an identity the continuation does not use."""
    branch = component.branches[0]
    dense = slice(5, 35)
    alpha, energy = branch.parameter[dense], branch.energy[dense]
    moment = branch.end_moment[dense]
    work = np.sum(0.5 * (moment[1:] + moment[:-1]) * np.diff(alpha))
    assert energy[-1] - energy[0] == pytest.approx(work, rel=2e-3)


def test_link_along_the_branch(component, rod):
    """Twist plus writhe follows alpha, but for whole turns where the rod passes itself."""
    branch = component.branches[0]
    excess = branch.link - (branch.parameter - rod.end_rotation) / TURN
    np.testing.assert_allclose(excess, np.round(excess), atol=5e-3)


def test_stability_changes_only_at_folds(component):
    branch = component.branches[0]
    changes = np.flatnonzero(np.diff(branch.negative_directions))
    folds = [point.index for point in branch.of_kind(Kind.FOLD)]
    assert len(changes) == len(folds)
    assert all(min(abs(c - f) for f in folds) <= 1 for c in changes)


def test_two_directions_join(rod, component):
    """The loop cut by bounds: both ends at bounds, points in order, the same energies."""
    ring = marked_rings(component)[0]
    bounds = Bounds(ring.curve.alpha - 1.5, ring.curve.alpha + 2.0)
    branch = imperfect_component(rod, ring, bounds=bounds).branches[0]
    assert branch.ends == (End.BOUND, End.BOUND)
    assert branch.parameter[0] == pytest.approx(bounds.least, abs=1e-12)
    assert branch.parameter[-1] == pytest.approx(bounds.most, abs=1e-12)
    assert np.all(np.diff(branch.parameter) > 0.0)
    assert np.all(np.diff(branch.arclength) > 0.0)
    assert ring.energy == pytest.approx(branch.of_kind(Kind.MARK)[0].energy, rel=1e-6)


@pytest.mark.slow
def test_other_components_lie_higher(rod):
    """That the component of the lowest ring is the lowest is found, not assumed."""
    found = components(rod, [0.4, 2.0], Bounds(-8.0, 8.0))
    assert len(found) >= 2
    energies = [min(b.energy.min() for b in c.branches) for c in found]
    assert energies == sorted(energies)
    best = lowest_component(rod)
    assert energies[0] == pytest.approx(best.branches[0].energy.min(), rel=0.01)
    assert energies[1] > 2.0 * energies[0]


def test_homotopy_in_the_curvature_reaches_the_ring(rod):
    ring = solve_continuum_ring(rod, 15)
    branch = curvature_branch(rod, ring.curve.alpha, bounds=Bounds(0.01, 1.0))
    assert branch.parameter[-1] == pytest.approx(1.0, abs=1e-12)
    assert branch.energy[-1] == pytest.approx(ring.energy, rel=2e-5)
    assert branch.ok


def test_twist_ratio_branch(rod):
    ring = solve_continuum_ring(rod, 15)
    branch = ratio_branch(rod, ring)
    np.testing.assert_allclose(branch.parameter[[0, -1]], [0.5, 1.5], atol=1e-9)
    # dE/dK3 = twisting energy / K3 at every equilibrium
    stiffness = branch.parameter * rod.bend_stiffness
    slope = np.gradient(branch.energy, stiffness)
    np.testing.assert_allclose(slope[2:-2], (branch.twist / stiffness)[2:-2], rtol=0.02)
    with pytest.raises(BranchError, match="widen the bounds"):
        ratio_branch(rod, ring, bounds=Bounds(2.0, 3.0))


def test_parameter_of_the_users_own(rod):
    """A parameter that stiffens bending and twisting alike leaves the shape as it is."""

    def conditions(disc, value):
        base = disc.coefficients()
        coefficients, rates = base.copy(), np.zeros_like(base)
        coefficients[..., 2:] /= value
        rates[..., 2:] = -coefficients[..., 2:] / value
        return Conditions(coefficients, rates, ring.curve.alpha, 0.0)

    ring = solve_continuum_ring(rod, 15)
    own = custom("stiffness", conditions, lambda rod, value: rod)
    options = ContinuationOptions()
    disc = mesh_for(rod, options)
    state = new_state(disc)
    found = imperfect_component(
        rod, ring, bounds=Bounds(ring.curve.alpha - 0.1, ring.curve.alpha + 0.1)
    )
    mark = found.of_kind(Kind.MARK)[0]
    state.slopes[:], state.loads[:] = mark.slopes, mark.loads
    walker, spot = start_walker(disc, own, options, 1.0, state)
    branch = follow_branch(walker, spot, Bounds(0.5, 2.0))
    np.testing.assert_allclose(branch.energy, mark.energy * branch.parameter, rtol=1e-9)
    np.testing.assert_allclose(branch.slopes[-1], mark.slopes, atol=1e-8)
    with pytest.raises(InputError, match="positive"):
        custom("bad", conditions, lambda rod, value: rod, scale=0.0)


def test_wrong_derivative_is_noticed(rod):
    """Negative control: with rates of the wrong sign the corrector cannot keep up."""

    def conditions(disc, value):
        base = disc.coefficients(value)
        rates = np.zeros_like(base)
        rates[..., :2] = -disc.strains.reshape(*rates.shape[:2], 2)
        return Conditions(base, rates, ring.curve.alpha, 0.0)

    ring = solve_continuum_ring(rod, 15)
    options = ContinuationOptions(shortest_step=1e-3, max_points=200)
    disc = mesh_for(rod, options)
    state = new_state(disc)
    right = imperfect_component(
        rod, ring, bounds=Bounds(ring.curve.alpha - 0.1, ring.curve.alpha + 0.1)
    )
    mark = right.of_kind(Kind.MARK)[0]
    state.slopes[:], state.loads[:] = mark.slopes, mark.loads
    own = custom("gamma", conditions, lambda rod, value: rod)
    walker, spot = start_walker(disc, own, options, 1.0, state)
    branch = follow_branch(walker, spot, Bounds(0.2, 1.2))
    assert not branch.ok


def test_no_start(rod):
    with pytest.raises(InputError, match="finite angle"):
        imperfect_component(rod, float("nan"))
    with pytest.raises(BranchError, match="widen the bounds"):
        imperfect_component(rod, 1.0, bounds=Bounds(3.0, 4.0))
    with pytest.raises(BranchError, match="no equilibrium was found") as error:
        imperfect_component(rod, 400.0)
    assert error.value.end is End.NO_START


def test_data_for_the_figures(rod, component):
    data = component_data(component)
    branch = data["branches"][0]
    assert branch["alpha"][0] == pytest.approx(component.branches[0].parameter[0] / TURN)
    assert branch["energy"].min() == pytest.approx(
        component.branches[0].energy.min() * rod.energy_scale_RT
    )
    assert {point["kind"] for point in branch["special"]} == {"mark", "fold"}
    linked = branch_data(component.branches[0], link=True)
    assert linked["link"].shape == branch["alpha"].shape
    shape = ring_shape(marked_rings(component)[0], points=60)
    closed = np.linalg.norm(shape["true_ribbon"][-1] - shape["true_ribbon"][0])
    opened = np.linalg.norm(shape["natural_ribbon"][-1] - shape["natural_ribbon"][0])
    assert closed < 1e-6
    assert opened > 1.0
    width = np.linalg.norm(shape["true_ribbon"] - shape["centreline"], axis=1)
    np.testing.assert_allclose(width, 10.0, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ELEVEN)
def test_diagrams_of_the_eleven(name):
    data = figure_7(molecule_rod(name))
    assert data["ok"]
    assert data["branches"][0]["residual"].max() <= 1e-10
    assert len(data["rings"]) >= 2
    best = lowest_continuum_ring(molecule_rod(name)).lowest
    assert data["rings"][0]["energy"] == pytest.approx(best.energy_RT, rel=2e-5)


def test_robustness_of_one_molecule():
    """Figure 10 at its middle ratio and corners."""
    fits = ((10, 4), (12, 5), (16, 6), (20, 4), (20, 6))
    data = robustness(molecule_chain("08T15"), ratios=(0.5, 1.5), fits=fits, span="molecule")
    assert data["spread_fit"] <= 0.05
    assert data["spread_width"] <= 0.05
    assert data["spread_all"] <= 0.15
    assert data["farthest"] <= 0.15
    assert not data["refused"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ELEVEN)
def test_robustness_of_the_eleven(name):
    """Every choice of the paper; pieces over the molecule."""
    data = robustness(molecule_chain(name), span="molecule")
    assert data["spread_fit"] <= 0.05
    assert data["spread_width"] <= 0.05
    assert data["spread_all"] <= 0.15


def test_robustness_with_pieces_over_the_padded_molecule():
    """The reading that makes (k, m) = (10, 4) the paper's exception."""
    data = robustness(
        molecule_chain("08T15"),
        ratios=(0.5, 1.5),
        fits=((10, 4), (12, 5), (20, 6)),
        widths=(10, 15, 25),
    )
    assert data["spread_fit"] <= 0.05
    assert data["spread_width"] <= 0.05
    assert data["farthest"] <= 0.15
    coarse = data["by_fit"][10, 4] - data["by_fit"][20, 6]
    assert np.all(np.abs(coarse) > 0.05)
