"""Equilibria of chains with bound guests: led from those of a chain that is elastic throughout.

A guest holds steps, so the planar circles that a search starts from cannot be met. The chain whose
steps rest at the guest's values but give way there as before is a molecule like any other, however
bent: its minima are searched as always, and each is followed while the guest's steps stiffen until
they are held.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.discrete.solve import NewtonOptions, solve_ring
from dnacheck.equilibria.ring import Equilibrium
from dnacheck.numerics.outcome import Status

if TYPE_CHECKING:
    from dnacheck.equilibria.boundary import AnyBoundary
    from dnacheck.equilibria.ring import Equilibria
    from dnacheck.model.chain import Chain

Array = NDArray[np.float64]

_STIFFENING = 10.0 ** np.arange(0.5, 4.1, 0.5)
"""What a guest's steps are stiffened by on the way to being held, where one step does not do."""
# Minima are one when their energies agree to this relative precision and their angles (rad) to the
# second; of a family of equal energy, whose register is free, one stands for all.
_SAME_ENERGY = 1e-7
_SAME_ANGLES = 1e-4


def hold_found(
    chain: Chain,
    boundary: AnyBoundary,
    newton: NewtonOptions,
    search: Callable[[Chain], Equilibria],
) -> Equilibria:
    """Minima of a chain with guests, lowest first, from a search of its elastic counterpart.

    Parameters
    ----------
    search : callable
        Searches a chain without guests for its equilibria under the boundary.
    """
    began = time.perf_counter()
    soft = search(chain.elastic())
    descend = replace(newton, minima_only=True)
    found: list[Equilibrium] = []
    failed = soft.failed_starts
    for start in soft.equilibria:
        ring = _held(chain, start, boundary, descend)
        if ring is None:
            failed += 1
        elif not any(same_minimum(ring, other) for other in found):
            found.append(ring)
    found.sort(key=lambda ring: ring.energy)
    return replace(
        soft,
        source=chain,
        equilibria=tuple(found),
        starts=soft.starts,
        failed_starts=failed,
        seconds=time.perf_counter() - began,
        status=Status.CONVERGED if found else Status.NOT_FOUND,
    )


def same_minimum(a: Equilibrium, b: Equilibrium) -> bool:
    """Whether two converged equilibria are one."""
    if abs(a.energy - b.energy) > _SAME_ENERGY * abs(a.energy) + 1e-14:
        return False
    if a.stable is None and b.stable is None:
        return True
    return bool(np.abs(a.angles - b.angles).max() < _SAME_ANGLES)


def _held(
    chain: Chain, start: Equilibrium, boundary: AnyBoundary, newton: NewtonOptions
) -> Equilibrium | None:
    """The minimum that a ring of the elastic chain leads to, at once or as its guest stiffens."""
    ring = solve_ring(chain, start.angles, newton, boundary=boundary, throw=False)
    if _good(ring):
        return ring
    here = start
    for stiffer in _stiffened(chain):
        here = solve_ring(stiffer, here.angles, newton, boundary=boundary, throw=False)
        if not _good(here):
            return None
    ring = solve_ring(chain, here.angles, newton, boundary=boundary, throw=False)
    return ring if _good(ring) else None


def _good(ring: Equilibrium) -> bool:
    return ring.status.ok and ring.stable is not False


def _stiffened(chain: Chain) -> Iterator[Chain]:
    elastic = chain.elastic()
    for factor in _STIFFENING:
        stiffness = elastic.stiffness.copy()
        stiffness[chain.bound] *= factor
        yield replace(elastic, stiffness=stiffness)
