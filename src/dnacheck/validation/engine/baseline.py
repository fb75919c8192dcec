"""What changed since an earlier report."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from dnacheck.numerics.outcome import InputError
from dnacheck.validation.engine.verdict import CheckResult

ROUNDING = 1e-9
"""Relative; the same computation on another machine may differ by about this."""


def read_baseline(path: Path) -> dict[str, Any]:
    """An earlier ``report.json``.

    Raises
    ------
    InputError
        Not readable, or not a report.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"baseline '{path}': {error.strerror or error}; give the report.json of another run"
        ) from None
    except ValueError:
        raise InputError(
            f"baseline '{path}': not JSON; give the report.json of another run"
        ) from None
    if not isinstance(content, dict) or not isinstance(content.get("checks"), list):
        raise InputError(f"baseline '{path}': not a report; give the report.json of another run")
    for check in content["checks"]:
        if not isinstance(check, dict) or not isinstance(check.get("name"), str):
            raise InputError(f"baseline '{path}': a check without a name; the file is damaged")
    return content


def compare(old: Mapping[str, Any], results: Sequence[CheckResult]) -> dict[str, Any]:
    """Checks that appeared, vanished, changed their verdict or their number."""
    before = {check["name"]: check for check in old["checks"]}
    now = {result.name: result for result in results}
    verdicts, numbers = [], []
    for name, result in now.items():
        if name not in before:
            continue
        was = before[name]
        entry = {
            "name": name,
            "quantity": result.quantity,
            "old_verdict": was.get("verdict"),
            "new_verdict": result.verdict.value,
            "old": was.get("got"),
            "new": result.got,
        }
        if was.get("verdict") != result.verdict.value:
            verdicts.append(entry)
        elif not _same(was.get("got"), result.got):
            numbers.append(entry)
    provenance = old.get("provenance")
    provenance = provenance if isinstance(provenance, Mapping) else {}
    return {
        "version": provenance.get("dnacheck"),
        "finished": provenance.get("finished"),
        "verdict": old.get("verdict"),
        "changed_verdicts": verdicts,
        "changed_numbers": numbers,
        "added": [name for name in now if name not in before],
        "removed": [name for name in before if name not in now],
    }


def _same(old: Any, new: Any) -> bool:
    if isinstance(old, int | float) and isinstance(new, int | float):
        if not (math.isfinite(old) and math.isfinite(new)):
            return math.isfinite(old) == math.isfinite(new)
        return math.isclose(old, new, rel_tol=ROUNDING, abs_tol=1e-300)
    if isinstance(new, float) and not math.isfinite(new):
        return old is None
    return bool(old == new)
