"""Compiled draws of exactly closed shapes about a register-constrained minimum, and their weights.

Every closed shape on the slice is q* + x + Y y for exactly one x with G x = 0, so integrating over
the slice is integrating over x and summing over the crossings y above it. Each draw counts one
crossing, that of :func:`dnacheck.cyclization.closure.kernels.projection.follow`, with the weight

    exp(-(E(q) - E*) + x^T H x / 2) / |det G(q) Y| * |S(q)| / |S*|

relative to the slice's Laplace value. The other crossings are counted without bias by a probe: a
damped iteration from a random start finds crossing j with an unknown probability p_j, and the
number of further starts until it is found again has the mean 1 / p_j.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from dnacheck.cyclization.closure.kernels.projection import (
    empty_shape,
    follow,
    newton_projection,
    same_solution,
)
from dnacheck.cyclization.laplace.kernels.gaussian import dot, draw_closed
from dnacheck.equilibria.boundary_kernels import Boundary
from dnacheck.equilibria.discrete.kernels.states import link_of

COUNTED = 0
NO_CROSSING = 1
OTHER_SIDE = 2
OTHER_CHART = 3
NO_LINK = -(2**31)

_PROBE_ITERATIONS = 60
_MOST_TRIALS = 1000
_SMALL_WEIGHT = 0.1
"""Crossings lighter than this fraction of the Laplace value survive only with probability
weight / fraction and count that much more, which keeps probes of negligible ones short."""


class SliceCentre(NamedTuple):
    """A register-constrained minimum, and which shapes near it are its own to count.

    Attributes
    ----------
    angles, direction : ndarray, shape (N, c)
        The minimum, and the row of |S| at its register.
    energy, extent : float
        In RT, and |S|.
    link : int
    covered : ndarray, shape (C,)
        Links that have charts of their own.
    rivals : ndarray, shape (R, N, c)
        Other minima of the same link and register; a shape nearer to one of them is theirs.
    boundary : Boundary
    topological : bool
        Whether shapes have a link: the end is that of a ring. Otherwise ``link`` counts turns of
        the total twist from ``turns`` on.
    turns : float
    """

    angles: Any
    direction: Any
    energy: float
    extent: float
    link: int
    covered: Any
    rivals: Any
    boundary: Boundary
    topological: bool
    turns: float


class Probes(NamedTuple):
    """Search for crossings that a draw does not count.

    Attributes
    ----------
    rate : float
        Fraction of draws that are probed; draws whose branch folds always are.
    mean, root : ndarray, shapes (6,), (6, 6)
        Gaussian of the random starts: its mean and lower Cholesky factor.
    """

    rate: float
    mean: Any
    root: Any


class DrawRecord(NamedTuple):
    """What is kept of pairs of draws, filled by :func:`draw_pairs`.

    Attributes
    ----------
    log_weights : ndarray, shape (pairs, 2)
    codes : ndarray, shape (pairs, 2)
        COUNTED or the reason of a zero weight.
    links : ndarray, shape (pairs, 2)
    others : ndarray, shape (pairs, 2)
        Weight of the other crossings, 0 where not probed.
    corrections : ndarray, shape (pairs, 2, 6)
        y.
    strains : ndarray, shape (pairs, 2, N, c) or (0, 2, N, c)
        q - q^ of counted draws, 0 for the others; no pairs, where they are not wanted.
    """

    log_weights: Any
    codes: Any
    links: Any
    others: Any
    corrections: Any
    strains: Any


@njit(cache=True, nogil=True, fastmath={"contract"})
def _energy(angles: Any, ground: Any, stiffness: Any) -> float:
    """Elastic energy (2.3) in the units of ``stiffness``."""
    energy = 0.0
    n, c = angles.shape
    for s in range(n):
        for j in range(c):
            pull = 0.5 * stiffness[s, j, j] * (angles[s, j] - ground[s, j])
            for k in range(j):
                pull += stiffness[s, j, k] * (angles[s, k] - ground[s, k])
            energy += pull * (angles[s, j] - ground[s, j])
    return energy


@njit(cache=True, nogil=True)
def chart_of_link(link: int, covered: Any) -> int:
    """The covered link that counts shapes of ``link``: the nearest of the same parity.

    Chains may pass through themselves, so shapes whose links differ by an even number are
    connected; a link without a chart of its own is counted by its neighbour's. Of two equally
    near the lower one is taken; ``link`` itself if none has its parity.
    """
    best = link
    least = 2**30
    for i in range(covered.shape[0]):
        gap = abs(covered[i] - link)
        if gap % 2 == 0 and gap < least:
            least = gap
            best = covered[i]
    return best


@njit(cache=True, nogil=True)
def _link_and_chart(shape: Any, centre: Any) -> tuple[int, int]:
    """Link of a shape, or what stands for it where the end is free, and who counts the shape."""
    covered = centre.covered
    if centre.topological:
        found = link_of(shape.state)
        return found, chart_of_link(found, covered)
    total = 0.0
    angles = shape.state.angles
    for s in range(angles.shape[0]):
        total += angles[s, 0]
    found = int(round(total / (2.0 * math.pi) - centre.turns))
    nearest = covered[0]
    for i in range(covered.shape[0]):
        if abs(covered[i] - found) < abs(nearest - found):
            nearest = covered[i]
    return found, nearest


@njit(cache=True, nogil=True, fastmath={"contract"})
def _log_weight(
    shape: Any, det: float, quadratic: float, steps: Any, centre: Any
) -> tuple[float, int, int]:
    """Log-weight of a shape, what became of it, and its link."""
    angles = shape.state.angles
    found = dot(centre.direction.reshape(angles.size), angles.reshape(angles.size))
    if not found > 0.0:
        return -math.inf, OTHER_SIDE, NO_LINK
    shape_link, chart = _link_and_chart(shape, centre)
    if chart != centre.link:
        return -math.inf, OTHER_CHART, shape_link
    if centre.rivals.shape[0] > 0:
        own = _distance(angles, centre.angles, steps.stiffness)
        for r in range(centre.rivals.shape[0]):
            if _distance(angles, centre.rivals[r], steps.stiffness) < own:
                return -math.inf, OTHER_CHART, shape_link
    value = centre.energy - _energy(angles, steps.ground, steps.stiffness) + 0.5 * quadratic
    return value - math.log(abs(det)) + math.log(found / centre.extent), COUNTED, shape_link


@njit(cache=True, nogil=True)
def _distance(angles: Any, centre: Any, stiffness: Any) -> float:
    """Squared distance of two shapes in the norm of the stiffness."""
    return 2.0 * _energy(angles, centre, stiffness)


@njit(cache=True, nogil=True, error_model="numpy")
def draw_pairs(rng: Any, steps: Any, centre: Any, factors: Any, probes: Any, record: Any) -> int:
    """Draw antithetic pairs +x, -x about one register-constrained minimum and weigh them.

    Parameters
    ----------
    steps : HingeSteps or RigidSteps, stiffness in RT. centre : SliceCentre.
    factors : SliceFactors, as filled by
        :func:`dnacheck.cyclization.laplace.kernels.register.constrained_minimum`.
    probes : Probes. record : DrawRecord, filled.

    Returns
    -------
    unfinished : probes that reached the bound on trials.
    """
    n, c = centre.angles.shape
    m = c * n
    shape = empty_shape(steps, centre.boundary)
    normals = np.empty((n, c))
    x = np.empty((n, c))
    draw = x.reshape(m)
    flat_centre = centre.angles.reshape(m)
    directions = factors.directions
    y = np.empty(6)
    trial = np.empty(6)
    unfinished = 0
    for pair in range(record.log_weights.shape[0]):
        quadratic = draw_closed(steps, rng, factors, normals, x)
        for side in range(2):
            if side == 1:
                for k in range(m):
                    draw[k] = -draw[k]
            met, det = follow(steps, flat_centre, draw, directions, y, shape)
            weight, code, shape_link = -math.inf, NO_CROSSING, NO_LINK
            if met:
                weight, code, shape_link = _log_weight(shape, det, quadratic, steps, centre)
            record.log_weights[pair, side] = weight
            record.codes[pair, side] = code
            record.links[pair, side] = shape_link
            record.others[pair, side] = 0.0
            for i in range(6):
                record.corrections[pair, side, i] = y[i] if met else math.nan
            if record.strains.shape[0] > 0:
                for s in range(n):
                    for k in range(c):
                        strain = shape.state.angles[s, k] - steps.ground[s, k]
                        record.strains[pair, side, s, k] = strain if code == COUNTED else 0.0
            chance = probes.rate if met else min(1.0, 8.0 * probes.rate)
            if not (chance > 0.0 and rng.random() < chance):
                continue
            # Probe: any crossing but the one counted above.
            _random_start(rng, probes.mean, probes.root, trial)
            code, det = newton_projection(
                steps, flat_centre, draw, 1.0, directions, True, _PROBE_ITERATIONS, trial, shape
            )
            if code < 0 or (met and same_solution(trial, y)):
                continue
            weight, code, shape_link = _log_weight(shape, det, quadratic, steps, centre)
            if weight == -math.inf:
                continue
            survival = min(1.0, math.exp(min(weight, 0.0)) / _SMALL_WEIGHT)
            if rng.random() >= survival:
                continue
            for i in range(6):
                y[i] = trial[i]
            trials = 0
            again = False
            while not again and trials < _MOST_TRIALS:
                trials += 1
                _random_start(rng, probes.mean, probes.root, trial)
                code, det = newton_projection(
                    steps, flat_centre, draw, 1.0, directions, True, _PROBE_ITERATIONS, trial, shape
                )
                again = code >= 0 and same_solution(trial, y)
            if not again:
                unfinished += 1
            record.others[pair, side] = math.exp(weight) * trials / (chance * survival)
    return unfinished


@njit(cache=True, nogil=True)
def _random_start(rng: Any, mean: Any, root: Any, out: Any) -> None:
    """Normal vector (6,) with a mean and a lower Cholesky factor of its covariance."""
    for i in range(6):
        out[i] = mean[i]
    for j in range(6):
        value = rng.standard_normal()
        for i in range(j, 6):
            out[i] += root[i, j] * value
