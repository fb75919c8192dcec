"""Half chains as a method object."""

from __future__ import annotations

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


@dataclass(frozen=True)
class HalfChain(Method):
    """First and second halves drawn apart, all pairs that meet counted.

    Attributes
    ----------
    halves : int or None
        First halves drawn, and as many second halves; None for growing numbers, 4,000 to
        256,000, until the tolerance or the time is reached.
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

    def options(self, run: Run, halves: int) -> HalfChainOptions:
        """These options for so many halves on either side."""
        from dnacheck.cyclization.half_chain.sampling import HalfChainOptions

        return HalfChainOptions(
            halves=halves,
            batches=self.batches,
            tilted=self.tilted,
            radius=self.radius,
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
        """Halves in growing numbers until the tolerance, the time or the most halves."""
        from dnacheck.cyclization.half_chain.sampling import half_chain
        from dnacheck.cyclization.result import JStatus
        from dnacheck.numerics.seeds import generator, seed_sequence

        sequence = seed_sequence(run.rng)
        deadline = time.perf_counter() + run.max_seconds
        halves, drawn = _FIRST_HALVES, 0
        best: JFactor | None = None
        while True:
            began = time.perf_counter()
            rng = generator(sequence.spawn(1)[0])
            options = self.options(run, halves)
            failure = None
            try:
                result = half_chain(search, options, rng)
            except SolveError as error:  # more halves may do
                failure = error
            else:
                if best is None or result.total_error < best.total_error:
                    best = result
            drawn += 2 * options.halves
            if run.progress is not None:
                run.progress(drawn)
            now = time.perf_counter()
            halves *= 4
            met = best is not None and best.total_error <= run.tolerance
            # Four times the halves make up to sixteen times the pairs.
            if met or halves > _MOST_HALVES or now + 4.0 * (now - began) > deadline:
                break
        if best is None:
            assert failure is not None
            raise failure
        if not met and best.status is not JStatus.HEAVY_TAILS:
            best = replace(best, status=JStatus.TOLERANCE_NOT_MET)
        return best
