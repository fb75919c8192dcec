"""Rotations and long products of them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from dnacheck.model.chain import angles_of_frames, chain_frames
from dnacheck.numerics.rotations import (
    matrix_from_quaternion,
    quaternion_from_matrix,
    rotation_exp,
    rotation_log,
    wedge_angles,
    wedge_rotation,
)
from dnacheck.validation.cases.case import HardCase, hard_case
from dnacheck.validation.engine.verdict import Rule

GROUP = "geometry"
_EPS = float(np.finfo(float).eps)


def _axis(rng: np.random.Generator) -> Any:
    v = rng.standard_normal(3)
    return v / np.linalg.norm(v)


def _log_exp_error(rng: np.random.Generator, angles: list[float]) -> float:
    """Largest error of log(exp(v)) against v, over the angle's own scale near 0."""
    worst = 0.0
    matrix, back = np.empty((3, 3)), np.empty(3)
    for angle in angles:
        for _ in range(20):
            v = angle * _axis(rng)
            rotation_exp(v, matrix)
            rotation_log(matrix, back)
            worst = max(worst, float(np.max(np.abs(back - v))) / min(1.0, angle))
    return worst


def log_near_zero(rng: np.random.Generator) -> HardCase:
    """Rotation logarithm of tiny rotations."""
    worst = _log_exp_error(rng, [1e-3, 1e-5, 1e-8, 1e-12, 1e-15])
    return hard_case(
        GROUP,
        "rotation logarithm near 0",
        "log(exp v) = v to round-off relative to |v|, down to 1e-15",
        f"largest relative error {worst:.1e}",
        worst,
        1e-7,
        Rule.AT_MOST,
        "a matrix near 1 holds v to eps: 1e-15/1e-15 is lost only in the last digits of I + v×",
    )


def log_near_pi(rng: np.random.Generator) -> HardCase:
    """Rotation logarithm of near half turns, where arccos of the trace fails."""
    worst = _log_exp_error(rng, [math.pi - d for d in (1e-1, 1e-3, 1e-5, 1e-7, 1e-9)])
    return hard_case(
        GROUP,
        "rotation logarithm near π",
        "log(exp v) = v to 1e-14 up to π − 1e-9; arccos of the trace is wrong there",
        f"largest error {worst:.1e} rad",
        worst,
        1e-14,
        Rule.AT_MOST,
        "some tens of roundings",
        unit="rad",
    )


def right_angles(rng: np.random.Generator) -> HardCase:
    """Wedge angles with θ near ±90°."""
    matrix, again = np.empty((3, 3)), np.empty((3, 3))
    worst = 0.0
    for sign in (-1.0, 1.0):
        for distance in (1e-2, 1e-5, 1e-8, 1e-12, 0.0):
            for _ in range(10):
                tau, phi = rng.uniform(-3.0, 3.0, 2)
                wedge_rotation(tau, sign * (0.5 * math.pi - distance), phi, matrix)
                wedge_rotation(*wedge_angles(matrix), again)
                worst = max(worst, float(np.max(np.abs(again - matrix))))
    return hard_case(
        GROUP,
        "wedge angles near ±90°",
        "angles recovered by atan2 give back the rotation, also where τ and φ are not unique",
        f"largest difference of matrices {worst:.1e}",
        worst,
        1e-14,
        Rule.AT_MOST,
        "some tens of roundings",
    )


def quaternion_signs(rng: np.random.Generator) -> HardCase:
    """Quaternions of random rotations, including half turns, give back the matrix."""
    worst = 0.0
    q, matrix, again = np.empty(4), np.empty((3, 3)), np.empty((3, 3))
    for angle in (0.0, 1e-9, 1.0, math.pi - 1e-9, math.pi):
        for _ in range(50):
            rotation_exp(angle * _axis(rng), matrix)
            quaternion_from_matrix(matrix, q)
            matrix_from_quaternion(q, again)
            worst = max(worst, float(np.max(np.abs(again - matrix))))
            matrix_from_quaternion(-q, again)
            worst = max(worst, float(np.max(np.abs(again - matrix))))
    return hard_case(
        GROUP,
        "quaternion signs",
        "q and −q give the matrix that q came from, at half turns too",
        f"largest difference {worst:.1e}",
        worst,
        1e-14,
        Rule.AT_MOST,
        "some tens of roundings",
    )


def long_products(rng: np.random.Generator) -> HardCase:
    """Frames after 10,000 steps."""
    n = 10_000
    angles = np.array([0.6, 0.0, 0.0]) + 0.1 * rng.standard_normal((n, 3))
    _, frames = chain_frames(angles)
    drift = float(np.max(np.abs(np.swapaxes(frames, 1, 2) @ frames - np.eye(3))))
    return hard_case(
        GROUP,
        "products of 10,000 rotations",
        "frames stay orthonormal: the drift does not grow with the number of steps",
        f"largest departure from orthonormality {drift:.1e}",
        drift,
        1e-14,
        Rule.AT_MOST,
        "renormalised as they are multiplied; a plain product drifts by 1e-12",
    )


def drift_against_length(rng: np.random.Generator) -> list[dict[str, Any]]:
    """Orthonormality, position and energy after N steps, against extended precision.

    Returns
    -------
    list of dict
        n; orthonormality of the last frame; position: relative error of the end against a product
        in long double; plain: orthonormality of a product without renormalisation; energy:
        relative error of the energy of angles recovered from the frames.
    """
    rows = []
    for n in (100, 300, 1000, 3000, 10_000):
        strain = 0.1 * rng.standard_normal((n, 3))
        ground = np.tile([0.6, 0.0, 0.0], (n, 1))
        angles = ground + strain
        centres, frames = chain_frames(angles)
        end, plain = long_double_end(angles)
        recovered = angles_of_frames(frames) - ground
        energy = float(np.sum(recovered**2) / np.sum(strain**2) - 1.0)
        rows.append(
            {
                "n": n,
                "orthonormality": float(np.max(np.abs(frames[-1].T @ frames[-1] - np.eye(3)))),
                "plain": plain,
                "position": float(
                    np.linalg.norm(centres[-1] - end) / max(1.0, float(np.linalg.norm(end)))
                ),
                "energy": abs(energy),
            }
        )
    return rows


def long_double_end(angles: Any) -> tuple[Any, float]:
    """End of a chain in long double, and the orthonormality of a plain double product."""
    frame = np.eye(3, dtype=np.longdouble)
    plain = np.eye(3)
    centre = np.zeros(3, dtype=np.longdouble)
    for tau, theta, phi in angles.astype(np.longdouble):
        centre = centre + frame[:, 2]
        ct, st, ch, sh = np.cos(tau), np.sin(tau), np.cos(theta), np.sin(theta)
        cp, sp = np.cos(phi), np.sin(phi)
        zero, one = np.longdouble(0), np.longdouble(1)
        by_tau = np.array([[ct, -st, zero], [st, ct, zero], [zero, zero, one]])
        by_theta = np.array([[one, zero, zero], [zero, ch, sh], [zero, -sh, ch]])
        by_phi = np.array([[cp, zero, sp], [zero, one, zero], [-sp, zero, cp]])
        step = by_tau @ by_theta @ by_phi
        frame = frame @ step
        plain = plain @ step.astype(float)
    drift = float(np.max(np.abs(plain.T @ plain - np.eye(3))))
    return centre.astype(float), drift


CASES = (log_near_zero, log_near_pi, right_angles, quaternion_signs, long_products)
