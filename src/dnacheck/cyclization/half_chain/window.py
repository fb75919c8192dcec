"""From pairs of half chains in shells about closure to ln J at vanishing window."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.result import PER_CUBIC_ANGSTROM_IN_MOLAR, LinkShare
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import SolveError
from dnacheck.numerics.statistics import checked_weights, pareto_shape

Array = NDArray[np.float64]

CURVED_SIGMAS = 3.0
"""Standard errors of the difference between parabola and straight line above which the window is
too wide for the line: then the parabola is reported, and the difference bounds its error."""
_BALL_VOLUME = math.pi**3 / 6.0
"""Of the unit ball in six dimensions."""


@dataclass(frozen=True)
class Window:
    """The estimate from one window: ``radius`` as in the options, ln J, its error and pairs."""

    radius: float
    log_j: float
    stderr: float
    pairs: int


@dataclass(frozen=True)
class HalfChainEstimate:
    """ln J (mol/L) at vanishing window and how it was reached.

    Attributes
    ----------
    log_j, stderr : float
        Extrapolated with a straight line in the squared radius.
    curved_log_j, curved_stderr : float
        The same with a parabola.
    bias, bias_stderr : float
        Difference of the two and its own standard error.
    windows : tuple of Window
        Estimates without extrapolation.
    links : tuple of LinkShare
        By the extrapolation that :attr:`curved` selects.
    pairs : int
    effective_halves : float
        (sum h)^2 / sum h^2, h what one half adds; the smaller of the two sides.
    largest_share : float
        Largest part of J that one half carries.
    pareto_shape : float or None
        Tail shape of what the halves add, the larger of the two sides.
    tilts : int
    """

    log_j: float
    stderr: float
    curved_log_j: float
    curved_stderr: float
    bias: float
    bias_stderr: float
    windows: tuple[Window, ...]
    links: tuple[LinkShare, ...]
    pairs: int
    effective_halves: float
    largest_share: float
    pareto_shape: float | None
    tilts: int

    @property
    def curved(self) -> bool:
        """Whether the window is too wide for the straight line."""
        return abs(self.bias) > CURVED_SIGMAS * self.bias_stderr

    @property
    def best(self) -> tuple[float, float]:
        """ln J and its standard error by the line, or by the parabola where the line is not enough.

        In 5,000 base pairs the line errs by twice the difference of the two.
        """
        if self.curved:
            return self.curved_log_j, self.curved_stderr
        return self.log_j, self.stderr


@dataclass(frozen=True)
class PairSums:
    """Weights of the pairs that met.

    Attributes
    ----------
    table : ndarray, shape (A, B, links, shells)
        Sums over the pairs of first batch a and second batch b, by link and shell.
    counts : ndarray, shape (shells,)
        Number of pairs.
    rows, columns : ndarray, shape (halves,)
        Sums over the partners of each first and each second half.
    """

    table: Array
    counts: NDArray[np.int64]
    rows: Array
    columns: Array


def polynomial_weights(shells: int, degree: int) -> Array:
    """Weights (shells,) that extrapolate densities in shells of a 6-ball to its centre.

    Shells have equal width in s = (distance / radius)^2; applied to the numbers counted in the
    shells over the ball's volume, they give the value at s = 0 of the polynomial in s fitted by
    least squares, with the variance of counting (inverse to the shells' volumes).
    """
    edges = np.linspace(0.0, 1.0, shells + 1)
    volumes = np.diff(edges**3)
    middles = 0.75 * np.diff(edges**4) / volumes
    powers = middles[:, None] ** np.arange(degree + 1)
    coefficients = np.linalg.solve(powers.T @ (volumes[:, None] * powers), np.eye(degree + 1)[0])
    weights: Array = powers @ coefficients
    return weights


def crossed_error(table: Array) -> float:
    """Standard error of the mean of a table (A, B) of statistics of independent sets.

    Entry (a, b) belongs to first set a and second set b; rows and columns share sets, so the
    variance is that of a random crossed layout: (row + column - residual mean squares) / AB.
    """
    a, b = table.shape
    mean = table.mean()
    rows = table.mean(axis=1) - mean
    columns = table.mean(axis=0) - mean
    rest = table - mean - rows[:, None] - columns[None, :]
    row_square = b * np.sum(rows**2) / (a - 1)
    column_square = a * np.sum(columns**2) / (b - 1)
    rest_square = np.sum(rest**2) / ((a - 1) * (b - 1))
    least = max(row_square, column_square)
    return math.sqrt(max(row_square + column_square - rest_square, least) / (a * b))


def window_estimate(
    chain: Chain,
    sums: PairSums,
    links: list[int],
    tilts: int,
    per_batch: int,
    radius: float,
    fractions: tuple[float, ...],
) -> HalfChainEstimate:
    """ln J at vanishing window from the weights in its shells.

    Parameters
    ----------
    links : link of each entry of the sums' third index.
    tilts : how many tilts were in use, reported only.
    per_batch : halves in each batch.
    radius, fractions : largest window, and the windows reported as fractions of it.

    Raises
    ------
    SolveError
        No pair met.
    """
    shells = len(sums.counts)
    if not sums.counts.any():
        raise SolveError(
            f"half chains of {chain.name}: none of {per_batch * sums.table.shape[0]} squared pairs "
            "met; draw more halves, widen the window, or tilt"
        )
    unit = math.log(PER_CUBIC_ANGSTROM_IN_MOLAR) - 3.0 * math.log(chain.rise_A)
    volume = _BALL_VOLUME * radius**6
    by_link = sums.table / (per_batch**2 * volume)
    table = by_link.sum(axis=2)

    def logarithm(values: Array) -> tuple[float, float]:
        mean = float(values.mean())
        if not mean > 0.0:
            return -math.inf, math.inf
        return math.log(mean) + unit, crossed_error(values) / mean

    line, curve = polynomial_weights(shells, 1), polynomial_weights(shells, 2)
    log_j, stderr = logarithm(table @ line)
    curved, curved_stderr = logarithm(table @ curve)
    difference = table @ (curve - line)
    mean = float((table @ line).mean())
    bias, bias_stderr = float(difference.mean()) / mean, crossed_error(difference) / abs(mean)
    chosen = curve if abs(bias) > CURVED_SIGMAS * bias_stderr else line
    windows = []
    for fraction in fractions:
        inside = max(round(fraction**2 * shells), 1)
        value, error = logarithm(table[:, :, :inside].sum(axis=2) / (inside / shells) ** 3)
        size = radius * math.sqrt(inside / shells)
        windows.append(Window(size, value, error, int(sums.counts[:inside].sum())))
    shares = [
        LinkShare(link, -value, error)
        for link, (value, error) in zip(
            links, (logarithm(by_link[:, :, i] @ chosen) for i in range(len(links))), strict=True
        )
        if math.isfinite(value)
    ]
    sides = (sums.rows, sums.columns)
    tails = [pareto_shape(checked_weights(side)) for side in sides]
    known = [tail for tail in tails if tail is not None]
    return HalfChainEstimate(
        log_j=log_j,
        stderr=stderr,
        curved_log_j=curved,
        curved_stderr=curved_stderr,
        bias=bias,
        bias_stderr=bias_stderr,
        windows=tuple(windows),
        links=tuple(sorted(shares, key=lambda share: share.minus_lnJ)),
        pairs=int(sums.counts.sum()),
        effective_halves=min(float(s.sum() ** 2 / np.square(s).sum()) for s in sides),
        largest_share=max(float(s.max() / s.sum()) for s in sides),
        pareto_shape=max(known) if known else None,
        tilts=tilts,
    )
