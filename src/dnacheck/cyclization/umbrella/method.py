"""Restrained Metropolis chains as a method object."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dnacheck.cyclization.method import Method, Run, rings_of

if TYPE_CHECKING:
    from dnacheck.cyclization.method import Target
    from dnacheck.cyclization.result import JFactor
    from dnacheck.cyclization.umbrella.sampling import UmbrellaOptions
    from dnacheck.equilibria.ring import Equilibria

_FIRST_RECORDS = 24
_MOST_RECORDS = 500
_LEAST_BURN_IN = 16


@dataclass(frozen=True)
class Umbrella(Method):
    """Metropolis chains under closure restraints of growing strength, joined by MBAR.

    Attributes
    ----------
    samples : int or None
        Recorded shapes for each strength and copy; None for a pilot and then as many as the
        tolerance or the time asks, 500 at most.
    burn_in : int or None
        Records at the start of each copy that tune the moves and are dropped; None for a fifth
        of ``samples``, 16 at least.
    thinning : int
        Sweeps from one record to the next.
    copies : int
        Independent ladders of strengths.
    """

    samples: int | None = None
    burn_in: int | None = None
    thinning: int = 4
    copies: int = 4

    def __post_init__(self) -> None:
        self.options(Run(), _FIRST_RECORDS if self.samples is None else self.samples)

    @property
    def name(self) -> str:
        return "metropolis"

    def options(self, run: Run, samples: int) -> UmbrellaOptions:
        """These options for so many records."""
        from dnacheck.cyclization.umbrella.sampling import UmbrellaOptions

        burn_in = max(_LEAST_BURN_IN, samples // 5) if self.burn_in is None else self.burn_in
        return UmbrellaOptions(
            samples=samples,
            burn_in=burn_in,
            thinning=self.thinning,
            copies=self.copies,
            threads=run.threads,
        )

    def run(self, target: Target, run: Run) -> JFactor:
        from dnacheck.cyclization.umbrella.sampling import metropolis
        from dnacheck.numerics.seeds import generator

        search = rings_of(target)
        if self.samples is None:
            return self._to_tolerance(search, run)
        result = metropolis(search, self.options(run, self.samples), generator(run.rng))
        if run.progress is not None:
            run.progress(result.samples)
        return result

    def _to_tolerance(self, search: Equilibria, run: Run) -> JFactor:
        """A pilot, then as long a run as the tolerance or the time asks."""
        from dnacheck.cyclization.result import JStatus
        from dnacheck.cyclization.umbrella.sampling import metropolis
        from dnacheck.numerics.seeds import generator, seed_sequence

        first, second = (generator(stream) for stream in seed_sequence(run.rng).spawn(2))
        began = time.perf_counter()
        best = metropolis(search, self.options(run, _FIRST_RECORDS), first)
        elapsed = time.perf_counter() - began
        drawn = best.samples
        if run.progress is not None:
            run.progress(drawn)
        records = _FIRST_RECORDS * (best.stderr / run.tolerance) ** 2
        # A fifth of a run goes into tuning the moves.
        longest = 0.8 * _FIRST_RECORDS * (run.max_seconds / elapsed - 1.0)
        records = min(records, _MOST_RECORDS, longest)
        if best.total_error > run.tolerance and records > 2 * _FIRST_RECORDS:
            best = metropolis(search, self.options(run, int(records)), second)
            if run.progress is not None:
                run.progress(drawn + best.samples)
        if best.total_error > run.tolerance:
            best = replace(best, status=JStatus.TOLERANCE_NOT_MET)
        return best
