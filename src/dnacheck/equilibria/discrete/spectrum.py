"""Eigenvalues of the projected Hessian of a closed ring."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.boundary_kernels import Boundary, ring_boundary, solve_held
from dnacheck.equilibria.discrete.kernels.states import (
    evaluate,
    factorise_state,
    new_factors,
    new_state,
    replace_rhs,
    substitute,
)
from dnacheck.model.chain import Chain

Array = NDArray[np.float64]

_LANCZOS_STEPS = 60
_LANCZOS_TOLERANCE = 1e-9


class ProjectedInverse:
    """The inverse of the projected Hessian at a point of a chain, applied in linear time.

    For a vector x (N, c) it gives Z (Z^T H Z)^-1 Z^T x, where Z spans the changes that keep the
    held components of the end where they are to first order.
    """

    def __init__(
        self,
        chain: Chain,
        angles: Array,
        multipliers: Array,
        boundary: Boundary | None = None,
    ) -> None:
        steps = chain.arrays
        # Copies: a ring's own arrays are read-only, for which kernels would be compiled anew.
        multipliers = np.array(multipliers)
        self.state = new_state(steps, boundary or ring_boundary())
        self.state.angles[:] = angles
        evaluate(self.state, steps)
        self.length = float(chain.n_steps)
        self.factors = new_factors(steps)
        self.small = np.empty((6, 7))
        factorise_state(
            self.state, steps, 0.0, multipliers, self.factors, self.small, self.state.gradient
        )

    def __call__(self, x: Array) -> Array:
        """Apply to ``x`` (N, c)."""
        replace_rhs(self.state, self.factors, x, self.small)
        multipliers = np.empty(6)
        solve_held(self.state.boundary, self.small, -self.small[:, 6], self.length, multipliers)
        step = np.empty_like(x)
        substitute(self.state, self.factors, multipliers, 1.0, step)
        return -step


def smallest_projected_eigenvalue(
    chain: Chain, angles: Array, multipliers: Array, boundary: Boundary | None = None
) -> float:
    """Algebraically smallest eigenvalue of the projected Hessian, by Lanczos on its inverse.

    In reduced energy per square radian, for the Euclidean metric of the 3N angles; of rigid steps,
    for that of their 6N coordinates in radians and units of length.
    """
    inverse = ProjectedInverse(chain, angles, multipliers, boundary)
    rng = np.random.default_rng(0)
    basis = [inverse(rng.standard_normal(chain.ground.shape))]
    basis[0] /= np.linalg.norm(basis[0])
    diagonal: list[float] = []
    off: list[float] = []
    previous = np.inf
    for _ in range(min(_LANCZOS_STEPS, chain.ground.size - 6)):
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
