"""Bead positions, frames, step angles and shape measures, in plain numpy.

Beads are interleaved: the centre and the groove bead of base pair 0, of base pair 1, and so on.
A closed ring of N base pairs has 2N beads. An open chain of N steps has N + 1 base pairs and one
more centre, which only shows where d3 of the last base pair points: 2N + 3 beads. Positions are
in Å; leading axes (frames of a trajectory) are carried along.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.model.chain import Chain, StepForm, chain_frames

Array = NDArray[np.float64]


def bead_count(n_steps: int, closed: bool) -> int:
    """Number of beads of a chain of ``n_steps``."""
    return 2 * n_steps if closed else 2 * n_steps + 3


def beads_of_angles(
    chain: Chain, angles: ArrayLike, closed: bool, groove_distance_A: float
) -> Array:
    """Bead positions, in Å, of a chain in given angles.

    Parameters
    ----------
    chain : Chain
    angles : array_like, shape (N, 3)
        Step angles; those of a ring must close.
    closed : bool
    groove_distance_A : float
        Distance of a groove bead from its centre, along d1.

    Returns
    -------
    ndarray, shape (n_beads, 3)
    """
    centres, frames = chain_frames(angles, chain.step_form)
    if not closed:
        centres = np.concatenate([centres, [centres[-1] + frames[-1, :, 2]]])
    pairs = chain.n_steps if closed else chain.n_steps + 1
    positions = np.empty((bead_count(chain.n_steps, closed), 3))
    positions[0::2] = chain.rise_A * centres[: len(positions[0::2])]
    positions[1::2] = positions[0 : 2 * pairs : 2] + groove_distance_A * frames[:pairs, :, 0]
    return positions


def frames_of_beads(positions: Array, closed: bool) -> tuple[Array, Array]:
    """Centres and frames from bead positions.

    Parameters
    ----------
    positions : ndarray, shape (..., n_beads, 3)

    Returns
    -------
    centres : ndarray, shape (..., N+1, 3)
        As given; a ring's first centre is repeated at the end.
    frames : ndarray, shape (..., N+1, 3, 3)
        Directors in columns: d3 points to the next centre, d1 is the groove bead's direction
        made perpendicular to it. A ring's first frame is repeated at the end.
    """
    centres = positions[..., 0::2, :]
    grooves = positions[..., 1::2, :]
    if closed:
        centres = np.concatenate([centres, centres[..., :1, :]], axis=-2)
    d3 = _unit(np.diff(centres, axis=-2))
    if not closed:
        centres = centres[..., :-1, :]
    start = centres[..., : grooves.shape[-2], :]
    arm = grooves - start
    d1 = _unit(arm - np.sum(arm * d3, axis=-1, keepdims=True) * d3)
    frames = np.stack([d1, np.cross(d3, d1), d3], axis=-1)
    if closed:
        frames = np.concatenate([frames, frames[..., :1, :, :]], axis=-3)
    return centres, frames


def step_angles(frames: Array, step_form: StepForm = "wedge") -> Array:
    """Step angles (..., N, 3) between successive frames (..., N+1, 3, 3), in radians.

    Written apart from :mod:`dnacheck.model.chain_kernels`, so that one checks the other.
    """
    step = np.einsum("...kij,...kil->...kjl", frames[..., :-1, :, :], frames[..., 1:, :, :])
    if step_form == "wedge":
        theta = np.arctan2(-step[..., 2, 1], np.hypot(step[..., 2, 0], step[..., 2, 2]))
        tau = np.arctan2(-step[..., 0, 1], step[..., 1, 1])
        phi = np.arctan2(-step[..., 2, 0], step[..., 2, 2])
        return np.stack([tau, theta, phi], axis=-1)
    tau = _parallel_twist(step)
    c, s = np.cos(0.5 * tau), np.sin(0.5 * tau)
    across = c * step[..., 0, 2] + s * step[..., 1, 2]
    along = c * step[..., 1, 2] - s * step[..., 0, 2]
    beyond = 1.0 + step[..., 2, 2]
    theta = 2.0 * np.arctan2(along, beyond)
    phi = 2.0 * np.arctan2(across, np.hypot(along, beyond))
    return np.stack([tau, theta, phi], axis=-1)


def strain(angles: Array, ground: Array) -> Array:
    """Difference of angles from their ground values, brought into [-pi, pi)."""
    return (angles - ground + np.pi) % (2.0 * np.pi) - np.pi


def elastic_energies_RT(chain: Chain, angles: Array) -> Array:
    """Elastic energy, in RT, of every frame of step angles (..., N, 3)."""
    d = strain(angles, chain.ground)
    product = np.einsum("...nij,...nj->...ni", chain.stiffness, d)
    return np.asarray(0.5 * chain.energy_scale_RT * np.sum(d * product, axis=(-2, -1)))


def log_volume_elements(angles: Array, step_form: StepForm = "wedge") -> Array:
    """Sum over the steps of ln(rotation volume element in the angles); see docs/md.md.

    cos(theta) for the wedge, cos(theta/2) cos^2(phi/2) for the mid-step form, up to constants.
    """
    theta, phi = angles[..., 1], angles[..., 2]
    if step_form == "wedge":
        terms = np.log(np.abs(np.cos(theta)))
    else:
        terms = np.log(np.abs(np.cos(0.5 * theta))) + 2.0 * np.log(np.abs(np.cos(0.5 * phi)))
    return np.asarray(terms.sum(axis=-1))


def planar_ring(chain: Chain, link: int, register: float, groove_distance_A: float) -> Array:
    """Beads of a planar circle of the given link, rolled about its own axis by ``register``.

    The circle is made here, from nothing but the number of base pairs: no solver's guess is used.

    Returns
    -------
    ndarray, shape (2N, 3)
        In Å.
    """
    n = chain.n_steps
    azimuth = 2.0 * np.pi * np.arange(n) / n
    radius = 0.5 * chain.rise_A / np.sin(np.pi / n)
    centres = radius * np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(n)], axis=1)
    d3 = _unit(np.roll(centres, -1, axis=0) - centres)
    up = np.array([0.0, 0.0, 1.0])
    side = np.cross(d3, up)
    roll = register + link * azimuth
    d1 = np.cos(roll)[:, None] * up + np.sin(roll)[:, None] * side
    positions = np.empty((2 * n, 3))
    positions[0::2] = centres
    positions[1::2] = centres + groove_distance_A * d1
    return positions


def twist_turns(frames: Array) -> Array:
    """Twist of the ribbon, in turns: the turning of d1 beyond parallel transport, summed."""
    step = np.einsum("...kij,...kil->...kjl", frames[..., :-1, :, :], frames[..., 1:, :, :])
    return np.asarray(_parallel_twist(step).sum(axis=-1) / (2.0 * np.pi))


def per_base_pair_fluctuation(centres: Array, reference: Array) -> Array:
    """Root mean square displacement of every base-pair centre about its mean position.

    Each frame is superposed on the reference (all centres, equal weights) before the mean is
    taken, so tumbling does not count. The same function serves any ensemble of rings.

    Parameters
    ----------
    centres : ndarray, shape (n_frames, N, 3)
        Centres of the N base pairs, in any unit of length.
    reference : ndarray, shape (N, 3)
        Ring to superpose on, such as the minimum.

    Returns
    -------
    ndarray, shape (N,)
        In the unit of the input.
    """
    moved = superposed(centres, reference)
    deviation = moved - moved.mean(axis=0)
    return np.asarray(np.sqrt(np.mean(np.sum(deviation**2, axis=2), axis=0)))


def superposed(centres: Array, reference: Array) -> Array:
    """Every frame of ``centres`` (n_frames, N, 3) rigidly moved onto ``reference`` (N, 3)."""
    about = reference.mean(axis=0)
    moving = centres - centres.mean(axis=1, keepdims=True)
    u, _, vt = np.linalg.svd(np.einsum("fni,nj->fij", moving, reference - about))
    # A reflection would fit better where the product has determinant -1; it is not allowed.
    u[:, :, 2] *= np.linalg.det(u @ vt)[:, None]
    return np.asarray(moving @ (u @ vt) + about)


def _parallel_twist(step: Array) -> Array:
    return np.arctan2(step[..., 1, 0] - step[..., 0, 1], step[..., 0, 0] + step[..., 1, 1])


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
