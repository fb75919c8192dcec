"""The cheapest method whose measured error meets a tolerance.

The order is that of cost: Laplace, register-integrated Laplace, exact-closure sampling, tilted
half chains. Laplace's error is not guessed: a small sample of exactly closed shapes measures it.
"""

from __future__ import annotations

import contextlib
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dnacheck.cyclization.closure.method import ClosureSampling
from dnacheck.cyclization.half_chain.method import HalfChain
from dnacheck.cyclization.method import Method, Run, register_profile_of
from dnacheck.cyclization.result import Attempt, JFactor, JStatus
from dnacheck.numerics.outcome import SolveError

if TYPE_CHECKING:
    from dnacheck.cyclization.method import Target

_PILOT_BATCHES = 8
_PILOT_SIGMAS = 2.4
"""Standard errors of a pilot of eight batches that hold the true value 95 % of the time (Student's
t with seven degrees of freedom)."""


@dataclass(frozen=True)
class Auto(Method):
    """The cheapest method whose measured error meets the tolerance."""

    @property
    def name(self) -> str:
        return "auto"

    def run(self, target: Target, run: Run) -> JFactor:
        from dnacheck.cyclization.laplace.isolated import laplace
        from dnacheck.cyclization.laplace.register import register_laplace
        from dnacheck.numerics.seeds import seed_sequence

        began = time.perf_counter()
        profile = register_profile_of(target)
        search = profile.search
        seeds = seed_sequence(run.rng).spawn(3)
        attempts: list[Attempt] = []
        results: list[JFactor] = []
        left = max(1e-3, run.max_seconds - (time.perf_counter() - began))
        sampling = replace(run, max_seconds=left)
        pilot = None
        with contextlib.suppress(SolveError):
            brief = ClosureSampling(first_batches=_PILOT_BATCHES, most_draws=1)
            pilot = brief.run(profile, replace(sampling, rng=seeds[0], progress=None))
        if pilot is not None:
            values = [register_laplace(profile)]
            with contextlib.suppress(SolveError):  # a free register has no Laplace value
                values.insert(0, laplace(search))
            for value in values:
                measured, attempt = _laplace_attempt(value, pilot, run.tolerance)
                attempts.append(attempt)
                results.append(measured)
                if attempt.met:
                    return _chosen(measured, attempts, run.tolerance)
            sampled = ClosureSampling().run(profile, replace(sampling, rng=seeds[1]))
            met = sampled.total_error <= run.tolerance and sampled.status is JStatus.CONVERGED
            attempts.append(_attempt(sampled, met))
            if met:
                return _chosen(sampled, attempts, run.tolerance)
            # A result that knows its error outranks a Laplace value whatever the two errors are.
            results = [sampled]
        left = began + run.max_seconds - time.perf_counter()
        halves = None
        if left > 0.0 and search.equilibria:
            # Too few pairs that meet are no reason to give up what closure sampling found.
            with contextlib.suppress(SolveError):
                rest = replace(run, rng=seeds[2], max_seconds=left, progress=None)
                halves = HalfChain().run(search, rest)
        if halves is not None:
            met = halves.total_error <= run.tolerance and halves.status is not JStatus.HEAVY_TAILS
            attempts.append(_attempt(halves, met))
            if met:
                return _chosen(halves, attempts, run.tolerance)
            results.append(halves)
        if not results:
            raise SolveError(
                f"J factor of {profile.chain.name}: no draw could be closed, and no isolated "
                "minimum for half chains; use --method register-laplace"
            )
        best = min(results, key=lambda r: (r.status is JStatus.HEAVY_TAILS, r.total_error))
        if best.status is not JStatus.HEAVY_TAILS:
            best = replace(best, status=JStatus.TOLERANCE_NOT_MET)
        reason = (
            f"no method met {run.tolerance:g}; {best.method} has the smallest error, "
            f"{best.total_error:.2g} ({_tried(attempts)})"
        )
        return replace(best, reason=reason, tried=tuple(attempts))


def _attempt(result: JFactor, met: bool) -> Attempt:
    return Attempt(result.method, result.minus_lnJ, result.total_error, result.seconds, met)


def _laplace_attempt(value: JFactor, pilot: JFactor, tolerance: float) -> tuple[JFactor, Attempt]:
    """A Laplace value with its error measured by the pilot."""
    bias = abs(value.minus_lnJ - pilot.minus_lnJ) + _PILOT_SIGMAS * pilot.stderr
    bias += pilot.bias_bound or 0.0
    met = bias <= tolerance
    status = JStatus.CONVERGED if met else value.status
    measured = replace(value, bias_bound=bias, status=status)
    return measured, _attempt(measured, met)


def _tried(attempts: list[Attempt]) -> str:
    return ", ".join(f"{a.method} {a.error:.2g} in {1e3 * a.seconds:.0f} ms" for a in attempts)


def _chosen(result: JFactor, attempts: list[Attempt], tolerance: float) -> JFactor:
    last = attempts[-1]
    reason = (
        f"{last.method} is the cheapest whose measured error, {last.error:.2g}, meets {tolerance:g}"
    )
    if len(attempts) > 1:
        reason += f" (not met by {_tried(attempts[:-1])})"
    return replace(result, reason=reason, tried=tuple(attempts))
