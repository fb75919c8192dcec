"""The minima of a molecule's ring, found over links and registers.

No result depends on which base pair is called the first: the compiled search works on a canonical
cut of the ring and rolls back what it finds (``kernels.cut``).
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.discrete.kernels import newton as nk
from dnacheck.equilibria.discrete.kernels.search import (
    Minima,
    SearchPlan,
    best_register,
    fill_start,
    search,
)
from dnacheck.equilibria.discrete.solve import NewtonOptions, make_ring, solve_ring
from dnacheck.equilibria.ring import Equilibria, Equilibrium
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import InputError, Status

LinkChoice = Literal["auto", "all"] | int

_WINDOW_RT = 8.0
"""Minima this far above the lowest change J by less than a part in a thousand; links and
registers beyond it are not searched by ``auto``."""
_PREDICTED_WINDOW_RT = 10.0
"""Links whose planar ring, relaxed as predicted, lies so far above the lowest are not started from
by ``auto``."""
_MOST_LINKS = 64
_MOST_MINIMA = 64
_ALL_LINKS_REACH = 2
_ALL_REGISTERS = 8
# Two minima a radian apart may hide where the predicted energy of rigid steps has one (1 in 1,000
# random molecules of 60-400 bp, 0.001 RT apart). Links this close to the lowest start again on both
# sides of it.
_RIGID_REGISTERS = np.array([0.5 * math.pi, 1.5 * math.pi])
_RIGID_WINDOW_RT = 1.0
_EXCESS_STEPS = 16
"""Steps by which a ring relaxed at a link is given the twist that it lacks or has too much."""


@dataclass(frozen=True)
class SearchOptions:
    """Where minima are looked for.

    Attributes
    ----------
    links : "auto", "all" or int
        ``auto``: the two links next to the ground twist and every other whose twisting energy
        stays within 8 RT or half the bending energy of a circle, from the register where the
        planar ring is predicted to rest and, where there is room for a second minimum, half a
        turn from the first. ``all``: five links or more around the ground twist, from eight more
        registers each. An integer: rings of that link alone, eight more registers.
    newton : NewtonOptions
    """

    links: LinkChoice = "auto"
    newton: NewtonOptions = field(default_factory=NewtonOptions)

    def __post_init__(self) -> None:
        if isinstance(self.links, bool) or not (
            self.links in ("auto", "all") or isinstance(self.links, int)
        ):
            raise InputError(f"link must be auto, all or an integer, not {self.links!r}")


def candidate_links(chain: Chain) -> tuple[int, ...]:
    """Links that ``auto`` searches, nearest to the ground twist first, 64 at most."""
    return _links_in_reach(chain)[:_MOST_LINKS]


def _links_in_reach(chain: Chain) -> tuple[int, ...]:
    n, turns = chain.n_steps, chain.relaxed_turns
    # Exact sums: the same for every cut of the ring.
    if chain.rigid:
        # What is left of a step's stiffness when the rest of it relaxes.
        compliance = np.linalg.inv(chain.stiffness)
        softness = math.fsum(compliance[:, 0, 0].tolist()) / n
        bend = 2.0 * n / math.fsum((compliance[:, 1, 1] + compliance[:, 2, 2]).tolist())
    else:
        softness = math.fsum((1.0 / chain.stiffness[:, 0, 0]).tolist()) / n
        bends = chain.stiffness[:, 1, 1] + chain.stiffness[:, 2, 2]
        bend = math.fsum(bends.tolist()) / (2.0 * n)
    allowed = max(_WINDOW_RT / chain.energy_scale_RT, math.pi**2 * bend / n)
    reach = math.sqrt(2.0 * allowed * n * softness) / (2.0 * math.pi)
    reach = min(reach, float(_MOST_LINKS))
    low, high = math.floor(turns - reach), math.ceil(turns + reach)
    chosen = [
        link
        for link in range(low, high + 1)
        if abs(link - turns) <= reach or link in (math.floor(turns), math.floor(turns) + 1)
    ]
    return tuple(sorted(chosen, key=lambda link: abs(link - turns)))


def search_plan(chain: Chain, links: LinkChoice = "auto") -> SearchPlan:
    """Links, registers and window of a search, for the compiled kernel."""
    registers = np.arange(_ALL_REGISTERS) * (2.0 * np.pi / _ALL_REGISTERS)
    if links == "auto":
        near = np.array(candidate_links(chain), dtype=np.int64)
        more = _RIGID_REGISTERS if chain.rigid else np.empty(0)
        unit = chain.energy_scale_RT
        return SearchPlan(
            near, more, _WINDOW_RT / unit, _RIGID_WINDOW_RT / unit, _PREDICTED_WINDOW_RT / unit
        )
    if links == "all":
        nearest = round(chain.relaxed_turns)
        around = range(nearest - _ALL_LINKS_REACH, nearest + _ALL_LINKS_REACH + 1)
        every = sorted({*around, *candidate_links(chain)})
        return SearchPlan(np.array(every, dtype=np.int64), registers, math.inf, math.inf, math.inf)
    one = np.array([links], dtype=np.int64)
    return SearchPlan(one, registers, math.inf, math.inf, math.inf)


def room(plan: SearchPlan) -> int:
    """Minima that are kept of a search."""
    return min(_MOST_MINIMA, len(plan.links) * (3 + len(plan.registers)))


def room_for(plan: SearchPlan, n_steps: int, coordinates: int) -> Minima:
    """Room for the minima of one molecule."""
    most = room(plan)
    return Minima(
        np.empty((most, n_steps, coordinates)),
        np.empty((most, 6)),
        np.empty((most, nk.N_FIGURES)),
        np.zeros(len(plan.links), dtype=np.bool_),
    )


def find_rings(chain: Chain, options: SearchOptions | None = None) -> Equilibria:
    """Minima of the closed chain over links and registers, lowest first.

    Every start is a planar ring of a given link, rolled to a register that second-order
    perturbation in the ground bends selects, or half a turn away from a minimum (and to eight more
    with ``all`` or a given link); no continuum solution is needed. Where one link is asked for
    and no start rests at it, a ring that is relaxed there is given its twist step by step.
    """
    options = options or SearchOptions()
    if chain.guests:
        from dnacheck.equilibria.discrete.bound_search import hold_rings

        return hold_rings(chain, options, find_rings)
    found = _searched(chain, search_plan(chain, options.links), options.newton)
    if options.links == "auto" and len(_links_in_reach(chain)) > _MOST_LINKS:
        text = f"only the {_MOST_LINKS} links nearest to the ground twist were searched"
        return replace(found, notes=(*found.notes, text))
    if isinstance(options.links, int):
        return _of_one_link(found, int(options.links), options.newton)
    return found


def search_minima(
    chain: Chain,
    links: tuple[int, ...],
    registers: NDArray[Any],
    window: float,
    options: NewtonOptions,
) -> Equilibria:
    """Minima reached from planar rings of the given links and registers.

    Each link starts from the register where its planar ring is predicted to rest. Links whose
    minimum lies within ``window`` (reduced energy) of the lowest start again: half a turn from
    that minimum, and from ``registers``, in radians from the predicted one.
    """
    plan = SearchPlan(
        np.array(links, dtype=np.int64),
        np.asarray(registers, dtype=float),
        float(window),
        float(window),
        math.inf,
    )
    return _searched(chain, plan, options)


def raw_minima(
    chain: Chain, plan: SearchPlan, options: NewtonOptions
) -> tuple[Minima, NDArray[np.intp], int, int]:
    """What the compiled search finds, before it is made into rings.

    Returns
    -------
    minima : Minima
    order : ndarray, shape (found,)
        Their places in ``minima``, lowest energy first.
    starts, failed : int
    """
    minima = room_for(plan, *chain.ground.shape)
    found, starts, failed = search(
        chain.arrays, plan, options.limits._replace(minima_only=True), minima
    )
    order = np.argsort(minima.figures[:found, nk.ENERGY], kind="stable")
    return minima, order, starts, failed


def _searched(chain: Chain, plan: SearchPlan, options: NewtonOptions) -> Equilibria:
    began = time.perf_counter()
    minima, order, starts, failed = raw_minima(chain, plan, options)
    seconds = time.perf_counter() - began
    found, most = len(order), room(plan)
    rings = tuple(
        make_ring(
            chain,
            minima.angles[i].copy(),
            minima.multipliers[i].copy(),
            minima.figures[i],
            nk.CONVERGED,
            seconds / max(found, 1),
        )
        for i in order
    )
    notes = (f"only the first {most} minima found were kept",) if found == _MOST_MINIMA else ()
    return Equilibria(
        source=chain,
        equilibria=rings,
        links_searched=tuple(int(link) for link in plan.links[minima.tried]),
        starts=starts,
        failed_starts=failed,
        seconds=seconds,
        status=Status.CONVERGED if rings else Status.NOT_FOUND,
        notes=notes,
    )


def _of_one_link(found: Equilibria, link: int, options: NewtonOptions) -> Equilibria:
    """The search with nothing but rings of the link asked for."""
    here = tuple(ring for ring in found.equilibria if ring.link == link)
    if here:
        return replace(found, equilibria=here)
    chain, began = found.chain, time.perf_counter()
    ring, kept = _given_its_twist(chain, link, options)
    if ring is not None:
        seconds = found.seconds + time.perf_counter() - began
        return replace(found, equilibria=(ring,), status=Status.CONVERGED, seconds=seconds)
    ends = tuple(_ends(chain, link, options))
    text = (
        f"no stable ring of link {link} was found: of {len(ends)} starts at it {_summary(ends)}; "
        f"a ring relaxed at link {link} keeps it up to {kept:.0%} of the excess of "
        f"{link - chain.relaxed_turns:+.2f} turns; search links auto or all"
    )
    return replace(
        found,
        equilibria=(),
        ends=ends,
        notes=(text,),
        status=Status.NOT_FOUND,
        seconds=found.seconds + time.perf_counter() - began,
    )


def _given_its_twist(
    chain: Chain, link: int, options: NewtonOptions
) -> tuple[Equilibrium | None, float]:
    """A ring relaxed at a link, followed as its steps take the chain's own ground twist.

    Returns
    -------
    ring : the lowest that still has the link at the end, or None.
    kept : share of the excess twist up to which some ring kept the link.
    """
    excess = 2.0 * math.pi * (link - chain.relaxed_turns) / chain.n_steps
    descend = replace(options, minima_only=True)

    def at(share: float) -> Chain:
        ground = chain.ground.copy()
        ground[:, 0] += (1.0 - share) * excess
        return replace(chain, ground=ground)

    relaxed = _searched(at(0.0), search_plan(chain, link), options)
    best: Equilibrium | None = None
    kept = 0.0
    for start in relaxed.equilibria:
        ring = start
        for step in range(1, _EXCESS_STEPS + 1):
            if not ring.status.ok or ring.stable is False or ring.link != link:
                break
            share = step / _EXCESS_STEPS
            kept = max(kept, (step - 1) / _EXCESS_STEPS)
            here = chain if step == _EXCESS_STEPS else at(share)
            ring = solve_ring(here, ring.angles, descend, throw=False)
        else:
            good = ring.status.ok and ring.stable is not False and ring.link == link
            if good and (best is None or ring.energy < best.energy):
                best, kept = ring, 1.0
    return best, kept


def _ends(chain: Chain, link: int, options: NewtonOptions) -> Iterator[Equilibrium]:
    """Where planar rings of a link come to an end, from all registers."""
    arrays = chain.arrays
    first = best_register(arrays, link)
    start = np.empty(chain.ground.shape)
    for register in search_plan(chain, link).registers:
        fill_start(arrays, link, first + register, start)
        yield solve_ring(chain, start, replace(options, minima_only=True), throw=False)


def _summary(ends: tuple[Equilibrium, ...]) -> str:
    """How many starts ended at which link, energy and residual."""
    counts: Counter[str] = Counter()
    worst: dict[str, float] = {}
    for ring in ends:
        where = f"ended at link {ring.link} ({ring.energy_RT:.4f} RT"
        if not ring.status.ok:
            where = f"stopped short of the tolerance ({ring.energy_RT:.1f} RT"
        counts[where] += 1
        worst[where] = max(worst.get(where, 0.0), ring.residual)
    return ", ".join(
        f"{count} {where}, residual {worst[where]:.0e})" for where, count in counts.most_common()
    )
