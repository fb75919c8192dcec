"""Equilibria of chains with bound guests: led from those of a chain that is elastic throughout.

A guest holds steps, so the planar circles that a search starts from cannot be met. The chain whose
steps rest at the guest's values but give way there as before is a molecule like any other, however
bent: its minima are searched as always, and each is followed while the guest's steps stiffen until
they are held.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.discrete.solve import NewtonOptions, solve_ring
from dnacheck.equilibria.ring import RING, Equilibria, Equilibrium
from dnacheck.numerics.outcome import InputError, Status

if TYPE_CHECKING:
    from dnacheck.equilibria.boundary import AnyBoundary
    from dnacheck.equilibria.discrete.search import SearchOptions
    from dnacheck.model.chain import Chain

Array = NDArray[np.float64]

_STIFFENING = 10.0 ** np.arange(0.5, 4.1, 0.5)
"""What a guest's steps are stiffened by on the way to being held, where one step does not do."""
_MOST_FURTHER_LINKS = 8
_ROUGH = 1e-4
_HALVINGS = 5
# Minima are one when their energies agree to this relative precision and their angles (rad) to the
# second; of a family of equal energy, whose register is free, one stands for all.
_SAME_ENERGY = 1e-7
_SAME_ANGLES = 1e-4


@dataclass
class _Found:
    """Minima of a chain with guests so far, and how the searches for them went."""

    rings: list[Equilibrium] = field(default_factory=list)
    links: list[int] = field(default_factory=list)
    starts: int = 0
    failed: int = 0
    notes: list[str] = field(default_factory=list)


def hold_rings(
    chain: Chain, options: SearchOptions, find: Callable[[Chain, SearchOptions], Equilibria]
) -> Equilibria:
    """Minima of a ring with guests over links and registers, lowest first.

    A guest that winds the chain around itself shifts the links of the rings, so those next to the
    lowest one are searched too until it lies between two that are higher.

    Parameters
    ----------
    find : callable
        Searches a chain without guests for its rings.
    """
    from dnacheck.equilibria.discrete.search import raw_minima, search_plan

    began = time.perf_counter()
    elastic = chain.elastic()
    found = _Found()
    newton = replace(options.newton, minima_only=True)
    if options.links == "auto":
        # Where the elastic chain rests need not be known well: it is only a start.
        rough = replace(newton, tolerance=max(newton.tolerance, _ROUGH))
        plan = search_plan(elastic, options.links)
        minima, order, starts, failed = raw_minima(elastic, plan, rough)
        found.links += [int(link) for link in plan.links[minima.tried]]
        _hold(chain, [minima.angles[i] for i in order], RING, newton, found)
        found.starts, found.failed = starts, found.failed + failed
    else:
        _hold_searched(chain, find(elastic, options), RING, newton, found)
    if isinstance(options.links, str) and _winds(chain):
        for _ in range(_MOST_FURTHER_LINKS):
            here = found.rings[0].link if found.rings else round(chain.relaxed_turns) - 1
            further = [link for link in (here, here - 1, here + 1) if link not in found.links]
            if not further:
                break
            more = find(elastic, replace(options, links=further[0]))
            found.links.append(further[0])
            _hold_searched(chain, more, RING, newton, found)
    if isinstance(options.links, int):
        found.rings = [ring for ring in found.rings if ring.link == options.links]
    return _collected(chain, RING, found, began)


def hold_found(
    chain: Chain, boundary: AnyBoundary, newton: NewtonOptions, soft: Equilibria
) -> Equilibria:
    """Minima of a chain with guests that those of its elastic counterpart lead to."""
    began = time.perf_counter() - soft.seconds
    found = _Found()
    _hold_searched(chain, soft, boundary, replace(newton, minima_only=True), found)
    return _collected(chain, boundary, found, began)


def _collected(chain: Chain, boundary: AnyBoundary, found: _Found, began: float) -> Equilibria:
    notes = tuple(found.notes)
    if not found.rings and not notes and found.links:
        notes = (
            f"no stable ring at links {', '.join(map(str, found.links))} with "
            f"{chain.guests[0].name} bound: {found.failed} of {found.starts} starts did not lead "
            "to one; search links all, or others",
        )
    return Equilibria(
        source=chain,
        equilibria=tuple(found.rings),
        links_searched=tuple(found.links),
        starts=found.starts,
        failed_starts=found.failed,
        seconds=time.perf_counter() - began,
        status=Status.CONVERGED if found.rings else Status.NOT_FOUND,
        notes=notes,
        boundary=boundary,
    )


def _hold_searched(
    chain: Chain,
    soft: Equilibria,
    boundary: AnyBoundary,
    newton: NewtonOptions,
    found: _Found,
) -> None:
    _hold(chain, [ring.angles for ring in soft.equilibria], boundary, newton, found)
    found.links += [link for link in soft.links_searched if link not in found.links]
    found.starts += soft.starts
    found.failed += soft.failed_starts
    found.notes += [note for note in soft.notes if soft.equilibria]


def _hold(
    chain: Chain,
    shapes: list[Array],
    boundary: AnyBoundary,
    newton: NewtonOptions,
    found: _Found,
) -> None:
    """Add what shapes (N, c) of the elastic chain lead to, lowest first."""
    for angles in shapes:
        ring = _held(chain, angles, boundary, newton)
        if ring is None:
            found.failed += 1
        elif not any(same_minimum(ring, other) for other in found.rings):
            found.rings.append(ring)
    found.rings.sort(key=lambda ring: ring.energy)


def follow_binding(
    chain: Chain, points: int = 17, newton: NewtonOptions | None = None
) -> tuple[tuple[float, Equilibrium], ...]:
    """The lowest ring of the free chain, followed while its guests bend the steps they hold.

    Parameters
    ----------
    chain : Chain
        With guests. At share 0 they hold their steps as those are unstressed, at 1 at the guests'
        values: of a kink the share is that of its angle.
    points : int
        Shares from 0 to 1, evenly spaced; where Newton's method does not reach the next one, or
        jumps to another link, smaller steps are taken.

    Returns
    -------
    tuple of (share, Equilibrium)
        Up to share 1, or up to where the branch ends. The free ring itself is not in it.
    """
    from dnacheck.equilibria.discrete.search import find_rings

    newton = replace(newton or NewtonOptions(), minima_only=True)
    free = find_rings(chain.elastic(0.0)).lowest
    angles, link, reached = free.angles, free.link, -1.0
    path: list[tuple[float, Equilibrium]] = []
    step = 1.0 / max(1, points - 1)
    for _ in range(points * 2**_HALVINGS):
        share = 0.0 if reached < 0.0 else min(1.0, reached + step)
        ring = solve_ring(_held_at(chain, share), angles, newton, throw=False)
        if not _good(ring) or (ring.link != link and path):
            step *= 0.5
            if reached < 0.0 or step < 2.0**-_HALVINGS / points:
                break
            continue
        angles, link, reached = ring.angles, ring.link, share
        path.append((share, ring))
        if share >= 1.0:
            break
    return tuple(path)


def _held_at(chain: Chain, share: float) -> Chain:
    """The chain with its guests holding their steps a share of the way to their values."""
    return replace(chain, ground=chain.elastic(share).ground)


def refuse_torn_guests(chain: Chain, boundary: AnyBoundary) -> None:
    """Refuse guests that hold steps on both sides of ends that are not joined.

    Raises
    ------
    InputError
    """
    for guest in chain.guests:
        if any(after < before for before, after in pairwise(guest.steps)):
            raise InputError(
                f"{guest.name} at site {guest.site} lies across the ends of a {boundary.label} "
                f"chain, steps {chain.n_steps - 1} and 0, which are not joined; move it, or cut "
                "the molecule elsewhere"
            )


def _winds(chain: Chain) -> bool:
    """Whether a guest bends its steps by more than half a turn altogether."""
    bends = np.hypot(chain.ground[:, 1], chain.ground[:, 2])
    return any(float(bends[list(guest.steps)].sum()) > math.pi for guest in chain.guests)


def same_minimum(a: Equilibrium, b: Equilibrium) -> bool:
    """Whether two converged equilibria are one."""
    if abs(a.energy - b.energy) > _SAME_ENERGY * abs(a.energy) + 1e-14:
        return False
    if a.stable is None and b.stable is None:
        return True
    return bool(np.abs(a.angles - b.angles).max() < _SAME_ANGLES)


def _held(
    chain: Chain, angles: Array, boundary: AnyBoundary, newton: NewtonOptions
) -> Equilibrium | None:
    """The minimum that a shape of the elastic chain leads to, at once or as its guest stiffens."""
    ring = solve_ring(chain, angles, newton, boundary=boundary, throw=False)
    if _good(ring):
        return ring
    for stiffer in _stiffened(chain):
        ring = solve_ring(stiffer, angles, newton, boundary=boundary, throw=False)
        if not _good(ring):
            return None
        angles = ring.angles
    ring = solve_ring(chain, angles, newton, boundary=boundary, throw=False)
    return ring if _good(ring) else None


def _good(ring: Equilibrium) -> bool:
    return ring.status.ok and ring.stable is not False


def _stiffened(chain: Chain) -> Iterator[Chain]:
    elastic = chain.elastic()
    for factor in _STIFFENING:
        stiffness = elastic.stiffness.copy()
        stiffness[chain.bound] *= factor
        yield replace(elastic, stiffness=stiffness)
