"""Fluctuation along the sequence: profiles with their errors, and two ensembles compared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.md.ensemble_statistics import BLOCKS_PER_REPLICA, block_means
from dnacheck.md.geometry import superposed
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FluctuationProfile:
    """Root mean square displacement of every base-pair centre, with what it stands on.

    Attributes
    ----------
    fluctuation_A, stderr_A : ndarray, shape (N,)
    blocks_A : ndarray, shape (B, N)
        First-order estimates of the profile from B blocks of configurations; their mean is the
        profile, and their scatter holds how errors of different base pairs go together.
    frames : int
    """

    fluctuation_A: Array
    stderr_A: Array
    blocks_A: Array
    frames: int


@dataclass(frozen=True)
class ProfileComparison:
    """One profile against another.

    Attributes
    ----------
    correlation : float
        Along the sequence (Pearson).
    expected_correlation : float
        What two estimates of one true profile with these statistical errors correlate by.
    mean_ratio, mean_ratio_stderr : float
        Of the means over the sequence.
    variation : float
        Standard deviation along the sequence over the mean, errors taken out.
    noise : float
        Standard deviation of the two profiles' statistical errors along the sequence, geometric
        mean, over the mean.
    """

    correlation: float
    expected_correlation: float
    mean_ratio: float
    mean_ratio_stderr: float
    variation: float
    noise: float


def fluctuation_profile(
    centres: Array, reference: Array, blocks: int = BLOCKS_PER_REPLICA
) -> FluctuationProfile:
    """Profile of an ensemble of rings from any sampler.

    Parameters
    ----------
    centres : ndarray, shape (R, F, N, 3)
        Base-pair centres of R independent runs of F configurations each, in Å.
    reference : ndarray, shape (N, 3)
        Ring on which every configuration is superposed first, such as the minimum.
    blocks : int
        Blocks of each run for the errors; a block should be many correlation times long.

    Raises
    ------
    InputError
        Another shape, fewer configurations than blocks, or not two blocks in all.
    """
    if centres.ndim != 4 or centres.shape[2:] != reference.shape:
        raise InputError(
            f"centres have shape {centres.shape}; needed are (runs, frames, {len(reference)}, 3)"
        )
    runs, frames, n = centres.shape[:3]
    if runs * blocks < 2:
        raise InputError("errors need two blocks or more")
    moved = superposed(centres.reshape(runs * frames, n, 3), reference)
    moved -= moved.mean(axis=0)
    squares = np.einsum("fni,fni->fn", moved, moved).reshape(runs, frames, n)
    mean = squares.mean(axis=(0, 1))
    rms = np.sqrt(mean)
    parts = rms + (block_means(squares, blocks) - mean) / (2.0 * rms)
    stderr = parts.std(axis=0, ddof=1) / np.sqrt(len(parts))
    return FluctuationProfile(rms, stderr, parts, runs * frames)


def compare_profiles(ours: FluctuationProfile, theirs: FluctuationProfile) -> ProfileComparison:
    """Correlation and mean ratio of two profiles, and the correlation their errors allow.

    With the true profile's variance s² along the sequence and error variances u² and v²
    (both without what moves the whole profile), two estimates correlate by
    s² / sqrt((s² + u²)(s² + v²)) (attenuation; Spearman, Am. J. Psychol. 15, 72, 1904). s² is the
    mean of both observed variances less their errors.

    Raises
    ------
    InputError
        Profiles of different lengths.
    """
    a, b = ours.fluctuation_A, theirs.fluctuation_A
    if a.shape != b.shape:
        raise InputError(f"profiles of {len(a)} and {len(b)} base pairs cannot be compared")
    errors = [_error_variance(profile) for profile in (ours, theirs)]
    signal = max(0.0, float(np.mean([a.var() - errors[0], b.var() - errors[1]])))
    total = float(np.sqrt((signal + errors[0]) * (signal + errors[1])))
    ratio = float(a.mean() / b.mean())
    spread = np.hypot(
        *(_mean_stderr(profile) / profile.fluctuation_A.mean() for profile in (ours, theirs))
    )
    return ProfileComparison(
        correlation=float(np.corrcoef(a, b)[0, 1]),
        expected_correlation=signal / total if total > 0.0 else float("nan"),
        mean_ratio=ratio,
        mean_ratio_stderr=float(ratio * spread),
        variation=float(np.sqrt(signal) / b.mean()),
        noise=float((errors[0] * errors[1]) ** 0.25 / b.mean()),
    )


def _error_variance(profile: FluctuationProfile) -> float:
    """Variance along the sequence of the mean profile's error."""
    error = profile.blocks_A - profile.blocks_A.mean(axis=0)
    count = len(error)
    return float(np.sum(error.var(axis=1)) / (count * (count - 1)))


def _mean_stderr(profile: FluctuationProfile) -> float:
    means = profile.blocks_A.mean(axis=1)
    return float(means.std(ddof=1) / np.sqrt(len(means)))
