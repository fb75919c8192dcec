"""Compiled draws of exactly closed shapes about one held ring, with their importance weights.

Every closed shape on the slice is q* + x + Y y for exactly one x with G x = 0, so integrating over
the slice is integrating over x and summing over the crossings y of its fibre. Each draw counts one
crossing, that of :func:`dnacheck.cyclization.closure.kernels.projection.follow`, with the weight

    exp(-(E(q) - E*) + x^T H x / 2) / |det G(q) Y| * |S(q)| / |S*|

relative to the slice's Laplace value. The other crossings are counted without bias by a probe: a
damped iteration from a random start finds crossing j with an unknown probability p_j, and the
number of further starts until it is found again has the mean 1 / p_j.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.cyclization.closure.kernels.projection import follow, newton_fibre, same_solution
from dnacheck.cyclization.laplace.kernels.gaussian import dot, draw_closed
from dnacheck.model.chain_kernels import WEDGE
from dnacheck.numerics.curve_topology import link_of_ring

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


@njit(cache=True, nogil=True, fastmath={"contract"})
def _energy(angles: Any, ground: Any, stiffness: Any) -> float:
    """Elastic energy (2.3) in the units of ``stiffness``."""
    energy = 0.0
    for s in range(angles.shape[0]):
        x0 = angles[s, 0] - ground[s, 0]
        x1 = angles[s, 1] - ground[s, 1]
        x2 = angles[s, 2] - ground[s, 2]
        k = stiffness[s]
        energy += 0.5 * (k[0, 0] * x0 * x0 + k[1, 1] * x1 * x1 + k[2, 2] * x2 * x2)
        energy += k[0, 1] * x0 * x1 + k[0, 2] * x0 * x2 + k[1, 2] * x1 * x2
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


@njit(cache=True, nogil=True, fastmath={"contract"})
def _log_weight(
    angles: Any,
    centres: Any,
    frames: Any,
    det: float,
    quadratic: float,
    stiffness: Any,
    ground: Any,
    direction: Any,
    energy: float,
    extent: float,
    link: int,
    covered: Any,
    centre: Any,
    rivals: Any,
) -> tuple[float, int, int]:
    """Log-weight of a shape, what became of it, and its link."""
    found = dot(direction.reshape(angles.size), angles.reshape(angles.size))
    if not found > 0.0:
        return -math.inf, OTHER_SIDE, NO_LINK
    shape_link = link_of_ring(centres, frames)[0]
    if chart_of_link(shape_link, covered) != link:
        return -math.inf, OTHER_CHART, shape_link
    if rivals.shape[0] > 0:
        own = _distance(angles, centre, stiffness)
        for r in range(rivals.shape[0]):
            if _distance(angles, rivals[r], stiffness) < own:
                return -math.inf, OTHER_CHART, shape_link
    value = energy - _energy(angles, ground, stiffness) + 0.5 * quadratic
    return value - math.log(abs(det)) + math.log(found / extent), COUNTED, shape_link


@njit(cache=True, nogil=True)
def _distance(angles: Any, centre: Any, stiffness: Any) -> float:
    """Squared distance of two shapes in the norm of the stiffness."""
    return 2.0 * _energy(angles, centre, stiffness)


@njit(cache=True, nogil=True, error_model="numpy")
def draw_pairs(
    rng: Any,
    pairs: int,
    stiffness: Any,
    ground: Any,
    form: int,
    centre: Any,
    direction: Any,
    energy: float,
    extent: float,
    link: int,
    covered: Any,
    rivals: Any,
    rows: Any,
    right: Any,
    z: Any,
    root: Any,
    projector: Any,
    schur: Any,
    fibre: Any,
    probe_rate: float,
    probe_mean: Any,
    probe_root: Any,
    log_weights: Any,
    codes: Any,
    links: Any,
    others: Any,
    corrections: Any,
) -> int:
    """Draw antithetic pairs +x, -x about one held ring and weigh them.

    Parameters
    ----------
    stiffness, ground, centre, direction : (N, 3, 3) in RT, (N, 3), (N, 3), (N, 3); the last is
        the row of |S| at the slice's register, ``extent`` its value at the centre.
    covered : (C,), links that have charts of their own. rivals : (R, N, 3), other held rings of
        the same link and register; a shape nearer to one of them is theirs to count.
    rows, right, z, root, projector, schur, fibre : as filled by
        :func:`dnacheck.cyclization.laplace.kernels.register.hold`.
    probe_rate : fraction of draws that are probed for other crossings; draws whose branch folds
        always are. probe_mean, probe_root : (6,), (6, 6), Gaussian of the random starts.
    log_weights, codes, links, others, corrections : (pairs, 2) and, the last, (pairs, 2, 6),
        filled: log-weight, COUNTED or the reason of a zero weight, link, weight of the other
        crossings (0 where not probed), and y.

    Returns
    -------
    unfinished : probes that reached the bound on trials.
    """
    n = centre.shape[0]
    m = 3 * n
    centres = np.empty((n + 1, 3))
    frames = np.empty((n + 1, 3, 3))
    axes = np.empty((n, 3, 3))
    halves = np.empty((n if form != WEDGE else 0, 5, 3))
    jacobian = np.empty((6, m))
    angles = np.empty((n, 3))
    normals = np.empty((n, 3))
    x = np.empty((n, 3))
    draw = x.reshape(m)
    flat_centre = centre.reshape(m)
    y = np.empty(6)
    trial = np.empty(6)
    unfinished = 0
    for pair in range(pairs):
        quadratic = draw_closed(rng, rows, right, z, root, projector, schur, normals, x)
        for side in range(2):
            if side == 1:
                for k in range(m):
                    draw[k] = -draw[k]
            met, det = follow(
                flat_centre, draw, fibre, form, y, angles, centres, frames, axes, halves, jacobian
            )
            log_weights[pair, side] = -math.inf
            codes[pair, side] = NO_CROSSING
            links[pair, side] = NO_LINK
            others[pair, side] = 0.0
            if met:
                weight, code, shape_link = _log_weight(
                    angles,
                    centres,
                    frames,
                    det,
                    quadratic,
                    stiffness,
                    ground,
                    direction,
                    energy,
                    extent,
                    link,
                    covered,
                    centre,
                    rivals,
                )
                log_weights[pair, side] = weight
                codes[pair, side] = code
                links[pair, side] = shape_link
            for i in range(6):
                corrections[pair, side, i] = y[i] if met else math.nan
            chance = probe_rate if met else min(1.0, 8.0 * probe_rate)
            if not (chance > 0.0 and rng.random() < chance):
                continue
            # Probe: any crossing but the one counted above.
            _random_start(rng, probe_mean, probe_root, trial)
            code, det = newton_fibre(
                flat_centre,
                draw,
                1.0,
                fibre,
                form,
                True,
                _PROBE_ITERATIONS,
                trial,
                angles,
                centres,
                frames,
                axes,
                halves,
                jacobian,
            )
            if code < 0 or (met and same_solution(trial, y)):
                continue
            weight, code, shape_link = _log_weight(
                angles,
                centres,
                frames,
                det,
                quadratic,
                stiffness,
                ground,
                direction,
                energy,
                extent,
                link,
                covered,
                centre,
                rivals,
            )
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
                _random_start(rng, probe_mean, probe_root, trial)
                code, det = newton_fibre(
                    flat_centre,
                    draw,
                    1.0,
                    fibre,
                    form,
                    True,
                    _PROBE_ITERATIONS,
                    trial,
                    angles,
                    centres,
                    frames,
                    axes,
                    halves,
                    jacobian,
                )
                again = code >= 0 and same_solution(trial, y)
            if not again:
                unfinished += 1
            others[pair, side] = math.exp(weight) * trials / (chance * survival)
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
