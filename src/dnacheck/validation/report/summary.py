"""The run in one table: a line per chapter, with the check that came closest to its limit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from dnacheck.validation.engine.verdict import CheckResult, Rule, Verdict
from dnacheck.validation.report.record import Section


@dataclass(frozen=True)
class Line:
    """A chapter at a glance.

    Attributes
    ----------
    name, title : str
    passed, checks, refused, controls : int
    verdict : str
        The worst of its checks.
    closest : CheckResult or None
        Of those that passed, the one that used the largest share of what it was allowed.
    used : float or None
        That share.
    """

    name: str
    title: str
    passed: int
    checks: int
    refused: int
    controls: int
    verdict: str
    closest: CheckResult | None
    used: float | None


def share_used(result: CheckResult) -> float | None:
    """Deviation over what is allowed; None where there is no such thing."""
    got, expected = result.got, result.expected
    if isinstance(got, str | bool | None) or isinstance(expected, str | bool | None):
        return None
    if result.rule is Rule.AT_MOST and expected > 0.0:
        used = got / expected
    elif result.rule is Rule.AT_LEAST and got > 0.0:
        used = expected / got
    elif result.rule is Rule.SIGMAS and result.tolerance:
        sigma = math.hypot(result.got_sigma or 0.0, result.expected_sigma or 0.0)
        used = abs(got - expected) / (result.tolerance * sigma) if sigma > 0.0 else math.nan
    elif result.rule in (Rule.RELATIVE, Rule.ABSOLUTE) and result.tolerance:
        scale = abs(expected) if result.rule is Rule.RELATIVE else 1.0
        used = abs(got - expected) / (result.tolerance * scale) if scale > 0.0 else math.nan
    else:
        return None
    return used if math.isfinite(used) else None


_WORST_FIRST = (Verdict.FAIL, Verdict.INCONCLUSIVE, Verdict.SKIPPED, Verdict.PASS)


def glance(sections: Sequence[Section], results: Sequence[CheckResult]) -> list[Line]:
    """One line per chapter that was run."""
    lines = []
    for section in sections:
        own = [r for r in results if r.name.partition(".")[0] == section.name]
        plain = [r for r in own if not r.control]
        controls = [r for r in own if r.control]
        if not own:
            continue
        verdicts = {result.verdict for result in own}
        shares = [
            (used, result)
            for result in plain
            if result.verdict is Verdict.PASS and (used := share_used(result)) is not None
        ]
        used, closest = max(shares, key=lambda item: item[0], default=(None, None))
        lines.append(
            Line(
                name=section.name,
                title=section.title,
                passed=sum(r.verdict is Verdict.PASS for r in plain),
                checks=len(plain),
                refused=sum(r.verdict is Verdict.PASS for r in controls),
                controls=len(controls),
                verdict=next(v for v in _WORST_FIRST if v in verdicts).value,
                closest=closest,
                used=used,
            )
        )
    return lines
