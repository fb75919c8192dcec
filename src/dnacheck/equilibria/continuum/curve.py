"""The curve of a continuum rod: the solution of (4.9) with (4.11) as functions of arclength."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.equilibria.continuum.collocation import gauss_rule
from dnacheck.equilibria.continuum.equations import B, directors
from dnacheck.equilibria.continuum.kernels.interpolate import evaluate
from dnacheck.model.rod.rod import Rod

Array = NDArray[np.float64]


def evaluate_curve(
    s: Array, mesh: Array, slopes: Array, quaternions: Array, centres: Array
) -> tuple[Array, Array, Array]:
    """Collocation polynomials at the points s; arrays as in ``kernels.interpolate.evaluate``.

    Returns
    -------
    q, r, u : ndarray, shapes (m, 4), (m, 3), (m, 3)
        Natural frame, position, and strain rate in laboratory axes.
    """
    rule = gauss_rule(slopes.shape[1])
    out = np.empty((s.size, 4)), np.empty((s.size, 3)), np.empty((s.size, 3))
    # Read-only views, whatever comes in: the kernel is compiled for one kind of array.
    views = [array.view() for array in (s, mesh, slopes, quaternions, centres)]
    for view in views:
        view.setflags(write=False)
    s, mesh, slopes, quaternions, centres = views
    q, r, u = out
    evaluate(s, mesh, slopes, quaternions, centres, rule.integrals, rule.to_powers, q, r, u)
    return out


@dataclass(frozen=True)
class Curve:
    """What solves a continuum rod: directors and centreline as functions of arclength.

    Attributes
    ----------
    rod : Rod
    alpha : float
        Angle from D1(0) to D1(1) of the end conditions (4.11), counted along the rod: the ring of
        the requested link has alpha = Omega(1) - Omega(0) + 2 pi link when it is nearly planar.
    bend, twist : float
        Parts of the reduced energy (K_theta = 1).
    end_moment : float
        m3(0), the moment about d3 at the end, reduced energy.
    loads : ndarray, shape (6,)
        m(0) and the constant force n in laboratory axes, which are the directors at s = 0.
    energy_error, shape_error : float or None
        Estimated errors of the energy and, in radians, of the frames, both taken from the mesh
        before the last and so pessimistic; None where no second mesh was solved.
    mesh : ndarray, shape (K + 1,)
    slopes : ndarray, shape (K, k, 3)
        Rates of the local Gibbs vector at the Gauss points, the solver's own unknowns.
    quaternions : ndarray, shape (K + 1, 4)
    centres : ndarray, shape (K + 1, 3)
        Natural frame (4.8) and position at the mesh points; lengths in units of the rod's.
    """

    rod: Rod
    alpha: float
    bend: float
    twist: float
    end_moment: float
    loads: Array
    energy_error: float | None
    shape_error: float | None
    mesh: Array
    slopes: Array
    quaternions: Array
    centres: Array

    @property
    def intervals(self) -> int:
        """Intervals of the mesh."""
        return int(self.mesh.size - 1)

    @property
    def degree(self) -> int:
        """Gauss points per interval."""
        return int(self.slopes.shape[1])

    def _evaluate(self, s: ArrayLike) -> tuple[Array, Array, Array]:
        s = np.ascontiguousarray(np.atleast_1d(np.asarray(s, dtype=float)))
        return evaluate_curve(s, self.mesh, self.slopes, self.quaternions, self.centres)

    def centreline(self, s: ArrayLike) -> Array:
        """r(s), shape (m, 3), in units of the rod's length."""
        return self._evaluate(s)[1]

    def natural_frames(self, s: ArrayLike) -> Array:
        """D1, D2, D3 in the columns, shape (m, 3, 3)."""
        return directors(self._evaluate(s)[0])

    def true_frames(self, s: ArrayLike) -> Array:
        """d1, d2, d3 in the columns, shape (m, 3, 3): the natural frames turned back by Omega.

        (6.1): D1 = cos(Omega) d1 + sin(Omega) d2. Frame 0 of the natural frame is the laboratory
        frame, so d1(0) is turned from e1 by -Omega(0).
        """
        frames = self.natural_frames(s)
        omega = self.rod.frame_angle(s)[:, None]
        c, sn = np.cos(omega), np.sin(omega)
        first, second = frames[..., 0], frames[..., 1]
        return np.stack([c * first - sn * second, sn * first + c * second, frames[..., 2]], axis=-1)

    def solution(self, s: ArrayLike) -> Array:
        """r, q, n, mu of (4.9) at s, shape (m, 14).

        mu follows from the moment m(s) = m(0) - r x n: mu = 2 sum_j m_j B_j q - 2 (r.n) q, whose
        last term is the integral of (mu.q)' = -2 d3.n with mu_4(0) = 0.
        """
        q, r, _ = self._evaluate(s)
        n = np.broadcast_to(self.loads[3:], r.shape)
        moment = self.loads[:3] - np.cross(r, n)
        local = np.einsum("mij,mi->mj", directors(q), moment)
        mu = 2.0 * np.einsum("mj,jab,mb->ma", local, B, q)
        mu -= 2.0 * np.sum(r * n, axis=1, keepdims=True) * q
        return np.concatenate([r, q, n, mu], axis=1)
