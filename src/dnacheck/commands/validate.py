"""``dnacheck validate``: run a validation scene and write its report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dnacheck.commands.common import RunSettings, common_options
from dnacheck.commands.output import note, print_json, progress

if TYPE_CHECKING:
    from dnacheck.validation.engine.plan import Plan
    from dnacheck.validation.engine.registry import Check, Findings
    from dnacheck.validation.report.write import RunRecord

EXIT_CHECK_FAILED = 1


@click.command(
    epilog="Example:  dnacheck validate -o report;  dnacheck validate quick --only table2"
)
@click.argument("scene", metavar="[SCENE]", required=False)
@click.option(
    "-o", "--output", default="report", show_default=True, help="Folder of the report.",
    type=click.Path(file_okay=False, path_type=Path),
)  # fmt: skip
@click.option("--quick", is_flag=True, help="Under 10 s: one molecule, the cheapest checks.")
@click.option("--full", is_flag=True, help="Everything, up to half an hour.")
@click.option("--list", "list_checks", is_flag=True, help="List the checks and the decisions.")
@click.option(
    "--only", multiple=True, metavar="NAME", help="Only this check or group (repeat; * is wild)."
)
@click.option(
    "--baseline", type=click.Path(path_type=Path), default=None, metavar="OLD.json",
    help="Show what changed since this report.",
)  # fmt: skip
@click.option(
    "--new-scene", type=click.Path(path_type=Path), default=None, metavar="FILE",
    help="Write a commented scene to start from, and stop.",
)  # fmt: skip
@common_options
def command(
    scene: str | None,
    output: Path,
    quick: bool,
    full: bool,
    list_checks: bool,
    only: tuple[str, ...],
    baseline: Path | None,
    new_scene: Path | None,
    run: RunSettings,
) -> int | None:
    """Run a validation scene and write its report.

    SCENE is a TOML file or the name of a scene that ships; by default the paper's eleven molecules
    ("default"), with --quick one of them ("quick").
    """
    if quick and full:
        raise click.UsageError("--quick and --full exclude each other")
    if new_scene is not None:
        _write_scene(new_scene, run)
        return None
    from dnacheck.validation.engine.plan import make_plan
    from dnacheck.validation.engine.registry import Level, select
    from dnacheck.validation.engine.run import RunOptions, run_scene
    from dnacheck.validation.scene.file import load_scene

    level = Level.QUICK if quick else Level.FULL if full else Level.DEFAULT
    chosen = select(only) if only else None
    loaded = load_scene(scene or ("quick" if quick else "default"))
    if list_checks:
        _print_list(make_plan(loaded, level, chosen), run.json)
        return None
    options = RunOptions(output, level, run.seed, run.threads, chosen, baseline)
    with progress("checks", None, run.quiet) as advance:

        def told(check: Check, findings: Findings, resumed: bool) -> None:
            advance(1)

        record = run_scene(loaded, options, told)
    _print_outcome(record, output, run)
    return EXIT_CHECK_FAILED if record.verdict.value == "fail" else None


def _write_scene(path: Path, run: RunSettings) -> None:
    """Write the commented template; an existing file is not overwritten."""
    from dnacheck.io.files import atomic_write
    from dnacheck.numerics.outcome import InputError
    from dnacheck.validation.scene.scene import scenes_directory

    if path.exists():
        raise InputError(f"file '{path}' exists; name another file for the new scene")
    atomic_write(path, (scenes_directory() / "template.toml").read_text(encoding="utf-8"))
    if run.json:
        print_json({"scene": str(path)})
    else:
        note(f"scene: {path}; run it with  dnacheck validate {path}", run.quiet)


def _print_list(plan: Plan, as_json: bool) -> None:
    if as_json:
        print_json(
            {
                "checks": [
                    {
                        "name": step.check.name,
                        "title": step.check.title,
                        "run": step.run,
                        "reason": step.reason,
                    }
                    for step in plan.steps
                ]
            }
        )
        return
    width = max(len(step.check.name) for step in plan.steps)
    for step in plan.steps:
        mark = "run " if step.run else "skip" if step.unavailable else "  – "
        click.echo(f"{mark}  {step.check.name:{width}}  {step.check.title} ({step.reason})")


def _print_outcome(record: RunRecord, output: Path, run: RunSettings) -> None:
    from dnacheck.validation.report.html import count, duration

    counts = count(record.results)
    if run.json:
        print_json(
            {
                "verdict": record.verdict.value,
                "counts": counts,
                "seconds": record.seconds,
                "report": str(output / "report.html"),
            }
        )
        return
    for result in record.results:
        if result.verdict.value in ("fail", "inconclusive"):
            click.echo(f"{result.verdict.value:12}  {result.name}: {result.reason}")
    words = ", ".join(
        f"{counts[key]} {key}"
        for key in ("passed", "failed", "inconclusive", "skipped")
        if counts[key]
    )
    click.echo(
        f"{record.verdict.value.upper()}: {words}; {counts['refused']} of {counts['controls']} "
        f"wrong models refused; {duration(record.seconds)}"
    )
    note(f"report: {output / 'report.html'}", run.quiet)
