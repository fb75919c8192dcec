"""J factors as accurate as wished: for every molecule the cheapest method that measures up."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from dnacheck.numerics.outcome import SolveError
from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.pilots import USED, pilots, variants_of
from dnacheck.validation.engine.registry import Findings
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge, must_fail
from dnacheck.validation.report.record import Column, Table

if TYPE_CHECKING:
    from dnacheck.cyclization.result import JFactor
    from dnacheck.model.chain import Chain

SHOWN_ROWS = 500
_FINER = 10.0
_FINEST_REFERENCE = 0.003
_METHODS = (
    "laplace",
    "register-laplace",
    "corrected-laplace",
    "closure",
    "half-chain",
    "metropolis",
)
"""From the cheapest to the dearest."""


def ln_J(context: Context) -> Findings:
    """Every molecule's J factor, with what was tried and why it was enough."""
    from dnacheck.cyclization.methods import Auto

    accuracy = context.scene.wanted.ln_J
    assert accuracy is not None
    variants = variants_of(context)
    with contextlib.suppress(SolveError):  # compiles, so that the times are of warm code
        Auto().compute(variants[0][2], tolerance=accuracy)
    chosen: dict[int, tuple[Chain, JFactor]] = {}
    rows, unsolved = [], []
    for index, (angles, ratio, chain) in enumerate(variants):
        row: dict[str, Any] = {
            "name": chain.name,
            "n_bp": chain.n_steps,
            "angles": angles,
            "ratio": ratio,
        }
        try:
            found = Auto().compute(chain, rng=context.seed + index, tolerance=accuracy)
        except SolveError as error:
            unsolved.append(chain.name)
            row["reason"] = str(error)
        else:
            chosen[id(chain)] = chain, found
            row |= {
                "minus_lnJ": found.minus_lnJ,
                "error": found.total_error,
                "J": found.molar,
                "method": found.method,
                "reason": found.reason,
            }
        rows.append(row)
    choices = [choice for _, choice in chosen.values()]
    results = [
        judge(
            "wanted.ln_J[solved]",
            "molecules without a J factor",
            len(unsolved),
            0,
            Rule.EQUAL,
            "every chain closes with some probability",
            "none may be missed",
        ),
        judge(
            "wanted.ln_J[accuracy]",
            "largest error of −ln J, as its method measures it",
            max((choice.total_error for choice in choices), default=float("inf")),
            accuracy,
            Rule.AT_MOST,
            "the scene's wish",
            "asked for by the scene",
            unit="RT",
        ),
        *_against_reference(context, [chain for chain, _ in chosen.values()], chosen, accuracy),
    ]
    return Findings(results, [_table(context, rows), _methods(choices, accuracy)])


def _against_reference(
    context: Context,
    chains: Sequence[Chain],
    chosen: dict[int, tuple[Chain, JFactor]],
    accuracy: float,
) -> list[CheckResult]:
    """The pilots against a reference that is ten times finer, and energies in place of J."""
    from dnacheck.cyclization.methods import ClosureSampling
    from dnacheck.validation.engine.rings import lowest_ring

    finer = max(accuracy / _FINER, _FINEST_REFERENCE)
    results = []
    used = pilots(chains) if chains else []
    for number, chain in enumerate(used):
        seed = context.seed + 1_000_003 + number
        reference = ClosureSampling().compute(chain, rng=seed, tolerance=finer)
        found = chosen[id(chain)][1]
        results.append(_pilot(chain.name, found.minus_lnJ, reference, accuracy))
        if number == 0:
            wrong = _pilot(
                f"control: {chain.name}", lowest_ring(chain).energy_RT, reference, accuracy
            )
            results.append(must_fail(wrong, "the entropy was left out"))
    return results


def _pilot(item: str, minus_lnJ: float, reference: JFactor, accuracy: float) -> CheckResult:
    return judge(
        f"wanted.ln_J[{item}]",
        "−ln J by the method chosen",
        minus_lnJ,
        reference.minus_lnJ,
        Rule.ABSOLUTE,
        "exact-closure sampling with other random numbers, ten times finer than the wish or 0.003",
        "asked for by the scene",
        accuracy,
        "RT",
        expected_sigma=reference.total_error,
    )


def _table(context: Context, rows: Sequence[dict[str, Any]]) -> Table:
    model = context.scene.model
    several = len(model.angles) * len(model.twist_ratios) > 1
    cut = f" The first {SHOWN_ROWS} of {len(rows)}." if len(rows) > SHOWN_ROWS else ""
    return Table(
        "ln-J",
        "J factors",
        [
            Column("name", "Molecule"),
            Column("n_bp", "bp"),
            *([Column("angles", "Angles"), Column("ratio", "K_3/K_1", "", "g")] if several else []),
            Column("minus_lnJ", "−ln J", "", ".3f"),
            Column("error", "measured error", "", ".3f"),
            Column("J", "J", "mol/L", ".2e"),
            Column("method", "Method"),
            Column("reason", "Why this one"),
        ],
        rows[:SHOWN_ROWS],
        f"J in mol/L, nothing fitted. The error is the standard error and the bound on what is "
        f"systematic, in quadrature; for Laplace it is measured with a short sample.{cut}",
        summary=not context.scene.checks.against_paper and len(rows) <= 30,
        collapsed=context.scene.checks.against_paper or len(rows) > 30,
    )


def _methods(choices: Sequence[JFactor], accuracy: float) -> Table:
    """How often each method was tried, and with what outcome."""
    rows = []
    seen = [attempt.method for choice in choices for attempt in choice.tried]
    # in the order in which they were tried, which is that of their cost
    for method in dict.fromkeys([*seen, *_METHODS]):
        tried = [a for choice in choices for a in choice.tried if a.method == method]
        if not tried:
            rows.append({"method": method, "tried": 0, "decision": "left out: dearer, not needed"})
            continue
        met = sum(attempt.met for attempt in tried)
        decision = f"chosen for {met} of {len(tried)}" if met else "left out: not accurate enough"
        rows.append(
            {
                "method": method,
                "tried": len(tried),
                "error": max(attempt.error for attempt in tried),
                "ms": 1e3 * sum(attempt.seconds for attempt in tried) / len(tried),
                "decision": decision,
            }
        )
    return Table(
        "pilot-ln-J",
        "Which method gives the J factors",
        [
            Column("method", "Method"),
            Column("tried", "molecules tried on", "", "d"),
            Column("error", "largest error measured", "", ".2g"),
            Column("ms", "time per molecule", "ms", ".1f"),
            Column("decision", "Decision"),
        ],
        rows,
        f"Wanted: {accuracy:g} on ln J. Methods from the cheapest to the dearest; each molecule "
        "stops at the first that is good enough, Laplace's error being measured with a short "
        f"sample of its own. The outcome is then checked on {USED}.",
    )
