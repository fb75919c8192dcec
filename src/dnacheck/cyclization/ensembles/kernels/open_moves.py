"""Compiled Metropolis moves over the angles of a chain.

The target is exp(-E(q) - U(c)) dq: E is quadratic in the 3N angles (RT), and U = strength/2
(|r|^2 / l^2 + |w|^2) holds the closure mismatch c = (r, w), the end vector and end rotation vector
in the first frame. Moves that turn a step as a rotation keep the invariant measure of rotations,
which is dq times the volume of the three axes (|cos theta| for the wedge), so their acceptance
carries the ratio of volumes.

* single angle: one tau, theta or phi changes, and everything beyond it turns about its axis.
* pivot: everything beyond a base pair turns about a random axis through it.
* crankshaft: the frames between two steps turn about the chord between them; the ends, and so the
  closure, stay.

Every move returns or counts acceptances; proposals are symmetric in the measure named.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from dnacheck.model.chain_kernels import WEDGE, fill_frames, midstep_angles, step_rotation
from dnacheck.numerics.random_numbers import below, uniform, unit_vector
from dnacheck.numerics.rotations import rotation_exp, rotation_log, wedge_angles

SINGLE, PIVOT, CRANKSHAFT = 0, 1, 2
N_MOVES = 3
_SHORTEST_CHORD = 1e-6


@njit(cache=True, nogil=True)
def step_energy(angles: Any, ground: Any, stiffness: Any) -> float:
    """Energy of one step's angles (3,) in the unit of ``stiffness`` (3, 3)."""
    x0, x1, x2 = angles[0] - ground[0], angles[1] - ground[1], angles[2] - ground[2]
    twice = stiffness[0, 0] * x0 * x0 + stiffness[1, 1] * x1 * x1 + stiffness[2, 2] * x2 * x2
    cross = stiffness[0, 1] * x0 * x1 + stiffness[0, 2] * x0 * x2 + stiffness[1, 2] * x1 * x2
    return 0.5 * twice + cross


@njit(cache=True, nogil=True)
def step_volume(angles: Any, form: int) -> float:
    """Volume spanned by the three axes of a step: rotation measure over d tau d theta d phi."""
    if form == WEDGE:
        return abs(math.cos(angles[1]))
    ch, sh = math.cos(0.5 * angles[1]), math.sin(0.5 * angles[1])
    cp, sp = math.cos(angles[2]), math.sin(angles[2])
    # Axes in the frame turned by tau/2: z and z', x and x', y', averaged in pairs.
    y = np.array([0.0, ch, -sh])
    z2 = np.array([0.0, sh, ch])
    x3 = np.array([cp, -sp * z2[1], -sp * z2[2]])
    z3 = np.array([sp, cp * z2[1], cp * z2[2]])
    a = 0.5 * (np.array([0.0, 0.0, 1.0]) + sh * y + ch * z3)
    b = -0.5 * (np.array([1.0, 0.0, 0.0]) + x3)
    return abs(
        a[0] * (b[1] * y[2] - b[2] * y[1])
        + a[1] * (b[2] * y[0] - b[0] * y[2])
        + a[2] * (b[0] * y[1] - b[1] * y[0])
    )


@njit(cache=True, nogil=True)
def angles_near(rotation: Any, ground: Any, form: int, out: Any) -> None:
    """Angles (3,) of a step's rotation, each within half a turn of the ground's."""
    if form == WEDGE:
        out[0], out[1], out[2] = wedge_angles(rotation)
    else:
        out[0], out[1], out[2] = midstep_angles(rotation)
    for i in range(3):
        turn = 2.0 * math.pi
        out[i] -= turn * math.floor((out[i] - ground[i]) / turn + 0.5)


@njit(cache=True, nogil=True)
def multiply(a: Any, b: Any, out: Any) -> None:
    """Matrix product (3, 3) into ``out``, which is neither factor."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@njit(cache=True, nogil=True)
def mismatch_square(end: Any, frame: Any, length: float) -> float:
    """|r|^2 / length^2 + |w|^2 of an end vector and an end frame (3, 3)."""
    x = frame[2, 1] - frame[1, 2]
    y = frame[0, 2] - frame[2, 0]
    z = frame[1, 0] - frame[0, 1]
    sine = math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(sine, frame[0, 0] + frame[1, 1] + frame[2, 2] - 1.0)
    square = (end[0] * end[0] + end[1] * end[1] + end[2] * end[2]) / (length * length)
    return square + angle * angle


@njit(cache=True, nogil=True)
def fill_tails(angles: Any, form: int, tails: Any, turns: Any) -> None:
    """End vector (N+1, 3) and frame (N+1, 3, 3) of the chain's end seen from each base pair."""
    n = angles.shape[0]
    step = np.empty((3, 3))
    for i in range(3):
        tails[n, i] = 0.0
        for j in range(3):
            turns[n, i, j] = 1.0 if i == j else 0.0
    for s in range(n - 1, -1, -1):
        step_rotation(angles[s, 0], angles[s, 1], angles[s, 2], form, step)
        for i in range(3):
            t = 1.0 if i == 2 else 0.0
            for j in range(3):
                t += step[i, j] * tails[s + 1, j]
            tails[s, i] = t
        multiply(step, turns[s + 1], turns[s])


@njit(cache=True, nogil=True)
def local_sweep(
    angles: Any,
    ground: Any,
    stiffness: Any,
    form: int,
    strength: float,
    length: float,
    reach: Any,
    use: Any,
    use_volume: bool,
    state: Any,
    accepted: Any,
    mismatch: Any,
) -> float:
    """One pass along the chain with single-angle and pivot moves; returns |c|^2 at its end.

    Parameters
    ----------
    angles : (N, 3), changed in place.
    stiffness : (N, 3, 3) in RT.
    strength, length : of the restraint U.
    reach : (3,), largest change of an angle, turn of a pivot and of a crankshaft, in radians.
    use : (3,), moves of each kind at every step (0 or 1 for the first two).
    use_volume : whether pivots carry the ratio of measures; False only to test the tests.
    state : (4,), random numbers.
    accepted : (3, 2), accepted and tried moves of each kind, added to.
    mismatch : (6,), closure mismatch at the end of the pass, filled.
    """
    n = angles.shape[0]
    tails, turns = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    fill_tails(angles, form, tails, turns)
    place, frame, new_frame = np.zeros(3), np.eye(3), np.empty((3, 3))
    step, new_step, turn = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    end, end_frame, part = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    old, new, axis = np.empty(3), np.empty(3), np.empty(3)
    square = mismatch_square(tails[0], turns[0], length)
    for s in range(n):
        for i in range(3):
            old[i] = angles[s, i]
        step_rotation(old[0], old[1], old[2], form, step)
        energy = step_energy(old, ground[s], stiffness[s])
        for trial in range(4):
            kind = SINGLE if trial < 3 else PIVOT
            if use[kind] == 0:
                continue
            ratio = 1.0
            if kind == SINGLE:
                for i in range(3):
                    new[i] = old[i]
                new[trial] += reach[SINGLE] * (2.0 * uniform(state) - 1.0)
                step_rotation(new[0], new[1], new[2], form, new_step)
            else:
                unit_vector(state, axis)
                amount = reach[PIVOT] * (2.0 * uniform(state) - 1.0)
                for i in range(3):
                    axis[i] *= amount
                rotation_exp(axis, turn)
                multiply(step, turn, new_step)
                angles_near(new_step, ground[s], form, new)
                if use_volume:
                    ratio = step_volume(old, form) / step_volume(new, form)
            new_energy = step_energy(new, ground[s], stiffness[s])
            change = new_energy - energy
            new_square = square
            if strength > 0.0:
                for i in range(3):
                    t = 1.0 if i == 2 else 0.0
                    for j in range(3):
                        t += new_step[i, j] * tails[s + 1, j]
                    axis[i] = t
                for i in range(3):
                    end[i] = place[i] + frame[i, 0] * axis[0] + frame[i, 1] * axis[1]
                    end[i] += frame[i, 2] * axis[2]
                multiply(frame, new_step, part)
                multiply(part, turns[s + 1], end_frame)
                new_square = mismatch_square(end, end_frame, length)
                change += 0.5 * strength * (new_square - square)
            accepted[kind, 1] += 1
            if uniform(state) < ratio * math.exp(-change):
                accepted[kind, 0] += 1
                square = new_square
                energy = new_energy
                for i in range(3):
                    old[i] = new[i]
                    for j in range(3):
                        step[i, j] = new_step[i, j]
        for i in range(3):
            angles[s, i] = old[i]
            place[i] += frame[i, 2]
        multiply(frame, step, new_frame)
        for i in range(3):
            for j in range(3):
                frame[i, j] = new_frame[i, j]
    for i in range(3):
        mismatch[i] = place[i]
    rotation_log(frame, mismatch[3:])
    return mismatch_square(place, frame, length)


@njit(cache=True, nogil=True)
def crankshaft_sweep(
    angles: Any,
    ground: Any,
    stiffness: Any,
    form: int,
    moves: int,
    reach: float,
    use_volume: bool,
    state: Any,
    accepted: Any,
) -> None:
    """``moves`` crankshafts: frames i+1 ... j turn about the chord from base pair i+1 to j+1.

    Steps i < j are drawn at random; the end's pose stays to round-off. Arguments as in
    :func:`local_sweep`.
    """
    n = angles.shape[0]
    if n < 2:
        return
    centres, frames = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    fill_frames(angles, form, centres, frames)
    axis, turn = np.empty(3), np.empty((3, 3))
    moved, relative = np.empty((3, 3)), np.empty((3, 3))
    new_i, new_j = np.empty(3), np.empty(3)
    for _ in range(moves):
        i, j = below(state, n), below(state, n - 1)
        if j >= i:
            j += 1
        if i > j:
            i, j = j, i
        chord = 0.0
        for x in range(3):
            axis[x] = centres[j + 1, x] - centres[i + 1, x]
            chord += axis[x] * axis[x]
        amount = reach * (2.0 * uniform(state) - 1.0)
        draw = uniform(state)
        accepted[CRANKSHAFT, 1] += 1
        if chord < _SHORTEST_CHORD:
            continue
        for x in range(3):
            axis[x] *= amount / math.sqrt(chord)
        rotation_exp(axis, turn)
        multiply(turn, frames[i + 1], moved)
        for x in range(3):
            for y in range(3):
                relative[x, y] = (
                    frames[i, 0, x] * moved[0, y]
                    + frames[i, 1, x] * moved[1, y]
                    + frames[i, 2, x] * moved[2, y]
                )
        angles_near(relative, ground[i], form, new_i)
        multiply(turn, frames[j], moved)
        for x in range(3):
            for y in range(3):
                relative[x, y] = (
                    moved[0, x] * frames[j + 1, 0, y]
                    + moved[1, x] * frames[j + 1, 1, y]
                    + moved[2, x] * frames[j + 1, 2, y]
                )
        angles_near(relative, ground[j], form, new_j)
        change = step_energy(new_i, ground[i], stiffness[i])
        change += step_energy(new_j, ground[j], stiffness[j])
        change -= step_energy(angles[i], ground[i], stiffness[i])
        change -= step_energy(angles[j], ground[j], stiffness[j])
        ratio = 1.0
        if use_volume:
            ratio = step_volume(angles[i], form) * step_volume(angles[j], form)
            ratio /= step_volume(new_i, form) * step_volume(new_j, form)
        if not draw < ratio * math.exp(-change):
            continue
        accepted[CRANKSHAFT, 0] += 1
        for x in range(3):
            angles[i, x], angles[j, x] = new_i[x], new_j[x]
        t00, t01, t02 = turn[0, 0], turn[0, 1], turn[0, 2]
        t10, t11, t12 = turn[1, 0], turn[1, 1], turn[1, 2]
        t20, t21, t22 = turn[2, 0], turn[2, 1], turn[2, 2]
        for k in range(i + 1, j + 1):
            for y in range(3):
                a, b, c = frames[k, 0, y], frames[k, 1, y], frames[k, 2, y]
                frames[k, 0, y] = t00 * a + t01 * b + t02 * c
                frames[k, 1, y] = t10 * a + t11 * b + t12 * c
                frames[k, 2, y] = t20 * a + t21 * b + t22 * c
            if k < j:
                for x in range(3):
                    centres[k + 1, x] = centres[k, x] + frames[k, x, 2]
