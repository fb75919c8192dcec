"""How much more tightly a guest binds to a ring than to the linear molecule.

Thermodynamic linkage: closing a bound molecule and binding to a closed one lead to the same state,
so the ratio of the binding constants on the ring and on the linear molecule is the ratio of the J
factors of the bound and the free molecule.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from dnacheck.cyclization.method import DEFAULT_TOLERANCE, Method, Run
from dnacheck.cyclization.result import JFactor
from dnacheck.equilibria.boundary import AnyBoundary
from dnacheck.equilibria.discrete.boundary_search import find_equilibria
from dnacheck.equilibria.discrete.search import SearchOptions
from dnacheck.equilibria.ring import RING, Equilibrium
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import InputError
from dnacheck.numerics.seeds import seed_sequence


@dataclass(frozen=True)
class Binding:
    """J factors of one molecule with and without its guests, and what follows.

    Attributes
    ----------
    guests : tuple of (name, site)
    free, bound : JFactor
    facing_free_deg, facing_bound_deg : float
        Register of the lowest ring at the first guest's site: the angle about the base pair's axis
        from the major groove to the middle of the ring. 0: the major groove faces inwards.
    """

    guests: tuple[tuple[str, int], ...]
    free: JFactor
    bound: JFactor
    facing_free_deg: float
    facing_bound_deg: float

    @property
    def ln_ratio(self) -> float:
        """ln of the binding constant on the ring over that on the linear molecule."""
        return self.free.minus_lnJ - self.bound.minus_lnJ

    @property
    def stderr(self) -> float:
        """Its statistical standard error."""
        return math.hypot(self.free.stderr, self.bound.stderr)

    @property
    def bias_bound(self) -> float | None:
        """Bound of its systematic error; None where none is known."""
        if self.free.bias_bound is None or self.bound.bias_bound is None:
            return None
        return self.free.bias_bound + self.bound.bias_bound

    @property
    def ratio(self) -> float:
        """Binding constant on the ring over that on the linear molecule."""
        return math.exp(self.ln_ratio)

    @property
    def register_change_deg(self) -> float:
        """By how much the lowest ring rolls at the site when the guest binds, in (-180, 180]."""
        change = self.facing_bound_deg - self.facing_free_deg
        return 180.0 - (180.0 - change) % 360.0

    def to_dict(self) -> dict[str, Any]:
        """The same as plain numbers and lists."""
        return {
            "guests": [{"name": name, "site": site} for name, site in self.guests],
            "free_minus_lnJ": self.free.minus_lnJ,
            "free_stderr": self.free.stderr,
            "ratio": self.ratio,
            "ln_ratio": self.ln_ratio,
            "ln_ratio_stderr": self.stderr,
            "ln_ratio_bias_bound": self.bias_bound,
            "facing_free_deg": self.facing_free_deg,
            "facing_bound_deg": self.facing_bound_deg,
            "register_change_deg": self.register_change_deg,
        }


def facing_deg(ring: Equilibrium, pair: int) -> float:
    """Angle about base pair ``pair``'s axis from the major groove to the middle of the ring."""
    centres, frames = ring.shape
    inwards = centres[:-1].mean(axis=0) - centres[pair]
    d1, d2 = frames[pair, :, 0], frames[pair, :, 1]
    # The groove is d1 of six parameters and d2 of three angles, whose long axis is -d1.
    groove, along = (d1, d2) if ring.chain.rigid else (d2, -d1)
    return math.degrees(math.atan2(float(inwards @ along), float(inwards @ groove)))


def binding(
    chain: Chain,
    method: Method,
    run: Run | None = None,
    options: SearchOptions | None = None,
    bound: JFactor | None = None,
    boundary: AnyBoundary = RING,
) -> Binding:
    """J of a chain with its guests and without, and the ratio of binding constants.

    Parameters
    ----------
    chain : Chain
        Holds at least one guest (:func:`dnacheck.model.guests.bind`).
    options : SearchOptions, optional
        With a link, both J are the parts of that link.
    bound : JFactor, optional
        Of the chain as it is, where that is known already.
    boundary : Ring, NickedRing, HingedRing or Loop
        How the closed molecule's ends meet, bound and free.

    Raises
    ------
    InputError
        Nothing is bound.
    SolveError
        No ring was found of the bound or the free molecule.
    """
    if not chain.guests:
        raise InputError(f"binding: {chain.name} holds no guest; bind one")
    run = run or Run(tolerance=DEFAULT_TOLERANCE)
    bare = chain.elastic(0.0)
    ours, theirs = seed_sequence(run.rng).spawn(2)
    rings = find_equilibria(chain, boundary, options)
    if bound is None:
        bound = method.compute(rings, rng=ours, threads=run.threads, tolerance=run.tolerance,
                               max_seconds=run.max_seconds)  # fmt: skip
    others = find_equilibria(bare, boundary, options)
    free = method.compute(others, rng=theirs, threads=run.threads, tolerance=run.tolerance,
                          max_seconds=run.max_seconds)  # fmt: skip
    if options is not None and isinstance(options.links, int):
        free = free.of_link(options.links, run.tolerance)
    pair = (chain.guests[0].site + 1) % chain.n_steps
    return Binding(
        tuple((guest.name, guest.site) for guest in chain.guests),
        free,
        bound,
        facing_deg(others.lowest, pair),
        facing_deg(rings.lowest, pair),
    )
