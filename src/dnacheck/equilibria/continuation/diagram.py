"""Bifurcation diagrams of Section VII: the perfect one (Figure 6) and imperfect ones (Figure 7)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.continuation.branch import Branch, BranchError, End
from dnacheck.equilibria.continuation.component import Component, follow_component
from dnacheck.equilibria.continuation.follow import Bounds, degenerate, follow_branch
from dnacheck.equilibria.continuation.options import ContinuationOptions
from dnacheck.equilibria.continuation.parameters import (
    Parameter,
    curvature_fraction,
    end_twist,
    twist_ratio,
)
from dnacheck.equilibria.continuation.walker import Spot, Walker
from dnacheck.equilibria.continuum.collocation import Discretisation, aligned_mesh, discretise
from dnacheck.equilibria.continuum.homotopy import detours
from dnacheck.equilibria.continuum.options import ContinuumOptions
from dnacheck.equilibria.continuum.search import lowest_continuum_ring
from dnacheck.equilibria.continuum.state import (
    State,
    new_state,
    register_roll,
    run_newton,
    start_from_perfect_ring,
    transfer,
)
from dnacheck.equilibria.ring import Equilibrium
from dnacheck.model.rod.rod import Rod
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

#: Figure 6's section of the perfect diagram, in turns.
_PERFECT_TURNS = (-3.2, 3.2)
#: The imperfect component is followed this many turns to each side of its start.
_TURNS_AROUND = 2.5

#: The twisted circle's energy to 1e-10 asks for this; stability is that of a family.
PERFECT = ContinuationOptions(least_intervals=40, degree=6, stability=False)


def mesh_for(rod: Rod, options: ContinuationOptions) -> Discretisation:
    """The rod on the mesh that the options ask for."""
    intervals = options.intervals
    if intervals is None:
        pieces = rod.breaks.size - 1
        intervals = max(options.least_intervals, pieces)
    return discretise(rod, aligned_mesh(rod.breaks, intervals), options.degree)


def start_walker(
    disc: Discretisation,
    active: Parameter,
    options: ContinuationOptions,
    value: float,
    state: State,
    symmetric: bool = False,
) -> tuple[Walker, Spot]:
    """Walker standing at the solution nearest to a state, at a value of the parameter.

    Raises
    ------
    BranchError
        No equilibrium there, or one that is not isolated.
    """
    walker = Walker(disc, active, symmetric, options)
    walker.place(value, state.loads, state.slopes)
    if not walker.at_parameter(value):
        # at a singular start Newton may fail or succeed; either way the matrix tells
        finite = bool(np.all(np.isfinite(walker.matrix())))
        end = End.DEGENERATE_START if finite and degenerate(walker) else End.NO_START
        raise BranchError(end, f"start at {active.name} = {value:.6g}: {end.value}")
    if degenerate(walker):
        end = End.DEGENERATE_START
        raise BranchError(end, f"start at {active.name} = {value:.6g}: {end.value}")
    return walker, walker.spot(None)


def _check_bounds(bounds: Bounds, value: float, name: str) -> None:
    if not bounds.least <= value <= bounds.most:
        raise BranchError(
            End.OUTSIDE,
            f"start at {name} = {value:.6g}, bounds {bounds.least:.6g} to {bounds.most:.6g}: "
            f"{End.OUTSIDE.value}",
        )


def perfect_diagram(
    rod: Rod,
    start: float = 0.5,
    bounds: Bounds | None = None,
    options: ContinuationOptions | None = None,
    depth: int = 1,
) -> Component:
    """Perfect diagram (Figure 6): the twisted circle, and what branches from it.

    Parameters
    ----------
    rod : Rod
        Without intrinsic curvature, see ``parameters.perfect_rod``; only its stiffnesses are used.
    start : float
        alpha of (4.12) to start from, radians.
    bounds : Bounds, optional
        Default 3.2 turns to both sides.
    depth : int
        Branch points between the circle and the farthest branch followed.

    Raises
    ------
    BranchError
        The start is a degenerate point: alpha exactly at a branch point.
    InputError
        The rod is curved, or its stiffness varies.
    """
    options = PERFECT if options is None else options
    if np.any(rod.strain_series != 0.0) or rod.compliance_series is not None:
        raise InputError("the perfect diagram needs a straight uniform rod: use perfect_rod")
    if bounds is None:
        bounds = Bounds(*(2.0 * np.pi * np.array(_PERFECT_TURNS)))
    _check_bounds(bounds, start, "end_twist")
    intervals = options.intervals or options.least_intervals
    # s = 1/2 must be a mesh point
    mesh = np.linspace(0.0, 1.0, intervals + intervals % 2 + 1)
    disc = discretise(rod, mesh, options.degree)
    state = new_state(disc)
    start_from_perfect_ring(state, start, 0.0)
    walker, spot = start_walker(disc, end_twist(0.0), options, start, state, symmetric=True)
    return follow_component(walker, spot, bounds, marks=(0.0,), depth=depth)


def imperfect_component(
    rod: Rod,
    start: float | Equilibrium,
    turn: float = 0.0,
    bounds: Bounds | None = None,
    options: ContinuationOptions | None = None,
    depth: int = 1,
) -> Component:
    """Component of the imperfect diagram (Figure 7) that contains a ring.

    The solutions with alpha = Omega(1) - Omega(0) modulo 2 pi, which are the rings of the molecule
    (Section VI C), are special points of kind MARK.

    Parameters
    ----------
    rod : Rod
    start : float or Equilibrium
        A ring on the component, or alpha in radians: the ring is then sought from the rolled
        perfect ring.
    turn : float
        With alpha: roll of the start away from the register that first-order perturbation
        selects; pi leads to the component of the saddles.

    Raises
    ------
    BranchError
        No equilibrium to start from, or not an isolated one.
    """
    options = ContinuationOptions() if options is None else options
    disc = mesh_for(rod, options)
    if isinstance(start, Equilibrium):
        state, alpha = _state_of(start, disc), start.curve.alpha
    else:
        alpha = float(start)
        if not np.isfinite(alpha):
            raise InputError(f"start of the diagram: alpha = {alpha}, give a finite angle")
        state = _find_start(disc, alpha, turn, options)
    if bounds is None:
        reach = 2.0 * np.pi * _TURNS_AROUND
        bounds = Bounds(alpha - reach, alpha + reach)
    _check_bounds(bounds, alpha, "end_twist")
    walker, spot = start_walker(disc, end_twist(), options, alpha, state)
    return follow_component(walker, spot, bounds, marks=(rod.end_rotation,), depth=depth)


def curvature_branch(
    rod: Rod,
    alpha: float,
    start: float = 0.02,
    turn: float = 0.0,
    bounds: Bounds | None = None,
    options: ContinuationOptions | None = None,
) -> Branch:
    """Homotopy of Section VII: the fraction gamma of the curvature, at fixed end twist.

    gamma = 0 is no start: the perfect ring may be rolled, so that every register solves it, and
    only those that first-order perturbation selects continue to gamma > 0.

    Parameters
    ----------
    alpha : float
        End twist, radians.
    start : float
        gamma to start from, on the perfect ring in the register that perturbation selects.
    turn : float
        Roll away from that register.

    Raises
    ------
    BranchError
        No start, a degenerate one (gamma = 0), or one outside the bounds.
    """
    options = ContinuationOptions() if options is None else options
    bounds = Bounds(-1.0, 1.0) if bounds is None else bounds
    _check_bounds(bounds, start, "curvature_fraction")
    disc = mesh_for(rod, options)
    state = new_state(disc)
    start_from_perfect_ring(state, alpha, register_roll(disc, alpha) + turn)
    walker, spot = start_walker(disc, curvature_fraction(alpha), options, start, state)
    return follow_branch(walker, spot, bounds)


def ratio_branch(
    rod: Rod,
    ring: Equilibrium,
    bounds: Bounds | None = None,
    options: ContinuationOptions | None = None,
) -> Branch:
    """A ring followed in K3/K1 at fixed end twist (end of Section VII); default 0.5 to 1.5."""
    options = ContinuationOptions() if options is None else options
    bounds = Bounds(0.5, 1.5) if bounds is None else bounds
    start = rod.twist_stiffness / rod.bend_stiffness
    _check_bounds(bounds, start, "twist_ratio")
    disc = mesh_for(rod, options)
    state = _state_of(ring, disc)
    walker, spot = start_walker(disc, twist_ratio(ring.curve.alpha), options, start, state)
    return follow_branch(walker, spot, bounds)


def lowest_component(
    rod: Rod, bounds: Bounds | None = None, options: ContinuationOptions | None = None
) -> Component:
    """Component that contains the lowest ring found over links and registers."""
    search = lowest_continuum_ring(rod)
    return imperfect_component(rod, search.lowest, bounds=bounds, options=options)


def components(
    rod: Rod,
    starts: Sequence[float] | None = None,
    bounds: Bounds | None = None,
    options: ContinuationOptions | None = None,
) -> tuple[Component, ...]:
    """Distinct components from several alpha and both registers, lowest first.

    Parameters
    ----------
    starts : sequence of float, optional
        alpha in radians; default eight values over four turns about zero.
    """
    if starts is None:
        starts = [2.0 * np.pi * (0.5 * i - 1.9) for i in range(8)]
    found: list[Component] = []
    for alpha in starts:
        for turn in (0.0, np.pi):
            try:
                new = imperfect_component(rod, float(alpha), turn, bounds, options)
            except BranchError:
                continue
            if not any(_shares(new, old) for old in found):
                found.append(new)
    return tuple(sorted(found, key=lambda c: min(float(b.energy.min()) for b in c.branches)))


def _shares(new: Component, old: Component) -> bool:
    """Whether the start of a new component lies on an old one."""
    first = new.branches[0]
    bend = first.disc.rod.bend_stiffness
    scale = 2.0 * np.pi * bend * np.array([1.0] * 3 + [2.0 * np.pi] * 3)
    lowest = int(np.argmin(first.energy))
    probe = first.loads[lowest] / scale
    for branch in old.branches:
        points = branch.loads / scale
        steps = np.diff(points, axis=0)
        squares = np.maximum(np.sum(steps**2, axis=1), 1e-300)
        gaps = probe - points[:-1]
        along = np.clip(np.sum(gaps * steps, axis=1) / squares, 0.0, 1.0)
        nearest = np.linalg.norm(gaps - along[:, None] * steps, axis=1)
        if np.any(nearest < 0.05 * np.sqrt(squares) + 1e-6):
            return True
    return False


def _state_of(ring: Equilibrium, disc: Discretisation) -> State:
    own = discretise(ring.rod, ring.curve.mesh, ring.curve.degree)
    state = new_state(own)
    state.slopes[:] = ring.curve.slopes
    state.loads[:] = ring.curve.loads
    state.centres[:] = ring.curve.centres
    moved = transfer(state, disc.mesh)
    if moved.disc.rule.points.size == disc.rule.points.size:
        return moved
    raise InputError(
        f"the ring has {ring.curve.degree} points per interval, the diagram "
        f"{disc.rule.points.size}: give both the same degree"
    )


def _find_start(
    disc: Discretisation, alpha: float, turn: float, options: ContinuationOptions
) -> State:
    """A ring at end twist alpha from the rolled perfect ring."""
    newton = ContinuumOptions(tolerance=options.tolerance)
    state = new_state(disc)
    start_from_perfect_ring(state, alpha, register_roll(disc, alpha) + turn)
    if run_newton(state, disc.coefficients(), alpha, newton):
        return state
    for converged in detours(state, alpha, turn, newton):
        if converged:
            return state
    raise BranchError(End.NO_START, f"start at end_twist = {alpha:.6g}: {End.NO_START.value}")
