"""Compiled ladder of restrained chains with exchanges between neighbours."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.cyclization.ensembles.kernels.open_moves import (
    CRANKSHAFT,
    crankshaft_sweep,
    local_sweep,
)
from dnacheck.numerics.random_numbers import uniform


@njit(cache=True, nogil=True)
def nearest_tilt(angles: Any, ground: Any, pulls: Any, offsets: Any) -> int:
    """Index of the tilt (K, N, 3) that most likely drew these angles; offsets are ln share - E."""
    best, index = -math.inf, 0
    for k in range(pulls.shape[0]):
        score = offsets[k]
        for s in range(angles.shape[0]):
            for i in range(3):
                score += pulls[k, s, i] * (angles[s, i] - ground[s, i])
        if score > best:
            best, index = score, k
    return index


@njit(cache=True, nogil=True)
def run_ladder(
    angles: Any,
    ground: Any,
    stiffness: Any,
    form: int,
    strengths: Any,
    length: float,
    reach: Any,
    use: Any,
    pulls: Any,
    offsets: Any,
    state: Any,
    thinning: int,
    accepted: Any,
    swapped: Any,
    mismatches: Any,
    tilts: Any,
) -> None:
    """Metropolis chains at R restraint strengths, recorded every ``thinning`` sweeps.

    After every sweep neighbouring strengths try to exchange their chains, even and odd pairs in
    turn. Random numbers are used in a fixed order, one stream for the whole ladder.

    Parameters
    ----------
    angles : (R, N, 3), chain at each strength, changed in place.
    strengths : (R,), from the free chain's 0 upwards, in RT.
    reach : (R, 3), largest move of each kind.
    accepted, swapped : (R, 3, 2), (R - 1, 2), accepted and tried, added to.
    mismatches, tilts : (R, T, 6), (R, T), closure mismatch and nearest tilt, filled.
    """
    count = strengths.shape[0]
    holder = np.arange(count)
    squares = np.empty(count)
    last = np.empty((count, 6))
    for t in range(mismatches.shape[1]):
        for sweep in range(thinning):
            for r in range(count):
                chain = angles[holder[r]]
                if use[CRANKSHAFT] > 0:
                    crankshaft_sweep(
                        chain,
                        ground,
                        stiffness,
                        form,
                        use[CRANKSHAFT],
                        reach[r, CRANKSHAFT],
                        True,
                        state,
                        accepted[r],
                    )
                squares[r] = local_sweep(
                    chain,
                    ground,
                    stiffness,
                    form,
                    strengths[r],
                    length,
                    reach[r],
                    use,
                    True,
                    state,
                    accepted[r],
                    last[r],
                )
            for r in range((t * thinning + sweep) % 2, count - 1, 2):
                gain = 0.5 * (strengths[r + 1] - strengths[r]) * (squares[r + 1] - squares[r])
                swapped[r, 1] += 1
                if uniform(state) < math.exp(min(gain, 0.0)):
                    swapped[r, 0] += 1
                    holder[r], holder[r + 1] = holder[r + 1], holder[r]
                    squares[r], squares[r + 1] = squares[r + 1], squares[r]
                    for i in range(6):
                        last[r, i], last[r + 1, i] = last[r + 1, i], last[r, i]
        for r in range(count):
            tilts[r, t] = nearest_tilt(angles[holder[r]], ground, pulls, offsets)
            for i in range(6):
                mismatches[r, t, i] = last[r, i]
    # Chains back in the order of the strengths.
    ordered = np.empty_like(angles)
    for r in range(count):
        ordered[r] = angles[holder[r]]
    angles[:] = ordered
