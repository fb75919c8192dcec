"""Derivatives of ln J from the draws that gave J.

With E = sum_s (q_s - q^_s).K_s (q_s - q^_s) / 2 in RT and J the density of closure, for every
parameter p of the chain

    d ln J / dp = <dE/dp>_open - <dE/dp>_closed,

and the open averages of a Gaussian are exact, so that

    d ln J / d q^_s = <K_s (q_s - q^_s)>_closed,
    d ln J / d K_s = K_s^-1 / 2 - <(q_s - q^_s)(q_s - q^_s)^T>_closed / 2.

The closed averages are weighted averages over the exactly closed shapes of
:mod:`dnacheck.cyclization.closure.sampling`. Errors come from its batches; a ratio's influence
function gives each batch a value of its own, and a parameter that moves many steps gets its error
from the batches of the chained derivative, correlations between steps included.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.cyclization.closure.method import ClosureSampling
from dnacheck.cyclization.closure.sampling import Draws
from dnacheck.cyclization.method import DEFAULT_TOLERANCE, Run
from dnacheck.cyclization.result import JFactor
from dnacheck.model.chain import Chain
from dnacheck.model.named_parameters import chain_derivatives, own_value
from dnacheck.numerics.outcome import InputError
from dnacheck.numerics.seeds import Randomness
from dnacheck.numerics.statistics import batch_error

if TYPE_CHECKING:
    from dnacheck.cyclization.method import Target

Array = NDArray[np.float64]

_MOST_GROUPS = 64
"""Batches are joined into so many groups at most, which bounds the memory of the derivatives."""


@dataclass(frozen=True, eq=False)
class LogJGradient:
    """Derivatives of ln J with respect to every step's ground values and stiffness.

    Attributes
    ----------
    ground : ndarray, shape (N, d)
        Element (s, i) is d ln J / d q^_si, per radian.
    stiffness : ndarray, shape (N, d, d)
        Element (s, i, j) is d ln J / d K_sij, K in RT per square radian and all elements free, so
        that a symmetric change dK changes ln J by the sum of the products of all elements.
    ground_batches, stiffness_batches : ndarray, shapes (B, N, d), (B, N, d, d)
        Values of independent batches, whose means are the above.
    chain : Chain
    """

    ground: Array
    stiffness: Array
    ground_batches: Array = field(repr=False)
    stiffness_batches: Array = field(repr=False)
    chain: Chain = field(repr=False)

    @property
    def ground_stderr(self) -> Array:
        """Standard errors (N, d) of ``ground``."""
        return _errors(self.ground_batches)

    @property
    def stiffness_stderr(self) -> Array:
        """Standard errors (N, d, d) of ``stiffness``."""
        return _errors(self.stiffness_batches)

    def with_respect_to(self, names: Sequence[str]) -> dict[str, tuple[float, float]]:
        """Derivatives by named parameters at the chain's own values, with standard errors.

        Raises
        ------
        InputError
            The chain has no such parameter.
        """
        values = {name: own_value(self.chain, name) for name in names}
        moves = chain_derivatives(self.chain, list(names), values)
        return {
            name: self.along(moves.ground[i], moves.stiffness[i]) for i, name in enumerate(names)
        }

    def along(
        self, ground: ArrayLike | None = None, stiffness: ArrayLike | None = None
    ) -> tuple[float, float]:
        """Derivative of ln J with respect to a parameter that moves many steps, and its error.

        Parameters
        ----------
        ground : array_like, shape (N, d), optional
            d q^_si / dp in radians.
        stiffness : array_like, shape (N, d, d), optional
            d K_sij / dp in RT.

        Returns
        -------
        value, stderr : float

        Raises
        ------
        InputError
            Another shape.
        """
        values = self.batches_along(ground, stiffness)
        return float(values.mean()), batch_error(values)

    def batches_along(
        self, ground: ArrayLike | None = None, stiffness: ArrayLike | None = None
    ) -> Array:
        """The batches' values (B,) of the derivative of :meth:`along`."""
        total = np.zeros(len(self.ground_batches))
        for name, change, batches in (
            ("ground", ground, self.ground_batches),
            ("stiffness", stiffness, self.stiffness_batches),
        ):
            if change is None:
                continue
            array = np.asarray(change, dtype=float)
            if array.shape != batches.shape[1:]:
                raise InputError(
                    f"derivative of {name} must have the shape {batches.shape[1:]}, "
                    f"not {array.shape}"
                )
            total += batches.reshape(len(total), -1) @ array.ravel()
        return total


def _errors(batches: Array) -> Array:
    errors: Array = batches.std(axis=0, ddof=1) / np.sqrt(len(batches))
    return errors


class Moments:
    """Weighted sums of strains and of their products over groups of batches.

    It is called with each round of draws.
    """

    def __init__(self, chain: Chain) -> None:
        self.chain = chain
        self.stiffness = chain.energy_scale_RT * np.asarray(chain.stiffness)
        n, d = chain.ground.shape
        self.weight = np.zeros(_MOST_GROUPS)
        self.first = np.zeros((_MOST_GROUPS, n, d))
        self.second = np.zeros((_MOST_GROUPS, n, d, d))
        self.batches = 0

    def __call__(self, draws: Draws) -> None:
        group = (self.batches + draws.batch) % _MOST_GROUPS
        self.batches += int(draws.batch.max()) + 1
        order = np.argsort(group, kind="stable")
        present, starts = np.unique(group[order], return_index=True)
        weights = draws.weights[order]
        strains = draws.record.strains[order]
        self.weight[present] += np.add.reduceat(weights.sum(axis=1), starts)
        d = strains.shape[-1]
        # One coordinate at a time: the products of all would be d times the strains' memory.
        for i in range(d):
            left = weights[:, :, None] * strains[..., i]
            self.first[present, :, i] += np.add.reduceat(left.sum(axis=1), starts)
            for j in range(i, d):
                product = np.einsum("psn,psn->pn", left, strains[..., j])
                self.second[present, :, i, j] += np.add.reduceat(product, starts)

    def gradient(self) -> LogJGradient:
        """The derivatives from all rounds so far."""
        used = slice(min(self.batches, _MOST_GROUPS))
        weight, first, second = self.weight[used], self.first[used], self.second[used]
        second = second + np.triu(np.ones(second.shape[-2:]), 1).T * np.swapaxes(second, -1, -2)
        mean_weight = weight.mean()
        share = weight / mean_weight

        def influence(sums: Array) -> Array:
            mean = sums.mean(axis=0) / mean_weight
            shares = share.reshape(-1, *([1] * mean.ndim))
            return mean + sums / mean_weight - shares * mean

        strains = influence(first)
        products = influence(second)
        pulls = np.einsum("sij,bsj->bsi", self.stiffness, strains)
        per_stiffness = 0.5 * (np.linalg.inv(self.stiffness) - products)
        return LogJGradient(
            ground=pulls.mean(axis=0),
            stiffness=per_stiffness.mean(axis=0),
            ground_batches=pulls,
            stiffness_batches=per_stiffness,
            chain=self.chain,
        )


@dataclass(frozen=True, eq=False)
class ClosedDraws:
    """Exactly closed shapes with their weights.

    Attributes
    ----------
    chain : Chain
    result : JFactor
        J, its errors and its diagnosis.
    strains : ndarray, shape (D, N, d)
        q - q^ of each shape in radians.
    weights : ndarray, shape (D,)
        Their sum is 1; a closed average is the sum of the weights times the values.
    batch : ndarray, shape (D,)
        Independent batch of each shape, from 0 to ``batches`` - 1.
    batches : int
    """

    chain: Chain
    result: JFactor
    strains: Array = field(repr=False)
    weights: Array = field(repr=False)
    batch: NDArray[np.int64] = field(repr=False)
    batches: int

    @property
    def log_j(self) -> float:
        """ln J, J in mol/L."""
        return -self.result.minus_lnJ

    @property
    def stderr(self) -> float:
        """Standard error of ln J."""
        return self.result.stderr

    def average(self, values: ArrayLike) -> tuple[Array, Array]:
        """Closed averages of values (D, ...) and their standard errors."""
        x = np.asarray(values, dtype=float)
        mean = np.tensordot(self.weights, x, axes=1)
        sums = np.zeros((self.batches, *x.shape[1:]))
        spread = self.weights.reshape(-1, *([1] * (x.ndim - 1))) * (x - mean)
        np.add.at(sums, self.batch, self.batches * spread)
        return mean, _errors(sums)


def closed_draws(
    target: Target,
    method: ClosureSampling | None = None,
    *,
    rng: Randomness = 0,
    threads: int = 1,
    progress: Callable[[int], None] | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
    max_seconds: float = float("inf"),
) -> ClosedDraws:
    """Exactly closed shapes with weights, drawn until ln J has the asked standard error.

    All shapes are kept, 8 d N bytes each; :class:`Moments` keeps sums only.

    Parameters
    ----------
    target : Chain, Equilibria or RegisterProfile
    method : ClosureSampling, optional
    rng : int, SeedSequence or Generator
        The same number gives the same draws as :meth:`ClosureSampling.compute`.

    Raises
    ------
    SolveError
        No register-constrained minimum, or no draw could be closed.
    """
    run = Run(rng, threads, progress, tolerance, max_seconds)
    sampler = (method or ClosureSampling()).sampler(target, run)
    began = time.perf_counter()
    kept: list[Array] = []

    def keep(draws: Draws) -> None:
        strains = draws.record.strains
        kept.append(strains.reshape(-1, *strains.shape[2:])[draws.weights.ravel() > 0.0])

    draws = sampler.draw(progress, keep)
    result = sampler.result(draws, began)
    weights = draws.weights.ravel()
    counted = weights > 0.0
    return ClosedDraws(
        chain=sampler.profile.chain,
        result=result,
        strains=np.concatenate(kept),
        weights=weights[counted] / weights.sum(),
        batch=np.repeat(draws.batch, 2)[counted],
        batches=int(draws.batch.max()) + 1,
    )
