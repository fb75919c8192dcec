"""Laplace's approximation of the J factor, from the log-determinant that a ring search leaves.

With n = 3N angles (6N coordinates of rigid steps), energies in RT and lengths in Å, one minimum
contributes

    J = w exp(-E) sqrt(det(K / 2 pi)) (2 pi)^((n - m)/2) / sqrt(|det KKT|),

where |det KKT| = det(Z^T H Z) det(G G^T): H is the Hessian of the Lagrangian, G the m x n
Jacobian of the m components that the boundary holds (6 for a ring), Z an orthonormal basis of its
null space. The density of orientations is against the normalised measure of those held: w is 8 pi^2
for all three, 4 pi for an axis (m = 5, a nick), 1 for none (m = 3, a hinge). Steps as the unit of
length and reduced energies leave the factor (s / 2 pi)^(m/2) / l^3, with s RT per reduced unit and
l the rise.
Derived in docs/theory/jfactors.md.
"""

from __future__ import annotations

import math
import time

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.laplace.kernels.register import register_of, register_rows
from dnacheck.cyclization.result import (
    PER_CUBIC_ANGSTROM_IN_MOLAR,
    JFactor,
    JStatus,
    link_shares,
)
from dnacheck.equilibria.boundary import AnyBoundary, HingedRing, NickedRing, Pull
from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
from dnacheck.equilibria.discrete.spectrum import ProjectedInverse
from dnacheck.equilibria.ring import RING, Equilibria, Equilibrium
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import InputError, SolveError

Array = NDArray[np.float64]

SOFT_REGISTER = 0.75
"""Standard deviation of the register (radians) above which Laplace's value is called unreliable:
beyond it the Gaussian differs from the integral over the register by 0.1 to 0.5 in ln J."""


def held_components(boundary: AnyBoundary) -> int:
    """How many components of the end a boundary holds: 6, 5 or 3.

    Raises
    ------
    InputError
        A boundary with loads or free translations, whose end has no place to be found at.
    """
    if isinstance(boundary, Pull):
        raise InputError(
            "a pulled chain has no J factor, its end is nowhere in particular; take a ring, a "
            "nicked or hinged ring, or a loop"
        )
    if isinstance(boundary, NickedRing):
        return 5
    return 3 if isinstance(boundary, HingedRing) else 6


_MEASURE = {6: 8.0 * math.pi**2, 5: 4.0 * math.pi, 3: 1.0}
"""Volume of the orientations that so many held components fix."""


def log_prefactor(chain: Chain, boundary: AnyBoundary = RING) -> float:
    """ln of w sqrt(det K) (s / 2 pi)^(m/2) / l^3 in mol/L, K reduced; see the module's text."""
    held = held_components(boundary)
    scale = chain.energy_scale_RT / (2.0 * math.pi)
    log_det_stiffness = float(np.linalg.slogdet(chain.stiffness[~chain.bound])[1].sum())
    return (
        math.log(_MEASURE[held])
        + 0.5 * log_det_stiffness
        + 0.5 * held * math.log(scale)
        - 3.0 * math.log(chain.rise_A)
        + math.log(PER_CUBIC_ANGSTROM_IN_MOLAR)
    )


def laplace_log_j(ring: Equilibrium) -> float:
    """ln J (mol/L) that Laplace's approximation gives one minimum."""
    return log_prefactor(ring.chain, ring.boundary) - ring.energy_RT - 0.5 * ring.log_abs_det_kkt


def register_spread(
    chain: Chain,
    turns: float,
    angles: Array,
    multipliers: Array,
    boundary: AnyBoundary = RING,
) -> float:
    """Standard deviation of the register of a ring in Laplace's Gaussian, in radians.

    ``turns`` are those of the register's rows, the link of a ring; ``multipliers`` (6,) are
    reduced. Infinite for a zero mode, such as a straight molecule has.
    """
    along, across = np.empty(chain.ground.shape), np.empty(chain.ground.shape)
    register_rows(chain.arrays, float(turns), along, across)
    register, extent = register_of(angles, along, across)
    row = (math.cos(register) * across - math.sin(register) * along) / extent
    inverse = ProjectedInverse(chain, angles, multipliers, boundary.for_chain(chain))
    variance = float(np.sum(row * inverse(row))) / chain.energy_scale_RT
    return math.sqrt(variance) if 0.0 < variance < math.inf else math.inf


def register_turns(ring: Equilibrium) -> float:
    """Turns of the rows that tell a shape's register: the link, or else the sum of its twists."""
    if ring.ring_link is not None:
        return float(ring.ring_link)
    return float(ring.angles[:, 0].sum()) / (2.0 * math.pi)


def require_rings(search: Equilibria) -> Equilibria:
    """The search itself, if it found a ring that is not unstable.

    Raises
    ------
    SolveError
        No stable ring at any link searched.
    """
    if all(ring.stable is False for ring in search.equilibria):
        raise SolveError(
            f"J factor of {search.chain.name}: {search.reason}",
            search,
        )
    return search


def laplace(target: Chain | Equilibria, options: SearchOptions | None = None) -> JFactor:
    """J factor by Laplace's approximation, summed over the minima of all links.

    Parameters
    ----------
    target : Chain or Equilibria
        A molecule, or the minima already found for it.
    options : SearchOptions, optional
        Where minima are looked for, if they are not given.

    Returns
    -------
    JFactor
        ``stderr`` is 0 and ``bias_bound`` unknown: the error of Laplace's approximation (0.2 to
        0.5 at 150 base pairs) is measured only by a method that samples, see
        :mod:`dnacheck.cyclization.automatic`. A soft register is said in the status.

    Raises
    ------
    SolveError
        No stable ring at any link searched, or the lowest is one of a family of equal energy (a
        straight molecule, whose register is free), for which Laplace's integral diverges.
    """
    began = time.perf_counter()
    search = find_rings(target, options) if isinstance(target, Chain) else target
    require_rings(search)
    chain = search.chain
    minima = [ring for ring in search.equilibria if ring.stable]
    neutral = [ring for ring in search.equilibria if ring.stable is None]
    if neutral:
        where = "" if neutral[0].ring_link is None else f" at link {neutral[0].ring_link}"
        raise SolveError(
            f"J factor of {chain.name}: the register is free{where}, where Laplace's "
            "approximation diverges; use the register-integrated one or sample",
            search,
        )
    parts: dict[int | None, float] = {}
    for ring in minima:
        value = laplace_log_j(ring)
        parts[ring.ring_link] = float(np.logaddexp(parts.get(ring.ring_link, -math.inf), value))
    total = float(np.logaddexp.reduce(list(parts.values())))
    lowest = minima[0]
    spread = register_spread(
        chain, register_turns(lowest), lowest.angles, lowest.multipliers, search.boundary
    )
    soft = not spread <= SOFT_REGISTER
    warnings = list(chain.warnings)
    if soft:
        warnings.append(
            f"the register of the lowest ring spreads by {spread:.2g} rad, more than "
            f"{SOFT_REGISTER:g}: {JStatus.SOFT_REGISTER.value}"
        )
    return JFactor(
        target=chain.name,
        n_bp=chain.n_steps,
        method="laplace",
        minus_lnJ=-total,
        stderr=0.0,
        links=link_shares({link: v for link, v in parts.items() if link is not None}),
        seconds=time.perf_counter() - began,
        warnings=tuple(warnings),
        status=JStatus.SOFT_REGISTER if soft else JStatus.NO_ERROR_ESTIMATE,
    )
