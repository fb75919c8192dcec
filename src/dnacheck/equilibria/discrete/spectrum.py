"""Eigenvalues of the projected Hessian of a closed ring."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.discrete.kernels.closure import energy_gradient, linearise
from dnacheck.equilibria.discrete.kernels.factorisation import (
    FACTOR_WIDTH,
    back_substitute,
    eliminate,
    factorise,
)
from dnacheck.model.chain import Chain
from dnacheck.numerics.small_systems import solve_small

Array = NDArray[np.float64]

_LANCZOS_STEPS = 60
_LANCZOS_TOLERANCE = 1e-9


class ProjectedInverse:
    """The inverse of the projected Hessian at a point of a chain, applied in linear time.

    For a vector x (N, 3) it gives Z (Z^T H Z)^-1 Z^T x, where Z spans the changes that keep the
    chain closed to first order.
    """

    def __init__(self, chain: Chain, angles: Array, multipliers: Array) -> None:
        n, steps = chain.n_steps, chain.arrays
        # Copies: a ring's own arrays are read-only, for which kernels would be compiled anew.
        angles, multipliers = np.array(angles), np.array(multipliers)
        centres, frames = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
        axes, gradient = np.empty((n, 3, 3)), np.empty((n, 3))
        halves = np.empty((n if chain.form_code else 0, 5, 3))
        form = chain.form_code
        linearise(angles, form, centres, frames, axes, halves)
        energy_gradient(angles, steps.ground, steps.stiffness, gradient)
        self.length = float(n)
        self.factors = np.empty((n, FACTOR_WIDTH))
        self.small = np.empty((6, 7))
        factorise(
            gradient,
            steps.stiffness,
            0.0,
            form,
            centres,
            axes,
            halves,
            multipliers,
            self.factors,
            self.small,
        )

    def __call__(self, x: Array) -> Array:
        """Apply to ``x`` (N, 3)."""
        eliminate(self.factors, x, self.small)
        multipliers = np.empty(6)
        solve_small(self.small, -self.small[:, 6], self.length, multipliers)
        step = np.empty_like(x)
        back_substitute(self.factors, multipliers, 1.0, step)
        return -step


def smallest_projected_eigenvalue(chain: Chain, angles: Array, multipliers: Array) -> float:
    """Algebraically smallest eigenvalue of the projected Hessian, by Lanczos on its inverse.

    In reduced energy per square radian, for the Euclidean metric of the 3N angles.
    """
    inverse = ProjectedInverse(chain, angles, multipliers)
    rng = np.random.default_rng(0)
    basis = [inverse(rng.standard_normal((chain.n_steps, 3)))]
    basis[0] /= np.linalg.norm(basis[0])
    diagonal: list[float] = []
    off: list[float] = []
    previous = np.inf
    for _ in range(min(_LANCZOS_STEPS, 3 * chain.n_steps - 6)):
        w = inverse(basis[-1])
        diagonal.append(float(np.sum(w * basis[-1])))
        for v in basis:
            w -= np.sum(w * v) * v
        for v in basis:
            w -= np.sum(w * v) * v
        size = float(np.linalg.norm(w))
        values = _tridiagonal_eigenvalues(diagonal, off)
        # Beside a zero mode, whose inverse is huge, small values are its rounding errors.
        values = values[np.abs(values) > 1e-9 * np.abs(values).max()]
        negative = values[values < 0.0]
        chosen = negative.max() if negative.size else values.max()
        if abs(chosen - previous) <= _LANCZOS_TOLERANCE * abs(chosen) or size < 1e-300:
            break
        previous = chosen
        off.append(size)
        basis.append(w / size)
    return float(1.0 / chosen)


def _tridiagonal_eigenvalues(diagonal: list[float], off: list[float]) -> Array:
    matrix = np.diag(diagonal) + np.diag(off, 1) + np.diag(off, -1)
    return np.linalg.eigvalsh(matrix)
