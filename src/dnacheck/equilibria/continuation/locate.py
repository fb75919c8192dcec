"""Folds, branch points and marked solutions between two points of a branch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.continuation.branch import Kind, SpecialPoint
from dnacheck.equilibria.continuation.walker import Spot, Walker

Array = NDArray[np.float64]

_MOST_STEPS = 60


def to_special(
    spot: Spot, kind: Kind, index: int, other: float, precision: float | None = None
) -> SpecialPoint:
    """A spot as a special point; ``other`` is the far end of the parameter's bracket."""
    low, high = sorted((spot.parameter, other))
    return SpecialPoint(
        kind=kind,
        parameter=spot.parameter,
        bracket=(low, high),
        precision=high - low if precision is None else precision,
        index=index,
        energy=spot.bend + spot.twist,
        bend=spot.bend,
        twist=spot.twist,
        loads=spot.loads,
        slopes=spot.slopes,
        residual=spot.residual,
        negative_directions=spot.negative_directions,
        tangent=spot.tangent,
    )


def specials_between(
    walker: Walker, here: Spot, there: Spot, marks: Sequence[float], index: int
) -> list[SpecialPoint]:
    """Special points on the step from ``here`` to ``there``, in order."""
    found: list[tuple[float, SpecialPoint]] = []
    corners = [here, there]
    if here.tangent[6] * there.tangent[6] < 0.0:
        fold, other = _bracket(walker, here, there, lambda s: float(s.tangent[6]))
        # near the fold the parameter is quadratic in the arclength
        width = float(np.linalg.norm(fold.scaled - other.scaled))
        bound = abs(float(fold.tangent[6])) * width * walker.scale[6]
        point = to_special(
            fold,
            Kind.FOLD,
            index,
            other.parameter,
            max(abs(fold.parameter - other.parameter), bound),
        )
        found.append((_along(here, fold), point))
        corners = [here, fold, there]
    if here.sign * there.sign < 0.0:
        shift = max(here.log_det, there.log_det)

        def determinant(s: Spot) -> float:
            return s.sign * float(np.exp(s.log_det - shift))

        branching, other = _bracket(walker, here, there, determinant)
        point = to_special(branching, Kind.BRANCH_POINT, index, other.parameter)
        found.append((_along(here, branching), point))
    for first, second in pairwise(corners):
        for value in _crossed(walker, first.parameter, second.parameter, marks):
            spot = _solve_at(walker, first, second, value)
            if spot is not None:
                found.append((_along(here, spot), to_special(spot, Kind.MARK, index, value)))
    return [point for _, point in sorted(found, key=lambda pair: pair[0])]


def _along(here: Spot, spot: Spot) -> float:
    return float(here.tangent @ (spot.scaled - here.scaled))


def _between(walker: Walker, a: Spot, b: Spot, fraction: float) -> Spot | None:
    """The solution at a fraction of the chord from a to b."""
    border = b.scaled - a.scaled
    length = float(np.linalg.norm(border))
    border = border / length
    x = fraction
    # cubic Hermite in the scaled unknowns and the slopes
    h00, h10 = (1 + 2 * x) * (1 - x) ** 2, x * (1 - x) ** 2
    h01, h11 = x * x * (3 - 2 * x), x * x * (x - 1)
    ta = length / max(float(a.tangent @ border), 0.3)
    tb = length / max(float(b.tangent @ border), 0.3)
    scaled = h00 * a.scaled + h01 * b.scaled + h10 * ta * a.tangent + h11 * tb * b.tangent
    slopes = h00 * a.slopes + h01 * b.slopes + h10 * ta * a.slopes_rate + h11 * tb * b.slopes_rate
    unknowns = scaled * walker.scale
    walker.place(unknowns[6], unknowns[:6], slopes)
    if not walker.correct(border, float(border @ a.scaled) + fraction * length):
        return None
    return walker.spot(a.tangent)


def _bracket(
    walker: Walker, here: Spot, there: Spot, test: Callable[[Spot], float]
) -> tuple[Spot, Spot]:
    """Shrink the step on which ``test`` changes sign; the better end first.

    Illinois' rule, with bisection whenever it stops gaining; ends when the parameter of the two
    ends agrees to ``precision`` and their distance to its square root, or when rounding stops it.
    """
    a, b = here, there
    fa, fb = test(a), test(b)
    weight_a, weight_b = fa, fb
    precision = walker.options.precision
    for step in range(_MOST_STEPS):
        gap = abs(a.parameter - b.parameter)
        width = float(np.linalg.norm(a.scaled - b.scaled))
        if gap <= precision and width <= np.sqrt(precision) * 0.1:
            break
        fraction = weight_a / (weight_a - weight_b)
        if step % 4 == 3 or not 0.0 < fraction < 1.0:
            fraction = 0.5
        fraction = min(max(fraction, 1e-3), 1.0 - 1e-3)
        middle = _between(walker, a, b, fraction)
        if middle is None and fraction != 0.5:
            middle = _between(walker, a, b, 0.5)
        if middle is None:
            break
        fm = test(middle)
        if fm == 0.0:
            return middle, middle
        if fm * fa > 0.0:
            a, fa, weight_a = middle, fm, fm
            weight_b *= 0.5
        else:
            b, fb, weight_b = middle, fm, fm
            weight_a *= 0.5
    return (a, b) if abs(fa) <= abs(fb) else (b, a)


def _crossed(walker: Walker, first: float, second: float, marks: Sequence[float]) -> list[float]:
    """Marked values (modulo the period) passed from one value of the parameter to another."""
    low, high = sorted((first, second))
    period = walker.active.period
    values: list[float] = []
    for mark in marks:
        if period is None:
            if low < mark <= high:
                values.append(float(mark))
            continue
        k = int(np.floor((low - mark) / period)) + 1
        while mark + k * period <= high:
            values.append(mark + k * period)
            k += 1
    return values if first <= second else values[::-1]


def _solve_at(walker: Walker, first: Spot, second: Spot, value: float) -> Spot | None:
    """The solution at a value of the parameter between two spots."""
    a, b = first, second
    for _ in range(_MOST_STEPS):
        change = b.parameter - a.parameter
        fraction = (value - a.parameter) / change if change != 0.0 else 0.5
        walker.place(
            value,
            a.loads + fraction * (b.loads - a.loads),
            a.slopes + fraction * (b.slopes - a.slopes),
        )
        if walker.at_parameter(value):
            spot = walker.spot(None)
            distance = np.linalg.norm(spot.scaled - a.scaled)
            if distance < 1.5 * np.linalg.norm(b.scaled - a.scaled):
                if spot.tangent @ first.tangent < 0.0:
                    spot = walker.spot(first.tangent)
                return spot
        middle = _between(walker, a, b, 0.5)
        if middle is None:
            return None
        if (middle.parameter - value) * (a.parameter - value) > 0.0:
            a = middle
        else:
            b = middle
    return None
