"""Error of ln J against processor time."""

from __future__ import annotations

from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Findings, Level
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge
from dnacheck.validation.report.record import Block, Column, Figure, Note, Table

_LABELS = {
    "laplace": "Laplace (bias)",
    "register-laplace": "register Laplace (bias)",
    "corrected-laplace": "Laplace + first term",
    "closure": "exact closure",
    "half-chain": "half chains, tilted",
    "half-chain-plain": "half chains, plain",
    "metropolis": "Metropolis, MBAR",
}
_FINER = 10.0
_SIGMAS = 4.0


def speed(context: Context) -> Findings:
    """Every method at several sizes on an easy, a middling and a hard molecule."""
    from dnacheck.validation.reference.work_precision import (
        LONG,
        SpeedOptions,
        molecules,
        study,
        warm_up,
    )

    options = LONG if context.level is Level.FULL else SpeedOptions()
    warm_up()
    results: list[CheckResult] = []
    blocks: list[Block] = []
    rows = []
    failed: list[str] = []
    for index, (name, chain) in enumerate(molecules().items()):
        found = study(name, chain, options, context.seed + index)
        lines = []
        for method, label in _LABELS.items():
            points = [point for point in found.points if point.method == method]
            if points:
                lines.append(
                    {
                        "label": label,
                        "seconds": [point.seconds for point in points],
                        "errors": [point.error for point in points],
                    }
                )
        blocks.append(
            Figure(
                f"speed-{name.partition(':')[0]}",
                f"Error of ln J against time, {name}",
                "work_precision",
                {"lines": lines, "up": "standard error, or bias, of ln J"},
                "Processor time from the chain to its J factor, ring search included. Samplers: "
                "their standard error. Laplace: its bias, the distance from exact closure of "
                f"standard error {found.reference_error:.3f}.",
            )
        )
        rows += [
            {
                "name": name,
                "method": _LABELS[point.method],
                "size": point.size,
                "seconds": point.seconds,
                "minus_lnJ": point.minus_lnJ,
                "error": point.error,
                "bias": point.bias,
            }
            for point in found.points
        ]
        failed += [f"{name}, {line}" for line in found.failed]
        biased = [p for p in found.points if p.method in ("laplace", "register-laplace")]
        results.append(
            judge(
                f"jfactor.speed[{name}, reference]",
                "standard error of the reference over the smallest bias that it judges",
                found.reference_error / min(abs(point.bias) for point in biased),
                1.0 / _FINER,
                Rule.AT_MOST,
                "batches of exact-closure sampling",
                "a reference must be ten times finer than what it judges",
            )
        )
        sampled = [p for p in found.points if p not in biased]
        worst = max(sampled, key=lambda p: abs(p.bias) / p.error)
        results.append(
            judge(
                f"jfactor.speed[{name}]",
                f"−ln J by {_LABELS[worst.method]}, {worst.size}: of {len(sampled)} runs the one "
                "furthest from exact closure",
                worst.minus_lnJ,
                found.reference,
                Rule.SIGMAS,
                "exact-closure sampling with another seed",
                "the furthest of a dozen or more short runs",
                _SIGMAS,
                "RT",
                got_sigma=worst.error,
                expected_sigma=found.reference_error,
            )
        )
    blocks.append(
        Table(
            "speed",
            "Error of ln J against time",
            [
                Column("name", "Molecule"),
                Column("method", "Method"),
                Column("size", "Size"),
                Column("seconds", "processor time", "s", ".3f"),
                Column("minus_lnJ", "−ln J", "", ".3f"),
                Column("error", "standard error or bias", "", ".4f"),
                Column("bias", "minus the reference", "", "+.3f"),
            ],
            rows,
            collapsed=True,
        )
    )
    if failed:
        blocks.append(Note("speed-failed", "Runs without a result. " + " · ".join(failed)))
    return Findings(results, blocks)
