"""ln J of one molecule in milliseconds: the register integral and a few exactly closed shapes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.laplace.constrained_minimum import slice_constant
from dnacheck.cyclization.laplace.kernels import quick as qk
from dnacheck.equilibria.ring import Equilibria
from dnacheck.model.chain import Chain
from dnacheck.model.chain_kernels import BOUND_STIFFNESS, HingeSteps
from dnacheck.model.rigid_kernels import RigidSteps
from dnacheck.numerics.outcome import SolveError

Array = NDArray[np.float64]

_SEED = 1996
_STEPS_A_ROOT_PAIR = 52.0
"""The weights of pairs spread by about n / 1250 in random molecules of n steps: (n / 52)^2 pairs
leave an error of 0.04."""
_FEWEST_PAIRS, _MOST_PAIRS = 4, 64
QUICK_WINDOW_RT = 8.0
"""Minima this far above the lowest add less than a part in a thousand to J."""
_GOOD, _FAIR = 0.1, 0.3
"""Errors of ln J below which a value is called good and fair."""
_FOLDED = 0.05


@lru_cache(maxsize=1024)
def common_normals(n_steps: int, width: int = 3) -> Array:
    """Standard normal numbers (P, N, c) of the pairs for molecules of one length."""
    pairs = math.ceil((n_steps / _STEPS_A_ROOT_PAIR) ** 2)
    pairs = min(max(pairs, _FEWEST_PAIRS), _MOST_PAIRS)
    return np.random.default_rng([_SEED, n_steps]).standard_normal((pairs, n_steps, width))


def quick_limits(chain: Chain, draws: bool = True) -> qk.QuickLimits:
    """The limits for one molecule; without ``draws`` the register integral alone."""
    normals = common_normals(*chain.ground.shape)
    return qk.QuickLimits(
        normals if draws else normals[:0], slice_constant(chain), 1.5, 8, 24, 5.0, 0.1
    )


@dataclass(frozen=True)
class QuickJ:
    """ln J (mol/L) with what it says of itself.

    Attributes
    ----------
    log_j : float
    register_log_j : float
        By the register integral alone.
    stderr : float
        Standard error of the draws.
    folded : float
        Part of the draws that reach no closed shape.
    spread : float
        Standard deviation of the register at the lowest ring, radians.
    """

    log_j: float
    register_log_j: float
    stderr: float
    folded: float
    spread: float

    @property
    def quality(self) -> str:
        """``good``, ``fair`` or ``poor``: errors of up to 0.1, of up to 0.3, and beyond.

        The error is the draws' own. Where more than a twentieth of them reach no closed shape,
        the shapes that they stand for may be missed, and the value is poor whatever it says.
        """
        if self.folded > _FOLDED or not self.stderr <= _FAIR:
            return "poor"
        return "good" if self.stderr <= _GOOD else "fair"


def quick_of_minima(
    chain: Chain, cut: HingeSteps | RigidSteps, minima: qk.KnownMinima
) -> QuickJ | None:
    """ln J from minima of the ring cut somewhere: reduced steps ``cut`` of ``chain``.

    None where no register could be covered or no draw closed.
    """
    scale = chain.energy_scale_RT
    steps = cut._replace(stiffness=np.ascontiguousarray(scale * cut.stiffness))
    bound = cut.stiffness[:, 0, 0] >= BOUND_STIFFNESS
    flexibility = np.zeros_like(steps.stiffness)
    flexibility[~bound] = np.linalg.inv(steps.stiffness[~bound])
    figures = np.empty(qk.N_QUICK_FIGURES)
    found = qk.quick_log_j(steps, flexibility, minima, quick_limits(chain), figures)
    return QuickJ(*map(float, figures)) if found else None


def quick_j(search: Equilibria) -> QuickJ:
    """ln J of a molecule whose minima are known.

    Raises
    ------
    SolveError
        No minimum, or none of the draws could be closed.
    """
    chain = search.chain
    rings = [ring for ring in search.equilibria if ring.stable is not False]
    rings = [r for r in rings if r.energy_RT < rings[0].energy_RT + QUICK_WINDOW_RT]
    value = None
    if rings:
        minima = qk.KnownMinima(
            np.array([ring.angles for ring in rings]),
            chain.energy_scale_RT * np.array([ring.multipliers for ring in rings]),
            np.array([ring.link for ring in rings], dtype=np.int64),
        )
        value = quick_of_minima(chain, chain.arrays, minima)
    if value is None:
        raise SolveError(f"J factor of {chain.name}: no register could be covered", search)
    return value
