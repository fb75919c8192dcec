"""Compiled half chains: poses of drawn halves, and the pairs that meet.

A half's pose is the position (steps) and frame of the joint between the halves, seen from base
pair 0: reached forward through the first half, or backward through the second from base pair N,
which coincides with base pair 0 in a ring.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from dnacheck.equilibria.discrete.kernels.states import by_kind
from dnacheck.model.chain_kernels import HingeSteps, step_rotation
from dnacheck.model.rigid_kernels import RigidSteps, linearise_rigid, new_kinematics
from dnacheck.numerics.rotations import matrix_from_quaternion, quaternion_from_matrix


class Halves(NamedTuple):
    """Halves of one side of the joint.

    Attributes
    ----------
    poses : ndarray, shape (M, 7)
        Position of the joint (steps) and its quaternion as in (4.8), scalar last.
    log_weights : ndarray, shape (M,)
    scores : ndarray, shape (M, K)
        Logarithm of each tilt's density over the free chain's.
    """

    poses: Any
    log_weights: Any
    scores: Any


class Cells(NamedTuple):
    """A grid of cubes into which first halves are sorted.

    Attributes
    ----------
    starts : ndarray, shape (cells + 1,)
        First member of each cell.
    low : ndarray, shape (3,)
    size : float
    shape : ndarray, shape (3,)
    batches : ndarray, shape (M,)
        Batch of each half.
    """

    starts: Any
    low: Any
    size: float
    shape: Any
    batches: Any


class Window(NamedTuple):
    """The window of every tilt, and the correction within it.

    Attributes
    ----------
    log_shares : ndarray, shape (K,)
    inverse_roots, log_dets : ndarray, shapes (K, 6, 6), (K,)
        L^-1 and log det L, L L^T the spread of the mismatch.
    spreads : ndarray, shape (K, 3, 3)
        Spread of the displacement in the frame of the joint.
    reaches : ndarray, shape (K, 2)
        Largest displacement and rotation angle within radius 1.
    multipliers, curvatures : ndarray, shapes (K, 6), (K, 6, 6)
        m and S in RT.
    links : ndarray, shape (K,)
        Index of each tilt's link.
    radius : float
    """

    log_shares: Any
    inverse_roots: Any
    log_dets: Any
    spreads: Any
    reaches: Any
    multipliers: Any
    curvatures: Any
    links: Any
    radius: float


class PairTotals(NamedTuple):
    """Sums over pairs, all added to.

    Attributes
    ----------
    sums : ndarray, shape (batches, links, shells)
    counts : ndarray, shape (shells,)
    rows, columns : ndarray, shapes (Ma,), (Mb,)
        Sums over partners.
    """

    sums: Any
    counts: Any
    rows: Any
    columns: Any


@njit(cache=True, nogil=True)
def _put_pose(r: Any, f: Any, backward: bool, pose: Any) -> None:
    """Pose (7,) of the joint from that of a half's end, position (3,) and frame (3, 3)."""
    for i in range(3):
        if backward:
            pose[i] = -(f[0, i] * r[0] + f[1, i] * r[1] + f[2, i] * r[2])
        else:
            pose[i] = r[i]
    quaternion_from_matrix(f, pose[3:])
    if backward:
        for i in range(3, 6):
            pose[i] = -pose[i]


@njit(cache=True, nogil=True, error_model="numpy")
def _hinge_poses(
    steps: HingeSteps, normals: Any, roots: Any, centre: Any, backward: bool, poses: Any
) -> None:
    ground, form = steps.ground, steps.form
    n = normals.shape[1]
    step = np.empty((3, 3))
    f = np.empty((3, 3))
    g = np.empty((3, 3))
    r = np.empty(3)
    a = np.empty(3)
    for m in range(normals.shape[0]):
        for i in range(3):
            r[i] = 0.0
            for j in range(3):
                f[i, j] = 1.0 if i == j else 0.0
        for s in range(n):
            for i in range(3):
                a[i] = centre[s, i]
                for j in range(i + 1):
                    a[i] += roots[s, i, j] * normals[m, s, j]
            for i in range(3):
                normals[m, s, i] = a[i] - ground[s, i]
            step_rotation(a[0], a[1], a[2], form, step)
            for i in range(3):
                r[i] += f[i, 2]
                for j in range(3):
                    g[i, j] = f[i, 0] * step[0, j] + f[i, 1] * step[1, j] + f[i, 2] * step[2, j]
            for i in range(3):
                for j in range(3):
                    f[i, j] = g[i, j]
        _put_pose(r, f, backward, poses[m])


@njit(cache=True, nogil=True, error_model="numpy")
def _rigid_poses(
    steps: RigidSteps, normals: Any, roots: Any, centre: Any, backward: bool, poses: Any
) -> None:
    n, c = centre.shape
    kinematics = new_kinematics(n)
    q = np.empty((n, c))
    for m in range(normals.shape[0]):
        for s in range(n):
            for i in range(c):
                q[s, i] = centre[s, i]
                for j in range(i + 1):
                    q[s, i] += roots[s, i, j] * normals[m, s, j]
            for i in range(c):
                normals[m, s, i] = q[s, i] - steps.ground[s, i]
        linearise_rigid(q, kinematics)
        _put_pose(kinematics.centres[n], kinematics.frames[n], backward, poses[m])


half_poses = by_kind(_hinge_poses, _rigid_poses)
"""Poses of halves drawn about one centre: (steps, normals, roots, centre, backward, poses).

``normals`` (M, n, c) are standard normal numbers, overwritten with the strains q - q^; ``roots``
(n, c, c) Cholesky roots of the covariance of each step; ``centre`` (n, c) is the mean. ``backward``
tells whether the half is followed from its far end to its near one. Fills ``poses`` (M, 7).
"""


@njit(cache=True, nogil=True)
def weigh(scores: Any, log_shares: Any, log_weights: Any) -> None:
    """Log weights (M,) of halves drawn from a mixture of tilts: -log sum share * density ratio."""
    for m in range(scores.shape[0]):
        top = -math.inf
        for k in range(scores.shape[1]):
            top = max(top, log_shares[k] + scores[m, k])
        total = 0.0
        for k in range(scores.shape[1]):
            total += math.exp(log_shares[k] + scores[m, k] - top)
        log_weights[m] = -(top + math.log(total))


@njit(cache=True, nogil=True)
def relative_rotation(qa: Any, qb: Any, out: Any) -> None:
    """Rotation vector (3,) of the frame of quaternion a seen from that of b, scalar part last."""
    w = qb[3] * qa[3] + qb[0] * qa[0] + qb[1] * qa[1] + qb[2] * qa[2]
    x = qb[3] * qa[0] - qb[0] * qa[3] - (qb[1] * qa[2] - qb[2] * qa[1])
    y = qb[3] * qa[1] - qb[1] * qa[3] - (qb[2] * qa[0] - qb[0] * qa[2])
    z = qb[3] * qa[2] - qb[2] * qa[3] - (qb[0] * qa[1] - qb[1] * qa[0])
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    length = math.sqrt(x * x + y * y + z * z)
    factor = 2.0 if length < 1e-150 else 2.0 * math.atan2(length, w) / length
    out[0], out[1], out[2] = factor * x, factor * y, factor * z


@njit(cache=True, nogil=True)
def log_volume_factor(angle_squared: float) -> float:
    """log of 8 pi^2 over the density of normalised rotations in rotation-vector coordinates.

    dR = 2 (1 - cos w) / w^2 d^3w / (8 pi^2), w the rotation angle.
    """
    if angle_squared < 1e-6:
        j = 1.0 - angle_squared / 12.0
    else:
        j = 2.0 * (1.0 - math.cos(math.sqrt(angle_squared))) / angle_squared
    return math.log(8.0 * math.pi**2 / j)


@njit(cache=True, nogil=True)
def fill_cells(positions: Any, low: Any, size: float, shape: Any, cells: Any) -> None:
    """Cell number of each position (M, 3) on a grid of ``shape`` (3,) cubes from ``low`` (3,)."""
    for m in range(positions.shape[0]):
        c = 0
        for i in range(3):
            k = int(math.floor((positions[m, i] - low[i]) / size))
            c = c * shape[i] + min(max(k, 0), shape[i] - 1)
        cells[m] = c


@njit(cache=True, nogil=True, error_model="numpy")
def match_pairs(first: Any, cells: Any, second: Any, window: Any, totals: Any) -> None:
    """Weights of all pairs of halves that meet within a window, by batch, link and shell.

    First halves (a) are sorted by cell and, within a cell, by the size of the first component
    of their quaternion. The window is the ellipsoid |L^-1 c| <= radius of the tilt that the second
    half (b) most likely came from, in shells of equal width in the square of |L^-1 c| / radius.
    Each pair counts with the product of its weights, the volume factor of the window's measure,
    and exp(-m.c + c.S.c / 2) of the tilt that the pair most likely came from, which takes the
    window's bias down to what is left after second order.

    Parameters
    ----------
    first, second : Halves. cells : Cells, of the first. window : Window. totals : PairTotals.
    """
    poses_a, log_weights_a, scores_a = first
    poses_b, log_weights_b, scores_b = second
    starts, low, size, shape = cells.starts, cells.low, cells.size, cells.shape
    log_shares, links, radius = window.log_shares, window.links, window.radius
    spreads, reaches = window.spreads, window.reaches
    shells = totals.counts.shape[0]
    c = np.empty(6)
    frame = np.empty((3, 3))
    square = radius * radius
    tilts = log_shares.shape[0]
    bounds = np.empty((3, 2), np.int64)
    for b in range(poses_b.shape[0]):
        best, label = -math.inf, 0
        for k in range(tilts):
            score = log_shares[k] + scores_b[b, k]
            if score > best:
                best, label = score, k
        root = window.inverse_roots[label]
        matrix_from_quaternion(poses_b[b, 3:], frame)
        most_turn = min(radius * reaches[label, 1], math.pi)
        cosine = math.cos(0.5 * most_turn)
        # Unit quaternions an angle w/2 apart (up to sign) differ by 2 sin(w/4) at most.
        chord = 2.0 * math.sin(0.25 * most_turn)
        component = abs(poses_b[b, 3])
        least = max(component - chord, 0.0)
        most = component + chord
        empty = False
        for i in range(3):
            # Lab extent of the body-frame ellipsoid; the body axes are the columns of frame b.
            half = 0.0
            for j in range(3):
                for k in range(3):
                    half += frame[i, j] * spreads[label, j, k] * frame[i, k]
            half = radius * math.sqrt(half)
            lo = int(math.floor((poses_b[b, i] - half - low[i]) / size))
            hi = int(math.floor((poses_b[b, i] + half - low[i]) / size))
            bounds[i, 0], bounds[i, 1] = max(lo, 0), min(hi, shape[i] - 1)
            empty = empty or bounds[i, 0] > bounds[i, 1]
        if empty:
            continue
        for i0 in range(bounds[0, 0], bounds[0, 1] + 1):
            for i1 in range(bounds[1, 0], bounds[1, 1] + 1):
                for i2 in range(bounds[2, 0], bounds[2, 1] + 1):
                    # Cells wholly outside the smallest sphere about the ellipsoid.
                    away = 0.0
                    for i in range(3):
                        k = i0 if i == 0 else (i1 if i == 1 else i2)
                        x = poses_b[b, i] - (low[i] + k * size)
                        x = max(-x, x - size, 0.0)
                        away += x * x
                    if away > (radius * reaches[label, 0]) ** 2:
                        continue
                    cell = (i0 * shape[1] + i1) * shape[2] + i2
                    lo, last = starts[cell], starts[cell + 1]
                    hi = last
                    while lo < hi:
                        middle = (lo + hi) // 2
                        if abs(poses_a[middle, 3]) < least:
                            lo = middle + 1
                        else:
                            hi = middle
                    for a in range(lo, last):
                        if abs(poses_a[a, 3]) > most:
                            break
                        dot = poses_a[a, 3] * poses_b[b, 3] + poses_a[a, 4] * poses_b[b, 4]
                        dot += poses_a[a, 5] * poses_b[b, 5] + poses_a[a, 6] * poses_b[b, 6]
                        if abs(dot) < cosine:
                            continue
                        x = poses_a[a, 0] - poses_b[b, 0]
                        y = poses_a[a, 1] - poses_b[b, 1]
                        z = poses_a[a, 2] - poses_b[b, 2]
                        distance = 0.0
                        for i in range(3):
                            c[i] = frame[0, i] * x + frame[1, i] * y + frame[2, i] * z
                            t = 0.0
                            for j in range(i + 1):
                                t += root[i, j] * c[j]
                            distance += t * t
                        if not distance < square:
                            continue
                        relative_rotation(poses_a[a, 3:], poses_b[b, 3:], c[3:])
                        for i in range(3, 6):
                            t = 0.0
                            for j in range(i + 1):
                                t += root[i, j] * c[j]
                            distance += t * t
                        if not distance < square:
                            continue
                        best, tilt = -math.inf, label
                        for k in range(tilts):
                            score = log_shares[k] + scores_a[a, k] + scores_b[b, k]
                            if score > best:
                                best, tilt = score, k
                        exponent = log_weights_a[a] + log_weights_b[b] - window.log_dets[label]
                        exponent += log_volume_factor(c[3] * c[3] + c[4] * c[4] + c[5] * c[5])
                        for i in range(6):
                            exponent -= window.multipliers[tilt, i] * c[i]
                            for j in range(6):
                                exponent += 0.5 * c[i] * window.curvatures[tilt, i, j] * c[j]
                        weight = math.exp(exponent)
                        shell = min(int(shells * distance / square), shells - 1)
                        totals.sums[cells.batches[a], links[tilt], shell] += weight
                        totals.counts[shell] += 1
                        totals.rows[a] += weight
                        totals.columns[b] += weight
