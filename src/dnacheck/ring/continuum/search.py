"""The lowest continuum ring: a search over links and registers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from dnacheck.model.rod.rod import Rod
from dnacheck.numerics.outcome import InputError, SolveError, Status
from dnacheck.ring.continuum.options import ContinuumOptions
from dnacheck.ring.continuum.ring import ContinuumRing
from dnacheck.ring.continuum.solver import SOLVED, attempts

# Two results are the same equilibrium when energies (relative to the flat ring's) and loads
# (relative to the largest) agree to this; converged results agree to far better, distinct ones
# differ by far more.
_SAME = 1e-5

# With links = "auto" the search grows by a link at a time while the lowest ring sits at its edge.
_WIDEST = 6


@dataclass(frozen=True)
class ContinuumSearch:
    """What a search found.

    Attributes
    ----------
    equilibria : tuple of ContinuumRing
        Every distinct equilibrium, lowest energy first.
    failures : tuple of ContinuumRing
        Starts that did not converge, with status and residual.
    links : tuple of int
        Links that were tried.
    status : Status
    """

    equilibria: tuple[ContinuumRing, ...]
    failures: tuple[ContinuumRing, ...]
    links: tuple[int, ...]
    status: Status

    @property
    def lowest(self) -> ContinuumRing:
        """The equilibrium of least energy.

        Raises
        ------
        SolveError
            When nothing converged; ``partial`` is this search.
        """
        if not self.equilibria:
            raise SolveError(f"continuum ring: {self.status.value}", self)
        return self.equilibria[0]


def lowest_continuum_ring(
    rod: Rod,
    links: str | int | Iterable[int] = "auto",
    options: ContinuumOptions | None = None,
    registers: int = 2,
) -> ContinuumSearch:
    """Search links and registers for continuum rings.

    Parameters
    ----------
    rod : Rod
    links : "auto", "all", int or iterable of int
        "auto": the two links nearest to the relaxed twist, and more while the lowest ring is
        found at the edge of what was tried; "all": five links around the relaxed twist.
    options : ContinuumOptions, optional
    registers : int
        Rolls per link, evenly spaced from the one that first-order perturbation prefers; 2 are
        that one and its opposite.

    Raises
    ------
    InputError
        ``links`` is none of the above, or ``registers`` is not positive.
    """
    options = ContinuumOptions() if options is None else options
    if registers < 1:
        raise InputError(f"registers = {registers}: give at least 1")
    relaxed = rod.relaxed_turns
    nearest = int(np.rint(relaxed))
    grow = False
    if isinstance(links, str):
        if links == "auto":
            first = int(np.floor(relaxed))
            wanted = [first, first + 1]
            grow = True
        elif links == "all":
            wanted = list(range(nearest - 2, nearest + 3))
        else:
            raise InputError(f"links = {links!r}: 'auto', 'all' or an integer")
    elif isinstance(links, Iterable):
        wanted = [int(link) for link in links]
    else:
        wanted = [int(links)]
    wanted.sort(key=lambda link: abs(link - relaxed))
    found: list[ContinuumRing] = []
    failures: list[ContinuumRing] = []
    tried: list[int] = []
    while wanted:
        link = wanted.pop(0)
        tried.append(link)
        # A far link can't be the lowest unless a near one was, so it gets no second chance.
        near = abs(link - relaxed) < 1.0 or not grow
        for ring in _from_link(rod, link, registers, near, options):
            if ring.status not in SOLVED:
                failures.append(ring)
            elif not any(_same(ring, other) for other in found):
                found.append(ring)
        if grow and not wanted and found and len(tried) < _WIDEST:
            best = min(found, key=lambda ring: ring.energy).link
            if best <= min(tried):
                wanted.append(min(tried) - 1)
            elif best >= max(tried):
                wanted.append(max(tried) + 1)
    found.sort(key=lambda ring: ring.energy)
    status = Status.CONVERGED if found else Status.NOT_FOUND
    return ContinuumSearch(tuple(found), tuple(failures), tuple(tried), status)


def _from_link(
    rod: Rod, link: int, registers: int, detour: bool, options: ContinuumOptions
) -> Iterator[ContinuumRing]:
    """Rings of one link from every register; the preferred one insists on a minimum."""
    for j in range(registers):
        turn = 2.0 * np.pi * j / registers
        for ring in attempts(rod, link, turn, options, detour and j == 0):
            yield ring
            if ring.status in SOLVED and ring.stable is not False:
                break


def _same(a: ContinuumRing, b: ContinuumRing) -> bool:
    if a.status is Status.SINGULAR or b.status is Status.SINGULAR:
        # members of one family: loads turn with the register
        a_size, b_size = np.linalg.norm(a.loads), np.linalg.norm(b.loads)
        agree = abs(a_size - b_size) < 1e2 * _SAME * max(a_size, b_size)
    else:
        size = max(float(np.max(np.abs(a.loads))), float(np.max(np.abs(b.loads))))
        agree = float(np.max(np.abs(a.loads - b.loads))) < 1e2 * _SAME * size
    scale = a.rod.bend_stiffness * (2.0 * np.pi) ** 2
    return bool(agree and a.link == b.link and abs(a.energy - b.energy) < _SAME * scale)
