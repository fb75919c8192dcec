"""ln J of a chain near given mechanics: value, gradient and Hessian from one set of closed draws.

With E the elastic energy in RT and <> a mean over closed shapes (the draws that gave J) or over the
open chain (Gaussian, exact), for parameters p and q

    d ln J / dp      = <E_p>_open - <E_p>_closed,
    d2 ln J / dp dq  = [Cov(E_p, E_q) - <E_pq>]_closed - [the same]_open

(docs/theory/mechanics.md). With x = q - q^ the strains of a shape,

    E_p  = -x.K g_p + x.K_p x / 2,
    E_pq = g_p.K g_q - x.(K_p g_q + K_q g_p) - x.K g_pq + x.K_pq x / 2,

g and K the ground values and stiffness, subscripts their derivatives. Nothing is sampled anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.gradient import ClosedDraws
from dnacheck.model.chain import Chain
from dnacheck.model.named_parameters import ChainDerivatives, chain_derivatives, modified_chain

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LocalModel:
    """ln J and its derivatives with respect to p parameters.

    Attributes
    ----------
    names : tuple of str
    log_j, stderr : float
        ln J (mol/L) and its standard error.
    gradient, gradient_stderr : ndarray, shape (p,)
        Per unit of each parameter; standard errors from independent batches.
    hessian : ndarray, shape (p, p)
    """

    names: tuple[str, ...]
    log_j: float
    stderr: float
    gradient: Array
    gradient_stderr: Array
    hessian: Array

    def at(self, change: Array) -> float:
        """ln J to second order after a change (p,) of the parameters."""
        return float(self.log_j + self.gradient @ change + 0.5 * change @ self.hessian @ change)


def local_model(
    chain: Chain, draws: ClosedDraws, names: Sequence[str], values: Mapping[str, float]
) -> LocalModel:
    """Derivatives of ln J from the draws of the chain at ``values``.

    Parameters
    ----------
    chain : Chain
        The molecule's own chain; ``draws`` belong to ``modified_chain(chain, values)``.
    names : sequence of str
        Parameters to differentiate by; offsets have zero derivative here.
    """
    here = modified_chain(chain, values)
    derivatives = chain_derivatives(chain, names, values)
    stiffness = here.energy_scale_RT * here.stiffness
    first = _first(draws.strains, stiffness, derivatives)
    opened, opened_covariance, opened_second = _open_means(stiffness, derivatives)
    weights = draws.weights
    closed, error = draws.average(first)
    centred = first - closed
    covariance = (weights[:, None] * centred).T @ centred
    second = _closed_second(draws.strains, weights, stiffness, derivatives)
    hessian = covariance - second - opened_covariance + opened_second
    return LocalModel(
        names=tuple(names),
        log_j=draws.log_j,
        stderr=draws.stderr,
        gradient=opened - closed,
        gradient_stderr=error,
        hessian=hessian,
    )


def _first(strains: Array, stiffness: Array, d: ChainDerivatives) -> Array:
    """E_p of every draw, shape (D, p)."""
    count = strains.shape[0]
    p = d.ground.shape[0]
    flat = strains.reshape(count, -1)
    pull = np.einsum("nij,pnj->pni", stiffness, d.ground).reshape(p, -1)
    out = -(flat @ pull.T)
    pairs = _pair_products(strains)
    out += 0.5 * (pairs @ d.stiffness.reshape(p, -1).T)
    return np.asarray(out)


def _pair_products(strains: Array) -> Array:
    """x x^T of every step, flat: shape (D, N d d)."""
    count, n, d = strains.shape
    return (strains[:, :, :, None] * strains[:, :, None, :]).reshape(count, n * d * d)


def _closed_second(strains: Array, weights: Array, stiffness: Array, d: ChainDerivatives) -> Array:
    """<E_pq> over the weighted draws, shape (p, p)."""
    n, dim = strains.shape[1:]
    mean = (weights @ strains.reshape(len(strains), -1)).reshape(n, dim)
    pairs = (weights @ _pair_products(strains)).reshape(n, dim, dim)
    return _second(mean, pairs, stiffness, d)


def _second(mean: Array, pairs: Array, stiffness: Array, d: ChainDerivatives) -> Array:
    """<E_pq> from <x> (N, d) and <x x^T> (N, d, d)."""
    direct = np.einsum("pni,nij,qnj->pq", d.ground, stiffness, d.ground)
    cross = np.einsum("ni,pnij,qnj->pq", mean, d.stiffness, d.ground)
    bent = np.einsum("ni,nij,pqnj->pq", mean, stiffness, d.second_ground)
    stiff = 0.5 * np.einsum("nij,pqnij->pq", pairs, d.second_stiffness)
    return np.asarray(direct - cross - cross.T - bent + stiff)


def _open_means(stiffness: Array, d: ChainDerivatives) -> tuple[Array, Array, Array]:
    """<E_p>, Cov(E_p, E_q) and <E_pq> of the open Gaussian chain."""
    inverse = np.linalg.inv(stiffness).astype(float)
    first = 0.5 * np.einsum("nij,pnij->p", inverse, d.stiffness)
    scaled = np.einsum("nij,pnjk->pnik", inverse, d.stiffness)
    covariance = np.einsum("pni,nij,qnj->pq", d.ground, stiffness, d.ground)
    covariance = covariance + 0.5 * np.einsum("pnij,qnji->pq", scaled, scaled)
    second = _second(np.zeros(d.ground.shape[1:]), inverse, stiffness, d)
    return first, covariance, second
