"""Where tilted sampling is centred: the minima of all links, and shapes along their softest mode.

A tilt is a closed shape q* with the Gaussian of the free chain moved there. With K the stiffness
in RT and q^ the ground angles, a chain drawn from it is free-chain distributed with the weight
exp(-E* - g.(q - q*)), g = K (q* - q^), E* its elastic energy (docs/theory/jfactors.md). At an
equilibrium g = -G^T m, so on closed chains the exponent vanishes to first order, and off them it
is m.c, c the closure mismatch.

Along the softest mode of a minimum, usually its register, closed chains spread further than the
tilted Gaussian does, which gives the weights a heavy tail. Closed shapes along that mode, a fixed
number of the Gaussian's standard deviations apart, make a mixture without it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.boundary_kernels import ring_boundary
from dnacheck.equilibria.discrete.kernels.states import (
    evaluate,
    factorise_state,
    jacobian,
    new_factors,
    new_state,
)
from dnacheck.equilibria.discrete.spectrum import ProjectedInverse
from dnacheck.equilibria.ring import Equilibria
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import SolveError

Array = NDArray[np.float64]

_SPACING = 1.5
"""Distance between neighbouring tilts in standard deviations of the tilted Gaussian."""
_SOFT_RATIO = 0.5
"""Projected Hessian over stiffness below which one tilt's weights have no finite variance:
the weights' square times the Gaussian has the inverse covariance 2H - K."""
_WINDOW_RT = 8.0
"""Minima this far above the lowest add less than a part in a thousand to J."""
_REACH_RT = 6.0
_MOST_PER_SIDE = 24
_CURVATURE_LIMIT = 6.0
"""Bound on the curvature of ln J in the mismatch, in its own standard deviations; a zero mode
makes it infinite, and the window is far smaller than one standard deviation."""
EASY_RT = 3.0
"""Energy of the lowest ring below which the free chain meets often enough by itself. Shapes of such
long molecules are far from any minimum, and a mixture about minima would give heavy tails."""
_WIDEST_TURN = 1.5
_WIDEST_MOVE = 0.25
"""Semi-axes of the largest unit window: radians, and a fraction of the contour length."""
_POWER_STEPS = 40
_PROJECTIONS = 12
_CLOSED = 1e-11


@dataclass(frozen=True)
class Linearisation:
    """Closure of a chain in given angles, to first order.

    Attributes
    ----------
    jacobian : ndarray, shape (6, cN)
        End displacement (steps) and rotation (radians) per radian of each angle.
    spread : ndarray, shape (6, 6)
        G K^-1 G^T in RT: covariance of the mismatch of chains drawn about these angles.
    multipliers : ndarray, shape (6,)
        Least-squares m of gradient + G^T m = 0 in the norm of K^-1, in RT; exact at equilibrium.
    curvature : ndarray, shape (6, 6)
        (G H^-1 G^T)^-1 in RT: curvature of the lowest energy in the mismatch.
    """

    jacobian: Array
    spread: Array
    multipliers: Array
    curvature: Array


@dataclass(frozen=True)
class Tilt:
    """One centre of the mixture.

    Attributes
    ----------
    angles : ndarray, shape (N, c)
        Closed shape q* in radians.
    pull : ndarray, shape (N, c)
        g = K (q* - q^) in RT per radian.
    energy_RT : float
    link : int
        Link of the minimum that it belongs to.
    share : float
        Fraction of the draws.
    at_joint : Linearisation
        Closure of the chain cut between its two halves, in the frame of the joint.
    window : ndarray, shape (6, 6)
        Covariance whose ellipsoids are the windows of pairs that meet, see :func:`window_shape`.
    """

    angles: Array
    pull: Array
    energy_RT: float
    link: int
    share: float
    at_joint: Linearisation
    window: Array


def rolled(chain: Chain, angles: Array, joint: int) -> tuple[Array, Array, Array]:
    """Angles, ground and stiffness of the ring cut at base pair ``joint`` instead of the first."""
    return (
        np.ascontiguousarray(np.roll(angles, -joint, axis=0)),
        np.ascontiguousarray(np.roll(chain.ground, -joint, axis=0)),
        np.ascontiguousarray(np.roll(chain.stiffness, -joint, axis=0)),
    )


def linearised_closure(chain: Chain, angles: Array, joint: int = 0) -> Linearisation:
    """Closure, multipliers and curvature of a closed shape (N, c), cut at base pair ``joint``."""
    q, ground, stiffness = rolled(chain, angles, joint)
    steps = chain.arrays._replace(ground=ground, stiffness=stiffness)
    state = new_state(steps, ring_boundary())
    state.angles[:] = q
    evaluate(state, steps)
    rows = np.empty((6, q.size))
    jacobian(state, rows)
    weighted = _flexible(np.asarray(np.linalg.inv(stiffness), dtype=float), rows)
    spread = weighted @ rows.T
    multipliers = -np.linalg.solve(spread, weighted @ state.gradient.ravel())
    factors, small = new_factors(steps), np.empty((6, 7))
    factorise_state(state, steps, 0.0, multipliers, factors, small, state.gradient)
    scale = chain.energy_scale_RT
    return Linearisation(
        jacobian=rows,
        spread=spread / scale,
        multipliers=scale * multipliers,
        curvature=_bounded_curvature(small[:, :6] / scale, spread / scale),
    )


def _flexible(flexibility: Array, rows: Array) -> Array:
    """K^-1 times the rows (6, cN) of a Jacobian."""
    n, c = flexibility.shape[:2]
    turned: Array = np.einsum("sij,rsj->rsi", flexibility, rows.reshape(6, n, c)).reshape(6, -1)
    return turned


def _bounded_curvature(flexibility: Array, spread: Array) -> Array:
    """Inverse of a symmetric (6, 6) with its eigenvalues bounded in units of ``spread``."""
    root = np.linalg.cholesky(spread)
    inverse_root = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(inverse_root @ flexibility @ inverse_root.T)
    floor = 1.0 / _CURVATURE_LIMIT
    sign = np.where(values < 0.0, -1.0, 1.0)
    bounded = sign / np.maximum(np.abs(values), floor)
    whole: Array = inverse_root.T @ (vectors * bounded) @ vectors.T @ inverse_root
    return whole


def _energy_RT(chain: Chain, angles: Array) -> tuple[float, Array]:
    strain = angles - chain.ground
    pull = chain.energy_scale_RT * np.einsum("sij,sj->si", chain.stiffness, strain)
    return 0.5 * float(np.sum(pull * strain)), pull


def close_chain(chain: Chain, angles: Array) -> Array | None:
    """The nearest closed shape in the norm of the stiffness, to first order; None if not found."""
    steps = chain.arrays
    state = new_state(steps, ring_boundary())
    state.angles[:] = angles
    rows = np.empty((6, angles.size))
    flexibility = np.asarray(np.linalg.inv(chain.stiffness), dtype=float)
    for _ in range(_PROJECTIONS):
        evaluate(state, steps)
        if not np.isfinite(state.closure).all():
            return None
        if np.abs(state.closure).max() < _CLOSED * chain.n_steps:
            return state.angles
        jacobian(state, rows)
        weighted = _flexible(flexibility, rows)
        change = np.linalg.solve(weighted @ rows.T, state.closure) @ weighted
        state.angles[:] -= change.reshape(angles.shape)
    return None


def softest_direction(
    chain: Chain, angles: Array, multipliers: Array, guess: Array | None = None
) -> tuple[Array, float]:
    """Softest closed change of shape in the norm of K, and its Hessian over stiffness.

    The direction (N, c) has unit length in that norm (RT): one standard deviation of the free
    Gaussian. Power iteration on the projected inverse Hessian; ``multipliers`` are reduced.
    """
    inverse = ProjectedInverse(chain, angles, multipliers)
    scale = chain.energy_scale_RT
    x = np.random.default_rng(0).standard_normal(angles.shape) if guess is None else guess.copy()
    growth = 1.0
    for _ in range(_POWER_STEPS):
        y = inverse(np.einsum("sij,sj->si", chain.stiffness, x))
        growth = float(np.sum(x * np.einsum("sij,sj->si", chain.stiffness, y))) / float(
            np.sum(x * np.einsum("sij,sj->si", chain.stiffness, x))
        )
        size = float(np.sqrt(scale * np.einsum("si,sij,sj->", y, chain.stiffness, y)))
        if not (np.isfinite(size) and size > 0.0):
            break
        x = y / size
    return x, 1.0 / growth if growth else np.inf


def _distance(chain: Chain, a: Array, b: Array) -> float:
    d = a - b
    return float(np.sqrt(chain.energy_scale_RT * np.einsum("si,sij,sj->", d, chain.stiffness, d)))


def _walk(chain: Chain, start: Array, direction: Array, ceiling: float, known: list[Array]) -> None:
    """Append closed shapes along the softest mode until the energy or a known shape stops it."""
    q, way = start, direction
    for _ in range(_MOST_PER_SIDE):
        moved = close_chain(chain, q + _SPACING * way)
        if moved is None or _energy_RT(chain, moved)[0] > ceiling:
            return
        if any(_distance(chain, moved, other) < 0.75 * _SPACING for other in known):
            return
        known.append(moved)
        multipliers = linearised_closure(chain, moved).multipliers / chain.energy_scale_RT
        new, _ = softest_direction(chain, moved, multipliers, guess=way)
        along = float(np.einsum("si,sij,sj->", new, chain.stiffness, way))
        q, way = moved, new if along > 0.0 else -new


def centre_shapes(search: Equilibria) -> list[tuple[Array, Array, int]]:
    """Angles (N, c), reduced multipliers (6,) and link of the shapes that sampling starts from.

    They are the minima of the search, and the one ring of a family with a free register that it
    found; a tilt need not be an isolated minimum.

    Raises
    ------
    SolveError
        There is none.
    """
    chain = search.chain
    shapes = [(r.angles, r.multipliers, r.link) for r in search.equilibria if r.stable is not False]
    if not shapes:
        raise SolveError(f"J factor of {chain.name}: {search.reason}", search)
    lowest = min(_energy_RT(chain, shape[0])[0] for shape in shapes)
    return [shape for shape in shapes if _energy_RT(chain, shape[0])[0] < lowest + _WINDOW_RT]


def closing_is_easy(search: Equilibria) -> bool:
    """Whether halves are drawn from the free chain, because closing it costs little."""
    energies = [ring.energy_RT for ring in search.equilibria if ring.stable is not False]
    return min(energies, default=np.inf) < EASY_RT


def window_shape(chain: Chain, spread: Array) -> Array:
    """Covariance (6, 6) of the mismatch that windows follow, cut where linear closure ends.

    The mismatch of chains about a closed shape to first order, ``spread``, grows beyond a turn and
    the contour length in long chains, where it says nothing of how the density of closure varies.
    It is cut in each principal direction at 1.5 rad and, for displacements, a quarter of the
    contour or the spread of a free chain's end, whichever is less.
    """
    flexibility = np.linalg.inv(chain.energy_scale_RT * chain.stiffness)
    bends = float(flexibility[:, 1, 1].mean() + flexibility[:, 2, 2].mean())
    free_end = np.sqrt(4.0 * chain.n_steps / (3.0 * bends))
    move = min(_WIDEST_MOVE * chain.n_steps, free_end)
    scale = np.array([move] * 3 + [_WIDEST_TURN] * 3)
    values, vectors = np.linalg.eigh(spread / np.outer(scale, scale))
    cut: Array = (vectors * np.minimum(values, 1.0)) @ vectors.T * np.outer(scale, scale)
    return cut


def ring_tilts(search: Equilibria, joint: int) -> tuple[Tilt, ...]:
    """Tilts that cover the stable minima of a search, for halves that meet at base pair ``joint``.

    Shares fall with half the energy, so that higher shapes are still sampled. Where closing costs
    little (:func:`closing_is_easy`) the minima alone serve, to shape the windows.

    Raises
    ------
    SolveError
        No stable ring at any link searched.
    """
    chain = search.chain
    shapes = centre_shapes(search)
    lowest = min(_energy_RT(chain, shape[0])[0] for shape in shapes)
    known: list[Array] = [np.array(shape[0]) for shape in shapes]
    links = [shape[2] for shape in shapes]
    for angles, multipliers, link in [] if closing_is_easy(search) else shapes:
        way, ratio = softest_direction(chain, angles, multipliers)
        if not abs(ratio) < _SOFT_RATIO:
            continue
        for side in (1.0, -1.0):
            _walk(chain, angles, side * way, lowest + _REACH_RT, known)
        links += [link] * (len(known) - len(links))
    energies, pulls = zip(*(_energy_RT(chain, q) for q in known), strict=True)
    log_shares = -0.5 * (np.array(energies) - lowest)
    shares = np.exp(log_shares) / np.exp(log_shares).sum()
    closures = [linearised_closure(chain, q, joint) for q in known]
    windows = [window_shape(chain, closure.spread) for closure in closures]
    columns = (known, pulls, energies, links, map(float, shares), closures, windows)
    return tuple(Tilt(*row) for row in zip(*columns, strict=True))
