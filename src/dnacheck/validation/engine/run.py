"""One validation run from a scene to its report."""

from __future__ import annotations

import datetime
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from dnacheck.validation.engine.baseline import compare, read_baseline
from dnacheck.validation.engine.plan import Plan, make_plan
from dnacheck.validation.engine.provenance import provenance
from dnacheck.validation.engine.registry import Check, Findings, Level
from dnacheck.validation.engine.runner import run_checks
from dnacheck.validation.engine.state import StateFolder, run_key
from dnacheck.validation.engine.verdict import skipped
from dnacheck.validation.engine.worker import Job
from dnacheck.validation.report.write import RunRecord, write_report
from dnacheck.validation.scene.scene import Scene

STATE_FOLDER = ".state"


@dataclass(frozen=True)
class RunOptions:
    """How to run a scene."""

    folder: Path
    level: Level = Level.DEFAULT
    seed: int = 0
    processes: int = 1
    only: Sequence[Check] | None = None
    baseline: Path | None = None


def run_scene(
    scene: Scene,
    options: RunOptions,
    progress: Callable[[Check, Findings, bool], None] = lambda check, findings, resumed: None,
    planned: Callable[[Plan], None] = lambda plan: None,
) -> RunRecord:
    """Run a scene and write its report; an interrupted run of the same scene is continued.

    Raises
    ------
    InputError
        The output folder can't be written, or the baseline is not a report.
    """
    began = time.perf_counter()
    old = read_baseline(options.baseline) if options.baseline is not None else None
    plan = make_plan(scene, options.level, options.only)
    planned(plan)
    key = run_key(scene, options.level, options.seed)
    state = StateFolder(options.folder / STATE_FOLDER, key)
    state.open()
    job = Job(scene, options.level, options.seed, str(state.root), key)
    resumed: list[str] = []

    def note(check: Check, findings: Findings, again: bool) -> None:
        if again:
            resumed.append(check.name)
        progress(check, findings, again)

    findings = run_checks(job, plan.chosen, options.processes, note)
    record = RunRecord(
        scene=scene,
        plan=plan,
        findings=findings,
        skipped=[skipped(step.check.name, step.check.title, step.reason) for step in plan.skipped],
        provenance=provenance(scene, options.level.name.lower(), options.seed, options.processes),
        seconds=time.perf_counter() - began,
        finished=datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC"),
        resumed=resumed,
    )
    if old is not None:
        record = replace(record, baseline=compare(old, record.results))
    write_report(record, options.folder)
    state.remove()
    return record
