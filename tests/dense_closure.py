"""Dense algebra of closed chains by finite differences of frames; no kernel of ring is used."""

import numpy as np

from dnacheck.model.chain import chain_frames


def end_pose(angles, form):
    """End displacement and rotation vector (6,) of angles (N, 3), small rotations included."""
    centres, frames = chain_frames(angles, form)
    r = frames[-1]
    skew = 0.5 * np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    sine = np.linalg.norm(skew)
    angle = np.arctan2(sine, 0.5 * (np.trace(r) - 1.0))
    return np.concatenate([centres[-1], skew * (angle / sine if sine > 1e-12 else 1.0)])


def jacobian(angles, form, step=1e-5):
    """Closure Jacobian (6, 3N) by central differences."""
    columns = []
    for i in range(angles.size):
        shift = np.zeros(angles.size)
        shift[i] = step
        shift = shift.reshape(angles.shape)
        columns.append(
            (end_pose(angles + shift, form) - end_pose(angles - shift, form)) / (2 * step)
        )
    return np.array(columns).T


def closure_hessian(angles, multipliers, form, step=1e-4):
    """Second derivatives (3N, 3N) of multipliers . closure by central differences."""
    n = angles.size

    def gradient(at):
        return multipliers @ jacobian(at, form)

    columns = []
    for i in range(n):
        shift = np.zeros(n)
        shift[i] = step
        shift = shift.reshape(angles.shape)
        columns.append((gradient(angles + shift) - gradient(angles - shift)) / (2 * step))
    hessian = np.array(columns)
    return 0.5 * (hessian + hessian.T)


def block_diagonal(stiffness):
    """Dense (3N, 3N) of per-step stiffnesses (N, 3, 3)."""
    n = len(stiffness)
    dense = np.zeros((3 * n, 3 * n))
    for s in range(n):
        dense[3 * s : 3 * s + 3, 3 * s : 3 * s + 3] = stiffness[s]
    return dense


def null_space(rows):
    """Orthonormal basis (n, n - m) of the null space of rows (m, n)."""
    return np.linalg.svd(rows)[2][len(rows) :].T


def brute_force_log_j(chain, first, second, windows):
    """ln J (mol/L) of half chains by counting pairs that meet, for each window (steps, radians).

    ``first`` and ``second`` are (centres (M, 3), frames (M, 3, 3)) of the ends of independent
    first and second halves. The density of poses is counts / pairs / volume, the rotation ball of
    angle w having the share (w - sin w) / pi of the rotation group.
    """
    from scipy.spatial import cKDTree

    r1, f1 = first
    r2, f2 = second
    # The pose that a first half must have to meet: the inverse of the second half's.
    wanted_frame = f2.transpose(0, 2, 1)
    wanted = -np.einsum("mij,mj->mi", wanted_frame, r2)
    widest = max(w[0] for w in windows)
    pairs = cKDTree(r1).query_ball_tree(cKDTree(wanted), widest)
    left = np.repeat(np.arange(len(r1)), [len(p) for p in pairs])
    right = np.concatenate([np.asarray(p, dtype=int) for p in pairs])
    gap = np.linalg.norm(r1[left] - wanted[right], axis=1)
    trace = np.einsum("mij,mij->m", f1[left], wanted_frame[right])
    turn = np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0))
    unit = 1660.539 / chain.rise_A**3
    result = []
    for length, angle in windows:
        count = np.sum((gap < length) & (turn < angle))
        volume = 4.0 / 3.0 * np.pi * length**3 * (angle - np.sin(angle)) / np.pi
        result.append(np.log(count / (len(r1) * len(r2) * volume) * unit))
    return np.array(result)
