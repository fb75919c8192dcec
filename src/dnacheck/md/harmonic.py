"""Small fluctuations about a minimum, from the Hessian of OpenMM's forces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dnacheck.md.bead_chain import BeadEnergy
from dnacheck.md.minimise import BeadMinimum, MinimiseOptions, folded_order, hessian_band
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

LARGEST_DENSE = 600
"""Base pairs up to which the Hessian is treated as a full matrix."""


def hessian(energy: BeadEnergy, minimum: BeadMinimum) -> Array:
    """Second derivatives (6N, 6N) of the energy at a minimum, RT/Å².

    Raises
    ------
    InputError
        More than :data:`LARGEST_DENSE` base pairs.
    """
    n = energy.beads.chain.n_steps
    if n > LARGEST_DENSE:
        raise InputError(f"a full Hessian of {n} base pairs is too large; up to {LARGEST_DENSE}")
    energy.beads.set_bond_rest(energy.context, minimum.bond_rest_A)
    folded = folded_order(n)
    band = hessian_band(energy, minimum.positions, MinimiseOptions().difference_A, folded)
    full = np.zeros((6 * n, 6 * n))
    for d in range(len(band)):
        columns = np.arange(6 * n - d)
        full[columns + d, columns] = full[columns, columns + d] = band[d, : 6 * n - d]
    order = (6 * folded[:, None] + np.arange(6)).ravel()
    return full[np.ix_(order, order)]


def harmonic_fluctuation(energy: BeadEnergy, minimum: BeadMinimum) -> Array:
    """Root mean square displacement (N,) of every centre, in Å, in the harmonic approximation.

    That is the Laplace covariance, with displacements superposed as in
    :func:`~dnacheck.md.geometry.per_base_pair_fluctuation` (to first order). It is infinite where
    the minimum has a zero mode, such as the roll of a straight molecule, that moves centres.
    """
    from scipy.linalg import cho_factor, cho_solve

    n = energy.beads.chain.n_steps
    matrix = hessian(energy, minimum)
    rigid = _rigid_motions(minimum.positions)
    scale = float(np.max(np.diagonal(matrix)))
    # Rigid motions become stiff; the superposition below removes what is left of them.
    factor = cho_factor(matrix + scale * rigid @ rigid.T)
    centre = np.zeros((6 * n, 3 * n))
    rows = (6 * np.arange(n)[:, None] + np.arange(3)).ravel()
    centre[rows, np.arange(3 * n)] = 1.0
    covariance = cho_solve(factor, centre)[rows]
    motions = _rigid_motions(minimum.centres_A)
    remove = np.eye(3 * n) - motions @ motions.T
    covariance = remove @ covariance @ remove
    return np.asarray(np.sqrt(np.diagonal(covariance).reshape(n, 3).sum(axis=1)))


def _rigid_motions(points: Array) -> Array:
    """Orthonormal basis (3n, 6) of the translations and rotations of points (n, 3)."""
    arm = points - points.mean(axis=0)
    motions = np.zeros((6, *points.shape))
    for k in range(3):
        motions[k, :, k] = 1.0
        motions[3 + k] = np.cross(np.eye(3)[k], arm)
    return np.asarray(np.linalg.qr(motions.reshape(6, -1).T)[0])
