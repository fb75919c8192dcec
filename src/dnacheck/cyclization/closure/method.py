"""Exact-closure sampling as a method object."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dnacheck.cyclization.method import Method, Run, register_profile_of

if TYPE_CHECKING:
    from dnacheck.cyclization.closure.sampling import ClosureOptions, ClosureSampler
    from dnacheck.cyclization.method import Target
    from dnacheck.cyclization.result import JFactor


@dataclass(frozen=True)
class ClosureSampling(Method):
    """Importance sampling of exactly closed shapes about the register-constrained minima.

    Attributes
    ----------
    first_batches, pairs_per_batch : int
        Independent batches of the first round and antithetic pairs of draws in each.
    most_draws : int
        Bound on the number of draws.
    probe_rate : float
        Fraction of draws that are searched for shapes not counted.
    gradient : bool
        Compute the derivatives of ln J too, :meth:`JFactor.gradient`.
    """

    first_batches: int = 20
    pairs_per_batch: int = 8
    most_draws: int = 400_000
    probe_rate: float = 0.1
    gradient: bool = False

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
            first_batches=self.first_batches,
            pairs_per_batch=self.pairs_per_batch,
            most_draws=self.most_draws,
            probe_rate=self.probe_rate,
            threads=run.threads,
        )

    def sampler(self, target: Target, run: Run) -> ClosureSampler:
        """What draws for a target, with the time that finding its minima leaves of the run's."""
        from dnacheck.cyclization.closure.sampling import ClosureSampler

        began = time.perf_counter()
        profile = register_profile_of(target)
        left = max(run.max_seconds - (time.perf_counter() - began), 1e-3)
        return ClosureSampler(profile, self.options(replace(run, max_seconds=left)), run.rng)

    def run(self, target: Target, run: Run) -> JFactor:
        sampler = self.sampler(target, run)
        if not self.gradient:
            return sampler.sample(run.progress)
        from dnacheck.cyclization.gradient import Moments

        moments = Moments(sampler.profile.chain)
        result = sampler.sample(run.progress, moments)
        return replace(result, derivatives=moments.gradient())
