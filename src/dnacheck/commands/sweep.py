"""``dnacheck sweep``: ring energies over a range of twist ratios."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import dnacheck as dc
from dnacheck.commands.common import (
    ContinuumSettings,
    ModelSettings,
    RunSettings,
    common_options,
    continuum_options,
    model_options,
    target_argument,
)
from dnacheck.commands.option_types import integer, shown
from dnacheck.commands.output import note, print_json, progress
from dnacheck.model.ranges import TWIST_RATIO

EXIT_NOT_CONVERGED = 3
_MOST_RATIOS = 10_000


class RatioRange(click.ParamType):
    """``FIRST:LAST:NUMBER``, or one number."""

    name = "first:last:number"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, ...]:
        if isinstance(value, tuple):
            return value
        words = value.split(":")
        try:
            numbers = [float(word) for word in words[:2]]
        except ValueError:
            numbers = []
        count = integer(words[2]) if len(words) == 3 else 1
        if not numbers or count is None or len(words) not in (1, 3):
            self.fail(f"{shown(value)} is not FIRST:LAST:NUMBER, such as 0.5:1.5:16", param, ctx)
        for number in numbers:
            if number not in TWIST_RATIO:
                self.fail(f"ratio {number:g}: give numbers {TWIST_RATIO}", param, ctx)
        if len(words) == 1:
            return (numbers[0],)
        first, last = numbers
        if not (1 <= count <= _MOST_RATIOS) or (count > 1 and not first < last):
            self.fail(
                f"{shown(value)}: the first ratio must lie below the last, and the number of "
                f"ratios between 1 and {_MOST_RATIOS}",
                param,
                ctx,
            )
        if count == 1:
            return (first,)
        return tuple(first + (last - first) * i / (count - 1) for i in range(count))


@click.command(epilog="Example:  dnacheck sweep 11T15 --ratios 0.5:1.5:16 --plot sweep.png")
@target_argument
@click.option(
    "--ratios",
    type=RatioRange(),
    default="0.5:1.5:16",
    show_default=True,
    metavar="FIRST:LAST:NUMBER",
    help="Twisting over bending stiffness; of six-parameter sets, what multiplies their twist's.",
)
@click.option(
    "--model",
    "which",
    type=click.Choice(["continuum", "discrete", "both"]),
    default="both",
    show_default=True,
    help="Which rings to follow.",
)
@click.option(
    "--corrected",
    is_flag=True,
    help="Continuum energies with the steps' own compliance (see docs/continuation.md).",
)
@click.option("--plot", type=click.Path(path_type=Path), default=None, help="Write a picture.")
@model_options
@continuum_options
@common_options
def command(
    target: str,
    ratios: tuple[float, ...],
    which: str,
    corrected: bool,
    plot: Path | None,
    model: ModelSettings,
    continuum: ContinuumSettings,
    run: RunSettings,
) -> int | None:
    """Ring energies of TARGET, with bending and twisting parts, over a range of twist ratios.

    Every minimum found is followed, and the search is repeated at some of the ratios, so that the
    energies are those of the lowest ring at each; the twist ratio of the model is not used.
    """
    from dnacheck.io.sequences import read_target
    from dnacheck.numerics.outcome import InputError

    molecules = list(read_target(target))
    models = ("continuum", "discrete") if which == "both" else (which,)
    records: list[dict[str, Any]] = []
    complete = True
    with progress("sweeps", len(molecules) * len(models), run.quiet) as advance:
        for molecule in molecules:
            if isinstance(molecule, InputError):
                raise molecule
            chain = dc.chain(molecule, **model.chain_arguments())
            for kind in models:
                if kind == "continuum" and chain.rigid and which == "both":
                    note("six parameters: the discrete rings alone are followed", run.quiet)
                    advance(1)
                    continue
                if kind == "continuum":
                    rod = dc.rod(chain, **continuum.rod_arguments())
                    sweep = dc.twist_ratio_scan(
                        rod, ratios, corrected_for=chain if corrected else None
                    )
                else:
                    sweep = dc.twist_ratio_scan(chain, ratios)
                complete = complete and not sweep.missing.size
                records.append({**sweep.to_dict(), "n_bp": chain.n_steps})
                advance(1)
    if plot is not None:
        _draw(plot, records)
        note(f"picture written to {plot}", run.quiet or run.json)
    if run.json:
        print_json(
            {"target": target, "angles": model.angles, "corrected": corrected, "sweeps": records}
        )
    else:
        for record in records:
            _print(record)
    for record in records:
        if record["status"] != "converged":
            note(f"{record['name']}, {record['model']}: {record['status']}", run.quiet)
    return None if complete else EXIT_NOT_CONVERGED


def _print(record: dict[str, Any]) -> None:
    click.echo(f"{record['name']}  {record['model']}")
    click.echo("   K3/K1    energy/RT      bend/RT     twist/RT  link")
    rows = zip(
        record["ratios"],
        record["energy"],
        record["bend"],
        record["twist"],
        record["link"],
        strict=True,
    )
    for ratio, energy, bend, twist, link in rows:
        click.echo(f"{ratio:8.4f} {energy:12.5f} {bend:12.5f} {twist:12.5f} {link:5d}")
    for crossing in record["crossings"]:
        verb = "crosses" if crossing["exchanged"] else "gives way"
        click.echo(
            f"  the lowest ring {verb} from link {crossing['links'][0]} to "
            f"{crossing['links'][1]} at K3/K1 = {crossing['ratio']:.6f}"
        )


def _draw(path: Path, records: list[dict[str, Any]]) -> None:
    from dnacheck.commands.pictures import save_figure
    from dnacheck.validation.plots import continuation as plots

    def draw(figure: Any) -> None:
        axes = figure.subplots(1, 3)
        for ax, quantity in zip(axes, ("energy", "bend", "twist"), strict=True):
            plots.sweep(ax, records, quantity)

    save_figure(path, (11.0, 4.0), draw)
