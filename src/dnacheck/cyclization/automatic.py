"""The cheapest method whose measured error meets a tolerance.

The order is that of cost: Laplace, register-integrated Laplace, its first anharmonic term,
exact-closure sampling, half chains. Laplace's error is not guessed: a small sample of exactly
closed shapes measures it. The same sample says how many draws the tolerance takes, hence whether
the anharmonic term may be had for less, and whether the Gaussian about the minima is a picture of
the closed shapes at all; where it is not, and where closing costs so little that no minimum is,
half chains come first.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dnacheck.cyclization.closure.method import ClosureSampling
from dnacheck.cyclization.half_chain.method import HalfChain
from dnacheck.cyclization.method import Method, Run, register_profile_of, rings_of
from dnacheck.cyclization.result import Attempt, JFactor, JStatus
from dnacheck.numerics.outcome import SolveError

if TYPE_CHECKING:
    from numpy.random import SeedSequence

    from dnacheck.cyclization.laplace.register import RegisterProfile
    from dnacheck.cyclization.method import Target
    from dnacheck.equilibria.ring import Equilibria

_PILOT_BATCHES = 8
_PILOT_SIGMAS = 2.4
"""Standard errors of a pilot of eight batches that hold the true value 95 % of the time (Student's
t with seven degrees of freedom)."""
_TERM_PAIRS = 100
_DRAWS_A_PAIR = 4
"""Closed shapes that a pair of the anharmonic term takes: both signs at two scales."""
_DISTRUSTED = (JStatus.HEAVY_TAILS, JStatus.FOLDED)


@dataclass(frozen=True)
class Auto(Method):
    """The cheapest method whose measured error meets the tolerance."""

    @property
    def name(self) -> str:
        return "auto"

    def run(self, target: Target, run: Run) -> JFactor:
        from dnacheck.numerics.seeds import seed_sequence

        search = rings_of(target, any_end=True)
        results: list[JFactor] = []
        attempts: list[Attempt] = []
        for result in _results(target, search, run, seed_sequence(run.rng).spawn(4)):
            met = result.total_error <= run.tolerance and result.status is JStatus.CONVERGED
            error = result.total_error
            attempts.append(Attempt(result.method, result.minus_lnJ, error, result.seconds, met))
            if met:
                return _chosen(result, attempts, run.tolerance)
            results.append(result)
        # A result that knows its error outranks a Laplace value whatever the two errors are.
        results = [r for r in results if r.samples and r.method != "corrected-laplace"] or results
        if not results:
            raise SolveError(
                f"J factor of {search.chain.name}: no draw could be closed, and no isolated "
                "minimum for half chains; use --method register-laplace"
            )
        best = min(results, key=lambda r: (r.status in _DISTRUSTED, r.total_error))
        if best.status not in _DISTRUSTED:
            best = replace(best, status=JStatus.TOLERANCE_NOT_MET)
        reason = (
            f"no method met {run.tolerance:g}; {best.method} has the smallest error of those "
            f"whose diagnosis is good, {best.total_error:.2g} ({_tried(attempts)})"
        )
        return replace(best, reason=reason, tried=tuple(attempts))


def _results(
    target: Target, search: Equilibria, run: Run, seeds: list[SeedSequence]
) -> Iterator[JFactor]:
    """Results in the order in which methods are tried; made only when they are asked for."""
    from dnacheck.cyclization.half_chain.proposals import closing_is_easy

    began = time.perf_counter()
    # Half chains meet as a closed ring and in no other way.
    closed = search.boundary.label == "ring"

    def left(seed: SeedSequence, least: float = 0.0) -> Run | None:
        seconds = max(began + run.max_seconds - time.perf_counter(), least)
        return replace(run, rng=seed, max_seconds=seconds) if seconds > 0.0 else None

    def halves() -> Iterator[JFactor]:
        allowed = left(seeds[2])
        if allowed is not None and search.equilibria and closed:
            # Too few pairs that meet are no reason to give up what another method found.
            with contextlib.suppress(SolveError):
                yield HalfChain().run(search, replace(allowed, progress=None))

    if closed and closing_is_easy(search):
        yield from halves()
        return
    profile = register_profile_of(target if target is not search.chain else search)
    first = left(seeds[0], least=1e-3)
    assert first is not None
    pilot = None
    with contextlib.suppress(SolveError):
        brief = ClosureSampling(first_batches=_PILOT_BATCHES, most_draws=1)
        pilot = brief.run(profile, replace(first, progress=None))
    if pilot is None:
        yield from halves()
        return
    if pilot.status in _DISTRUSTED:
        yield from halves()
    else:
        yield from _laplace_values(profile, search, pilot, run.tolerance)
        correcting = left(seeds[3])
        if correcting is not None:
            yield from _corrected(profile, pilot, correcting)
    sampling = left(seeds[1], least=1e-3)
    assert sampling is not None
    yield ClosureSampling().run(profile, sampling)
    if pilot.status not in _DISTRUSTED:
        yield from halves()


def _laplace_values(
    profile: RegisterProfile, search: Equilibria, pilot: JFactor, tolerance: float
) -> Iterator[JFactor]:
    """Laplace's values with their errors measured by the pilot."""
    from dnacheck.cyclization.laplace.isolated import laplace
    from dnacheck.cyclization.laplace.register import register_laplace

    values = [register_laplace(profile)]
    with contextlib.suppress(SolveError):  # a free register has no Laplace value
        values.insert(0, laplace(search))
    for value in values:
        bias = abs(value.minus_lnJ - pilot.minus_lnJ) + _PILOT_SIGMAS * pilot.stderr
        bias += pilot.bias_bound or 0.0
        status = JStatus.CONVERGED if bias <= tolerance else value.status
        yield replace(value, bias_bound=bias, status=status)


def _corrected(profile: RegisterProfile, pilot: JFactor, run: Run) -> Iterator[JFactor]:
    """The first anharmonic term, for no more closed shapes than sampling takes or has time for."""
    from dnacheck.cyclization.laplace.anharmonic import AnharmonicOptions, corrected_laplace

    draws = pilot.samples * (pilot.stderr / run.tolerance) ** 2
    draws = min(draws, pilot.samples * run.max_seconds / max(pilot.seconds, 1e-3))
    pairs = int(min(draws, 1e6) / _DRAWS_A_PAIR)
    if pairs < _TERM_PAIRS:
        return
    options = AnharmonicOptions(0.7 * run.tolerance, first_pairs=_TERM_PAIRS, most_pairs=pairs)
    with contextlib.suppress(SolveError):
        result = corrected_laplace(profile, options, run.rng)
        met = result.total_error <= run.tolerance
        yield replace(result, status=JStatus.CONVERGED) if met else result


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
