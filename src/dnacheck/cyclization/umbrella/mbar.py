"""Restrained series joined by MBAR (Shirts & Chodera, J. Chem. Phys. 129, 124105 (2008))."""

from __future__ import annotations

import contextlib
import logging
import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_ZERO_WEIGHT = 1e4
"""Reduced energy that stands for a weight of zero, which pymbar's logarithms cannot take."""


@contextlib.contextmanager
def quiet_pymbar() -> Iterator[Any]:
    """pymbar, without the notes that it prints through its logger about an absent accelerator."""
    loggers = [logging.getLogger(name) for name in ("pymbar", "pymbar.mbar_solvers")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import pymbar
            import pymbar.timeseries

            yield pymbar
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


@dataclass(frozen=True)
class RestrainedSeries:
    """What one copy of a ladder recorded.

    Attributes
    ----------
    squares : ndarray, shape (R, T)
        Twice the restraint's energy over its strength, of every record.
    log_kernels : tuple of ndarray, shape (R, T)
        ln of the functions of closure whose free-chain means are wanted; -inf where they vanish.
    places : ndarray, shape (R, T)
        Nearest tilt, for the decorrelation: where the chain is among registers and links.
    links : ndarray of int, shape (R, T)
    """

    squares: Array
    log_kernels: tuple[Array, ...]
    places: NDArray[np.int64]
    links: NDArray[np.int64]


@dataclass(frozen=True)
class JoinedSeries:
    """Free-chain means of the functions of closure, from all strengths.

    Attributes
    ----------
    log_means : ndarray, shape (K,)
    errors : ndarray, shape (K,)
        Standard errors of the logarithms.
    ratio_error : float
        Standard error of ln(mean 1 / mean 0).
    overlap : ndarray, shape (R, R)
    samples : int
        Decorrelated samples used.
    links : dict of int to (float, float)
        ln of the mean of function 0 restricted to each link, and its error.
    """

    log_means: Array
    errors: Array
    ratio_error: float
    overlap: Array
    samples: int
    links: dict[int, tuple[float, float]]


def decorrelate(series: RestrainedSeries) -> tuple[list[NDArray[np.int64]], Array]:
    """Records kept at each strength, and the statistical inefficiencies (R,) in records.

    The larger inefficiency of the restraint's energy and of the chain's place counts.
    """
    kept = []
    inefficiencies = np.ones(len(series.squares))
    with quiet_pymbar() as pymbar:
        for r, square in enumerate(series.squares):
            g = 1.0
            for values in (square, series.places[r].astype(float)):
                if np.ptp(values) > 0.0:
                    g = max(g, float(pymbar.timeseries.statistical_inefficiency(values)))
            inefficiencies[r] = g
            picks = pymbar.timeseries.subsample_correlated_data(square, g=g)
            kept.append(np.asarray(picks, dtype=np.int64))
    return kept, inefficiencies


def join_series(
    strengths: Array,
    series: list[RestrainedSeries],
    kept: list[list[NDArray[np.int64]]],
    links: tuple[int, ...] = (),
) -> JoinedSeries:
    """Free-chain means by MBAR over the decorrelated records of some copies.

    Parameters
    ----------
    strengths : (R,), restraint strengths from 0, the free chain, upwards.
    kept : records kept, by copy and strength.
    links : links whose parts are wanted, too.
    """
    count = len(strengths)

    def gathered(values: list[Array]) -> Array:
        parts = [
            v[r][picks[r]] for r in range(count) for v, picks in zip(values, kept, strict=True)
        ]
        return np.concatenate(parts)

    sizes = np.array([sum(len(picks[r]) for picks in kept) for r in range(count)])
    squares = gathered([s.squares for s in series])
    kernels = [
        gathered([s.log_kernels[k] for s in series]) for k in range(len(series[0].log_kernels))
    ]
    link_of = gathered([s.links for s in series])  # type: ignore[misc]
    wanted = [-kernel for kernel in kernels]
    wanted += [np.where(link_of == link, -kernels[0], np.inf) for link in links]
    targets = np.minimum(np.array([np.zeros(len(squares)), *wanted]), _ZERO_WEIGHT)
    with quiet_pymbar() as pymbar:
        mbar = pymbar.MBAR(0.5 * strengths[:, None] * squares[None, :], sizes)
        overlap = np.asarray(mbar.compute_overlap()["matrix"])
        free = mbar.compute_perturbed_free_energies(targets)
    log_means = -np.asarray(free["Delta_f"])[0, 1:]
    errors = np.asarray(free["dDelta_f"])
    n = len(kernels)
    return JoinedSeries(
        log_means=log_means[:n],
        errors=errors[0, 1 : n + 1],
        ratio_error=float(errors[1, 2]) if n > 1 else math.nan,
        overlap=overlap,
        samples=len(squares),
        links={
            link: (float(log_means[n + i]), float(errors[0, n + 1 + i]))
            for i, link in enumerate(links)
            if log_means[n + i] > -0.1 * _ZERO_WEIGHT
        },
    )
