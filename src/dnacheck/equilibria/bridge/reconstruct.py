"""Base-pair frames and step angles from a continuum ring (Section IX)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.model.chain import StepForm, angles_of_frames
from dnacheck.numerics.outcome import InputError
from dnacheck.numerics.superpose import superpose

if TYPE_CHECKING:
    from dnacheck.equilibria.ring import Equilibrium

Array = NDArray[np.float64]

# A d1 this nearly along d3 (cosine) has no direction left after projection.
_PARALLEL = 0.99


@dataclass(frozen=True)
class Reconstruction:
    """Base pairs of a continuum ring.

    Attributes
    ----------
    centres : ndarray, shape (N + 1, 3)
        Base-pair centres in steps; the last equals the first.
    frames : ndarray, shape (N + 1, 3, 3)
        Directors in the columns, orthonormal; the last frame is the fictitious base pair's.
    angles : ndarray, shape (N, 3)
        tau, theta, phi of every step, radians, in the order in which they are applied: the start
        for the discrete solver.
    step_length_spread : float
        Largest relative departure of the distances between neighbouring centres from one step.
    projection : float
        Largest angle in radians by which a d1 was turned into its normal plane.
    """

    centres: Array
    frames: Array
    angles: Array
    step_length_spread: float
    projection: float


def reconstruct(ring: Equilibrium, step_form: StepForm = "wedge") -> Reconstruction:
    """Sample a continuum ring at its base pairs.

    The centres are taken evenly along the centreline, shifted back by half a step,
    r(i) = r((2i - 1)/2N); d3(i) points from centre i to centre i + 1; d1(i) = d1(s = i/N) is
    projected onto the plane normal to d3(i). The angles come from atan2, not from the printed
    arcsin, and so are right beyond 90 degrees.

    Parameters
    ----------
    ring : Equilibrium
        In units of its own length, which is N steps.
    step_form : {"wedge", "midstep"}
        How the angles make a rotation, as in the chain.

    Raises
    ------
    InputError
        Two centres coincide, or a d1 lies along its d3.
    """
    n = ring.rod.n_steps
    index = np.arange(n)
    shifted = ((2.0 * index - 1.0) / (2.0 * n)) % 1.0
    order = np.argsort(shifted)
    centres = np.empty((n + 1, 3))
    centres[order] = n * ring.curve.centreline(shifted[order])
    centres[n] = centres[0]
    edges = np.diff(centres, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    if not np.min(lengths) > 1e-6:
        raise InputError("reconstruction: two base-pair centres coincide on the continuum ring")
    d3 = np.vstack([edges / lengths[:, None], edges[:1] / lengths[0]])
    d1 = ring.curve.true_frames(np.arange(n + 1) / n)[:, :, 0]
    along = np.sum(d1 * d3, axis=1)
    if np.max(np.abs(along)) > _PARALLEL:
        raise InputError("reconstruction: a d1 lies along the centreline; refine the mesh")
    d1 = d1 - along[:, None] * d3
    d1 /= np.linalg.norm(d1, axis=1, keepdims=True)
    # The rod may start at another base pair than the molecule.
    own = (np.arange(n + 1) - ring.rod.cut) % n
    centres, d1, d3 = centres[own], d1[own], d3[own]
    frames = np.stack([d1, np.cross(d3, d1), d3], axis=2)
    return Reconstruction(
        centres=centres,
        frames=frames,
        angles=angles_of_frames(frames, step_form),
        step_length_spread=float(np.max(np.abs(lengths - 1.0))),
        projection=float(np.max(np.abs(np.arcsin(along)))),
    )


def rms_difference(a: ArrayLike, b: ArrayLike, rise_A: float) -> float:
    """Rms distance in Å between two rings' base-pair centres after optimal superposition.

    Parameters
    ----------
    a, b : array_like, shape (N, 3) or (N + 1, 3)
        Centres in steps; with N + 1 the repeated last one is left out of both.
    rise_A : float
        Length of a step.
    """
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    if a.shape != b.shape:
        raise InputError(f"rings of {len(a)} and {len(b)} centres can't be superposed")
    closed = np.allclose(a[0], a[-1], atol=1e-6) and np.allclose(b[0], b[-1], atol=1e-6)
    stop = len(a) - 1 if closed else len(a)
    return superpose(a[:stop], b[:stop])[1] * rise_A
