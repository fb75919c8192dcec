"""``dnacheck profile``: J against length."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
from dnacheck.commands.option_types import Count, Number, integer, shown
from dnacheck.commands.output import note, print_json, progress
from dnacheck.cyclization.methods import METHODS

if TYPE_CHECKING:
    from dnacheck.mechanics.profile import LengthProfile

EXIT_NOT_CONVERGED = 3
_MOST_LENGTHS = 2_000


class LengthRange(click.ParamType):
    """``FIRST:LAST`` or ``FIRST:LAST:STEP``, in base pairs more or fewer."""

    name = "first:last[:step]"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> range:
        if isinstance(value, range):
            return value
        words = value.split(":")
        numbers = [number for word in words if (number := integer(word)) is not None]
        if len(words) not in (2, 3) or len(numbers) != len(words):
            self.fail(
                f"{shown(value)} is not FIRST:LAST or FIRST:LAST:STEP, such as -12:12", param, ctx
            )
        first, last = numbers[:2]
        step = numbers[2] if len(numbers) == 3 else 1
        if step < 1 or first > last or (last - first) // step >= _MOST_LENGTHS:
            self.fail(
                f"{shown(value)}: FIRST must not exceed LAST, STEP is at least 1, and "
                f"{_MOST_LENGTHS} lengths are the most",
                param,
                ctx,
            )
        return range(first, last + 1, step)


@click.command(epilog="Example:  dnacheck profile 11T15 --change -12:12 --plot profile.png")
@target_argument
@click.option(
    "--change",
    type=LengthRange(),
    default="-12:12",
    show_default=True,
    metavar="FIRST:LAST[:STEP]",
    help="Base pairs added (or, negative, removed).",
)
@click.option(
    "--at",
    "place",
    type=Count(allowed.POSITION),
    default=None,
    help="Base pair, from 0, before which they go in.  [default: the end]",
)
@click.option(
    "--filler", default="ACGTTGCATC", show_default=True, help="Letters that are added, repeated."
)
@click.option(
    "--method",
    type=click.Choice(list(METHODS)),
    default="auto",
    show_default=True,
    help="See dnacheck jfactor.",
)
@click.option(
    "--tolerance",
    type=Number(allowed.TOLERANCE),
    default=0.02,
    show_default=True,
    help="Standard error wanted on each ln J.",
)
@click.option(
    "--measured",
    type=click.Path(path_type=Path, dir_okay=False),
    default=None,
    help="CSV with n_bp, minus_lnJ, stderr to lay over the picture.",
)
@click.option(
    "--plot", type=click.Path(path_type=Path, dir_okay=False), default=None, help="Write a picture."
)
@model_options
@common_options
def command(
    target: str,
    change: range,
    place: int | None,
    filler: str,
    method: str,
    tolerance: float,
    measured: Path | None,
    plot: Path | None,
    model: ModelSettings,
    run: RunSettings,
) -> int | None:
    """J of TARGET against its length, base pairs being added or removed at one place.

    Says where J peaks, how far apart the peaks lie, and the helical repeat that they imply. A
    FASTA file with several records gives several profiles, drawn in one picture.
    """
    from dnacheck.io.sequences import read_target
    from dnacheck.mechanics.profile import read_measured_profile
    from dnacheck.numerics.outcome import InputError

    molecules = list(read_target(target))
    points = () if measured is None else read_measured_profile(measured)
    profiles: list[LengthProfile] = []
    with progress("lengths", len(change) * len(molecules), run.quiet or run.json) as advance:
        for molecule in molecules:
            if isinstance(molecule, InputError):
                raise molecule
            profiles.append(
                dc.profile(
                    molecule,
                    change,
                    place=place,
                    filler=filler,
                    method=method,
                    tolerance=tolerance,
                    rng=run.seed,
                    threads=run.threads,
                    progress=advance,
                    **model.chain_arguments(),
                )
            )
    records = [profile.to_dict() for profile in profiles]
    if run.json:
        print_json(records[0] if len(records) == 1 else {"target": target, "profiles": records})
    else:
        for record in records:
            _print(record)
    if plot is not None:
        from dnacheck.commands.pictures import save_figure
        from dnacheck.validation.plots import mechanics as plots

        def draw(figure: Any) -> None:
            plots.profile(figure.subplots(), records, points)

        save_figure(plot, (6.5, 4.0), draw)
        note(f"picture written to {plot}", run.quiet or run.json)
    failed = [(p.name, c, reason) for p in profiles for c, reason in p.failures]
    for name, steps, reason in failed:
        note(f"{name}{steps:+d}: {reason}", run.quiet)
    unmet = sum(not point.result.status.ok for profile in profiles for point in profile.points)
    if unmet:
        note(f"{unmet} lengths did not meet the tolerance {tolerance:g}; see --json", run.quiet)
    return EXIT_NOT_CONVERGED if failed else None


def _print(record: dict[str, Any]) -> None:
    click.echo(f"{record['target']}")
    click.echo("  change     bp    -ln J   error")
    for point in record["points"]:
        click.echo(
            f"{point['change_bp']:8d} {point['n_bp']:6d} {point['minus_lnJ']:8.3f} "
            f"{point['stderr']:7.3f}"
        )
    peaks = ", ".join(f"{x:.1f}" for x in record["peaks_bp"])
    dips = ", ".join(f"{x:.1f}" for x in record["dips_bp"])
    if peaks:
        click.echo(f"  J peaks at {peaks} bp")
    if dips:
        click.echo(f"  J is least at {dips} bp")
    period, repeat = record["period_bp"], record["helical_repeat_bp"]
    if period is not None and math.isfinite(period):
        click.echo(f"  period {period:.2f} bp")
    if repeat is not None and math.isfinite(repeat):
        click.echo(f"  helical repeat that the peaks imply: {repeat:.2f} bp per turn")
