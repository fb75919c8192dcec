"""Means of positive weights: errors, effective samples, heavy tails."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

HEAVY_PARETO_SHAPE = 0.7
"""Tail shape above which the variance of a mean cannot be estimated from the sample: Vehtari,
Simpson, Gelman, Yao & Gabry, Pareto smoothed importance sampling (2015-2024)."""
_LEAST_TAIL = 5


@dataclass(frozen=True)
class WeightSummary:
    """Mean of importance weights, on a logarithmic scale.

    Attributes
    ----------
    log_mean : float
        ln of the mean weight, -inf if all are zero.
    stderr : float
        Standard error of the mean over the mean, for independent weights.
    effective_samples : float
        (sum w)^2 / sum w^2.
    largest_share : float
        Largest weight over their sum.
    pareto_shape : float or None
        Shape k of the upper tail, see :func:`pareto_shape`.
    """

    log_mean: float
    stderr: float
    effective_samples: float
    largest_share: float
    pareto_shape: float | None

    @property
    def heavy(self) -> bool:
        """Whether the tail forbids to trust the standard error."""
        return self.pareto_shape is not None and self.pareto_shape > HEAVY_PARETO_SHAPE

    @property
    def unseen(self) -> float:
        """Expected part of the mean that lies in the tail beyond the largest weight drawn.

        About one draw in as many as were made exceeds the largest, and a tail of shape k is then
        larger by 1 / (1 - k) on average. Counted where the variance is in doubt, k > 1/2; infinite
        where the mean is, k >= 1.
        """
        if self.pareto_shape is None or self.pareto_shape <= 0.5:
            return 0.0
        return self.largest_share / (1.0 - self.pareto_shape) if self.pareto_shape < 1 else math.inf


def checked_log_weights(log_weights: ArrayLike) -> Array:
    """Log-weights as an array; -inf (a weight of zero) is allowed.

    Raises
    ------
    InputError
        A weight is NaN or infinite, or there is none.
    """
    values = np.asarray(log_weights, dtype=float).ravel()
    if values.size == 0:
        raise InputError("a mean weight needs at least one weight")
    bad = np.isnan(values) | (values == math.inf)
    if bad.any():
        place = int(np.argmax(bad))
        raise InputError(f"log-weight {place} is {values[place]}; weights must be finite numbers")
    return values


def checked_weights(weights: ArrayLike) -> Array:
    """Logarithms of weights.

    Raises
    ------
    InputError
        A weight is negative, NaN or infinite, or there is none.
    """
    values = np.asarray(weights, dtype=float).ravel()
    bad = ~(values >= 0.0) | ~np.isfinite(values)
    if bad.any():
        place = int(np.argmax(bad))
        raise InputError(
            f"weight {place} is {values[place]}; weights must be finite and not negative"
        )
    with np.errstate(divide="ignore"):
        return checked_log_weights(np.log(values))


def summarise_weights(log_weights: ArrayLike) -> WeightSummary:
    """Mean of independent weights given by their logarithms, with its error and diagnostics.

    Raises
    ------
    InputError
        See :func:`checked_log_weights`.
    """
    values = checked_log_weights(log_weights)
    top = float(values.max())
    if top == -math.inf:
        return WeightSummary(-math.inf, math.inf, 0.0, 0.0, None)
    weights = np.exp(values - top)
    mean = float(weights.mean())
    spread = float(weights.std(ddof=1)) if weights.size > 1 else math.inf
    return WeightSummary(
        log_mean=top + math.log(mean),
        stderr=spread / (mean * math.sqrt(weights.size)),
        effective_samples=float(weights.sum() ** 2 / np.square(weights).sum()),
        largest_share=float(weights.max() / weights.sum()),
        pareto_shape=pareto_shape(values),
    )


def pareto_shape(log_weights: ArrayLike) -> float | None:
    """Shape k of a generalised Pareto distribution fitted to the largest weights.

    The tail holds the largest min(n / 5, 3 sqrt(n)) weights; the fit is the quasi-Bayesian one of
    Zhang & Stephens, Technometrics 51, 316 (2009), with the shrinkage towards 0.5 of Vehtari et
    al. None if the tail has fewer than five different weights.
    """
    values = checked_log_weights(log_weights)
    n = values.size
    size = int(min(n / 5.0, 3.0 * math.sqrt(n)))
    if size < _LEAST_TAIL:
        return None
    ordered = np.sort(values)
    cut = ordered[-size - 1]
    if cut == -math.inf:
        return None
    top = ordered[-1]
    excess = np.exp(ordered[-size:] - top) - math.exp(cut - top)
    excess = excess[excess > 0.0]
    if np.unique(excess).size < _LEAST_TAIL:
        return None
    m = excess.size
    trials = 30 + int(math.sqrt(m))
    quartile = excess[int(m / 4.0 + 0.5) - 1]
    theta = 1.0 / excess[-1] + (1.0 - np.sqrt(trials / (np.arange(1, trials + 1) - 0.5))) / (
        3.0 * quartile
    )
    shapes = np.log1p(-theta[:, None] * excess).mean(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        likelihood = m * (np.log(-theta / shapes) - shapes - 1.0)
    likelihood = np.where(np.isfinite(likelihood), likelihood, -math.inf)
    weight = np.exp(likelihood - likelihood.max())
    best = float(np.sum(theta * weight) / weight.sum())
    shape = float(np.log1p(-best * excess).mean())
    return (shape * m + 0.5 * 10.0) / (m + 10.0)


def batch_error(batch_values: ArrayLike) -> float:
    """Standard error of the mean of independent batch values.

    Raises
    ------
    InputError
        Fewer than two batches.
    """
    values = np.asarray(batch_values, dtype=float).ravel()
    if values.size < 2:
        raise InputError("an error from batches needs at least two batches")
    return float(values.std(ddof=1) / math.sqrt(values.size))
