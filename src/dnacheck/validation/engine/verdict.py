"""Verdicts: what a check expected, what it got, and what follows."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace
from typing import Any


class Verdict(enum.Enum):
    """How a check ended."""

    PASS = "pass"
    FAIL = "fail"
    INCONCLUSIVE = "inconclusive"
    SKIPPED = "skipped"


class Rule(enum.Enum):
    """What makes a check pass; the value is how the report writes it."""

    RELATIVE = "|got - expected| <= tolerance * |expected|"
    ABSOLUTE = "|got - expected| <= tolerance"
    AT_MOST = "got <= expected"
    AT_LEAST = "got >= expected"
    EQUAL = "got = expected"
    SIGMAS = "|got - expected| <= tolerance * combined standard error"


Value = float | int | str | bool | None

SURE_SIGMAS = 2.0
"""A deviation fails only if it exceeds the tolerance by more than so many standard errors."""


@dataclass(frozen=True)
class CheckResult:
    """One judged number.

    Attributes
    ----------
    name : str
        ``check[item]``, where ``check`` is the name in the registry.
    quantity, unit : str
        What was measured.
    expected, expected_sigma : value and its standard error
    source : str
        Where the expected value comes from.
    got, got_sigma : value and its standard error
    tolerance : float or None
    rule : Rule
    why : str
        Why the tolerance is what it is.
    verdict : Verdict
    reason : str
        The verdict in words: by how much, or why it was skipped.
    control : bool
        Whether this is a deliberately wrong computation, which passes by being refused.
    seconds, seed
        Cost of the check it belongs to, shared among its results, and its seed.
    """

    name: str
    quantity: str
    expected: Value
    got: Value
    tolerance: float | None
    rule: Rule
    source: str
    why: str
    verdict: Verdict
    reason: str
    unit: str = ""
    expected_sigma: float | None = None
    got_sigma: float | None = None
    control: bool = False
    seconds: float = 0.0
    seed: int = 0


def judge(
    name: str,
    quantity: str,
    got: Value,
    expected: Value,
    rule: Rule,
    source: str,
    why: str,
    tolerance: float | None = None,
    unit: str = "",
    got_sigma: float | None = None,
    expected_sigma: float | None = None,
    widest_sigma: float | None = None,
) -> CheckResult:
    """Compare and give the verdict.

    Parameters
    ----------
    got, expected : number, text or bool
        A number that is not finite fails.
    tolerance : float
        Its meaning depends on the rule; unused by AT_MOST, AT_LEAST and EQUAL.
    got_sigma, expected_sigma : float, optional
        Standard errors. With RELATIVE and ABSOLUTE a combined standard error above the tolerance
        is inconclusive, unless even so the deviation is out of reach.
    widest_sigma : float, optional
        With SIGMAS: a combined standard error above this is inconclusive, because anything passes
        against an error bar that is wide enough.
    """
    verdict, reason = _verdict(
        got, expected, rule, tolerance, got_sigma, expected_sigma, widest_sigma
    )
    return CheckResult(
        name=name,
        quantity=quantity,
        expected=expected,
        got=got,
        tolerance=tolerance,
        rule=rule,
        source=source,
        why=why,
        verdict=verdict,
        reason=reason,
        unit=unit,
        expected_sigma=expected_sigma,
        got_sigma=got_sigma,
    )


def _verdict(
    got: Value,
    expected: Value,
    rule: Rule,
    tolerance: float | None,
    got_sigma: float | None,
    expected_sigma: float | None,
    widest_sigma: float | None,
) -> tuple[Verdict, str]:
    if rule is Rule.EQUAL:
        same = got == expected
        return (Verdict.PASS, "equal") if same else (Verdict.FAIL, f"{got!r}, not {expected!r}")
    if not _number(got) or not _number(expected):
        return Verdict.FAIL, f"not a finite number: got {got!r}, expected {expected!r}"
    assert isinstance(got, int | float)
    assert isinstance(expected, int | float)
    sigma = math.hypot(got_sigma or 0.0, expected_sigma or 0.0)
    if not math.isfinite(sigma):
        return Verdict.FAIL, "the standard error is not finite"
    if rule is Rule.AT_MOST:
        return _bound(got <= expected, got, expected, got - SURE_SIGMAS * sigma <= expected)
    if rule is Rule.AT_LEAST:
        return _bound(got >= expected, got, expected, got + SURE_SIGMAS * sigma >= expected)
    if tolerance is None or not tolerance > 0.0:
        raise ValueError(f"the rule '{rule.value}' needs a positive tolerance")
    deviation = abs(got - expected)
    if rule is Rule.SIGMAS:
        if widest_sigma is not None and sigma > widest_sigma:
            return Verdict.INCONCLUSIVE, f"standard error {sigma:.2g} exceeds {widest_sigma:.2g}"
        if not sigma > 0.0:
            return Verdict.FAIL, "no standard error was given"
        words = f"{deviation / sigma:.2f} standard errors apart, {tolerance:g} allowed"
        return (Verdict.PASS if deviation <= tolerance * sigma else Verdict.FAIL), words
    allowed = tolerance * abs(expected) if rule is Rule.RELATIVE else tolerance
    if rule is Rule.RELATIVE and expected != 0:
        words = f"off by {_percent(deviation / abs(expected))}, {_percent(tolerance)} allowed"
    else:
        words = f"off by {deviation:.2g}, {allowed:.2g} allowed"
    if deviation > allowed + SURE_SIGMAS * sigma:
        return Verdict.FAIL, words
    if sigma > allowed:
        return Verdict.INCONCLUSIVE, f"standard error {sigma:.2g} exceeds {allowed:.2g}"
    if deviation > allowed:
        return Verdict.INCONCLUSIVE, f"{words}, but within {SURE_SIGMAS:g} standard errors"
    return Verdict.PASS, words


def _bound(holds: bool, got: float, expected: float, could_hold: bool) -> tuple[Verdict, str]:
    words = f"{got:.3g} against the bound {expected:.3g}"
    if holds:
        return Verdict.PASS, words
    if could_hold:
        return Verdict.INCONCLUSIVE, f"{words}, within {SURE_SIGMAS:g} standard errors"
    return Verdict.FAIL, words


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _percent(fraction: float) -> str:
    return f"{100.0 * fraction:.2g} %"


def must_fail(result: CheckResult, fault: str) -> CheckResult:
    """Turn the result of a deliberately wrong computation into a control.

    The control passes if the result was refused. ``fault`` says what was broken.
    """
    if result.verdict is Verdict.FAIL:
        verdict, reason = Verdict.PASS, f"refused as it must be: {result.reason}"
    else:
        verdict = Verdict.FAIL
        reason = f"not refused although {fault} ({result.verdict.value}: {result.reason})"
    return replace(
        result,
        quantity=f"control: {result.quantity}, {fault}",
        verdict=verdict,
        reason=reason,
        control=True,
    )


def skipped(name: str, quantity: str, reason: str) -> CheckResult:
    """A check that was not run."""
    return CheckResult(
        name, quantity, None, None, None, Rule.EQUAL, "", "", Verdict.SKIPPED, reason
    )


def failed(name: str, quantity: str, reason: str) -> CheckResult:
    """A check that broke before it had a number."""
    return CheckResult(name, quantity, None, None, None, Rule.EQUAL, "", "", Verdict.FAIL, reason)


def overall(results: list[CheckResult]) -> Verdict:
    """FAIL if anything failed or nothing passed, else PASS."""
    verdicts = {result.verdict for result in results}
    if Verdict.FAIL in verdicts or Verdict.PASS not in verdicts:
        return Verdict.FAIL
    return Verdict.PASS
