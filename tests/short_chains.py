"""Short, soft chains on which sampling can be checked by brute force."""

from __future__ import annotations

import functools

import numpy as np

from dnacheck.equilibria.discrete.kernels.starts import fill_circle
from dnacheck.model.chain import Chain, uniform_stiffness


@functools.cache
def closed_ground_chain(n: int = 30, link: int = 3, stiffness_RT: float = 40.0) -> Chain:
    """A chain that rests as a planar ring: closure costs no energy, J is large."""
    ground = np.empty((n, 3))
    straight = np.zeros((n, 3))
    straight[:, 0] = 2.0 * np.pi * link / n
    fill_circle(straight, 0, link, 0.3, ground)
    return Chain(
        "closed", ground, uniform_stiffness(n, 1.5), persistence_length_A=3.4 * stiffness_RT
    )


def soft_chain(n: int, stiffness_RT: float, seed: int = 1) -> Chain:
    """A chain with uneven ground angles and a full stiffness matrix on every step."""
    rng = np.random.default_rng(seed)
    ground = np.column_stack(
        [rng.uniform(0.4, 0.8, n), rng.uniform(-0.3, 0.3, n), rng.uniform(-0.3, 0.3, n)]
    )
    root = np.eye(3) + 0.2 * rng.standard_normal((n, 3, 3))
    return Chain(
        "soft", ground, root @ root.transpose(0, 2, 1), persistence_length_A=3.4 * stiffness_RT
    )


def exact_free_angles(chain: Chain, samples: int, rng: np.random.Generator) -> np.ndarray:
    """Independent draws (samples, N, 3) from the free chain."""
    covariance = np.linalg.inv(chain.energy_scale_RT * chain.stiffness)
    roots = np.linalg.cholesky(covariance)
    normals = rng.standard_normal((samples, *chain.ground.shape))
    return chain.ground + np.einsum("sij,tsj->tsi", roots, normals)


def end_poses(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ends (M, 3) and end frames (M, 3, 3) of chains (M, N, 3), by plain matrix products (2.1)."""
    end = np.zeros((len(angles), 3))
    frame = np.broadcast_to(np.eye(3), (len(angles), 3, 3))
    for s in range(angles.shape[1]):
        tau, theta, phi = angles[:, s].T
        one, zero = np.ones_like(tau), np.zeros_like(tau)
        twist = np.array(
            [
                [np.cos(tau), -np.sin(tau), zero],
                [np.sin(tau), np.cos(tau), zero],
                [zero, zero, one],
            ]
        )
        roll = np.array(
            [
                [one, zero, zero],
                [zero, np.cos(theta), np.sin(theta)],
                [zero, -np.sin(theta), np.cos(theta)],
            ]
        )
        tilt = np.array(
            [
                [np.cos(phi), zero, np.sin(phi)],
                [zero, one, zero],
                [-np.sin(phi), zero, np.cos(phi)],
            ]
        )
        end = end + frame[:, :, 2]
        step = np.einsum("ijm,jkm,klm->mil", twist, roll, tilt)
        frame = frame @ step
    return end, frame
