"""The perfect diagram (Figure 6) against what is known in closed form."""

import numpy as np
import pytest

from dnacheck.equilibria.continuation import (
    Bounds,
    BranchError,
    ContinuationOptions,
    End,
    Kind,
    curvature_branch,
    perfect_diagram,
    perfect_rod,
)
from dnacheck.equilibria.continuation.diagram import PERFECT
from dnacheck.equilibria.continuum.equations import perfect_energy
from dnacheck.numerics.outcome import InputError

TURN = 2.0 * np.pi


def branching_twist(mode, ratio):
    return TURN * np.sqrt(mode**2 - 1.0) / ratio


@pytest.fixture(scope="module")
def rod():
    return perfect_rod(158, 1.5)


@pytest.fixture(scope="module")
def circle(rod):
    return perfect_diagram(rod, depth=0)


def test_energy_on_the_twisted_circle(rod, circle):
    branch = circle.branches[0]
    exact = [
        perfect_energy(alpha, rod.bend_stiffness, rod.twist_stiffness) for alpha in branch.parameter
    ]
    np.testing.assert_allclose(branch.energy, exact, rtol=1e-10)
    np.testing.assert_allclose(branch.end_moment, rod.twist_stiffness * branch.parameter, atol=1e-9)
    assert branch.residual.max() <= PERFECT.tolerance
    assert branch.left_out.max() <= PERFECT.symmetry_tolerance
    assert circle.ok
    assert branch.ends == (End.BOUND, End.BOUND)


def test_branch_points_of_the_circle(circle):
    found = [point.parameter for point in circle.branches[0].of_kind(Kind.BRANCH_POINT)]
    expected = [branching_twist(mode, 1.5) for mode in (2, 3, 4)]
    np.testing.assert_allclose(found, [-x for x in reversed(expected)] + expected, atol=1e-6)
    for point in circle.branches[0].of_kind(Kind.BRANCH_POINT):
        assert point.bracket[0] <= point.parameter <= point.bracket[1]
        assert point.precision <= 2e-8


@pytest.mark.parametrize("ratio", [0.6, 2.3])
def test_branch_points_at_other_ratios(ratio):
    bounds = Bounds(-0.5, 1.05 * branching_twist(3, ratio))
    found = perfect_diagram(perfect_rod(100, ratio), bounds=bounds, depth=0)
    got = [point.parameter for point in found.of_kind(Kind.BRANCH_POINT)]
    np.testing.assert_allclose(got, [branching_twist(n, ratio) for n in (2, 3)], atol=1e-6)


def test_wrong_formula_is_told_apart(circle):
    """Negative control: sqrt(n^2 - 1) and n differ by far more than the precision."""
    first = min(abs(point.parameter) for point in circle.of_kind(Kind.BRANCH_POINT))
    assert abs(first - TURN * 2.0 / 1.5) > 1.0


def test_family_from_the_first_branch_point(rod):
    """The branch of mode 2 leads from the circle to the circle two links on, and closes."""
    bounds = Bounds(-1.3 * TURN, 1.3 * TURN)
    diagram = perfect_diagram(rod, bounds=bounds)
    assert diagram.ok
    family = diagram.branches[1]
    assert family.closed
    first = branching_twist(2, 1.5)
    # alpha and alpha + 2 turns are one problem: the other end is -first + 2 turns
    ends = {-first, first - 2.0 * TURN, first, -first + 2.0 * TURN}
    for point in family.of_kind(Kind.BRANCH_POINT):
        assert min(abs(point.parameter - end) for end in ends) < 1e-6
    circle_energy = perfect_energy(first, rod.bend_stiffness, rod.twist_stiffness)
    assert family.energy.min() < circle_energy
    assert family.left_out.max() < 1e-8
    # planar figure of eight at no end moment: alpha one turn, twist zero
    eight = [p for p in family.of_kind(Kind.MARK) if abs(p.end_moment) < 1e-9]
    assert eight
    # Euler's figure of eight, one period of the inflectional elastica: curvature 2 k l cn(l s)
    # with l = 4 K, closed where 2 E = K
    from scipy.special import ellipe, ellipk

    m = 0.8261147659
    assert 2.0 * ellipe(m) == pytest.approx(ellipk(m), rel=1e-8)
    k = ellipk(m)
    exact = 32.0 * rod.bend_stiffness * k * (ellipe(m) - (1.0 - m) * k)
    assert eight[0].energy == pytest.approx(exact, rel=1e-6)


def test_start_exactly_at_a_branch_point(rod):
    with pytest.raises(BranchError, match="not isolated") as error:
        perfect_diagram(rod, start=branching_twist(2, 1.5), depth=0)
    assert error.value.end is End.DEGENERATE_START


def test_start_at_no_end_twist(rod):
    """In the symmetric sector alpha = 0 is a regular point: the circle, and no other branch."""
    found = perfect_diagram(rod, start=0.0, bounds=Bounds(-1.0, 1.0), depth=0)
    branch = found.branches[0]
    exact = 0.5 * rod.bend_stiffness * TURN**2 + 0.5 * rod.twist_stiffness * branch.parameter**2
    np.testing.assert_allclose(branch.energy, exact, rtol=1e-10)


@pytest.mark.parametrize("alpha", [0.0, 0.7])
def test_perfect_ring_is_no_start_for_the_homotopy(rod, alpha):
    """Without the symmetric sector every register solves the perfect problem."""
    with pytest.raises(BranchError) as error:
        curvature_branch(rod, alpha, start=0.0)
    assert error.value.end is End.DEGENERATE_START


def test_bad_input(rod):
    with pytest.raises(InputError, match="twist ratio"):
        perfect_rod(158, -1.0)
    with pytest.raises(InputError, match="lower bound"):
        Bounds(2.0, 1.0)
    with pytest.raises(BranchError, match="widen the bounds"):
        perfect_diagram(rod, start=9.0, bounds=Bounds(0.0, 1.0))
    with pytest.raises(InputError, match="positive"):
        ContinuationOptions(first_step=-1.0)
    with pytest.raises(InputError, match="shortest_step <= first_step"):
        ContinuationOptions(first_step=1.0)


def test_point_limit_and_short_steps_keep_their_points(rod):
    from dataclasses import replace

    few = perfect_diagram(rod, options=replace(PERFECT, max_points=5), depth=0)
    assert not few.ok
    assert len(few.branches[0]) == 11
    assert "raise max_points" in few.status
    stuck = ContinuationOptions(
        degree=6, stability=False, shortest_step=1e-3, largest_turn=1e-6, least_intervals=40
    )
    branch = perfect_diagram(rod, options=stuck, depth=0).branches[0]
    assert End.SHORT_STEP in branch.ends
    assert "lower shortest_step" in branch.status
