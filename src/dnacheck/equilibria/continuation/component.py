"""All branches that hang together: switching at branch points, and joining loops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.continuation.branch import Branch, Kind, SpecialPoint
from dnacheck.equilibria.continuation.follow import Bounds, follow_branch
from dnacheck.equilibria.continuation.walker import Spot, Walker

if TYPE_CHECKING:
    import pandas

Array = NDArray[np.float64]

# First steps tried off a branch point, in scaled arclength.
_STEPS_OFF = (0.03, 0.01, 0.1, 0.003)
# Tangents closer than this angle (cosine) belong to the same branch.
_PARALLEL = 0.95
# Branch points found from two branches agree to about the square root of the precision.
_SAME_BRANCH_POINT = 1e-3


@dataclass(frozen=True)
class Component:
    """A connected set of branches.

    Attributes
    ----------
    branches : tuple of Branch
    failures : tuple of SpecialPoint
        Branch points at which no second branch was found.
    unexplored : tuple of SpecialPoint
        Branch points left aside because ``max_branches`` was reached.
    """

    branches: tuple[Branch, ...]
    failures: tuple[SpecialPoint, ...] = ()
    unexplored: tuple[SpecialPoint, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether every branch ended where it was meant to and every branch point was used."""
        return (
            bool(self.branches)
            and all(branch.ok for branch in self.branches)
            and not self.failures
            and not self.unexplored
        )

    @property
    def status(self) -> str:
        """What is missing, in words."""
        words = [branch.status for branch in self.branches if not branch.ok]
        if self.failures:
            words.append(
                f"{len(self.failures)} branch points could not be left: raise intervals or "
                "max_iterations"
            )
        if self.unexplored:
            words.append(
                f"{len(self.unexplored)} branch points were not followed: raise max_branches"
            )
        return "; ".join(dict.fromkeys(words)) or "complete within the bounds"

    def to_dict(self) -> dict[str, Any]:
        """The branches as lists of numbers, in RT and turns: a component in the commands' JSON."""
        from dnacheck.equilibria.continuation.figures import component_data

        return component_data(self, link=True)

    def to_frame(self) -> pandas.DataFrame:
        """A row for each point of each branch: energies and end moment in RT, alpha in turns."""
        import pandas

        names = ["alpha", "value", "energy", "bend", "twist", "end_moment", "link"]
        names += ["negative_directions", "residual"]
        parts = []
        for number, branch in enumerate(self.to_dict()["branches"]):
            columns = {name: branch[name] for name in names if name in branch}
            parts.append(pandas.DataFrame({"branch": number, **columns}))
        return pandas.concat(parts, ignore_index=True)

    def of_kind(self, kind: Kind) -> tuple[SpecialPoint, ...]:
        """Special points of one kind, lowest energy first, each once."""
        out: list[SpecialPoint] = []
        for branch in self.branches:
            for point in branch.of_kind(kind):
                if not any(_same_point(branch, point, other) for other in out):
                    out.append(point)
        return tuple(sorted(out, key=lambda point: point.energy))


def _scaled(branch: Branch, point: SpecialPoint) -> Array:
    bend = branch.disc.rod.bend_stiffness
    scale = 2.0 * np.pi * bend * np.array([1.0] * 3 + [2.0 * np.pi] * 3)
    return np.append(point.loads / scale, point.parameter / branch.active.scale)


def _same_point(branch: Branch, a: SpecialPoint, b: SpecialPoint) -> bool:
    gap = _scaled(branch, a) - _scaled(branch, b)
    if branch.active.period is not None:
        gap[6] = 0.0
    return bool(np.linalg.norm(gap) < _SAME_BRANCH_POINT)


def switch(walker: Walker, point: SpecialPoint) -> list[Spot]:
    """First spots of the other branch through a branch point, one to each side.

    The null space of the extended matrix holds the tangents of both branches; the step goes along
    its direction perpendicular to the known tangent.
    """
    walker.place(point.parameter, point.loads, point.slopes)
    known = point.tangent
    if not walker.evaluate(known, float(known @ walker.scaled())):
        return []
    _, _, rows = np.linalg.svd(walker.matrix())
    plane = np.array([walker.spread(row) for row in rows[-2:]])
    flat = plane - np.outer(plane @ known, known)
    direction = np.linalg.svd(flat)[2][0]
    base = walker.scaled()
    stage = walker.state.stage_sensitivity[..., :7].copy()
    rates = stage @ (direction * walker.scale)
    spots: list[Spot] = []
    for sign in (1.0, -1.0):
        for step in _STEPS_OFF:
            unknowns = (base + sign * step * direction) * walker.scale
            walker.place(unknowns[6], unknowns[:6], point.slopes + sign * step * rates)
            level = float(direction @ base) * sign + step
            if not walker.correct(sign * direction, level):
                continue
            spot = walker.spot(sign * direction)
            moved = spot.scaled - base
            parallel = abs(float(moved @ known)) / float(np.linalg.norm(moved))
            if parallel < _PARALLEL and abs(float(spot.tangent @ known)) < _PARALLEL:
                spots.append(spot)
                break
    return spots


def follow_component(
    walker: Walker,
    start: Spot,
    bounds: Bounds,
    marks: Sequence[float] = (),
    depth: int = 1,
) -> Component:
    """Branch through ``start``, and the branches that cross it, up to ``depth`` crossings away."""
    branches = [follow_branch(walker, start, bounds, marks)]
    failures: list[SpecialPoint] = []
    waiting = [(point, 1) for point in branches[0].of_kind(Kind.BRANCH_POINT)]
    used: list[SpecialPoint] = []
    unexplored: list[SpecialPoint] = []
    while waiting:
        point, level = waiting.pop(0)
        first = branches[0]
        crossing = [other for other in used if _same_point(first, point, other)]
        used.append(point)
        if crossing:
            continue
        if level > depth:
            continue
        if len(branches) >= walker.options.max_branches:
            unexplored.append(point)
            continue
        spots = switch(walker, point)
        if not spots:
            failures.append(point)
            continue
        for spot in spots:
            if any(_on(branch, spot, walker) for branch in branches[1:]):
                continue
            branch = follow_branch(walker, spot, bounds, marks, both=False)
            branches.append(branch)
            waiting += [(p, level + 1) for p in branch.of_kind(Kind.BRANCH_POINT)]
    return Component(tuple(branches), tuple(failures), tuple(unexplored))


def _on(branch: Branch, spot: Spot, walker: Walker) -> bool:
    """Whether a spot lies on a branch already followed (a loop met from its other side)."""
    scale = walker.scale
    points = np.column_stack([branch.loads, branch.parameter]) / scale
    gaps = points - spot.scaled
    if branch.active.period is not None:
        gaps[:, 6] = 0.0
    steps = gaps[1:] - gaps[:-1]
    squares = np.maximum(np.sum(steps**2, axis=1), 1e-300)
    along = np.clip(-np.sum(gaps[:-1] * steps, axis=1) / squares, 0.0, 1.0)
    nearest = np.linalg.norm(gaps[:-1] + along[:, None] * steps, axis=1)
    return bool(np.any(nearest < 0.05 * np.sqrt(squares) + 1e-6))
