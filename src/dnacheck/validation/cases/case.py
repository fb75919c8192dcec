"""One hard case."""

from __future__ import annotations

from dataclasses import dataclass

from dnacheck.validation.engine.verdict import CheckResult, Rule, Value, judge


@dataclass(frozen=True)
class HardCase:
    """A case, what must happen, what did, and the verdict on the number that decides."""

    title: str
    must: str
    did: str
    result: CheckResult


def hard_case(
    group: str,
    title: str,
    must: str,
    did: str,
    got: Value,
    expected: Value,
    rule: Rule,
    why: str,
    tolerance: float | None = None,
    unit: str = "",
) -> HardCase:
    """A case with the check that decides it."""
    result = judge(
        f"hard.{group}[{title}]", must, got, expected, rule, "what must happen", why, tolerance,
        unit,
    )  # fmt: skip
    return HardCase(title, must, did, result)
