"""Every method on one molecule, and by how many standard errors any two of them differ."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dnacheck.cyclization.laplace.register import register_profile
from dnacheck.cyclization.methods import ClosureSampling, HalfChain, Laplace, Umbrella
from dnacheck.cyclization.result import JFactor
from dnacheck.equilibria.ring import Equilibria
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
    umbrella : Umbrella or None
    threads : int
    """

    closure: float = 0.005
    corrected: float | None = 0.005
    halves: int = 40_000
    plain_halves: int = 0
    umbrella: Umbrella | None = None
    threads: int = 1


def compare_methods(
    search: Equilibria, options: CompareOptions, seed: int = 0
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
        results["laplace"] = Laplace().compute(search)
    results["register-laplace"] = Laplace(register=True).compute(profile)
    if options.corrected is not None:
        results["corrected-laplace"] = Laplace(register=True, order=1).compute(
            profile, rng=seeds[0], tolerance=options.corrected
        )
    threads = options.threads
    results["closure"] = ClosureSampling().compute(
        profile, rng=seeds[1], tolerance=options.closure, threads=threads
    )
    for tilted, halves, place in ((True, options.halves, 2), (False, options.plain_halves, 3)):
        if halves:
            way = HalfChain(halves, tilted)
            results[way.name] = way.compute(search, rng=seeds[place], threads=threads)
    if options.umbrella is not None:
        results["metropolis"] = options.umbrella.compute(search, rng=seeds[4], threads=threads)
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
