"""Laplace, half chains and Metropolis sampling against exact-closure sampling."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from dnacheck.numerics.outcome import SolveError
from dnacheck.validate.checks.jfactors.runs import BEST, chains, row, sampled
from dnacheck.validate.context import Context
from dnacheck.validate.registry import Findings, Level
from dnacheck.validate.sections import Column, Table
from dnacheck.validate.verdict import CheckResult, Rule, judge

if TYPE_CHECKING:
    from dnacheck.jfactor.result import JFactor
    from dnacheck.model.chain import Chain

SIGMAS = 3.0
"""Methods must meet within so many combined standard errors."""
LARGEST_LAPLACE_BIAS = 0.6
"""0.3 to 0.5 was seen on the eleven molecules."""


def _method_table(name: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    return Table(name, name, [Column("name", "Molecule")], rows)


def laplace(context: Context) -> Findings:
    """Laplace, plain and register-integrated, against exact-closure sampling."""
    from dnacheck.jfactor.laplace import laplace as plain
    from dnacheck.jfactor.register import register_laplace

    wanted = context.scene.wanted.ln_J or 0.05
    results, rows = [], []
    for index, chain in enumerate(chains(context)):
        best = sampled(chain, min(0.01, wanted), context.seed + index)
        held = register_laplace(chain)
        try:
            simple = plain(chain).minus_lnJ
        except SolveError:
            simple = None
        rows.append(
            {
                **row(best),
                "n_bp": chain.n_steps,
                "J": best.J_molar,
                "laplace": simple,
                "register": held.minus_lnJ,
                "register_bias": held.minus_lnJ - best.minus_lnJ,
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
                LARGEST_LAPLACE_BIAS,
                Rule.AT_MOST,
                "what Laplace's approximation leaves out; 0.3 to 0.5 seen on the eleven molecules",
                "beyond it one of the two would be wrong",
                unit="RT",
                got_sigma=best.stderr,
            ),
        ]
    return Findings(results, [_method_table("closure", rows)])


def _agreement(
    name: str, item: str, other: JFactor, best: JFactor, widest: float, what: str
) -> CheckResult:
    """A method against exact-closure sampling."""
    return judge(
        f"{name}[{item}]",
        f"−ln J by {what}",
        other.minus_lnJ,
        best.minus_lnJ,
        Rule.SIGMAS,
        "exact-closure sampling, an independent method",
        "both with standard errors from independent batches",
        SIGMAS,
        "RT",
        got_sigma=other.total_error,
        expected_sigma=best.total_error,
        widest_sigma=widest,
    )


def half_chain(context: Context) -> Findings:
    """Tilted half chains against exact-closure sampling."""
    from dnacheck.jfactor.half_chain import HalfChainOptions
    from dnacheck.jfactor.half_chain import half_chain as run

    results, rows = [], []
    chosen = chains(context) if context.level is Level.FULL else _few(context)
    for index, chain in enumerate(chosen):
        best = sampled(chain, 0.01, context.seed + index)
        other = run(chain, HalfChainOptions(), context.rng(index))
        rows.append(row(other))
        results.append(
            _agreement("jfactor.half_chain", chain.name, other, best, 0.2, "tilted half chains")
        )
    return Findings(results, [_method_table("half-chain", rows)])


def _few(context: Context) -> list[Chain]:
    """The best cyclizers and the first molecule, of the paper's the worst."""
    first = chains(context)[0]
    return [first, *(chain for chain in _best_cyclizers(context) if chain is not first)]


def _best_cyclizers(context: Context) -> list[Chain]:
    from dnacheck.validate.rings import scene_chain

    known = {molecule.name: molecule for molecule in context.molecules}
    names = [name for name in BEST if name in known] or list(known)[:1]
    return [scene_chain(context.scene, known[name]) for name in names]


def metropolis(context: Context) -> Findings:
    """Restrained Metropolis sampling with MBAR against exact-closure sampling."""
    from dnacheck.jfactor.umbrella import UmbrellaOptions
    from dnacheck.jfactor.umbrella import metropolis as run

    full = context.level is Level.FULL
    options = UmbrellaOptions(samples=1000 if full else 100, burn_in=100 if full else 50)
    results, rows = [], []
    for index, chain in enumerate(_best_cyclizers(context)[: None if full else 2]):
        best = sampled(chain, 0.01, context.seed + index)
        other = run(chain, options, context.rng(index))
        rows.append(row(other))
        widest = 0.15 if full else 0.6
        words = "restrained Metropolis sampling joined by MBAR"
        results.append(_agreement("jfactor.metropolis", chain.name, other, best, widest, words))
    return Findings(results, [_method_table("metropolis", rows)])
