"""Half chains as a method object."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dnacheck.cyclization.method import Method, Run, rings_of
from dnacheck.numerics.outcome import SolveError

if TYPE_CHECKING:
    from dnacheck.cyclization.half_chain.sampling import HalfChainOptions
    from dnacheck.cyclization.method import Target
    from dnacheck.cyclization.result import JFactor
    from dnacheck.equilibria.ring import Equilibria

_FIRST_HALVES = 4_000
_MOST_HALVES = 256_000
_LEAST_RADIUS = 0.15
_BIAS_POWER = 4
"""What is left of the window's bias grows with this power of its radius."""


_LEAST_GROWTH = 1.25
"""Halves that grow less make no better result worth its time."""


@dataclass(frozen=True)
class HalfChain(Method):
    """First and second halves drawn apart, all pairs that meet counted.

    Attributes
    ----------
    halves : int or None
        First halves drawn, and as many second halves; None for growing numbers, 4,000 to
        256,000, and windows as small as the bias asks, until the tolerance or the time is reached.
    tilted : bool
        Draw about closed shapes; otherwise from the free chain.
    batches : int
        Independent sets that they are drawn in.
    radius : float
        Largest mismatch of a pair, in standard deviations of the mismatch of tilted chains.
    shells : int
        Shells of the window, for its extrapolation to size zero.
    """

    halves: int | None = None
    tilted: bool = True
    batches: int = 16
    radius: float = 0.6
    shells: int = 24

    def __post_init__(self) -> None:
        self.options(Run(), _FIRST_HALVES if self.halves is None else self.halves)

    @property
    def name(self) -> str:
        return "half-chain" if self.tilted else "half-chain-plain"

    def options(self, run: Run, halves: int, radius: float | None = None) -> HalfChainOptions:
        """These options for so many halves on either side."""
        from dnacheck.cyclization.half_chain.sampling import HalfChainOptions

        return HalfChainOptions(
            halves=halves,
            batches=self.batches,
            tilted=self.tilted,
            radius=self.radius if radius is None else radius,
            shells=self.shells,
            threads=run.threads,
        )

    def run(self, target: Target, run: Run) -> JFactor:
        from dnacheck.cyclization.half_chain.sampling import half_chain
        from dnacheck.numerics.seeds import generator

        search = rings_of(target)
        if self.halves is None:
            return self._to_tolerance(search, run)
        result = half_chain(search, self.options(run, self.halves), generator(run.rng))
        if run.progress is not None:
            run.progress(result.samples)
        return result

    def _to_tolerance(self, search: Equilibria, run: Run) -> JFactor:
        """Halves in growing numbers and windows that shrink, until the tolerance or the time."""
        from dnacheck.cyclization.half_chain.sampling import half_chain_estimate, half_chain_result
        from dnacheck.cyclization.result import JStatus
        from dnacheck.numerics.seeds import generator, seed_sequence

        sequence = seed_sequence(run.rng)
        deadline = time.perf_counter() + run.max_seconds
        halves, radius, drawn = _FIRST_HALVES, self.radius, 0
        best: JFactor | None = None
        while True:
            began = time.perf_counter()
            options = self.options(run, halves, radius)
            failure, smaller = None, radius
            try:
                estimate = half_chain_estimate(search, options, generator(sequence.spawn(1)[0]))
                seconds = time.perf_counter() - began
                result = half_chain_result(search.chain, options, estimate, seconds)
            except SolveError as error:  # more halves may do
                failure = error
            else:
                if best is None or result.total_error < best.total_error:
                    best = result
                bias = abs(estimate.bias)
                if bias > max(0.5 * run.tolerance, 3.0 * estimate.bias_stderr):
                    shrink = (0.25 * run.tolerance / bias) ** (1.0 / _BIAS_POWER)
                    smaller = max(_LEAST_RADIUS, radius * max(shrink, 0.5))
            drawn += 2 * options.halves
            if run.progress is not None:
                run.progress(drawn)
            now = time.perf_counter()
            met = best is not None and best.total_error <= run.tolerance
            # A smaller window holds fewer of the pairs; twice the halves make up for a part.
            growth = 2.0 if smaller < radius else 4.0
            # Four times the halves make up to sixteen times the pairs; what is begun cannot be
            # broken off.
            growth = min(growth, math.sqrt(max(deadline - now, 0.0) / max(now - began, 1e-9)))
            halves, radius = int(growth * halves), smaller
            if met or halves > _MOST_HALVES or growth < _LEAST_GROWTH:
                break
        if best is None:
            assert failure is not None
            raise failure
        if not met and best.status is not JStatus.HEAVY_TAILS:
            best = replace(best, status=JStatus.TOLERANCE_NOT_MET)
        return best
