"""Compiled ln J of one molecule for less than a sample of closed shapes costs, for many of them.

Register-constrained minima are followed over a coarse grid of registers about every minimum, which
integrates Laplace's J over the register (:mod:`dnacheck.cyclization.laplace.register`); a few
antithetic pairs of exactly closed shapes, spread over those registers by their Laplace weights,
multiply it with their mean weight (:mod:`dnacheck.cyclization.closure.sampling`). The normal
numbers of the pairs are given, so that the result depends on nothing else, and molecules of one
length are compared with common random numbers.

What the sampler checks and this leaves out: that a draw keeps the parity of its link, and shapes
beyond the crossing that is counted.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from dnacheck.cyclization.closure.kernels.projection import empty_shape, follow
from dnacheck.cyclization.laplace.kernels.gaussian import ROWS, SliceFactors, closed_of_normals
from dnacheck.cyclization.laplace.kernels.register import (
    CLOSED,
    ENERGY,
    EXTENT,
    FOUND,
    LOG_DET_KKT,
    N_FIGURES,
    SLOPE,
    RegisterProblem,
    constrained_minimum,
)
from dnacheck.equilibria.boundary_kernels import ring_boundary
from dnacheck.equilibria.discrete.kernels.registers import (
    register_of,
    register_rows,
    wrapped,
)
from dnacheck.model.chain_kernels import is_bound

# Positions of the figures of quick_log_j.
LOG_J, REGISTER_LOG_J, STDERR, FOLDED, SPREAD = range(5)
N_QUICK_FIGURES = 5

_SAME_SHAPE = 0.02
"""Two minima of one register are one when no angle differs by more, in radians."""
_PROBE = 0.2
"""Radians from a minimum at which the slope of the energy tells how far the register spreads."""
_SUBDIVISIONS = 2
_CLOSED = 1e-4
"""Closure residual of a register-constrained minimum, which moves its energy by 1e-3 RT."""
_ITERATIONS = 10


class KnownMinima(NamedTuple):
    """Minima of one molecule.

    Attributes
    ----------
    angles : ndarray, shape (M, N, c)
    multipliers : ndarray, shape (M, 6)
        In RT and RT per step.
    links : ndarray, shape (M,)
    """

    angles: Any
    multipliers: Any
    links: Any


class QuickLimits(NamedTuple):
    """How coarsely the register is covered, and the numbers that pairs are drawn with.

    Attributes
    ----------
    normals : ndarray, shape (P, N, c)
        Standard normal numbers; no pairs leave the register integral.
    constant : float
        ln J(psi) = constant - E - ln det KKT / 2 + ln |S|, see
        :class:`dnacheck.cyclization.laplace.constrained_minimum.Constrainer`.
    spacing : float
        Of registers in standard deviations of the register.
    fewest, most : int
        Registers on the circle.
    depth : float
        Registers whose density lies below the largest by exp(-depth) are left out.
    tolerance : float
        Of the gradient of a register-constrained minimum, RT per radian.
    """

    normals: Any
    constant: float
    spacing: float
    fewest: int
    most: int
    depth: float
    tolerance: float


class _Chart(NamedTuple):
    """Room for register-constrained minima: S slices."""

    angles: Any
    multipliers: Any
    links: Any
    positions: Any
    log_masses: Any
    figures: Any
    registers: Any


@njit(cache=True, nogil=True)
def _empty_chart(room: int, n: int, width: int) -> _Chart:
    return _Chart(
        np.empty((room, n, width)),
        np.empty((room, ROWS)),
        np.empty(room, np.int64),
        np.empty(room, np.int64),
        np.empty(room),
        np.empty((room, N_FIGURES)),
        np.empty(room),
    )


@njit(cache=True, nogil=True)
def empty_factors(n: int, width: int) -> SliceFactors:
    """Room for the Gaussian about one register-constrained minimum."""
    return SliceFactors(
        np.empty((ROWS, width * n)),
        np.empty((n, width, ROWS)),
        np.empty((n, width, ROWS)),
        np.empty((n, width * (width + 1) // 2)),
        np.empty((ROWS, width * n)),
        np.empty((ROWS, ROWS)),
        np.empty((6, width * n)),
    )


@njit(cache=True, nogil=True)
def _is_known(chart: _Chart, count: int, link: int, position: int, angles: Any) -> bool:
    """Whether one of the first ``count`` slices is this shape."""
    for s in range(count):
        if chart.links[s] != link or chart.positions[s] != position:
            continue
        worst = 0.0
        for i in range(angles.shape[0]):
            for j in range(angles.shape[1]):
                worst = max(worst, abs(chart.angles[s, i, j] - angles[i, j]))
        if worst < _SAME_SHAPE:
            return True
    return False


@njit(cache=True, nogil=True)
def _keep(chart: _Chart, count: int, place: Any, work: Any, constant: float) -> None:
    """Write a slice at ``count``; ``place`` is its register, link and position."""
    q, m, figure, _ = work
    chart.angles[count] = q
    chart.multipliers[count] = m
    chart.figures[count] = figure
    chart.registers[count], chart.links[count], chart.positions[count] = place
    chart.log_masses[count] = (
        constant - figure[ENERGY] - 0.5 * figure[LOG_DET_KKT] + math.log(figure[EXTENT])
    )


@njit(cache=True, nogil=True)
def _predict(chart: _Chart, place: Any, shift: float, extrapolate: bool, q: Any, m: Any) -> None:
    """A molecule rolled by ``shift`` radians from slice ``place[0]``, into ``q`` and ``m``.

    Rolling multiplies the bends -theta + i phi with exp(i shift) and turns force and moment about
    the axis of the first base pair; what is left, the molecule's own bends, is extrapolated from
    slice ``place[1]``, rolled here.
    """
    here, before = place
    c, sn = math.cos(shift), math.sin(shift)
    ahead, back_c, back_s = 0.0, 1.0, 0.0
    if extrapolate and before >= 0:
        gap = chart.registers[here] - chart.registers[before]
        ahead, back_c, back_s = shift / gap, math.cos(gap), math.sin(gap)
    for s in range(q.shape[0]):
        x, y = -chart.angles[here, s, 1], chart.angles[here, s, 2]
        q[s, 0] = chart.angles[here, s, 0]
        if ahead != 0.0:
            u, v = -chart.angles[before, s, 1], chart.angles[before, s, 2]
            q[s, 0] += ahead * (q[s, 0] - chart.angles[before, s, 0])
            x, y = (
                x + ahead * (x - (back_c * u - back_s * v)),
                y + ahead * (y - (back_s * u + back_c * v)),
            )
        q[s, 1], q[s, 2] = -(c * x - sn * y), sn * x + c * y
    for i in (0, 3):
        x, y = chart.multipliers[here, i], chart.multipliers[here, i + 1]
        m[i + 2] = chart.multipliers[here, i + 2]
        if ahead != 0.0:
            u, v = chart.multipliers[before, i], chart.multipliers[before, i + 1]
            m[i + 2] += ahead * (m[i + 2] - chart.multipliers[before, i + 2])
            x, y = (
                x + ahead * (x - (back_c * u - back_s * v)),
                y + ahead * (y - (back_s * u + back_c * v)),
            )
        m[i], m[i + 1] = c * x - sn * y, sn * x + c * y
    m[6] = chart.multipliers[here, 6]
    if ahead != 0.0:
        m[6] += ahead * (m[6] - chart.multipliers[before, 6])


@njit(cache=True, nogil=True)
def _moved(
    steps: Any, problem: RegisterProblem, chart: _Chart, place: Any, shift: float, work: Any
) -> bool:
    """The minimum ``shift`` radians from slice ``place[0]``, extrapolated from ``place[1]``."""
    q, m, figure, factors = work
    here = place[0]
    for pieces in range(1, _SUBDIVISIONS + 1):
        _predict(chart, place, shift / pieces if pieces > 1 else shift, pieces == 1, q, m)
        reached = True
        for piece in range(pieces):
            at = chart.registers[here] + shift * (piece + 1) / pieces
            aim = RegisterProblem(
                problem.inverse_stiffness, problem.along, problem.across, at,
                problem.tolerance, problem.closed, problem.most, problem.boundary,
            )  # fmt: skip
            code = constrained_minimum(steps, aim, q, m, factors, figure)
            reached = code == FOUND and figure[EXTENT] > 0.0
            if not reached:
                break
        if reached:
            return True
    return False


@njit(cache=True, nogil=True)
def _walk(
    steps: Any, problem: RegisterProblem, chart: _Chart, first: int, count: int,
    circle: Any, limits: QuickLimits, work: Any,
) -> int:  # fmt: skip
    """Follow the branch of slice ``first`` both ways; returns the new number of slices.

    ``circle`` holds the number of registers and how far a register's density may lie below that
    of ``first``; slice ``count`` itself, if it is that of the probe, helps to extrapolate.
    """
    registers, floor, before = circle
    q = work[0]
    link = chart.links[first]
    width = 2.0 * math.pi / registers
    for way in (1, -1):
        here = first
        for _ in range(registers):
            if count >= chart.links.shape[0] - 1:
                break
            last = chart.log_masses[here]
            # A Gaussian's logarithm falls from step to step by one, three, five ... times the
            # first fall, which says without a solve that the next register is not needed.
            if last < floor:
                break
            if here != first:
                away = abs(chart.registers[here] - chart.registers[first]) / width
                fall = (chart.log_masses[first] - last) * ((away + 1.0) / away) ** 2
                if chart.log_masses[first] - fall < floor:
                    break
            if not _moved(steps, problem, chart, (here, before), way * width, work):
                break
            position = (chart.positions[here] + way) % registers
            if _is_known(chart, count, link, position, q):
                break
            register = chart.registers[here] + way * width
            _keep(chart, count, (register, link, position), work, limits.constant)
            before, here = here, count
            count += 1
        before = first + 1 if count > first + 1 else -1
    return count


@njit(cache=True, nogil=True)
def _cover_link(
    steps: Any, flexibility: Any, minima: KnownMinima, link: int, limits: QuickLimits,
    chart: _Chart, count: int, best: float, factors: Any,
) -> tuple[int, float]:  # fmt: skip
    """Slices of one link; returns the new number of slices and the first minimum's spread.

    ``best`` is the largest logarithm of a density per radian so far.
    """
    along, across = np.empty(steps.ground.shape), np.empty(steps.ground.shape)
    register_rows(steps, float(link), along, across)
    q, m, figure = np.empty(steps.ground.shape), np.zeros(ROWS), np.empty(N_FIGURES)
    work = (q, m, figure, factors)
    began = count
    origin, width, registers, spread = 0.0, 0.0, 0, math.inf
    for k in range(minima.links.shape[0]):
        if minima.links[k] != link or count >= chart.links.shape[0] - 1:
            continue
        q[:] = minima.angles[k]
        m[:6] = minima.multipliers[k]
        m[6] = 0.0
        register, _ = register_of(q, along, across)
        position = 0
        if registers > 0:
            position = int(round((register - origin) / width)) % registers
            register += wrapped(origin + position * width - register)
        problem = RegisterProblem(
            flexibility,
            along,
            across,
            register,
            limits.tolerance,
            _CLOSED,
            _ITERATIONS,
            ring_boundary(),
        )
        code = constrained_minimum(steps, problem, q, m, factors, figure)
        if code != FOUND or not figure[EXTENT] > 0.0:
            continue
        if registers > 0 and _is_known(chart, count, link, position, q):
            continue
        _keep(chart, count, (register, link, position), work, limits.constant)
        if chart.log_masses[count] < best - limits.depth:
            continue
        best = max(best, chart.log_masses[count])
        before = -1
        if registers == 0:
            origin = register
            curvature = 0.0
            if _moved(steps, problem, chart, (count, -1), _PROBE, work):
                # Kept beyond the last slice, where nothing else is written.
                before = chart.links.shape[0] - 1
                _keep(chart, before, (register + _PROBE, link - 1, 0), work, limits.constant)
                curvature = (figure[SLOPE] - chart.figures[count, SLOPE]) / _PROBE
            spread = 1.0 / math.sqrt(curvature) if curvature > 0.0 else math.inf
            wide = min(limits.spacing * spread, 2.0 * math.pi / limits.fewest)
            registers = min(int(math.ceil(2.0 * math.pi / wide)), limits.most)
            width = 2.0 * math.pi / registers
        circle = (registers, best - limits.depth, before)
        count = _walk(steps, problem, chart, count, count + 1, circle, limits, work)
    for s in range(began, count):
        chart.log_masses[s] += math.log(width)
    return count, spread


@njit(cache=True, nogil=True)
def _is_nearest(chart: _Chart, count: int, own: int, angles: Any, stiffness: Any) -> bool:
    """Whether no other slice of the same register is nearer in the norm of the stiffness."""
    for r in range(count):
        if (
            r == own
            or chart.links[r] != chart.links[own]
            or chart.positions[r] != chart.positions[own]
        ):
            continue
        gap = 0.0
        for s in range(angles.shape[0]):
            if is_bound(stiffness, s):
                continue
            for i in range(angles.shape[1]):
                for j in range(angles.shape[1]):
                    a = angles[s, i] - chart.angles[r, s, i]
                    b = angles[s, j] - chart.angles[r, s, j]
                    c = angles[s, i] - chart.angles[own, s, i]
                    d = angles[s, j] - chart.angles[own, s, j]
                    gap += stiffness[s, i, j] * (a * b - c * d)
        if gap < 0.0:
            return False
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def quick_log_j(
    steps: Any, flexibility: Any, minima: KnownMinima, limits: QuickLimits, figures: Any
) -> bool:
    """ln J (mol/L) from the minima of a molecule.

    Parameters
    ----------
    steps : HingeSteps or RigidSteps, stiffness in RT. flexibility : (N, c, c), its inverses.
    minima : KnownMinima, lowest first within a link. limits : QuickLimits.
    figures : (5,), filled with ln J; ln J by the register integral alone; the standard error of
        the mean weight; the part of the draws that reach no closed shape; and the standard
        deviation of the register at the first minimum, in radians.

    Returns
    -------
    found : whether there is a value.
    """
    n, width = steps.ground.shape
    pairs = limits.normals.shape[0]
    figures[:] = math.nan
    chart = _empty_chart(4 * limits.most, n, width)
    factors = empty_factors(n, width)
    count = 0
    best = -math.inf
    for k in range(minima.links.shape[0]):
        seen = False
        for j in range(k):
            seen = seen or minima.links[j] == minima.links[k]
        if seen:
            continue
        count, spread = _cover_link(
            steps, flexibility, minima, minima.links[k], limits, chart, count, best, factors
        )
        # Per radian; the width of a link's registers is at most a radian.
        if count > 0:
            best = max(best, chart.log_masses[:count].max())
        if k == 0:
            figures[SPREAD] = spread
    if count == 0:
        return False
    masses = chart.log_masses[:count]
    top = masses.max()
    total = np.exp(masses - top).sum()
    figures[REGISTER_LOG_J] = top + math.log(total)
    figures[LOG_J], figures[STDERR], figures[FOLDED] = figures[REGISTER_LOG_J], 0.0, 0.0
    if pairs == 0:
        return True
    boundary = ring_boundary()
    shape = empty_shape(steps, boundary)
    angles = shape.state.angles
    along, across = np.empty((n, width)), np.empty((n, width))
    q, m = np.empty((n, width)), np.empty(ROWS)
    figure = np.empty(N_FIGURES)
    x, y = np.empty((n, width)), np.empty(6)
    draw, centre = x.reshape(width * n), q.reshape(width * n)
    first, second, folded = 0.0, 0.0, 0
    pair, passed = 0, 0.0
    for s in range(count):
        passed += math.exp(masses[s] - top) / total
        if not (pair < pairs and (pair + 0.5) / pairs < passed):
            continue
        register_rows(steps, float(chart.links[s]), along, across)
        q[:] = chart.angles[s]
        m[:] = chart.multipliers[s]
        problem = RegisterProblem(
            flexibility, along, across, chart.registers[s], 1e-3, CLOSED, 20, boundary
        )
        usable = constrained_minimum(steps, problem, q, m, factors, figure) == FOUND
        c, sn = math.cos(chart.registers[s]), math.sin(chart.registers[s])
        while pair < pairs and (pair + 0.5) / pairs < passed:
            quadratic = closed_of_normals(steps, factors, limits.normals[pair], x)
            weight = 0.0
            for side in range(2):
                if side == 1:
                    for k in range(width * n):
                        draw[k] = -draw[k]
                met, det = False, 0.0
                if usable:
                    met, det = follow(steps, centre, draw, factors.directions, y, shape)
                if not met:
                    folded += 1
                    continue
                found, rise = 0.0, 0.0
                for t in range(n):
                    for i in range(width):
                        angle = angles[t, i]
                        found += (c * along[t, i] + sn * across[t, i]) * angle
                        for j in range(0 if is_bound(steps.stiffness, t) else width):
                            rise += (
                                0.5 * (angle - q[t, i]) * steps.stiffness[t, i, j]
                                * (angles[t, j] + q[t, j] - 2.0 * steps.ground[t, j])
                            )  # fmt: skip
                if not found > 0.0:
                    continue
                if not _is_nearest(chart, count, s, angles, steps.stiffness):
                    continue
                weight += 0.5 * math.exp(0.5 * quadratic - rise) / abs(det) * found / figure[EXTENT]
            first += weight
            second += weight * weight
            pair += 1
    mean = first / pairs
    if not (math.isfinite(mean) and mean > 0.0):
        return False
    figures[LOG_J] += math.log(mean)
    variance = max(second / pairs - mean * mean, 0.0) / max(pairs - 1, 1)
    figures[STDERR] = math.sqrt(variance) / mean
    figures[FOLDED] = folded / (2.0 * pairs)
    return True
