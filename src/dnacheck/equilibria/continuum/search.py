"""The lowest continuum ring: a search over links and registers."""

from __future__ import annotations

import time
from collections.abc import Iterable

import numpy as np

from dnacheck.equilibria.continuum.coarse_chain import coarse_minima
from dnacheck.equilibria.continuum.options import ContinuumOptions
from dnacheck.equilibria.continuum.solver import SOLVED, attempts, near
from dnacheck.equilibria.ring import Equilibria, Equilibrium
from dnacheck.model.rod.rod import Rod
from dnacheck.numerics.outcome import InputError, Status

# Two results are the same equilibrium when energies (relative to the flat ring's) and loads
# (relative to the largest) agree to this; converged results agree to far better, distinct ones
# differ by far more.
_SAME = 1e-5

# Minima this far above the lowest, in RT, change the J factor by less than a part in a thousand.
_WINDOW_RT = 8.0
_ALL_LINKS_REACH = 2
# With K3 of a hundredth of K1 and less, hundreds of links have nearly the same energy.
_MOST_LINKS = 13
_ALL_REGISTERS = 8


def candidate_links(rod: Rod) -> tuple[int, ...]:
    """Links that "auto" searches, nearest to the relaxed twist first.

    The two around the relaxed twist, and every other whose twisting energy as a flat ring stays
    within 8 RT or half the bending energy of a circle; 13 at most.
    """
    return _links_in_reach(rod)[:_MOST_LINKS]


def _links_in_reach(rod: Rod) -> tuple[int, ...]:
    turns = rod.relaxed_turns
    allowed = max(_WINDOW_RT / rod.energy_scale_RT, np.pi**2 * rod.bend_stiffness)
    reach = float(np.sqrt(2.0 * allowed / rod.twist_stiffness)) / (2.0 * np.pi)
    reach = min(max(reach, 1.0), float(_MOST_LINKS) + 1.0)
    around = range(int(np.floor(turns - reach)), int(np.ceil(turns + reach)) + 1)
    inside = (link for link in around if abs(link - turns) <= reach)
    return tuple(sorted(inside, key=lambda link: abs(link - turns)))


def lowest_continuum_ring(
    rod: Rod,
    links: str | int | Iterable[int] = "auto",
    options: ContinuumOptions | None = None,
    registers: int | None = None,
) -> Equilibria:
    """Search links and registers for continuum rings.

    Each link starts from the minima of the rod cut into straight pieces
    (:mod:`dnacheck.equilibria.continuum.coarse_chain`). Where Newton's method finds no minimum from
    there the perfect ring is tried in the register that first-order perturbation prefers, then the
    paths of ``homotopy``, and where they find none either, the other registers get the same
    treatment. Links whose minimum lies within 8 RT of the lowest also start from the other
    registers, by Newton's method alone: that finds the saddles between registers. Where one link
    is asked for, only rings whose link it is are returned.

    Parameters
    ----------
    rod : Rod
    links : "auto", "all", int or iterable of int
        "auto": :func:`candidate_links`; "all": those and five links around the relaxed twist.
    options : ContinuumOptions, optional
    registers : int, optional
        Rolls per link, evenly spaced from the preferred one. Default 2 (the preferred one and
        its opposite) for "auto", 8 otherwise.

    Raises
    ------
    InputError
        ``links`` is none of the above, or ``registers`` is not positive.
    """
    options = ContinuumOptions() if options is None else options
    wanted = _wanted_links(rod, links)
    if registers is None:
        registers = 2 if links == "auto" else _ALL_REGISTERS
    if registers < 1:
        raise InputError(f"registers = {registers}: give at least 1")
    turns = 2.0 * np.pi / registers * np.arange(registers)
    began, starts = time.perf_counter(), 0
    found: list[Equilibrium] = []
    failures: list[Equilibrium] = []
    pending: dict[int, list[float]] = {}
    unit = rod.energy_scale_RT
    coarse = coarse_minima(
        rod,
        wanted,
        0 if links == "auto" else _ALL_REGISTERS,
        _WINDOW_RT / unit if links == "auto" else np.inf,
    )
    for link in wanted:
        pending[link] = list(turns)
        of_link = [start for start in coarse if start.link == link]
        starts += len(of_link)
        reached = [_collect(near(rod, start, options), found, failures) for start in of_link]
        if any(reached):
            del pending[link][0]
            continue
        # Registers in turn, with detours, until one of them gives a minimum.
        while pending[link]:
            starts += 1
            if _collect(attempts(rod, link, pending[link].pop(0), options), found, failures):
                break
    for link in wanted:
        here = [ring.energy for ring in found if ring.link == link and ring.stable is not False]
        window = _WINDOW_RT / rod.energy_scale_RT
        if not here or min(here) > min(ring.energy for ring in found) + window:
            continue
        for turn in pending[link]:
            starts += 1
            _collect(attempts(rod, link, turn, options, detour=False), found, failures)
    found.sort(key=lambda ring: ring.energy)
    one = wanted[0] if isinstance(links, (int, np.integer)) else None
    kept = tuple(ring for ring in found if one is None or ring.link == one)
    minima = any(ring.stable is not False for ring in kept)
    status = Status.CONVERGED if minima else Status.NOT_FOUND
    elsewhere = tuple(ring for ring in found if one is not None and ring.link != one)
    notes: tuple[str, ...] = ()
    if kept and links == "auto" and len(_links_in_reach(rod)) > _MOST_LINKS:
        notes = (f"only the {_MOST_LINKS} links nearest to the relaxed twist were searched",)
    return Equilibria(
        source=rod,
        equilibria=kept,
        links_searched=tuple(wanted),
        starts=starts,
        failed_starts=len(failures),
        seconds=time.perf_counter() - began,
        status=status,
        ends=(*elsewhere, *failures),
        notes=notes,
    )


def _wanted_links(rod: Rod, links: str | int | Iterable[int]) -> list[int]:
    if isinstance(links, str):
        if links not in ("auto", "all"):
            raise InputError(f"links = {links!r}: 'auto', 'all' or an integer")
        chosen = set(candidate_links(rod))
        if links == "all":
            nearest = int(np.rint(rod.relaxed_turns))
            chosen |= set(range(nearest - _ALL_LINKS_REACH, nearest + _ALL_LINKS_REACH + 1))
    elif isinstance(links, Iterable):
        chosen = {int(link) for link in links}
    else:
        chosen = {int(links)}
    return sorted(chosen, key=lambda link: abs(link - rod.relaxed_turns))


def _collect(
    rings: Iterable[Equilibrium], found: list[Equilibrium], failures: list[Equilibrium]
) -> bool:
    """Sort rings into the lists until one is not unstable; True if there was one."""
    for ring in rings:
        if ring.status not in SOLVED:
            failures.append(ring)
            continue
        if not any(_same(ring, other) for other in found):
            found.append(ring)
        if ring.stable is not False:
            return True
    return False


def _same(a: Equilibrium, b: Equilibrium) -> bool:
    if a.status is Status.NEUTRAL or b.status is Status.NEUTRAL:
        # members of one family: loads turn with the register
        a_size, b_size = np.linalg.norm(a.curve.loads), np.linalg.norm(b.curve.loads)
        agree = abs(a_size - b_size) < 1e2 * _SAME * max(a_size, b_size)
    else:
        size = max(float(np.max(np.abs(a.curve.loads))), float(np.max(np.abs(b.curve.loads))))
        agree = float(np.max(np.abs(a.curve.loads - b.curve.loads))) < 1e2 * _SAME * size
    scale = a.rod.bend_stiffness * (2.0 * np.pi) ** 2
    return bool(agree and a.link == b.link and abs(a.energy - b.energy) < _SAME * scale)
