"""Laplace's approximation of the J factor, from the log-determinant that a ring search leaves.

With n = 3N angles, energies in RT and lengths in Å, one minimum contributes (NUMERICS section 5)

    J = 8 pi^2 exp(-E) sqrt(det(K / 2 pi)) (2 pi)^((n - 6)/2) / sqrt(|det KKT|),

where |det KKT| = det(Z^T H Z) det(G G^T): H is the Hessian of the Lagrangian, G the 6 x n
Jacobian of closure, Z an orthonormal basis of its null space. Steps as the unit of length and
reduced energies leave the factor (s / 2 pi)^3 / l^3, with s RT per reduced unit and l the rise.
"""

from __future__ import annotations

import math
import time

import numpy as np

from dnacheck.jfactor.result import (
    PER_CUBIC_ANGSTROM_IN_MOLAR,
    JFactor,
    JStatus,
    link_shares,
)
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import SolveError
from dnacheck.ring.discrete import DiscreteRing
from dnacheck.ring.search import RingSearch, SearchOptions, find_rings

SOFT_EIGENVALUE_RT = 8.0
"""Smallest eigenvalue of the projected Hessian (RT per square radian) below which Laplace's
value is called unreliable: sampling from it degrades below 5 (NUMERICS 5)."""


def log_prefactor(chain: Chain) -> float:
    """ln of 8 pi^2 sqrt(det K) (s / 2 pi)^3 / l^3 in mol/L, K reduced; see the module's text."""
    scale = chain.energy_scale_RT / (2.0 * math.pi)
    log_det_stiffness = float(np.linalg.slogdet(chain.stiffness)[1].sum())
    return (
        math.log(8.0 * math.pi**2)
        + 0.5 * log_det_stiffness
        + 3.0 * math.log(scale)
        - 3.0 * math.log(chain.rise_A)
        + math.log(PER_CUBIC_ANGSTROM_IN_MOLAR)
    )


def laplace_log_j(ring: DiscreteRing) -> float:
    """ln J (mol/L) that Laplace's approximation gives one minimum."""
    return log_prefactor(ring.chain) - ring.energy_RT - 0.5 * ring.log_abs_det_kkt


def require_rings(search: RingSearch) -> RingSearch:
    """The search itself, if it found a stable ring.

    Raises
    ------
    SolveError
        No stable ring at any link searched.
    """
    if not any(ring.stable for ring in search.equilibria):
        raise SolveError(
            f"J factor of {search.chain.name}: no stable ring at links "
            f"{', '.join(map(str, search.links_searched))}; {JStatus.NOT_FOUND.value}",
            search,
        )
    return search


def laplace(target: Chain | RingSearch, options: SearchOptions | None = None) -> JFactor:
    """J factor by Laplace's approximation, summed over the minima of all links.

    Parameters
    ----------
    target : Chain or RingSearch
        A molecule, or the minima already found for it.
    options : SearchOptions, optional
        Where minima are looked for, if they are not given.

    Returns
    -------
    JFactor
        ``stderr`` is 0 and ``bias_bound`` unknown: the error of Laplace's approximation (0.2 to
        0.5 at 150 base pairs) is measured only by a method that samples, see
        :mod:`dnacheck.jfactor.choose`. A soft register is said in the status.

    Raises
    ------
    SolveError
        No stable ring at any link searched.
    """
    began = time.perf_counter()
    search = find_rings(target, options) if isinstance(target, Chain) else target
    require_rings(search)
    chain = search.chain
    minima = [ring for ring in search.equilibria if ring.stable]
    parts: dict[int, float] = {}
    for ring in minima:
        value = laplace_log_j(ring)
        parts[ring.link] = float(np.logaddexp(parts.get(ring.link, -math.inf), value))
    total = float(np.logaddexp.reduce(list(parts.values())))
    softest = minima[0].smallest_eigenvalue * chain.energy_scale_RT
    soft = not softest > SOFT_EIGENVALUE_RT
    warnings = list(chain.warnings)
    if soft:
        warnings.append(
            f"the softest mode of the lowest ring has {softest:.3g} RT per square radian, below "
            f"{SOFT_EIGENVALUE_RT:g}: {JStatus.SOFT_REGISTER.value}"
        )
    return JFactor(
        target=chain.name,
        n_bp=chain.n_steps,
        method="laplace",
        minus_lnJ=-total,
        stderr=0.0,
        links=link_shares(parts),
        seconds=time.perf_counter() - began,
        warnings=tuple(warnings),
        status=JStatus.SOFT_REGISTER if soft else JStatus.NO_ERROR_ESTIMATE,
    )
