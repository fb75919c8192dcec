"""The lowest ring of a molecule, found over links and registers."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.discrete.kernels import newton as nk
from dnacheck.equilibria.discrete.kernels.search import search
from dnacheck.equilibria.discrete.solve import DiscreteRing, NewtonOptions, make_ring
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import InputError, SolveError, Status

LinkChoice = Literal["auto", "all"] | int

_WINDOW_RT = 8.0
"""Minima this far above the lowest change J by less than a part in a thousand; links and
registers beyond it are not searched by ``auto``."""
_MOST_MINIMA = 64
_ALL_LINKS_REACH = 2
_ALL_REGISTERS = 8
# Rings of rigid steps start from 0 and half a turn, and from these.
_RIGID_REGISTERS = np.array([0.5 * math.pi, 1.5 * math.pi])


@dataclass(frozen=True)
class SearchOptions:
    """Where minima are looked for.

    Attributes
    ----------
    links : "auto", "all" or int
        ``auto``: the two links next to the ground twist and every other whose twisting energy
        stays within 8 RT or half the bending energy of a circle, from the registers where the
        planar ring is predicted to rest. ``all``: five links or more around the ground twist,
        from eight more registers each. An integer: that link alone, eight more registers.
    newton : NewtonOptions
    """

    links: LinkChoice = "auto"
    newton: NewtonOptions = field(default_factory=NewtonOptions)

    def __post_init__(self) -> None:
        if isinstance(self.links, bool) or not (
            self.links in ("auto", "all") or isinstance(self.links, int)
        ):
            raise InputError(f"link must be auto, all or an integer, not {self.links!r}")


@dataclass(frozen=True)
class RingSearch:
    """Every distinct minimum that a search found, lowest first.

    ``links_searched`` are the links of the starting shapes; a start may relax to another link of
    the same parity, because chains may pass through themselves. ``failed_starts`` counts starts
    that did not converge.
    """

    chain: Chain
    equilibria: tuple[DiscreteRing, ...]
    links_searched: tuple[int, ...]
    starts: int
    failed_starts: int
    seconds: float
    status: Status

    @property
    def lowest(self) -> DiscreteRing:
        """The minimum of lowest energy.

        Raises
        ------
        SolveError
            None was found.
        """
        if not self.equilibria:
            raise SolveError(
                f"discrete ring of {self.chain.name}: none of {self.starts} starts over links "
                f"{self.links_searched} converged; {self.status.value}",
                self,
            )
        return self.equilibria[0]


def candidate_links(chain: Chain) -> tuple[int, ...]:
    """Links that ``auto`` searches, nearest to the ground twist first."""
    turns = chain.relaxed_turns
    if chain.rigid:
        # What is left of a step's stiffness when the rest of it relaxes.
        softness = np.linalg.inv(chain.stiffness).mean(axis=0)
        twist = 1.0 / float(softness[0, 0])
        bend = 2.0 / float(softness[1, 1] + softness[2, 2])
    else:
        twist = 1.0 / float(np.mean(1.0 / chain.stiffness[:, 0, 0]))
        bend = 0.5 * float(np.mean(chain.stiffness[:, 1, 1] + chain.stiffness[:, 2, 2]))
    allowed = max(_WINDOW_RT / chain.energy_scale_RT, math.pi**2 * bend / chain.n_steps)
    reach = math.sqrt(2.0 * allowed * chain.n_steps / twist) / (2.0 * math.pi)
    low, high = math.floor(turns - reach), math.ceil(turns + reach)
    chosen = [
        link
        for link in range(low, high + 1)
        if abs(link - turns) <= reach or link in (math.floor(turns), math.floor(turns) + 1)
    ]
    return tuple(sorted(chosen, key=lambda link: abs(link - turns)))


def find_rings(chain: Chain, options: SearchOptions | None = None) -> RingSearch:
    """Minima of the closed chain over links and registers, lowest first.

    Every start is a planar ring of a given link, rolled to the registers that second-order
    perturbation in the ground bends selects (and to eight more with ``all`` or a given link); no
    continuum solution is needed.
    """
    options = options or SearchOptions()
    if options.links == "auto":
        links: tuple[int, ...] = candidate_links(chain)
        registers: NDArray[Any] = np.empty(0)
        window = 0.0
        if chain.rigid:
            registers, window = _RIGID_REGISTERS, _WINDOW_RT / chain.energy_scale_RT
    elif options.links == "all":
        nearest = round(chain.relaxed_turns)
        around = range(nearest - _ALL_LINKS_REACH, nearest + _ALL_LINKS_REACH + 1)
        links = tuple(sorted({*around, *candidate_links(chain)}))
        registers = np.arange(_ALL_REGISTERS) * (2.0 * np.pi / _ALL_REGISTERS)
        window = math.inf
    else:
        links = (int(options.links),)
        registers = np.arange(_ALL_REGISTERS) * (2.0 * np.pi / _ALL_REGISTERS)
        window = math.inf
    return search_minima(chain, links, registers, window, options.newton)


def search_minima(
    chain: Chain,
    links: tuple[int, ...],
    registers: NDArray[Any],
    window: float,
    options: NewtonOptions,
) -> RingSearch:
    """Minima reached from planar rings of the given links and registers.

    Each link starts from the registers where its planar ring is predicted to rest. Links whose
    minimum lies within ``window`` (reduced energy) of the lowest start again from ``registers``,
    in radians from the best of these.
    """
    most = min(_MOST_MINIMA, len(links) * (2 + len(registers)))
    angles = np.empty((most, *chain.ground.shape))
    multipliers = np.empty((most, 6))
    figures = np.empty((most, nk.N_FIGURES))
    began = time.perf_counter()
    found, starts, failed = search(
        chain.arrays,
        np.array(links, dtype=np.int64),
        registers,
        window,
        options.limits._replace(minima_only=True),
        angles,
        multipliers,
        figures,
    )
    seconds = time.perf_counter() - began
    order = np.argsort(figures[:found, nk.ENERGY], kind="stable")
    rings = tuple(
        make_ring(
            chain,
            angles[i].copy(),
            multipliers[i].copy(),
            figures[i],
            nk.CONVERGED,
            seconds / max(found, 1),
        )
        for i in order
    )
    return RingSearch(
        chain=chain,
        equilibria=rings,
        links_searched=links,
        starts=starts,
        failed_starts=failed,
        seconds=seconds,
        status=Status.CONVERGED if rings else Status.NOT_FOUND,
    )
