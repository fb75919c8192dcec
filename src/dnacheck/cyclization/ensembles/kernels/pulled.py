"""Compiled draws of a pulled chain: a population of chains grown step by step and resampled."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from dnacheck.model.chain_kernels import step_rotation

# A population is resampled where its effective size falls below this share of it.
_EFFECTIVE = 0.5


class PulledSteps(NamedTuple):
    """Steps and loads as the growth reads them.

    Attributes
    ----------
    ground : ndarray, shape (N, 3)
    root : ndarray, shape (N, 3, 3)
        Root of each step's covariance, in radians.
    form : int
    force, torque : float
        RT per step length and RT per radian.
    """

    ground: Any
    root: Any
    form: int
    force: float
    torque: float


@njit(cache=True, nogil=True)
def _resample(rng: Any, weights: Any, total: float, frames: Any, lengths: Any, turns: Any) -> None:
    """Systematic resampling, in place."""
    m = weights.shape[0]
    old_frames, old_lengths, old_turns = frames.copy(), lengths.copy(), turns.copy()
    place = rng.random()
    passed, source = weights[0] / total * m, 0
    for k in range(m):
        while passed < place + k and source < m - 1:
            source += 1
            passed += weights[source] / total * m
        frames[k] = old_frames[source]
        lengths[k] = old_lengths[source]
        turns[k] = old_turns[source]


@njit(cache=True, nogil=True)
def grow(rng: Any, steps: PulledSteps, count: int, out: Any) -> int:
    """Grow ``count`` chains under the loads; their weighted means.

    The start's d3 lies along the force; the end is free. A chain's turn is that of its end about
    the force, counted without jumps from step to step.

    Parameters
    ----------
    out : (3,), filled with the mean extension (steps), the mean turn (radians) and ln of the mean
        weight, the partition function over that of the free chain.

    Returns
    -------
    resampled : how many times.
    """
    n = steps.ground.shape[0]
    frames = np.zeros((count, 3, 3))
    lengths, turns = np.zeros(count), np.zeros(count)
    logs, weights = np.zeros(count), np.ones(count)
    rotation, turned = np.empty((3, 3)), np.empty((3, 3))
    normal, angles = np.empty(3), np.empty(3)
    for m in range(count):
        for i in range(3):
            frames[m, i, i] = 1.0
    log_mean, resampled = 0.0, 0
    for s in range(n):
        top = -math.inf
        for m in range(count):
            for k in range(3):
                normal[k] = rng.standard_normal()
            for k in range(3):
                angles[k] = steps.ground[s, k]
                for j in range(3):
                    angles[k] += steps.root[s, k, j] * normal[j]
            step_rotation(angles[0], angles[1], angles[2], steps.form, rotation)
            frame = frames[m]
            lengths[m] += frame[2, 2]
            before = math.atan2(frame[1, 0] - frame[0, 1], frame[0, 0] + frame[1, 1])
            logs[m] += steps.force * frame[2, 2]
            for i in range(3):
                for j in range(3):
                    turned[i, j] = (
                        frame[i, 0] * rotation[0, j]
                        + frame[i, 1] * rotation[1, j]
                        + frame[i, 2] * rotation[2, j]
                    )
            for i in range(3):
                for j in range(3):
                    frame[i, j] = turned[i, j]
            turn = math.atan2(frame[1, 0] - frame[0, 1], frame[0, 0] + frame[1, 1]) - before
            turn += 2.0 * math.pi * round((angles[0] - turn) / (2.0 * math.pi))
            turns[m] += turn
            logs[m] += steps.torque * (turn - steps.ground[s, 0])
            top = max(top, logs[m])
        total, squares = 0.0, 0.0
        for m in range(count):
            weights[m] = math.exp(logs[m] - top)
            total += weights[m]
            squares += weights[m] * weights[m]
        if total * total < _EFFECTIVE * count * squares and s < n - 1:
            _resample(rng, weights, total, frames, lengths, turns)
            log_mean += top + math.log(total / count)
            resampled += 1
            for m in range(count):
                logs[m] = 0.0
    top = logs.max()
    total, length, turn = 0.0, 0.0, 0.0
    for m in range(count):
        weight = math.exp(logs[m] - top)
        total += weight
        length += weight * lengths[m]
        turn += weight * turns[m]
    out[0], out[1] = length / total, turn / total
    out[2] = log_mean + top + math.log(total / count)
    return resampled
