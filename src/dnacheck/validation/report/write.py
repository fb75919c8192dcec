"""Writes ``report.html``, ``report.json``, ``checks.csv``, the tables and the figures."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from dnacheck.io.files import atomic_write
from dnacheck.numerics.outcome import InputError
from dnacheck.validation.engine.plan import Plan
from dnacheck.validation.engine.registry import Findings
from dnacheck.validation.engine.verdict import CheckResult, Verdict, overall
from dnacheck.validation.report.record import Section, Table
from dnacheck.validation.scene.scene import Scene


@dataclass(frozen=True)
class RunRecord:
    """Everything a report is made of.

    ``findings`` holds the findings of every check that ran, by name; ``seconds`` is the wall time
    of this run and ``resumed`` the checks whose findings an earlier, interrupted run left.
    """

    scene: Scene
    plan: Plan
    findings: Mapping[str, Findings]
    skipped: Sequence[CheckResult]
    provenance: Mapping[str, Any]
    seconds: float
    finished: str
    resumed: Sequence[str] = ()
    baseline: Mapping[str, Any] | None = None

    @property
    def results(self) -> list[CheckResult]:
        """All results in the order of the registry, skipped ones included."""
        skipped = {result.name: result for result in self.skipped}
        found: list[CheckResult] = []
        for step in self.plan.steps:
            if step.check.name in self.findings:
                found.extend(self.findings[step.check.name].results)
            elif step.check.name in skipped:
                found.append(skipped[step.check.name])
        return found

    @property
    def verdict(self) -> Verdict:
        """PASS or FAIL."""
        return overall(self.results)

    def sections(self) -> list[Section]:
        """A section per group that ran."""
        from dnacheck.validation.engine.registry import groups

        made = []
        for group in groups():
            names = [check.name for check in group.checks if check.name in self.findings]
            if names:
                found = {name: self.findings[name] for name in names}
                if group.assemble is not None:
                    blocks = list(group.assemble(found))
                else:
                    blocks = [block for item in found.values() for block in item.blocks]
                made.append(Section(group.name, group.title, group.intro, blocks))
        return made

    def tables(self) -> list[Table]:
        """Every table of every section."""
        return [b for section in self.sections() for b in section.blocks if isinstance(b, Table)]


def result_to_dict(result: CheckResult) -> dict[str, Any]:
    """A result as in ``report.json``."""
    values = {item.name: getattr(result, item.name) for item in fields(result)}
    values["rule"] = result.rule.value
    values["verdict"] = result.verdict.value
    return {key: _finite(value) for key, value in values.items()}


def _finite(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if hasattr(value, "tolist"):
        return _finite(value.tolist())
    return value


def report_json(record: RunRecord) -> str:
    """``report.json``; its schema is ``data/report.schema.json``."""
    plan = [
        {
            "check": step.check.name,
            "title": step.check.title,
            "run": step.run,
            "reason": step.reason,
            "seconds": _seconds(record, step.check.name),
        }
        for step in record.plan.steps
    ]
    tables = [
        {
            "id": table.id,
            "title": table.title,
            "columns": [
                {"key": c.key, "label": c.label, "unit": c.unit, "group": c.group}
                for c in table.columns
            ],
            "rows": [{c.key: row.get(c.key) for c in table.columns} for row in table.rows],
        }
        for table in record.tables()
    ]
    content: dict[str, Any] = {
        "schema": 1,
        "verdict": record.verdict.value,
        "title": record.scene.title,
        "provenance": {
            **record.provenance,
            "finished": record.finished,
            "seconds": record.seconds,
            "resumed": list(record.resumed),
        },
        "checks": [result_to_dict(result) for result in record.results],
        "plan": plan,
        "tables": tables,
    }
    if record.baseline is not None:
        content["baseline"] = record.baseline
    return json.dumps(_finite(content), indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def _seconds(record: RunRecord, check: str) -> float | None:
    found = record.findings.get(check)
    return None if found is None else sum(result.seconds for result in found.results)


def checks_csv(results: Sequence[CheckResult]) -> str:
    """``checks.csv``: one line per result."""
    from dnacheck.validation.report.tables import guarded

    names = [item.name for item in fields(CheckResult)]
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(names)
    for result in results:
        values = result_to_dict(result)
        writer.writerow([guarded(values[name]) for name in names])
    return buffer.getvalue()


def write_report(record: RunRecord, folder: Path) -> Path:
    """Write all files into ``folder`` and return the path of ``report.html``.

    Raises
    ------
    InputError
        The folder can't be written.
    """
    from dnacheck.validation.report.html import report_html
    from dnacheck.validation.report.tables import table_csv

    html, figures = report_html(record)
    try:
        for name in ("tables", "figures"):
            (folder / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"output folder '{folder}': {error.strerror}; name a writable folder with -o"
        ) from None
    kept = {f"{table.id}.csv" for table in record.tables()} | {f"{name}.svg" for name in figures}
    for old in [*(folder / "tables").glob("*.csv"), *(folder / "figures").glob("*.svg")]:
        if old.name not in kept:
            old.unlink()
    for table in record.tables():
        atomic_write(folder / "tables" / f"{table.id}.csv", table_csv(table))
    for name, svg in figures.items():
        atomic_write(folder / "figures" / f"{name}.svg", svg)
    atomic_write(folder / "checks.csv", checks_csv(record.results))
    atomic_write(folder / "report.json", report_json(record))
    atomic_write(folder / "report.html", html)
    return folder / "report.html"
