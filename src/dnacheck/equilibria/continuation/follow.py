"""Pseudo-arclength continuation: predictor, step control, and when to stop."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.continuation.branch import Branch, End, Kind, SpecialPoint
from dnacheck.equilibria.continuation.locate import specials_between, to_special
from dnacheck.equilibria.continuation.parameters import Parameter
from dnacheck.equilibria.continuation.walker import Spot, Walker
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

#: Scaled singular values of the extended matrix below this make a start degenerate.
_DEGENERATE = 1e-6
#: Two scaled points closer than this are the same solution.
SAME = 1e-6
_ON_MARK = 1e-12
_GROW, _SHRINK, _SHRINK_BEND = 1.4, 0.4, 0.6


@dataclass(frozen=True)
class Bounds:
    """Where a branch is given up.

    Attributes
    ----------
    least, most : float
        Of the parameter.
    energy : float
        Largest reduced energy.
    """

    least: float = -np.inf
    most: float = np.inf
    energy: float = np.inf

    def __post_init__(self) -> None:
        if not self.least < self.most or np.isnan(self.energy):
            raise InputError(
                f"bounds {self.least} to {self.most}: give a lower bound below the upper one"
            )


def degenerate(walker: Walker) -> bool:
    """Whether the solution at which the walker stands is not isolated at its parameter."""
    singular = np.linalg.svd(walker.matrix()[:, :-1], compute_uv=False)
    return bool(singular[-1] < _DEGENERATE * max(1.0, singular[0]))


def march(
    walker: Walker,
    start: Spot,
    bounds: Bounds,
    marks: Sequence[float],
    closes_at: Array | None,
) -> tuple[list[Spot], list[SpecialPoint], End]:
    """Follow the branch from a spot along its tangent until it ends.

    Parameters
    ----------
    closes_at : ndarray, shape (7,), optional
        Scaled point that ends the branch when met again; default the start.

    Returns
    -------
    spots : list of Spot
        After the start.
    special : list of SpecialPoint
        ``index`` counts from the start (0).
    end : End
    """
    options = walker.options
    spots: list[Spot] = []
    special: list[SpecialPoint] = []
    here = start
    before: Spot | None = None
    home = start.scaled if closes_at is None else closes_at
    travelled = 0.0
    length = options.first_step
    last_length = 0.0
    while len(spots) < options.max_points:
        length = min(length, options.longest_step, options.largest_turn / (here.turn_rate + 1e-30))
        if length < options.shortest_step:
            return spots, special, End.SHORT_STEP
        _predict(walker, here, before, length, last_length)
        level = float(here.tangent @ here.scaled) + length
        if not walker.correct(here.tangent, level):
            length *= _SHRINK
            continue
        there = walker.spot(here.tangent)
        bend = float(np.arccos(np.clip(there.tangent @ here.tangent, -1.0, 1.0)))
        chord = float(np.linalg.norm(there.scaled - here.scaled))
        if bend > options.sharpest_turn or chord > 1.2 * length:
            length *= _SHRINK_BEND
            continue
        out = _outside(there, bounds)
        if out is not None:
            end, point = _leave(walker, here, there, bounds, out, len(spots))
            special += specials_between(walker, here, point, marks, len(spots))
            spots.append(point)
            special.append(to_special(point, Kind.BOUND, len(spots), point.parameter))
            return spots, special, end
        if travelled > 2.0 * chord and _passes(here, there, home, walker.active):
            arrived = _arrive(walker, here, there, home)
            if arrived is not None:
                special += specials_between(walker, here, arrived, marks, len(spots))
                spots.append(arrived)
                return spots, special, End.CLOSED
        special += specials_between(walker, here, there, marks, len(spots))
        spots.append(there)
        travelled += chord
        last_length = length
        before, here = here, there
        if there.iterations < options.wanted_iterations and bend < 0.5 * options.sharpest_turn:
            length *= _GROW
        elif there.iterations > options.wanted_iterations + 1:
            length *= _SHRINK_BEND
    return spots, special, End.POINT_LIMIT


def _predict(
    walker: Walker, here: Spot, before: Spot | None, length: float, last_length: float
) -> None:
    """Stand at the extrapolation through this spot, its tangent and the previous tangent."""
    half = 0.0 if before is None else 0.5 * length * length / last_length
    scaled = here.scaled + length * here.tangent
    slopes = here.slopes + length * here.slopes_rate
    if before is not None:
        scaled += half * (here.tangent - before.tangent)
        slopes += half * (here.slopes_rate - before.slopes_rate)
    unknowns = scaled * walker.scale
    walker.place(unknowns[6], unknowns[:6], slopes)


def _outside(spot: Spot, bounds: Bounds) -> float | None:
    """The bound of the parameter that was passed, nan for the energy, or None."""
    if spot.parameter > bounds.most:
        return bounds.most
    if spot.parameter < bounds.least:
        return bounds.least
    if spot.bend + spot.twist > bounds.energy:
        return np.nan
    return None


def _leave(
    walker: Walker, here: Spot, there: Spot, bounds: Bounds, bound: float, index: int
) -> tuple[End, Spot]:
    """The point at the bound; beyond it when that can't be had."""
    if np.isnan(bound):
        return End.ENERGY, there
    change = there.parameter - here.parameter
    fraction = (bound - here.parameter) / change
    walker.place(
        bound,
        here.loads + fraction * (there.loads - here.loads),
        here.slopes + fraction * (there.slopes - here.slopes),
    )
    if not walker.at_parameter(bound):
        return End.BOUND, there
    return End.BOUND, walker.spot(there.tangent)


def _gap(scaled: Array, home: Array, active: Parameter) -> Array:
    """Difference of two scaled points; equal problems a period apart count as one."""
    gap: Array = scaled - home
    if active.period is not None:
        gap[6] = 0.0
    return gap


def _passes(here: Spot, there: Spot, home: Array, active: Parameter) -> bool:
    """Whether the step from here to there may have gone through ``home``."""
    chord = _gap(there.scaled, here.scaled, active)
    gap = _gap(here.scaled, home, active)
    square = float(chord @ chord)
    along = -float(gap @ chord) / square if square > 0.0 else 0.0
    if not -0.01 <= along <= 1.01:
        return False
    return float(np.linalg.norm(gap + along * chord)) < 0.3 * np.sqrt(square)


def _arrive(walker: Walker, here: Spot, there: Spot, home: Array) -> Spot | None:
    """The solution nearest ``home`` on the step, if it is ``home``."""
    border = there.scaled - here.scaled
    total = float(border @ border)
    gap = _gap(home, here.scaled, walker.active)
    chord = _gap(there.scaled, here.scaled, walker.active)
    fraction = float(gap @ chord) / float(chord @ chord)
    for _ in range(8):
        walker.place(
            here.parameter + fraction * (there.parameter - here.parameter),
            here.loads + fraction * (there.loads - here.loads),
            here.slopes + fraction * (there.slopes - here.slopes),
        )
        if not walker.correct(border, float(border @ here.scaled) + fraction * total):
            return None
        spot = walker.spot(here.tangent)
        miss = _gap(home, spot.scaled, walker.active)
        if float(np.linalg.norm(miss)) < SAME:
            return spot
        along = spot.tangent.copy()
        if walker.active.period is not None:
            along[6] = 0.0
        change = float(miss @ along) / float(along @ along)
        if float(np.linalg.norm(miss - change * along)) > 0.5 * float(np.linalg.norm(miss)) + SAME:
            return None
        fraction += change * float(border @ spot.tangent) / total
    return None


def follow_branch(
    walker: Walker,
    start: Spot,
    bounds: Bounds,
    marks: Sequence[float] = (),
    both: bool = True,
) -> Branch:
    """Branch through a converged spot.

    Parameters
    ----------
    walker : Walker
    start : Spot
        With a unit tangent, in whose direction the branch is numbered.
    marks : sequence of float
        Values of the parameter (modulo its period) whose solutions are wanted.
    both : bool
        Follow against the tangent too.
    """
    began = time.perf_counter()
    ahead, special, end = march(walker, start, bounds, marks, None)
    special = _mark_of_start(walker, start, marks) + [
        point
        for point in special
        if point.kind is not Kind.MARK
        or float(np.linalg.norm(_scaled(walker, point) - start.scaled)) > SAME
    ]
    spots = [start, *ahead]
    ends: tuple[End, ...] = (end,)
    if both and end is not End.CLOSED:
        back = replace(
            start, tangent=-start.tangent, slopes_rate=-start.slopes_rate, sign=-start.sign
        )
        behind, found, first = march(walker, back, bounds, marks, None)
        n = len(behind)
        flipped = [
            replace(
                point,
                index=(n - 1 - point.index) if point.kind is not Kind.BOUND else n - point.index,
                tangent=-point.tangent,
            )
            for point in reversed(found)
            if point.kind is not Kind.MARK
            or float(np.linalg.norm(_scaled(walker, point) - start.scaled)) > SAME
        ]
        special = flipped + [replace(point, index=point.index + n) for point in special]
        reversed_spots = [
            replace(s, tangent=-s.tangent, slopes_rate=-s.slopes_rate) for s in reversed(behind)
        ]
        spots = [*reversed_spots, *spots]
        ends = (first, end)
    return make_branch(walker, spots, special, ends, time.perf_counter() - began)


def _scaled(walker: Walker, point: SpecialPoint) -> Array:
    return np.asarray(np.append(point.loads, point.parameter) / walker.scale, dtype=float)


def _mark_of_start(walker: Walker, start: Spot, marks: Sequence[float]) -> list[SpecialPoint]:
    """The start as a marked solution, if it is one."""
    period = walker.active.period
    for mark in marks:
        gap = start.parameter - mark
        if period is not None:
            gap -= period * round(gap / period)
        if abs(gap) <= _ON_MARK * walker.scale[6]:
            return [to_special(start, Kind.MARK, 0, start.parameter)]
    return []


def make_branch(
    walker: Walker,
    spots: Sequence[Spot],
    special: Sequence[SpecialPoint],
    ends: tuple[End, ...],
    seconds: float,
) -> Branch:
    """Freeze what was followed."""
    scaled = np.array([s.scaled for s in spots])
    steps = np.linalg.norm(np.diff(scaled, axis=0), axis=1)
    bend, twist = np.array([s.bend for s in spots]), np.array([s.twist for s in spots])
    arrays = {
        "parameter": np.array([s.parameter for s in spots]),
        "energy": bend + twist,
        "bend": bend,
        "twist": twist,
        "residual": np.array([s.residual for s in spots]),
        "left_out": np.array([s.left_out for s in spots]),
        "arclength": np.concatenate([[0.0], np.cumsum(steps)]),
        "loads": np.array([s.loads for s in spots]),
        "slopes": np.array([s.slopes for s in spots]),
        "total_twist": np.array([s.total_twist for s in spots]),
        "negative_directions": np.array([s.negative_directions for s in spots], dtype=np.int64),
        "iterations": np.array([s.iterations for s in spots], dtype=np.int64),
    }
    for array in arrays.values():
        array.setflags(write=False)
    return Branch(
        disc=walker.disc,
        active=walker.active,
        symmetric=walker.symmetric,
        special=tuple(special),
        ends=ends,
        seconds=seconds,
        **arrays,
    )
