"""The continuum ring by ``scipy.integrate.solve_bvp``, in the paper's own fourteen variables.

Written apart from the package's solver: (4.9) with (4.11) for (r, q, n, mu), the energy as a
fifteenth variable, analytic Jacobians, and the rolled perfect ring (4.12) as the start. All it
takes from the package is the rod: strains, stiffnesses and end rotation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np


class RodLike(Protocol):
    """What the oracle needs to know about a rod."""

    bend_stiffness: float
    twist_stiffness: float
    end_rotation: float
    breaks: Any

    def strains(self, s: Any) -> Any: ...

    def relative_compliance(self, s: Any) -> Any: ...


@dataclass(frozen=True)
class OracleRing:
    """What ``solve_bvp`` found: reduced energy, end moment m3(0), and its own report."""

    energy: float
    end_moment: float
    force: np.ndarray
    nodes: int
    rms_residual: float
    success: bool
    message: str
    solution: Any


# q' = Q(u) q / 2 and mu' = Q(u) mu / 2 - (d d3/dq)^T n, with Q(u) = sum u_j B_j.
_B = np.zeros((3, 4, 4))
for _j, _pairs in enumerate((((0, 3), (1, 2)), ((2, 0), (1, 3)), ((0, 1), (2, 3)))):
    for _a, _b in _pairs:
        _B[_j, _a, _b], _B[_j, _b, _a] = 1.0, -1.0


def _tangent(q: Any) -> Any:
    return np.stack(
        [
            2 * (q[0] * q[2] + q[1] * q[3]),
            2 * (q[1] * q[2] - q[0] * q[3]),
            q[2] ** 2 + q[3] ** 2 - q[0] ** 2 - q[1] ** 2,
        ]
    )


def _tangent_by_q(q: Any) -> Any:
    """(3, 4, m)."""
    x, y, z, w = q
    return 2 * np.stack([[z, w, x, y], [-w, z, y, -x], [-x, -y, z, w]])


# Second derivatives of d3 by q are constant: entry (i, a, b).
_SECOND = np.zeros((3, 4, 4))
_SECOND[0, 0, 2] = _SECOND[0, 2, 0] = _SECOND[0, 1, 3] = _SECOND[0, 3, 1] = 2.0
_SECOND[1, 1, 2] = _SECOND[1, 2, 1] = 2.0
_SECOND[1, 0, 3] = _SECOND[1, 3, 0] = -2.0
_SECOND[2] = np.diag([-2.0, -2.0, 2.0, 2.0])


class _Problem:
    def __init__(self, rod: RodLike, alpha: float, gamma: float = 1.0) -> None:
        self.rod = rod
        self.alpha = alpha
        self.gamma = gamma

    def compliance(self, s: Any) -> Any:
        relative = self.rod.relative_compliance(s).T
        bend = relative[0] / self.rod.bend_stiffness
        return np.stack([bend, bend, relative[1] / self.rod.twist_stiffness])

    def fun(self, s: Any, y: Any) -> Any:
        q, n, mu = y[3:7], y[7:10], y[10:14]
        m = 0.5 * np.einsum("am,jab,bm->jm", mu, _B, q)
        c = self.compliance(s)
        u = c * m
        u[:2] += self.gamma * self.rod.strains(s).T
        out = np.empty_like(y)
        out[:3] = _tangent(q)
        out[3:7] = 0.5 * np.einsum("jm,jab,bm->am", u, _B, q)
        out[7:10] = 0.0
        out[10:14] = 0.5 * np.einsum("jm,jab,bm->am", u, _B, mu)
        out[10:14] -= np.einsum("iam,im->am", _tangent_by_q(q), n)
        out[14] = 0.5 * np.sum(c * m * m, axis=0)
        return out

    def jac(self, s: Any, y: Any) -> Any:
        q, n, mu = y[3:7], y[7:10], y[10:14]
        c = self.compliance(s)
        bq = np.einsum("jab,bm->jam", _B, q)
        bmu = np.einsum("jab,bm->jam", _B, mu)
        m = 0.5 * np.einsum("am,jam->jm", mu, bq)
        u = c * m
        u[:2] += self.gamma * self.rod.strains(s).T
        turn = 0.5 * np.einsum("jm,jab->abm", u, _B)
        # m_j by q is -B_j mu / 2 (B_j is skew), by mu is B_j q / 2
        out = np.zeros((15, 15, s.size))
        out[:3, 3:7] = _tangent_by_q(q)
        out[3:7, 3:7] = turn - 0.25 * np.einsum("jm,jam,jbm->abm", c, bq, bmu)
        out[3:7, 10:14] = 0.25 * np.einsum("jm,jam,jbm->abm", c, bq, bq)
        out[10:14, 3:7] = -0.25 * np.einsum("jm,jam,jbm->abm", c, bmu, bmu)
        out[10:14, 3:7] -= np.einsum("iab,im->abm", _SECOND, n)
        out[10:14, 7:10] = -np.swapaxes(_tangent_by_q(q), 0, 1)
        out[10:14, 10:14] = turn + 0.25 * np.einsum("jm,jam,jbm->abm", c, bmu, bq)
        out[14, 3:7] = -0.5 * np.einsum("jm,jm,jam->am", c, m, bmu)
        out[14, 10:14] = 0.5 * np.einsum("jm,jm,jam->am", c, m, bq)
        return out

    def bc(self, ya: Any, yb: Any) -> Any:
        target = np.array([0.0, 0.0, -np.sin(self.alpha / 2), -np.cos(self.alpha / 2)])
        return np.concatenate([ya[:6], ya[13:15], yb[:3], yb[3:7] - target])

    def start(self, s: Any) -> Any:
        """(4.12), corrected, rolled to the register of least first-order energy."""
        k1, k3, alpha = self.rod.bend_stiffness, self.rod.twist_stiffness, self.alpha
        w = self.rod.strains(s).T
        integrand = (w[0] + 1j * w[1]) * np.exp(1j * alpha * s)
        roll = float(np.angle(np.trapezoid(integrand, s)))
        sp, cp = np.sin(np.pi * s), np.cos(np.pi * s)
        sa, ca = np.sin(alpha * s / 2), np.cos(alpha * s / 2)
        r = np.stack([0 * s, np.cos(2 * np.pi * s) - 1, np.sin(2 * np.pi * s)]) / (2 * np.pi)
        q = np.stack([sp * ca, -sp * sa, cp * sa, cp * ca])
        bend, twist = 4 * np.pi * k1, 2 * alpha * k3
        mu = np.stack(
            [
                bend * cp * ca - twist * sp * sa,
                -bend * cp * sa - twist * sp * ca,
                -bend * sp * sa + twist * cp * ca,
                -bend * sp * ca - twist * cp * sa,
            ]
        )
        force = 2 * np.pi * k3 * alpha
        c, sn = np.cos(roll), np.sin(roll)
        turned = np.stack([c * r[0] - sn * r[1], sn * r[0] + c * r[1], r[2]])
        n = np.stack([force * c + 0 * s, force * sn + 0 * s, 0 * s])
        energy = s * (0.5 * k1 * (2 * np.pi) ** 2 + 0.5 * k3 * alpha**2)
        return np.concatenate([turned, _roll(q, roll), n, _roll(mu, roll), energy[None]], axis=0)


def _roll(v: Any, roll: float) -> Any:
    """Quaternions turned about e3: z(roll) v z(-roll) leaves components 3 and 4 alone."""
    c, sn = np.cos(roll), np.sin(roll)
    return np.stack([c * v[0] - sn * v[1], sn * v[0] + c * v[1], v[2], v[3]])


# Fractions of the intrinsic curvature to pass through: none if Newton's method takes the rolled
# perfect ring at once, else ever more.
_PATHS = (
    (1.0,),
    (0.5, 1.0),
    (0.25, 0.5, 0.75, 1.0),
    (0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0),
)


def solve(rod: RodLike, link: int, tol: float = 1e-8, nodes: int = 60) -> OracleRing:
    """Equilibrium ring of the rod at a link, by ``solve_bvp``.

    Parameters
    ----------
    rod : RodLike
    link : int
        Sets alpha = Omega(1) - Omega(0) + 2 pi link.
    tol : float
        Relative residual asked of ``solve_bvp``.
    nodes : int
        Nodes of the first mesh, to which the rod's knots are added.
    """
    from scipy.integrate import solve_bvp

    alpha = rod.end_rotation + 2 * np.pi * link
    mesh = np.unique(np.concatenate([np.linspace(0.0, 1.0, nodes), np.asarray(rod.breaks)]))
    mesh = mesh[np.concatenate([[True], np.diff(mesh) > 1e-9])]
    mesh[-1] = 1.0
    for path in _PATHS:
        s, y = mesh, _Problem(rod, alpha).start(mesh)
        for gamma in path:
            problem = _Problem(rod, alpha, gamma)
            last = gamma == 1.0
            with np.errstate(all="ignore"):  # a path that diverges is followed by a finer one
                found = solve_bvp(
                    problem.fun,
                    problem.bc,
                    s,
                    y,
                    fun_jac=problem.jac,
                    tol=max(tol, 1e-4),
                    max_nodes=800,
                )
                if found.success and last and tol < 1e-4:
                    found = solve_bvp(
                        problem.fun,
                        problem.bc,
                        found.x,
                        found.y,
                        fun_jac=problem.jac,
                        tol=tol,
                        bc_tol=1e-10,
                        max_nodes=100_000,
                    )
            if not found.success:
                break
            s, y = found.x, found.y
        if found.success:
            break
    moment = 0.5 * np.einsum("a,jab,b->j", found.y[10:14, 0], _B, found.y[3:7, 0])
    return OracleRing(
        energy=float(found.y[14, -1]),
        end_moment=float(moment[2]),
        force=found.y[7:10, 0],
        nodes=int(found.x.size),
        rms_residual=float(np.max(found.rms_residuals)),
        success=bool(found.success),
        message=str(found.message),
        solution=found.sol,
    )
