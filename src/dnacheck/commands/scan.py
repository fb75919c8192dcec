"""``dnacheck scan``: ring energy and J factor of many sequences, or of all windows of a genome."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dnacheck.commands import option_types as allowed
from dnacheck.commands.common import (
    ModelSettings,
    RunSettings,
    common_options,
    model_options,
)
from dnacheck.commands.option_types import Count
from dnacheck.commands.output import note, print_json, progress

if TYPE_CHECKING:
    from dnacheck.io.sequences import SequenceSource
    from dnacheck.scanning.scan import ScanOptions

EXIT_NOT_CONVERGED = 3


@click.command(
    epilog="""\b
Examples:  dnacheck scan library.fasta -o library.csv
           dnacheck scan genome.fa.gz --window 150 -o genome.parquet -o genome.html --workers 2"""
)
@click.argument("fasta", metavar="FILE")
@click.option(
    "-o",
    "--output",
    "outputs",
    type=click.Path(path_type=Path),
    multiple=True,
    required=True,
    help="By suffix: .csv, .parquet, .html (a page to read), .bedgraph or .bw (tracks, with "
    "--window); may be given several times. An unfinished one is gone on with.",
)
@click.option("--restart", is_flag=True, help="Replace an existing output.")
@click.option(
    "--window", type=Count(allowed.WINDOW), help="Scan every window of so many base pairs."
)
@click.option(
    "--step", type=Count(allowed.STEP), default=1, show_default=True, help="From window to window."
)
@click.option("--both-strands", is_flag=True, help="Read each window from both strands.")
@click.option("--region", metavar="NAME:A-B", help="Windows inside base pairs A to B, from 1.")
@click.option(
    "--piece",
    type=Count(allowed.PIECE),
    help="Windows of a piece of work and file.  [default: 16384]",
)
@click.option(
    "--workers",
    type=Count(allowed.THREADS),
    help="Local worker processes (Dask's where dnacheck[cluster] is installed).",
)
@click.option("--scheduler", metavar="ADDRESS", help="Use the workers of a Dask scheduler.")
@click.option("--dry-run", is_flag=True, help="Say how many rows, how long and how much disk.")
@click.option(
    "--laplace",
    is_flag=True,
    help="Leave J of records at Laplace's value, several times faster; that of windows always is.",
)
@click.option(
    "--other-strand", is_flag=True, help="Two more columns of records: what the other strand gives."
)
@model_options
@common_options
def command(
    fasta: str,
    outputs: tuple[Path, ...],
    restart: bool,
    window: int | None,
    step: int,
    both_strands: bool,
    region: str | None,
    piece: int | None,
    workers: int | None,
    scheduler: str | None,
    dry_run: bool,
    laplace: bool,
    other_strand: bool,
    model: ModelSettings,
    run: RunSettings,
) -> int | None:
    """Lowest ring and J factor of every record, or window, of FILE.

    FILE is FASTA or GenBank, compressed or not, "-" for a pipe. A killed scan goes on where it
    stopped when the same command is given again, and ends with the same file. A bad record is a
    row with its reason in the column "status"; windows that hold letters other than A, C, G, T are
    skipped and counted. If no row is ok, the exit code is 3. The column "quality" of records says
    how far to believe J: good (error of ln J up to 0.1), fair (0.3), poor, or "laplace only".
    """
    from dnacheck.io.sequences import SequenceSource
    from dnacheck.numerics.outcome import InputError
    from dnacheck.scanning.pieces import PIECE_WINDOWS, Region, WindowOptions
    from dnacheck.scanning.scan import ScanOptions

    windowed = None
    if window is not None:
        windowed = WindowOptions(
            window,
            step,
            both_strands,
            Region.parse(region) if region else None,
            PIECE_WINDOWS if piece is None else piece,
        )
    elif both_strands or region or piece is not None or step != 1:
        raise InputError(
            "--step, --both-strands, --region and --piece are of windows: add --window"
        )
    source = SequenceSource(fasta)
    plain = len(outputs) == 1 and outputs[0].suffix.lower() != ".parquet"
    if windowed is None and plain and not (workers or scheduler or dry_run):
        options = ScanOptions(model.build_arguments(), run.threads, other_strand, laplace)
        return _records(source, outputs[0], restart, options, run)
    if other_strand:
        raise InputError(
            "--other-strand is of whole records in one CSV file; windows have --both-strands"
        )
    from dnacheck.scanning.batch import Plan, batch_line
    from dnacheck.scanning.batch import run as run_plan

    plan = Plan.of(source, model.build_arguments(), windowed, laplace)
    if dry_run:
        found = plan.estimate(outputs, workers or run.threads)
        if run.json:
            print_json(found)
        else:
            note(_estimate_text(found))
        return None
    with progress("windows" if windowed else "sequences", plan.rows, run.quiet or run.json) as done:
        summary = run_plan(plan, outputs, run.threads, workers, scheduler, done, restart)
    if run.json:
        print_json({"output": [str(path) for path in outputs], **asdict(summary)})
    else:
        note(batch_line(summary, outputs), run.quiet)
    return None if summary.ok_rows else EXIT_NOT_CONVERGED


def _records(
    source: SequenceSource, output: Path, restart: bool, options: ScanOptions, run: RunSettings
) -> int | None:
    """Whole records into a CSV file, row by row."""
    from dnacheck.scanning.scan import scan, state_path, summary_line

    with progress("sequences", source.count, run.quiet or run.json) as advance:
        summary = scan(source, output, options, advance, restart)
    if run.json:
        print_json(
            {
                "output": str(output),
                "state": str(state_path(output)),
                "rows": summary.rows,
                "resumed_rows": summary.resumed_rows,
                "failed_rows": summary.failed_rows,
                "ok_rows": summary.ok_rows,
                "reasons": summary.reasons,
                "seconds": summary.seconds,
            }
        )
    else:
        note(summary_line(summary, output), run.quiet)
    return None if summary.ok_rows else EXIT_NOT_CONVERGED


def _estimate_text(found: dict[str, object]) -> str:
    """The answer of --dry-run in words."""
    rows, rate = int(str(found["rows"])), float(str(found["rows_a_second_and_worker"]))
    seconds = float(str(found["seconds"]))
    size = found["bytes"]
    assert isinstance(size, dict)
    spans = ((86400.0, "days"), (3600.0, "hours"), (60.0, "minutes"), (0.0, "seconds"))
    unit, name = next(span for span in spans if seconds >= 2.0 * span[0])
    disk = ", ".join(f"{path} about {count / 1e6:.1f} MB" for path, count in size.items())
    return (
        f"{rows:,} rows; about {seconds / (unit or 1.0):.1f} {name} with {found['workers']} "
        f"worker(s) at {rate:,.0f} a second each; {disk}. Nothing was written."
    )
