"""Gauss points, meshes that respect the rod's knots, and coefficients at the collocation points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dnacheck.model.rod.rod import Rod

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GaussRule:
    """Gauss collocation on [0, 1] with k points.

    Attributes
    ----------
    points, weights : ndarray, shape (k,)
    integrals : ndarray, shape (k, k)
        Entry (j, l): integral from 0 to point j of the l-th Lagrange polynomial.
    to_powers : ndarray, shape (k, k)
        Values at the points to coefficients of 1, x, .., x**(k-1).
    """

    points: Array
    weights: Array
    integrals: Array
    to_powers: Array


@lru_cache(maxsize=16)
def gauss_rule(k: int) -> GaussRule:
    """The rule with ``k`` points, read-only and shared."""
    x, w = np.polynomial.legendre.leggauss(k)
    points, weights = 0.5 * (x + 1.0), 0.5 * w
    to_powers = np.linalg.inv(np.vander(points, increasing=True))
    powers = np.arange(1, k + 1)
    integrals = (points[:, None] ** powers / powers) @ to_powers
    arrays = [np.ascontiguousarray(v, dtype=float) for v in (points, weights, integrals, to_powers)]
    for array in arrays:
        array.setflags(write=False)
    return GaussRule(*arrays)


def aligned_mesh(breaks: Array, intervals: int | None) -> Array:
    """Mesh on [0, 1], shape (K + 1,), whose points include the rod's breaks where possible.

    The strains are smooth between the breaks only, so an interval across one loses the order of
    the method. With fewer intervals than pieces the mesh is uniform; None gives one interval per
    piece, split where a piece is more than 1.5 times longer than the average.
    """
    lengths = np.diff(breaks)
    if intervals is None:
        counts = np.maximum(1, np.ceil(lengths / (1.5 * lengths.mean()))).astype(int)
    elif intervals < lengths.size:
        return np.arange(intervals + 1.0) / intervals
    else:
        counts = np.ones(lengths.size, dtype=int)
        for _ in range(intervals - lengths.size):
            counts[np.argmax(lengths / counts)] += 1
    pieces = [
        breaks[i] + lengths[i] * np.arange(counts[i]) / counts[i] for i in range(lengths.size)
    ]
    return np.concatenate([*pieces, [1.0]])


def bisect(mesh: Array, marked: NDArray[np.bool_]) -> Array:
    """Halve the marked intervals."""
    middle = 0.5 * (mesh[1:] + mesh[:-1])
    return np.sort(np.concatenate([mesh, middle[marked]]))


@dataclass(frozen=True)
class Discretisation:
    """A rod on a mesh.

    Attributes
    ----------
    rod : Rod
    mesh : ndarray, shape (K + 1,)
    h : ndarray, shape (K,)
    rule : GaussRule
    points : ndarray, shape (K k,)
        All collocation points.
    strains : ndarray, shape (K k, 2)
        w1hat, w2hat there.
    compliance : ndarray, shape (K k, 2)
        Bending and twisting compliance there.
    """

    rod: Rod
    mesh: Array
    h: Array
    rule: GaussRule
    points: Array
    strains: Array
    compliance: Array

    def coefficients(self, fraction: float = 1.0, twist_factor: float = 1.0) -> Array:
        """w1hat, w2hat and the compliances at the collocation points, shape (K, k, 4).

        ``fraction`` is the gamma of Section VII; ``twist_factor`` multiplies K3.
        """
        out = np.empty((self.h.size, self.rule.points.size, 4))
        flat = out.reshape(-1, 4)
        flat[:, :2] = fraction * self.strains
        flat[:, 2] = self.compliance[:, 0]
        flat[:, 3] = self.compliance[:, 1] / twist_factor
        return out


def discretise(rod: Rod, mesh: Array, degree: int) -> Discretisation:
    """Evaluate the rod at the collocation points of a mesh with ``degree`` points an interval."""
    rule = gauss_rule(degree)
    h = np.diff(mesh)
    points = (mesh[:-1, None] + h[:, None] * rule.points).ravel()
    compliance = rod.relative_compliance(points)
    compliance = compliance / np.array([rod.bend_stiffness, rod.twist_stiffness])
    mesh = mesh.copy()
    for array in (mesh, h, points):
        array.setflags(write=False)
    return Discretisation(rod, mesh, h, rule, points, rod.strains(points), compliance)
