"""``dnacheck scan``: ring energy and J factor of many sequences."""

from __future__ import annotations

from pathlib import Path

import click

from dnacheck.commands.common import (
    ModelSettings,
    RunSettings,
    common_options,
    model_options,
)
from dnacheck.commands.output import note, print_json, progress

EXIT_NOT_CONVERGED = 3


@click.command(epilog="Example:  dnacheck scan library.fasta -o library.csv")
@click.argument("fasta", metavar="FILE")
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    required=True,
    help="CSV file; an unfinished one is gone on with.",
)
@click.option("--restart", is_flag=True, help="Replace an existing output file.")
@model_options
@common_options
def command(
    fasta: str, output: Path, restart: bool, model: ModelSettings, run: RunSettings
) -> int | None:
    """Lowest ring and J factor of every record of FILE: FASTA or GenBank, "-" for a pipe.

    A killed scan goes on where it stopped when the same command is given again, and ends with the
    same file. A bad record is a row with its reason in the column "status"; if no row is ok, the
    exit code is 3. The column "quality" says how far to believe J: good (error of ln J up to 0.1),
    fair (0.3), poor, or "laplace only".
    """
    from dnacheck.io.sequences import SequenceSource
    from dnacheck.scanning.scan import ScanOptions, scan, state_path, summary_line

    source = SequenceSource(fasta)
    options = ScanOptions(model.build_arguments(), run.threads)
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
