"""``dnacheck sensitivity``: what each step and each letter does to ln J."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import dnacheck as dc
from dnacheck.commands import option_types as allowed
from dnacheck.commands.common import (
    ModelSettings,
    RunSettings,
    common_options,
    model_options,
    target_argument,
)
from dnacheck.commands.option_types import Count, Number
from dnacheck.commands.output import note, print_json, progress


@click.command(epilog="Example:  dnacheck sensitivity 11T15 --plot sensitivity.png")
@target_argument
@click.option(
    "--compute",
    type=Count(allowed.COMPUTED),
    default=30,
    show_default=True,
    help="Substitutions computed anew, those with the largest predicted change.",
)
@click.option(
    "--tolerance",
    type=Number(allowed.TOLERANCE),
    default=0.02,
    show_default=True,
    help="Standard error wanted on ln J.",
)
@click.option(
    "--csv",
    "table",
    type=click.Path(path_type=Path, dir_okay=False),
    default=None,
    help="Write all substitutions as CSV.",
)
@click.option(
    "--plot",
    type=click.Path(path_type=Path, dir_okay=False),
    default=None,
    help="Write a picture: heat map of all substitutions, derivatives along the molecule.",
)
@model_options
@common_options
def command(
    target: str,
    compute: int,
    tolerance: float,
    table: Path | None,
    plot: Path | None,
    model: ModelSettings,
    run: RunSettings,
) -> int | None:
    """Derivatives of ln J along TARGET, and what each single changed letter does to it.

    The change of -ln J is predicted by the gradient for all 3N substitutions and computed anew
    for those that matter most.
    """
    from dnacheck.io.sequences import read_one

    molecule = read_one(target, "a sensitivity map")
    with progress("substitutions", compute, run.quiet or run.json) as advance:
        found = dc.sensitivity(
            molecule,
            tolerance=tolerance,
            compute=compute,
            rng=run.seed,
            threads=run.threads,
            progress=advance,
            **model.chain_arguments(),
        )
    record = found.to_dict()
    if run.json:
        print_json(record)
    else:
        click.echo(f"{found.name}: -ln J = {found.minus_lnJ:.3f} ± {found.stderr:.3f}")
        click.echo("the letters that matter most (change of -ln J)")
        click.echo("  place  letters  predicted           computed")
        for item in found.most(10):
            anew = (
                "-"
                if item.computed is None
                else f"{item.computed:+.3f} ± {item.computed_stderr:.3f}"
            )
            click.echo(
                f"{item.position:7d}  {item.old} to {item.new}   {item.predicted:+.3f} ± "
                f"{item.predicted_stderr:.3f}     {anew}"
            )
    if table is not None:
        from dnacheck.io.files import atomic_write

        atomic_write(table, found.to_frame().to_csv(index=False))
        note(f"table written to {table}", run.quiet or run.json)
    if plot is not None:
        from dnacheck.commands.pictures import save_figure
        from dnacheck.validation.plots import mechanics as plots

        def draw(figure: Any) -> None:
            upper, lower = figure.subplots(2, 1, sharex=True)
            plots.substitutions(upper, record)
            plots.step_derivatives(lower, record)

        save_figure(plot, (9.0, 5.5), draw)
        note(f"picture written to {plot}", run.quiet or run.json)
    return None
