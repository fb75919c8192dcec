"""The cheapest method whose measured error meets a tolerance.

The order is that of cost: Laplace, register-integrated Laplace, exact-closure sampling, tilted
half chains. Laplace's error is not guessed: a small sample of exactly closed shapes measures it.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from dnacheck.cyclization.closure.sampling import ClosureOptions, ClosureSampler
from dnacheck.cyclization.laplace.isolated import laplace
from dnacheck.cyclization.laplace.register import (
    RegisterProfile,
    register_laplace,
    register_profile,
)
from dnacheck.cyclization.result import JFactor, JStatus
from dnacheck.equilibria.discrete.search import RingSearch, find_rings
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import InputError, SolveError
from dnacheck.numerics.seeds import seed_sequence

_PILOT_BATCHES = 8
_PILOT_SIGMAS = 2.4
"""Standard errors of a pilot of eight batches that hold the true value 95 % of the time (Student's
t with seven degrees of freedom)."""
_FIRST_HALVES = 4_000
_MOST_HALVES = 256_000
_FIRST_RECORDS = 24
_MOST_RECORDS = 500


@dataclass(frozen=True)
class Attempt:
    """One method tried by :func:`choose`.

    Attributes
    ----------
    method : str
    minus_lnJ : float
    error : float
        Measured error of ln J: standard error and bias bound in quadrature; for Laplace its
        difference from the pilot sample plus 2.4 of the pilot's standard errors.
    seconds : float
        Wall time that it took.
    met : bool
        Whether the error meets the tolerance.
    """

    method: str
    minus_lnJ: float
    error: float
    seconds: float
    met: bool


@dataclass(frozen=True)
class Choice:
    """The J factor chosen, why, and everything that was tried."""

    result: JFactor
    reason: str
    attempts: tuple[Attempt, ...]


def checked_tolerance(tolerance: float) -> float:
    """The tolerance itself, if it is a positive number.

    Raises
    ------
    InputError
        It is not.
    """
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        raise InputError(f"tolerance must be a finite number greater than 0, not {tolerance}")
    return tolerance


def _laplace_attempt(value: JFactor, pilot: JFactor, tolerance: float) -> tuple[JFactor, Attempt]:
    """A Laplace value with its error measured by the pilot."""
    bias = abs(value.minus_lnJ - pilot.minus_lnJ) + _PILOT_SIGMAS * pilot.stderr
    bias += pilot.bias_bound or 0.0
    met = bias <= tolerance
    status = JStatus.CONVERGED if met else value.status
    measured = replace(value, bias_bound=bias, status=status)
    return measured, Attempt(value.method, value.minus_lnJ, bias, value.seconds, met)


def half_chains_to_tolerance(
    search: RingSearch,
    tolerance: float,
    max_seconds: float = math.inf,
    seed: int | np.random.SeedSequence = 0,
    threads: int = 1,
) -> JFactor:
    """Tilted half chains in growing numbers until the tolerance, the time or 256,000 halves.

    Raises
    ------
    SolveError
        No stable ring, or no pair of halves met.
    """
    from dnacheck.cyclization.half_chain.sampling import HalfChainOptions, half_chain

    checked_tolerance(tolerance)
    sequence = seed_sequence(seed)
    deadline = time.perf_counter() + max_seconds
    halves = _FIRST_HALVES
    best: JFactor | None = None
    while True:
        began = time.perf_counter()
        options = HalfChainOptions(halves=halves, threads=threads)
        result = half_chain(search, options, np.random.default_rng(sequence.spawn(1)[0]))
        if best is None or result.total_error < best.total_error:
            best = result
        now = time.perf_counter()
        halves *= 4
        met = best.total_error <= tolerance
        # Four times the halves make up to sixteen times the pairs.
        if met or halves > _MOST_HALVES or now + 4.0 * (now - began) > deadline:
            break
    if not met and best.status is not JStatus.HEAVY_TAILS:
        best = replace(best, status=JStatus.TOLERANCE_NOT_MET)
    return best


def metropolis_to_tolerance(
    search: RingSearch,
    tolerance: float,
    max_seconds: float = math.inf,
    seed: int | np.random.SeedSequence = 0,
    threads: int = 1,
) -> JFactor:
    """Restrained Metropolis chains: a pilot, then as long a run as the tolerance or the time asks.

    Raises
    ------
    SolveError
        No stable ring at any link searched.
    """
    from dnacheck.cyclization.umbrella.sampling import UmbrellaOptions, metropolis

    checked_tolerance(tolerance)
    sequence = seed_sequence(seed)
    first, second = (np.random.default_rng(stream) for stream in sequence.spawn(2))
    pilot = UmbrellaOptions(samples=_FIRST_RECORDS, burn_in=16, threads=threads)
    began = time.perf_counter()
    best = metropolis(search, pilot, first)
    elapsed = time.perf_counter() - began
    records = _FIRST_RECORDS * (best.stderr / tolerance) ** 2
    # A fifth of a run goes into tuning the moves.
    records = min(records, _MOST_RECORDS, 0.8 * _FIRST_RECORDS * (max_seconds / elapsed - 1.0))
    if best.total_error > tolerance and records > 2 * _FIRST_RECORDS:
        count = int(records)
        options = UmbrellaOptions(samples=count, burn_in=max(16, count // 5), threads=threads)
        best = metropolis(search, options, second)
    if best.total_error > tolerance:
        best = replace(best, status=JStatus.TOLERANCE_NOT_MET)
    return best


def choose(
    target: Chain | RingSearch,
    tolerance: float,
    max_seconds: float = math.inf,
    seed: int = 0,
    threads: int = 1,
    progress: Callable[[int], None] | None = None,
) -> Choice:
    """J factor by the cheapest method whose measured error meets a tolerance.

    Parameters
    ----------
    tolerance : float
        Error of ln J that is wanted: standard error and bias bound in quadrature.
    max_seconds : float
        Wall time after which the best so far is returned.
    progress : callable, optional
        Called with the number of draws made so far.

    Returns
    -------
    Choice
        Where nothing meets the tolerance, the result of smallest error, with the status
        ``TOLERANCE_NOT_MET`` or ``HEAVY_TAILS``.

    Raises
    ------
    InputError
        A tolerance or time that is not positive.
    SolveError
        No stable ring at any link searched.
    """
    checked_tolerance(tolerance)
    began = time.perf_counter()
    search = find_rings(target) if isinstance(target, Chain) else target
    profile: RegisterProfile = register_profile(search)
    options = ClosureOptions(
        tolerance=tolerance,
        max_seconds=max(1e-3, max_seconds - (time.perf_counter() - began)),
        threads=threads,
    )
    seeds = np.random.SeedSequence(seed).spawn(3)
    attempts: list[Attempt] = []
    results: list[JFactor] = []
    pilot_options = replace(options, first_batches=_PILOT_BATCHES, most_draws=1)
    try:
        pilot = ClosureSampler(profile, pilot_options, seeds[0]).sample()
    except SolveError:
        pilot = None
    if pilot is not None:
        values = [register_laplace(profile)]
        with contextlib.suppress(SolveError):  # a free register has no Laplace value
            values.insert(0, laplace(search))
        for value in values:
            measured, attempt = _laplace_attempt(value, pilot, tolerance)
            attempts.append(attempt)
            results.append(measured)
            if attempt.met:
                return _chosen(measured, attempts, tolerance)
        sampled = ClosureSampler(profile, options, seeds[1]).sample(progress)
        met = sampled.total_error <= tolerance and sampled.status is JStatus.CONVERGED
        attempts.append(
            Attempt("closure", sampled.minus_lnJ, sampled.total_error, sampled.seconds, met)
        )
        if met:
            return _chosen(sampled, attempts, tolerance)
        # A result that knows its error outranks a Laplace value whatever the two errors are.
        results = [sampled]
    deadline = began + max_seconds
    left = deadline - time.perf_counter()
    halves = None
    if left > 0.0 and search.equilibria:
        # Too few pairs that meet are no reason to give up what closure sampling found.
        with contextlib.suppress(SolveError):
            halves = half_chains_to_tolerance(search, tolerance, left, seeds[2], threads)
    if halves is not None:
        met = halves.total_error <= tolerance and halves.status is not JStatus.HEAVY_TAILS
        attempts.append(
            Attempt("half-chain", halves.minus_lnJ, halves.total_error, halves.seconds, met)
        )
        if met:
            return _chosen(halves, attempts, tolerance)
        results.append(halves)
    if not results:
        raise SolveError(
            f"J factor of {profile.chain.name}: no draw could be closed, and no isolated minimum "
            "for half chains; use --method register-laplace"
        )
    best = min(results, key=lambda r: (r.status is JStatus.HEAVY_TAILS, r.total_error))
    if best.status is not JStatus.HEAVY_TAILS:
        best = replace(best, status=JStatus.TOLERANCE_NOT_MET)
    reason = (
        f"no method met {tolerance:g}; {best.method} has the smallest error, "
        f"{best.total_error:.2g} ({_tried(attempts)})"
    )
    return Choice(best, reason, tuple(attempts))


def _tried(attempts: list[Attempt]) -> str:
    return ", ".join(f"{a.method} {a.error:.2g} in {1e3 * a.seconds:.0f} ms" for a in attempts)


def _chosen(result: JFactor, attempts: list[Attempt], tolerance: float) -> Choice:
    last = attempts[-1]
    reason = (
        f"{last.method} is the cheapest whose measured error, {last.error:.2g}, meets {tolerance:g}"
    )
    if len(attempts) > 1:
        reason += f" (not met by {_tried(attempts[:-1])})"
    return Choice(result, reason, tuple(attempts))
