"""Laplace, half chains and Metropolis sampling against exact-closure sampling."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from dnacheck.model.molecules import embedded_names
from dnacheck.numerics.outcome import SolveError
from dnacheck.validation.checks.jfactors.runs import BEST, chains, row, sampled
from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Findings, Level
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge, must_fail
from dnacheck.validation.report.record import Column, Table

if TYPE_CHECKING:
    from dnacheck.model.chain import Chain
    from dnacheck.validation.reference.agreement import CompareOptions

SIGMAS = 3.0
"""Methods must meet within so many combined standard errors."""
LARGEST_BIAS_OVER_ROD = 2.0
"""Largest bias of Laplace's approximation over the 0.514 L/2P that it lacks for a straight rod
(Shimada & Yamakawa 1984); 0.8 to 1.1 was seen on 200 random molecules."""


def _method_table(name: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    return Table(name, name, [Column("name", "Molecule")], rows)


def laplace(context: Context) -> Findings:
    """Laplace, plain and register-integrated, against exact-closure sampling."""
    from dnacheck.cyclization.laplace.register import register_profile
    from dnacheck.cyclization.methods import Laplace

    wanted = context.scene.wanted.ln_J or 0.05
    results, rows = [], []
    for index, chain in enumerate(chains(context)):
        best = sampled(chain, min(0.01, wanted), context.seed + index)
        profile = register_profile(chain)
        held = Laplace(register=True).compute(profile)
        corrected = Laplace(register=True, order=1)
        term = corrected.compute(profile, rng=context.seed + 1000 + index, tolerance=0.01)
        try:
            simple = Laplace().compute(chain).minus_lnJ
        except SolveError:
            simple = None
        length = chain.n_steps * chain.rise_A
        first_term = 0.514 * length / (2.0 * chain.persistence_length_A)
        rows.append(
            {
                **row(best),
                "n_bp": chain.n_steps,
                "J": best.molar,
                "laplace": simple,
                "register": held.minus_lnJ,
                "register_bias": held.minus_lnJ - best.minus_lnJ,
                "corrected": term.minus_lnJ,
                "corrected_error": term.total_error,
                "corrected_bias": term.minus_lnJ - best.minus_lnJ,
            }
        )
        results += [
            judge(
                f"jfactor.laplace[{chain.name} error]",
                "standard error and bias bound of −ln J by exact-closure sampling",
                best.total_error,
                min(0.02, wanted),
                Rule.AT_MOST,
                "batches of the sampler, and its bounds",
                "0.02 has been reached in 0.2 s",
                unit="RT",
            ),
            judge(
                f"jfactor.laplace[{chain.name}]",
                "register-integrated Laplace against exact-closure sampling",
                abs(held.minus_lnJ - best.minus_lnJ),
                LARGEST_BIAS_OVER_ROD * first_term,
                Rule.AT_MOST,
                "twice the first anharmonic term of a straight rod, 0.514 L/2P",
                "beyond it one of the two would be wrong",
                unit="RT",
                got_sigma=best.stderr,
            ),
            judge(
                f"jfactor.laplace[{chain.name} corrected]",
                "−ln J by register-integrated Laplace with its first anharmonic term",
                term.minus_lnJ,
                best.minus_lnJ,
                Rule.ABSOLUTE,
                "exact-closure sampling",
                "the next term is estimated at 0.01 for the eleven, 0.04 for 500 base pairs",
                0.05,
                "RT",
                got_sigma=term.stderr,
                expected_sigma=best.stderr,
            ),
        ]
    return Findings(results, [_method_table("closure", rows)])


def pairwise(context: Context) -> Findings:
    """Every two methods on every molecule, against their standard errors."""
    from dnacheck.validation.engine.rings import rings
    from dnacheck.validation.reference.agreement import compare_methods, differences, standard_error

    results: list[CheckResult] = []
    rows: list[dict[str, Any]] = []
    squares: list[float] = []
    for index, chain in enumerate(_compared(context)):
        slow = index == 0 or chain.name in embedded_names()
        found = compare_methods(rings(chain), _effort(context, chain, slow), context.seed + index)
        pairs = differences(found)
        squares += [pair.sigmas**2 for pair in pairs]
        worst = pairs[0]
        results.append(
            judge(
                f"jfactor.pairwise[{chain.name}]",
                f"−ln J by {_WORDS[worst.first]} and by {_WORDS[worst.second]}, of "
                f"{len(pairs)} pairs of methods the two that differ most",
                found[worst.first].minus_lnJ,
                found[worst.second].minus_lnJ,
                Rule.SIGMAS,
                "methods that share nothing but the energy of the chain",
                "standard errors alone, from independent batches or copies; no bias bounds",
                SIGMAS,
                "RT",
                got_sigma=standard_error(found[worst.first]),
                expected_sigma=standard_error(found[worst.second]),
                widest_sigma=_WIDEST,
            )
        )
        row: dict[str, Any] = {"name": chain.name, "sigmas": worst.sigmas}
        for method, result in found.items():
            row[method] = result.minus_lnJ
            row[f"{method}-error"] = standard_error(result)
        rows.append(row)
        if index == 0:
            best = found["closure"]
            results.append(
                must_fail(
                    judge(
                        f"jfactor.pairwise[control: {chain.name}]",
                        "−ln J by register-integrated Laplace and by exact closure",
                        found["register-laplace"].minus_lnJ,
                        best.minus_lnJ,
                        Rule.SIGMAS,
                        "exact-closure sampling",
                        "as above",
                        SIGMAS,
                        "RT",
                        expected_sigma=best.stderr,
                    ),
                    "what is anharmonic was left out",
                )
            )
    results.append(
        judge(
            "jfactor.pairwise[all]",
            "root mean square of all differences over their standard errors",
            math.sqrt(sum(squares) / len(squares)),
            1.5,
            Rule.AT_MOST,
            "1, if the methods agree and their errors are honest",
            f"{len(squares)} pairs, several of which share a method",
        )
    )
    return Findings(results, [_method_table("methods", rows)])


_WIDEST = 1.0
_WORDS = {
    "corrected-laplace": "Laplace with its first anharmonic term",
    "closure": "exact closure",
    "half-chain": "tilted half chains",
    "half-chain-plain": "plain half chains",
    "metropolis": "Metropolis sampling with MBAR",
}


def _compared(context: Context) -> list[Chain]:
    """All molecules of a small scene; of a large one the shortest, the median and the longest."""
    from dnacheck.validation.engine.pilots import pilots

    every = chains(context)
    return every if len(every) <= 12 or context.level is Level.FULL else pilots(every)


def _effort(context: Context, chain: Chain, slow: bool) -> CompareOptions:
    """How long each method runs; the slow ones longest on the three best cyclizers."""
    from dnacheck.cyclization.methods import Umbrella
    from dnacheck.validation.reference.agreement import CompareOptions

    best = chain.name in BEST
    if context.level is Level.FULL:
        return CompareOptions(
            plain_halves=400_000 if best else 0,
            umbrella=Umbrella(samples=1000 if best else 400, burn_in=100) if slow else None,
        )
    umbrella = Umbrella(samples=100 if best else 40, burn_in=50 if best else 16, thinning=2)
    return CompareOptions(
        closure=0.01, corrected=0.01, halves=8_000, umbrella=umbrella if slow else None
    )
