"""A branch of rings and its special points."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.continuation.parameters import Parameter
from dnacheck.equilibria.continuum.collocation import Discretisation
from dnacheck.equilibria.continuum.options import ContinuumOptions
from dnacheck.equilibria.continuum.solver import refine
from dnacheck.equilibria.continuum.state import State, new_state, run_newton
from dnacheck.equilibria.ring import Equilibrium
from dnacheck.model.rod.rod import Rod
from dnacheck.numerics.curve_topology import polygon_writhe
from dnacheck.numerics.outcome import DnaCheckError

Array = NDArray[np.float64]

_WRITHE_CORNERS = 48


class End(enum.Enum):
    """How a branch ended; the value says what to change where that is called for."""

    BOUND = "reached a bound of the parameter"
    ENERGY = "reached the energy limit"
    CLOSED = "the branch closed upon itself"
    BRANCH_POINT = "ended at the start of the branch it came from"
    POINT_LIMIT = (
        "reached the limit of points before a bound: the branch may never meet the bounds; raise "
        "max_points, lengthen longest_step, or set bounds within the parameters it has visited"
    )
    SHORT_STEP = (
        "the step fell below shortest_step: lower shortest_step, raise max_iterations or "
        "intervals, or start elsewhere"
    )
    DEGENERATE_START = (
        "the start is not isolated (a branch point, a fold, or a family of solutions such as the "
        "register of the perfect ring): move the starting parameter away from it, or break the "
        "symmetry with some intrinsic curvature"
    )
    NO_START = (
        "no equilibrium was found to start from: choose another start of the parameter, link or "
        "register, or raise max_iterations"
    )
    OUTSIDE = "the start lies outside the bounds: widen the bounds or start within them"

    @property
    def ok(self) -> bool:
        """Whether the branch ended where it was meant to."""
        return self in (End.BOUND, End.ENERGY, End.CLOSED, End.BRANCH_POINT)


class Kind(enum.Enum):
    """What is special about a point."""

    FOLD = "fold"
    BRANCH_POINT = "branch point"
    MARK = "mark"
    BOUND = "bound"
    START = "start"


class BranchError(DnaCheckError):
    """A branch could not be made; ``end`` says why."""

    def __init__(self, end: End, message: str) -> None:
        super().__init__(message)
        self.end = end


@dataclass(frozen=True)
class SpecialPoint:
    """A located point of a branch.

    Attributes
    ----------
    kind : Kind
    parameter : float
    bracket : (float, float)
        Values of the parameter between which the test function changes sign.
    precision : float
        Length of the bracket, and for a fold the bound on its value that follows.
    index : int
        The special point lies on the branch after this point.
    energy, bend, twist : float
        Reduced.
    loads : ndarray, shape (6,)
    slopes : ndarray, shape (K, k, 3)
        The solution, see ``ring.continuum.kernels.condense``.
    residual : float
    negative_directions : int
        Conjugate points, -1 where not counted.
    tangent : ndarray, shape (7,)
        Of the branch, scaled.
    """

    kind: Kind
    parameter: float
    bracket: tuple[float, float]
    precision: float
    index: int
    energy: float
    bend: float
    twist: float
    loads: Array
    slopes: Array
    residual: float
    negative_directions: int
    tangent: Array

    @property
    def end_moment(self) -> float:
        """m3(0)."""
        return float(self.loads[2])


@dataclass(frozen=True)
class Branch:
    """Solutions along a curve, in the order they were followed.

    Attributes
    ----------
    disc : Discretisation
        Rod and mesh.
    active : Parameter
        What was varied.
    symmetric : bool
        Whether the sector symmetric about s = 0 was followed, see ``sectors``.
    parameter, energy, bend, twist, residual, left_out : ndarray, shape (M,)
        Value of the parameter; reduced energies; residual of the equations in use; defect of
        closure conditions left out for symmetry.
    arclength : ndarray, shape (M,)
    loads : ndarray, shape (M, 6)
        m(0) and n.
    slopes : ndarray, shape (M, K, k, 3)
    total_twist : ndarray, shape (M,)
        Integral of u3, radians.
    negative_directions : ndarray of int, shape (M,)
        Conjugate points at fixed parameter; -1 where not counted.
    iterations : ndarray of int, shape (M,)
    special : tuple of SpecialPoint
    ends : (End, End)
        How the two directions ended; the first is START's own status for a one-way branch.
    seconds : float
    """

    disc: Discretisation
    active: Parameter
    symmetric: bool
    parameter: Array
    energy: Array
    bend: Array
    twist: Array
    residual: Array
    left_out: Array
    arclength: Array
    loads: Array
    slopes: Array
    total_twist: Array
    negative_directions: NDArray[np.int64]
    iterations: NDArray[np.int64]
    special: tuple[SpecialPoint, ...]
    ends: tuple[End, ...]
    seconds: float

    def __len__(self) -> int:
        return int(self.parameter.size)

    @property
    def end_moment(self) -> Array:
        """m3(0), shape (M,), reduced energy."""
        return self.loads[:, 2]

    @property
    def stable(self) -> NDArray[np.bool_]:
        """No negative directions; False also where they were not counted."""
        return self.negative_directions == 0

    @property
    def closed(self) -> bool:
        """Whether the branch is a loop."""
        return End.CLOSED in self.ends

    @property
    def ok(self) -> bool:
        """Whether every end was meant."""
        return all(end.ok for end in self.ends)

    @property
    def status(self) -> str:
        """How the branch ended, in words."""
        return "; ".join(dict.fromkeys(end.value for end in self.ends))

    def of_kind(self, kind: Kind) -> tuple[SpecialPoint, ...]:
        """Special points of one kind, in the order of the branch."""
        return tuple(point for point in self.special if point.kind is kind)

    @cached_property
    def link(self) -> Array:
        """Turns of d1 about the closed centreline, shape (M,): twist plus writhe.

        An integer where d1 closes, which it does at the marks only.
        """
        s = np.arange(_WRITHE_CORNERS) / _WRITHE_CORNERS
        out = np.empty(len(self))
        state = new_state(self.disc)
        for i in range(len(self)):
            state.slopes[:] = self.slopes[i]
            _place(state)
            centres = state.evaluate(s, state.quaternions())[1]
            turns = self.total_twist[i] - self.disc.rod.end_rotation
            out[i] = turns / (2.0 * np.pi) + polygon_writhe(centres)
        out.setflags(write=False)
        return out

    def ring(self, point: int | SpecialPoint) -> Equilibrium:
        """The ring at a point of the branch, on the branch's mesh."""
        if isinstance(point, SpecialPoint):
            value, loads, slopes = point.parameter, point.loads, point.slopes
        else:
            value, loads, slopes = (
                float(self.parameter[point]),
                self.loads[point],
                self.slopes[point],
            )
        return ring_from(self.disc, self.active, value, loads, slopes)


def _place(state: State) -> None:
    """Centres at the mesh points from the slopes alone."""
    from dnacheck.equilibria.continuation.shape import mesh_centres

    rule = state.disc.rule
    mesh_centres(state.slopes, state.disc.h, rule.integrals, rule.weights, state.centres)


def ring_from(
    disc: Discretisation, active: Parameter, value: float, loads: Array, slopes: Array
) -> Equilibrium:
    """Continuum ring of a solution of a family, on the same mesh."""
    from dnacheck.equilibria.continuum.collocation import discretise

    rod: Rod = active.rod(disc.rod, value)
    state = new_state(discretise(rod, disc.mesh, disc.rule.points.size))
    state.loads[:] = loads
    state.slopes[:] = slopes
    conditions = active.conditions(disc, value)
    options = ContinuumOptions(adapt=False)
    run_newton(state, conditions.coefficients, conditions.alpha, options)
    return refine(state, conditions.alpha, options)
