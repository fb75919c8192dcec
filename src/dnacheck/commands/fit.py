"""``dnacheck fit``: mechanics from measured J factors."""

from __future__ import annotations

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
)
from dnacheck.commands.option_types import Number
from dnacheck.commands.output import note, print_json, progress

if TYPE_CHECKING:
    from dnacheck.mechanics.fit import MechanicsFit, Prior

EXIT_NOT_CONVERGED = 3
DEFAULT_FREE = "persistence_length_A,twist_ratio,twist_offset_deg,bend_scale"


@click.command(epilog="Example:  dnacheck fit measured.csv --free persistence_length_A,offset")
@click.argument("data", type=click.Path(path_type=Path))
@click.option(
    "--free",
    default=DEFAULT_FREE,
    show_default=True,
    help="Parameters to fit, with commas between them; also offset, offset[GROUP], tau[AA] ...",
)
@click.option(
    "--prior",
    "prior_texts",
    multiple=True,
    metavar="NAME=MEAN,ERROR",
    help="A normal prior; may be given several times.",
)
@click.option("--robust", is_flag=True, help="Huber's loss, which forgives outliers.")
@click.option(
    "--tolerance",
    type=Number(allowed.TOLERANCE),
    default=0.02,
    show_default=True,
    help="Standard error of each computed ln J.",
)
@click.option("--posterior", is_flag=True, help="Sample the posterior too (emcee).")
@click.option(
    "--plot",
    type=click.Path(path_type=Path, dir_okay=False),
    default=None,
    help="Write a picture of computed against measured.",
)
@model_options
@common_options
def command(
    data: Path,
    free: str,
    prior_texts: tuple[str, ...],
    robust: bool,
    tolerance: float,
    posterior: bool,
    plot: Path | None,
    model: ModelSettings,
    run: RunSettings,
) -> int | None:
    """Fit mechanics to the measured J factors in DATA, a CSV file.

    Columns: molecule, minus_lnJ (or J_molar), stderr, and optionally group and name. Says what
    the data cannot see, how well each molecule is predicted when it is left out, and whether the
    model explains the data within their errors.
    """
    from dnacheck.mechanics.posterior import posterior as sample_posterior
    from dnacheck.mechanics.posterior import profile_likelihood

    names = [name.strip() for name in free.split(",") if name.strip()]
    with progress("iterations", None, run.quiet or run.json) as advance:
        fit = dc.fit(
            data,
            names,
            priors=dict(_prior(text) for text in prior_texts),
            robust=robust,
            tolerance=tolerance,
            rng=run.seed,
            threads=run.threads,
            progress=advance,
            **model.chain_arguments(),
        )
    record = fit.to_dict()
    for item in record["parameters"]:
        if item["stderr"] is None:
            item["intervals"] = None
            continue
        intervals = profile_likelihood(fit, item["name"]).intervals
        item["intervals"] = {f"{100 * level:.0f}%": ends for level, ends in intervals.items()}
    if posterior:
        drawn = sample_posterior(fit, rng=run.seed)
        record["posterior"] = {
            "converged": drawn.converged,
            "autocorrelation_steps": list(drawn.autocorrelation),
            "acceptance": drawn.acceptance,
            "intervals": {
                name: {f"{100 * x:.0f}%": drawn.interval(name, x) for x in (0.68, 0.95)}
                for name in drawn.names
            },
        }
    if run.json:
        print_json(record)
    else:
        _print(fit, record)
    for warning in fit.warnings:
        note(warning, run.quiet)
    if plot is not None:
        from dnacheck.commands.pictures import save_figure
        from dnacheck.validation.plots import mechanics as plots

        def draw(figure: Any) -> None:
            plots.fitted(figure.subplots(), record)

        save_figure(plot, (5.0, 4.5), draw)
        note(f"picture written to {plot}", run.quiet or run.json)
    return None if fit.converged else EXIT_NOT_CONVERGED


def _prior(text: str) -> tuple[str, Prior]:
    from dnacheck.mechanics.fit import Prior
    from dnacheck.numerics.outcome import InputError

    name, _, numbers = text.partition("=")
    try:
        mean, error = (float(word) for word in numbers.split(","))
    except ValueError:
        raise InputError(
            f"--prior '{text}': write NAME=MEAN,ERROR, such as persistence_length_A=463,30"
        ) from None
    return name.strip(), Prior(mean, error)


def _print(fit: MechanicsFit, record: dict[str, Any]) -> None:
    click.echo(f"{len(fit.names)} molecules, {len(fit.parameters)} parameters")
    for item in record["parameters"]:
        error = "not seen by the data" if item["stderr"] is None else f"± {item['stderr']:.4g}"
        text = f"  {item['name']:<22} {item['value']:10.4g} {error} {item['unit']}"
        if item["intervals"]:
            low, high = item["intervals"]["95%"]
            text += f"   95 %: {low:.4g} to {high:.4g}"
        click.echo(text)
    click.echo("  molecule            measured  computed  residual  left out")
    for row in record["molecules"]:
        click.echo(
            f"  {row['name']:<18} {row['measured']:9.2f} {row['computed']:9.2f} "
            f"{row['residual']:+9.2f} {row['leave_one_out_residual']:+9.2f}"
        )
    p_value = "" if fit.p_value is None else f", p = {fit.p_value:.2g}"
    click.echo(
        f"  rms {fit.rms:.3f}, left out {fit.leave_one_out_rms:.3f}; chi-square "
        f"{fit.chi_square:.1f} for {fit.degrees_of_freedom} degrees of freedom{p_value}"
    )
