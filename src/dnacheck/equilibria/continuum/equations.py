"""The equilibrium equations as the paper prints them, and their closed-form solution.

The solver works with the same equations in fewer unknowns (see ``kernels.condense``); this module
states them in the paper's fourteen variables (r, q, n, mu), for checks, for independent solvers
and for whoever wants to read them next to the text.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: B_1, B_2, B_3 of Section IV B: mu^T B_j q / 2 is the moment about d_j, B_j q / 2 the rate of q
#: under a unit strain u_j.
B = np.array(
    [
        [[0, 0, 0, 1], [0, 0, 1, 0], [0, -1, 0, 0], [-1, 0, 0, 0]],
        [[0, 0, -1, 0], [0, 0, 0, 1], [1, 0, 0, 0], [0, -1, 0, 0]],
        [[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]],
    ],
    dtype=float,
)
B.setflags(write=False)


def directors(q: ArrayLike) -> Array:
    """d1, d2, d3 of (4.8) in the columns, shape (..., 3, 3), from q (..., 4), scalar part last."""
    x, y, z, w = np.moveaxis(np.asarray(q, dtype=float), -1, 0)
    return np.stack(
        [
            np.stack([x * x - y * y - z * z + w * w, 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
            np.stack(
                [2 * (x * y + z * w), -x * x + y * y - z * z + w * w, 2 * (y * z - x * w)], -1
            ),
            np.stack(
                [2 * (x * z - y * w), 2 * (y * z + x * w), -x * x - y * y + z * z + w * w], -1
            ),
        ],
        axis=-2,
    )


def moments(q: ArrayLike, mu: ArrayLike) -> Array:
    """Moments m_j = mu^T B_j q / 2 about the directors, shape (..., 3)."""
    return 0.5 * np.einsum("...a,jab,...b->...j", np.asarray(mu), B, np.asarray(q))


def rates(state: ArrayLike, strains: ArrayLike, stiffness: ArrayLike) -> Array:
    """Right-hand side of (4.9).

    Parameters
    ----------
    state : array_like, shape (..., 14)
        r (3), q (4), n (3), mu (4).
    strains : array_like, shape (..., 3)
        Unstressed strains u1hat, u2hat, u3hat at the same s.
    stiffness : array_like, shape (..., 3)
        K1, K2, K3.

    Returns
    -------
    ndarray, shape (..., 14)
        r' = d3, q' = sum_j u_j B_j q / 2, n' = 0,
        mu' = -(d d3/d q)^T n + sum_j u_j B_j mu / 2, with u_j = m_j / K_j + u_jhat.
    """
    state = np.asarray(state, dtype=float)
    q, n, mu = state[..., 3:7], state[..., 7:10], state[..., 10:14]
    u = moments(q, mu) / np.asarray(stiffness) + np.asarray(strains)
    turn = 0.5 * np.einsum("...j,jab->...ab", u, B)
    x, y, z, w = np.moveaxis(q, -1, 0)
    jacobian = 2.0 * np.stack(
        [np.stack([z, w, x, y], -1), np.stack([-w, z, y, -x], -1), np.stack([-x, -y, z, w], -1)],
        axis=-2,
    )
    return np.concatenate(
        [
            directors(q)[..., :, 2],
            np.einsum("...ab,...b->...a", turn, q),
            np.zeros_like(n),
            -np.einsum("...ia,...i->...a", jacobian, n) + np.einsum("...ab,...b->...a", turn, mu),
        ],
        axis=-1,
    )


def end_conditions(first: ArrayLike, last: ArrayLike, alpha: float) -> Array:
    """Fourteen residuals of (4.11), from the states (14,) at s = 0 and s = 1."""
    first, last = np.asarray(first, dtype=float), np.asarray(last, dtype=float)
    target = np.array([0.0, 0.0, -np.sin(0.5 * alpha), -np.cos(0.5 * alpha)])
    return np.concatenate([first[:3], last[:3], first[3:6], first[13:14], last[3:7] - target])


def perfect_ring(s: ArrayLike, alpha: float, bend: float, twist: float) -> Array:
    """The twisted circle (4.12), misprints corrected, shape (m, 14).

    In the printed mu(s) the sines and cosines that multiply 2 alpha K3 read sin(alpha s) and
    cos(alpha s); they must be sin(pi s) and cos(pi s). The first term of the fourth row must read
    -4 pi K1 sin(pi s) cos(alpha s/2). As printed, mu does not satisfy (4.9).

    Parameters
    ----------
    bend, twist : float
        K1 = K2 and K3.
    """
    s = np.asarray(s, dtype=float)
    one, zero = np.ones_like(s), np.zeros_like(s)
    sp, cp = np.sin(np.pi * s), np.cos(np.pi * s)
    sa, ca = np.sin(0.5 * alpha * s), np.cos(0.5 * alpha * s)
    k1, k3 = 4.0 * np.pi * bend, 2.0 * alpha * twist
    return np.stack(
        [
            zero,
            (np.cos(2.0 * np.pi * s) - 1.0) / (2.0 * np.pi),
            np.sin(2.0 * np.pi * s) / (2.0 * np.pi),
            sp * ca,
            -sp * sa,
            cp * sa,
            cp * ca,
            2.0 * np.pi * twist * alpha * one,
            zero,
            zero,
            k1 * cp * ca - k3 * sp * sa,
            -k1 * cp * sa - k3 * sp * ca,
            -k1 * sp * sa + k3 * cp * ca,
            -k1 * sp * ca - k3 * cp * sa,
        ],
        axis=-1,
    )


def perfect_energy(alpha: float, bend: float, twist: float) -> float:
    """Energy of the twisted circle, K1 (2 pi)^2 / 2 + K3 alpha^2 / 2."""
    return 0.5 * bend * (2.0 * np.pi) ** 2 + 0.5 * twist * alpha**2
