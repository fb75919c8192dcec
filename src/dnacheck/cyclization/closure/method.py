"""Exact-closure sampling as a method object."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from dnacheck.cyclization.method import Method, Run, held_rings_of

if TYPE_CHECKING:
    from dnacheck.cyclization.closure.sampling import ClosureOptions
    from dnacheck.cyclization.method import Target
    from dnacheck.cyclization.result import JFactor


@dataclass(frozen=True)
class ClosureSampling(Method):
    """Importance sampling of exactly closed shapes about the held rings.

    Attributes
    ----------
    first_batches, pairs_per_batch : int
        Independent batches of the first round and antithetic pairs of draws in each.
    most_draws : int
        Bound on the number of draws.
    probe_rate : float
        Fraction of draws that are searched for shapes not counted.
    """

    first_batches: int = 20
    pairs_per_batch: int = 8
    most_draws: int = 400_000
    probe_rate: float = 0.1

    def __post_init__(self) -> None:
        self.options(Run())

    @property
    def name(self) -> str:
        return "closure"

    def options(self, run: Run) -> ClosureOptions:
        """These options with those of a run."""
        from dnacheck.cyclization.closure.sampling import ClosureOptions

        return ClosureOptions(
            tolerance=run.tolerance,
            max_seconds=run.max_seconds,
            threads=run.threads,
            **asdict(self),
        )

    def run(self, target: Target, run: Run) -> JFactor:
        from dnacheck.cyclization.closure.sampling import ClosureSampler

        sampler = ClosureSampler(held_rings_of(target), self.options(run), run.rng)
        return sampler.sample(run.progress)
