"""Stiffnesses of the continuum rod from those of the steps (Section V).

The paper's rule is K1 = K_theta/N, K2 = K_phi/N, K3 = K_tau/N (5.3) with K_theta = K_phi. For a
sequence-dependent stiffness the moment varies slowly along the rod while the base pairs turn
quickly, so it is the compliance, not the stiffness, that averages: every step's compliance matrix
is turned into the natural frame and averaged with the weights of the filter. What is left of
bending anisotropy and of bend-twist coupling must be small, because the rod of (4.9) is taken as
transversely isotropic in the natural frame; otherwise the conversion is refused.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.model.rod.options import RodOptions
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

# theta turns by -theta about d1 in the convention of (2.1): sign of (u1, u2, u3) against
# (theta, phi, tau).
_SIGN = np.array([-1.0, 1.0, 1.0])


@dataclass(frozen=True)
class RodStiffness:
    """Transversely isotropic stiffness along the rod, per unit s.

    Attributes
    ----------
    bend, twist : float
        K1 = K2 and K3, harmonic means along the rod (its exact values when uniform).
    profile : ndarray, shape (N, 2), or None
        Local compliance of bending and twisting at the middle of every step relative to the
        mean, 1 on average; None when uniform.
    anisotropy, coupling : float
        Largest relative bending anisotropy and bend-twist coupling left after averaging.
    """

    bend: float
    twist: float
    profile: Array | None
    anisotropy: float
    coupling: float


def _body_compliance(stiffness: Array) -> Array:
    """Compliances (N, 3, 3) along (d1, d2, d3) from stiffnesses in (tau, theta, phi)."""
    order = np.array([1, 2, 0])
    reordered = stiffness[:, order][:, :, order] * np.outer(_SIGN, _SIGN)
    return np.asarray(np.linalg.inv(reordered), dtype=float)


def require_positive(stiffness: Array) -> None:
    """Refuse stiffnesses (N, 3, 3) that are not positive definite.

    Raises
    ------
    InputError
    """
    smallest = np.linalg.eigvalsh(stiffness)[:, 0]
    if not np.all(smallest > 0.0):
        step = int(np.argmin(smallest))
        raise InputError(f"stiffness of step {step + 1}: not positive definite; correct its matrix")


def rod_stiffness(stiffness: Array, phase: Array, options: RodOptions) -> RodStiffness:
    """Average the step stiffnesses in the natural frame.

    Parameters
    ----------
    stiffness : ndarray, shape (N, 3, 3)
        Symmetric positive, order (tau, theta, phi).
    phase : ndarray, shape (N,)
        Omega at the bending axes of each step.
    options : RodOptions

    Raises
    ------
    InputError
        Too much anisotropy or coupling survives the average.
    """
    n = len(stiffness)
    compliance = _body_compliance(stiffness)
    cosine, sine = np.cos(phase), np.sin(phase)
    turn = np.zeros((n, 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = cosine
    turn[:, 0, 1], turn[:, 1, 0], turn[:, 2, 2] = sine, -sine, 1.0
    natural = turn @ compliance @ turn.transpose(0, 2, 1)
    # Trace and twist entries are the same in every frame about d3, so they may be averaged
    # cyclically; the rest is averaged with one-sided windows at the ends.
    scalar = np.stack([0.5 * (natural[:, 0, 0] + natural[:, 1, 1]), natural[:, 2, 2]], axis=1)
    width = options.filter_width
    weights = np.convolve(np.ones(width), np.ones(width)) / width**2
    reach = width - 1
    cyclic = scalar[np.arange(-reach, n + reach) % n]
    local = np.stack([np.convolve(cyclic[:, c], weights, "valid") for c in range(2)], axis=1)
    norm = np.convolve(np.ones(n), weights)[reach : reach + n]

    def windowed(values: Array) -> Array:
        return np.convolve(values, weights)[reach : reach + n] / norm

    half_difference = windowed(0.5 * (natural[:, 0, 0] - natural[:, 1, 1]))
    off_diagonal = windowed(natural[:, 0, 1])
    anisotropy = float(np.max(np.hypot(half_difference, off_diagonal) / local[:, 0]))
    coupled = np.hypot(windowed(natural[:, 0, 2]), windowed(natural[:, 1, 2]))
    coupling = float(np.max(coupled / np.sqrt(local[:, 0] * local[:, 1])))
    limit = options.anisotropy_limit
    if max(anisotropy, coupling) > limit:
        what = "bending anisotropy" if anisotropy >= coupling else "bend-twist coupling"
        raise InputError(
            f"stiffness: a {what} of {max(anisotropy, coupling):.2g} survives the average over "
            f"the filter window (limit {limit}): the continuum rod is transversely isotropic; "
            "widen filter_width, or use the discrete model"
        )
    mean = scalar.mean(axis=0)
    spread = np.max(np.abs(scalar / mean - 1.0))
    # A uniform stiffness keeps (5.3) exactly, without a profile to evaluate.
    profile = None if spread < 1e-12 else local / mean
    return RodStiffness(
        bend=1.0 / (n * float(mean[0])),
        twist=1.0 / (n * float(mean[1])),
        profile=profile,
        anisotropy=anisotropy,
        coupling=coupling,
    )
