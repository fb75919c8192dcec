"""Every method on one molecule, and by how many standard errors any two of them differ."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dnacheck.cyclization.closure.sampling import ClosureOptions, ClosureSampler
from dnacheck.cyclization.half_chain.sampling import HalfChainOptions, half_chain
from dnacheck.cyclization.laplace.anharmonic import AnharmonicOptions, corrected_laplace
from dnacheck.cyclization.laplace.isolated import laplace
from dnacheck.cyclization.laplace.register import register_laplace, register_profile
from dnacheck.cyclization.result import JFactor
from dnacheck.cyclization.umbrella.sampling import UmbrellaOptions, metropolis
from dnacheck.equilibria.discrete.search import RingSearch
from dnacheck.numerics.outcome import SolveError

APPROXIMATE = ("laplace", "register-laplace")
"""Methods whose error is a bias that they do not know themselves."""


@dataclass(frozen=True)
class CompareOptions:
    """Effort of each method; None or 0 leaves it out.

    Attributes
    ----------
    closure : float
        Standard error asked of exact-closure sampling.
    corrected : float or None
        Error asked of Laplace with its first anharmonic term.
    halves, plain_halves : int
        Halves on each side, tilted and plain.
    umbrella : UmbrellaOptions or None
    threads : int
    """

    closure: float = 0.005
    corrected: float | None = 0.005
    halves: int = 40_000
    plain_halves: int = 0
    umbrella: UmbrellaOptions | None = None
    threads: int = 1


def compare_methods(
    search: RingSearch, options: CompareOptions, seed: int = 0
) -> dict[str, JFactor]:
    """J factors by method, each sampler with random numbers of its own.

    Raises
    ------
    SolveError
        No stable ring. A free register, for which plain Laplace has no value, leaves that out.
    """
    seeds = np.random.SeedSequence(seed).spawn(5)
    profile = register_profile(search)
    results: dict[str, JFactor] = {}
    with contextlib.suppress(SolveError):
        results["laplace"] = laplace(search)
    results["register-laplace"] = register_laplace(profile)
    if options.corrected is not None:
        wanted = AnharmonicOptions(tolerance=options.corrected)
        results["corrected-laplace"] = corrected_laplace(profile, wanted, seeds[0])
    exact = ClosureOptions(tolerance=options.closure, threads=options.threads)
    results["closure"] = ClosureSampler(profile, exact, seeds[1]).sample()
    for name, halves, place in (
        ("half-chain", options.halves, 2),
        ("half-chain-plain", options.plain_halves, 3),
    ):
        if halves:
            sizes = HalfChainOptions(
                halves=halves, tilted=name == "half-chain", threads=options.threads
            )
            results[name] = half_chain(search, sizes, np.random.default_rng(seeds[place]))
    if options.umbrella is not None:
        results["metropolis"] = metropolis(
            search, options.umbrella, np.random.default_rng(seeds[4])
        )
    return results


@dataclass(frozen=True)
class Difference:
    """-ln J of two methods on one molecule.

    Attributes
    ----------
    first, second : str
    difference : float
        First minus second.
    error : float
        Their standard errors in quadrature. Bias bounds count only for the corrected Laplace, whose
        error is mostly one; those of the sampling methods would only make agreement easier.
    """

    first: str
    second: str
    difference: float
    error: float

    @property
    def sigmas(self) -> float:
        """Difference over its standard error, without sign."""
        return abs(self.difference) / self.error


def standard_error(result: JFactor) -> float:
    """Standard error of -ln J; with the estimated next term for the corrected Laplace."""
    if result.method == "corrected-laplace":
        return math.hypot(result.stderr, result.bias_bound or 0.0)
    return result.stderr


def differences(results: Mapping[str, JFactor]) -> tuple[Difference, ...]:
    """Every pair of methods that know their errors, largest number of standard errors first."""
    known = {name: result for name, result in results.items() if name not in APPROXIMATE}
    found = [
        Difference(
            a,
            b,
            known[a].minus_lnJ - known[b].minus_lnJ,
            math.hypot(standard_error(known[a]), standard_error(known[b])),
        )
        for a, b in itertools.combinations(known, 2)
    ]
    return tuple(sorted(found, key=lambda pair: -pair.sigmas))
