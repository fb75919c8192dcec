"""Means, variances and decorrelated error bars of a sampled ensemble."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.md.ensemble import Ensemble
from dnacheck.md.geometry import elastic_energies_RT, strain, superposed
from dnacheck.md.writhe_kernels import fill_writhe
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

BLOCKS_PER_REPLICA = 10
"""Blocks whose means give the error bars of quantities known at every base pair."""


@dataclass(frozen=True)
class Estimate:
    """A mean with its standard error.

    Attributes
    ----------
    mean, stderr : float
    effective_samples : float
        Number of independent samples that would give this error.
    """

    mean: float
    stderr: float
    effective_samples: float


@dataclass(frozen=True)
class EnsembleStatistics:
    """What an ensemble of rings says.

    Attributes
    ----------
    elastic_RT : Estimate
        Energy of the steps.
    equipartition_RT : float
        Energy of the minimum + (3N - 6)/2, which a harmonic ring would have.
    temperature_K : Estimate
        Of the velocities.
    writhe : Estimate
    radius_of_gyration_A : Estimate
        Of the base-pair centres.
    angle_mean, angle_mean_stderr : ndarray, shape (N, 3)
        tau, theta, phi of each step, radians.
    angle_variance, angle_variance_stderr : ndarray, shape (N, 3)
        Square radians.
    fluctuation_A, fluctuation_stderr_A : ndarray, shape (N,)
        Root mean square displacement of each base-pair centre, superposed on the minimum.
    frames : int
        Configurations used.
    """

    elastic_RT: Estimate
    equipartition_RT: float
    temperature_K: Estimate
    writhe: Estimate
    radius_of_gyration_A: Estimate
    angle_mean: Array
    angle_mean_stderr: Array
    angle_variance: Array
    angle_variance_stderr: Array
    fluctuation_A: Array
    fluctuation_stderr_A: Array
    frames: int


def statistical_inefficiency(series: Array) -> float:
    """Number of samples that count for one independent sample.

    1 + 2 sum over lags of (1 - lag/F) C(lag), up to the first lag where the autocorrelation C,
    averaged over replicas, is not positive (Chodera et al., J. Chem. Theory Comput. 3, 26, 2007).

    Parameters
    ----------
    series : ndarray, shape (R, F)
        Equally spaced samples of R replicas; the mean is taken over all.
    """
    deviation = np.asarray(series, dtype=float) - np.mean(series)
    replicas, count = deviation.shape
    variance = float(np.mean(deviation**2))
    if variance <= 0.0:
        return 1.0
    spectrum = np.abs(np.fft.rfft(deviation, 2 * count, axis=1)) ** 2
    lags = np.arange(count)
    products = np.fft.irfft(spectrum, 2 * count, axis=1)[:, :count].sum(axis=0)
    correlation = products / (replicas * (count - lags)) / variance
    ends = np.flatnonzero(correlation[1:] <= 0.0)
    last = int(ends[0]) + 1 if ends.size else count
    window = slice(1, last)
    weights = 1.0 - lags[window] / count
    return float(max(1.0, 1.0 + 2.0 * np.sum(weights * correlation[window])))


def estimate(series: Array) -> Estimate:
    """Mean and standard error of correlated samples (R, F)."""
    series = np.asarray(series, dtype=float)
    effective = series.size / statistical_inefficiency(series)
    return Estimate(
        mean=float(series.mean()),
        stderr=float(series.std() / np.sqrt(effective)),
        effective_samples=float(effective),
    )


def block_means(values: Array, blocks: int = BLOCKS_PER_REPLICA) -> Array:
    """Means of successive blocks, (R * blocks, ...), of values (R, F, ...)."""
    replicas, count = values.shape[:2]
    size = count // blocks
    if size < 1:
        raise InputError(f"{count} configurations are too few for {blocks} blocks")
    cut = values[:, count - size * blocks :]
    cut = cut.reshape(replicas * blocks, size, *values.shape[2:])
    return np.asarray(cut.mean(axis=1))


def block_stderr(values: Array, blocks: int = BLOCKS_PER_REPLICA) -> Array:
    """Standard error of the mean of values (R, F, ...), from block means."""
    means = block_means(values, blocks)
    return np.asarray(means.std(axis=0, ddof=1) / np.sqrt(len(means)))


def analyse_ensemble(
    ensemble: Ensemble, minimum_RT: float, reference_A: Array
) -> EnsembleStatistics:
    """Statistics of an ensemble of rings.

    Parameters
    ----------
    ensemble : Ensemble
        Closed, its replicas of one length.
    minimum_RT : float
        Energy of the minimum that it fluctuates about.
    reference_A : ndarray, shape (N, 3)
        Centres of that minimum, to superpose on.

    Raises
    ------
    InputError
        The chain is open, or there are too few configurations for error bars.
    """
    chain = ensemble.chain
    if not ensemble.closed:
        raise InputError("these statistics are those of a ring; the chain is open")
    n = chain.n_steps
    shape = (len(ensemble.replicas), -1)
    angles = np.stack(ensemble.angles())
    centres = np.ascontiguousarray(ensemble.positions[:, 0::2])
    writhe = np.empty(len(centres))
    fill_writhe(centres, writhe)
    about = centres - centres.mean(axis=1, keepdims=True)
    gyration = np.sqrt(np.mean(np.sum(about**2, axis=2), axis=1))
    moved = superposed(centres, reference_A)
    squares = np.sum((moved - moved.mean(axis=0)) ** 2, axis=2).reshape(*shape, n)
    fluctuation = np.sqrt(squares.mean(axis=(0, 1)))
    deviation = strain(angles, chain.ground)
    spread = deviation - deviation.mean(axis=(0, 1))
    kinetic = np.stack([r.kinetic_RT for r in ensemble.replicas])
    temperature = 2.0 * kinetic / ensemble.degrees_of_freedom * ensemble.beads.temperature_K
    return EnsembleStatistics(
        elastic_RT=estimate(elastic_energies_RT(chain, angles)),
        equipartition_RT=minimum_RT + 0.5 * (3 * n - 6),
        temperature_K=estimate(temperature),
        writhe=estimate(writhe.reshape(shape)),
        radius_of_gyration_A=estimate(gyration.reshape(shape)),
        angle_mean=chain.ground + deviation.mean(axis=(0, 1)),
        angle_mean_stderr=block_stderr(deviation),
        angle_variance=np.mean(spread**2, axis=(0, 1)),
        angle_variance_stderr=block_stderr(spread**2),
        fluctuation_A=fluctuation,
        fluctuation_stderr_A=block_stderr(squares) / (2.0 * fluctuation),
        frames=len(centres),
    )
