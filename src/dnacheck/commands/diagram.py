"""``dnacheck diagram``: bifurcation diagrams of a molecule or of the perfect rod."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import dnacheck as dc
from dnacheck.commands import option_types as allowed
from dnacheck.commands.common import (
    ContinuumSettings,
    ModelSettings,
    RunSettings,
    common_options,
    continuum_options,
    model_options,
    target_argument,
)
from dnacheck.commands.option_types import Count, Number
from dnacheck.commands.output import note, print_json

if TYPE_CHECKING:
    from dnacheck.equilibria.continuation.component import Component

EXIT_NOT_CONVERGED = 3


@click.command(
    epilog="Example:  dnacheck diagram 11T15 --plot diagram.png;  dnacheck diagram perfect"
)
@target_argument
@click.option(
    "--bounds",
    type=(Number(allowed.TURNS), Number(allowed.TURNS)),
    default=None,
    metavar="FIRST LAST",
    help="End twist alpha between which branches are followed, in turns.",
)
@click.option(
    "--start",
    type=Number(allowed.TURNS),
    default=None,
    metavar="TURNS",
    help="End twist to start from, in turns.  [default: the lowest ring's; perfect: 0.08]",
)
@click.option(
    "--components",
    "search",
    is_flag=True,
    help="Start from sixteen rolled rings, to find components beside the lowest ring's.",
)
@click.option(
    "--max-points",
    type=Count(allowed.POINTS),
    default=3000,
    show_default=True,
    help="Points per branch and direction.",
)
@click.option(
    "--bp", "n_bp", type=Count(allowed.BASE_PAIRS), default=158, show_default=True,
    help="Base pairs of the perfect rod.",
)  # fmt: skip
@click.option("--plot", type=click.Path(path_type=Path), default=None, help="Write a picture.")
@model_options
@continuum_options
@common_options
def command(
    target: str,
    bounds: tuple[float, float] | None,
    start: float | None,
    search: bool,
    max_points: int,
    n_bp: int,
    plot: Path | None,
    model: ModelSettings,
    continuum: ContinuumSettings,
    run: RunSettings,
) -> int | None:
    """Bifurcation diagram of TARGET: energy and end moment of its rings against end twist.

    TARGET may be "perfect", the straight uniform rod of Figure 6. Rings whose sugar-phosphate
    chains close are marked; stable stretches are those without conjugate points.
    """
    from dnacheck.equilibria.continuation.branch import BranchError
    from dnacheck.equilibria.continuation.figures import component_data

    try:
        found = _components(target, bounds, start, search, max_points, n_bp, model, continuum)
    except BranchError as error:
        return _failed(target, error, run)
    data = [component_data(component, link=run.json) for component in found]
    if plot is not None:
        _draw(plot, target, found, data)
        note(f"picture written to {plot}", run.quiet or run.json)
    if run.json:
        print_json({"target": target, "components": data})
    else:
        for record in data:
            _print(record)
    complete = all(record["ok"] for record in data)
    if not complete:
        for record in data:
            if not record["ok"]:
                note(record["status"], run.quiet)
    return None if complete else EXIT_NOT_CONVERGED


def _components(
    target: str,
    bounds: tuple[float, float] | None,
    start: float | None,
    search: bool,
    max_points: int,
    n_bp: int,
    model: ModelSettings,
    continuum: ContinuumSettings,
) -> tuple[Component, ...]:
    import math
    from dataclasses import replace

    from dnacheck.equilibria.continuation import diagram
    from dnacheck.equilibria.continuation.follow import Bounds
    from dnacheck.equilibria.continuation.options import ContinuationOptions
    from dnacheck.equilibria.continuation.parameters import perfect_rod
    from dnacheck.io.sequences import read_one
    from dnacheck.model.chain import PERSISTENCE_LENGTH_A, RISE_A, TWIST_RATIO
    from dnacheck.numerics.outcome import InputError

    turn = 2.0 * math.pi
    limits = None if bounds is None else Bounds(turn * bounds[0], turn * bounds[1])
    alpha = None if start is None else turn * start
    if target == "perfect":
        ratio = TWIST_RATIO if model.twist_ratio is None else model.twist_ratio
        length, rise = model.persistence_length, model.rise
        rod = perfect_rod(
            n_bp,
            ratio,
            PERSISTENCE_LENGTH_A if length is None else length,
            RISE_A if rise is None else rise,
        )
        options = replace(diagram.PERFECT, max_points=max_points)
        if search:
            raise InputError("the perfect diagram is connected: leave out --components")
        return (diagram.perfect_diagram(rod, 0.5 if alpha is None else alpha, limits, options),)
    chain = dc.chain(read_one(target, "a diagram"), **model.chain_arguments())
    rod = dc.rod(chain, **continuum.rod_arguments())
    if search:
        options = ContinuationOptions(max_points=max_points)
        return diagram.components(rod, None, limits or Bounds(-5 * math.pi, 5 * math.pi), options)
    return (dc.diagram(rod, bounds=bounds, start=start, max_points=max_points),)


def _failed(target: str, error: Exception, run: RunSettings) -> int:
    if run.json:
        print_json({"target": target, "components": [], "status": str(error)})
    note(str(error), False)
    return EXIT_NOT_CONVERGED


def _print(record: dict[str, Any]) -> None:
    for branch in record["branches"]:
        values = branch["alpha"]
        click.echo(
            f"branch of {len(values)} points, end twist {values.min():.4f} to {values.max():.4f} "
            f"turns, energy {branch['energy'].min():.4f} to {branch['energy'].max():.4f} RT, "
            f"residual below {branch['residual'].max():.1e}: {branch['status']}"
        )
        for point in branch["special"]:
            directions = point["negative_directions"]
            stable = {0: "stable", -1: ""}.get(directions, f"{directions} negative directions")
            click.echo(
                f"  {point['kind']:12} alpha = {point['value'] / 6.283185307179586:12.8f} turns  "
                f"energy {point['energy']:10.5f} RT  m3(0) {point['end_moment']:9.4f} RT  {stable}"
            )


def _draw(
    path: Path, target: str, found: tuple[Component, ...], data: list[dict[str, Any]]
) -> None:
    from dnacheck.commands.pictures import save_figure
    from dnacheck.equilibria.continuation.figures import marked_rings, ring_shape
    from dnacheck.validation.plots import continuation as plots

    branches = [branch for record in data for branch in record["branches"]]
    rings = [] if target == "perfect" else [ring_shape(r) for r in marked_rings(found[0])[:2]]

    def draw(figure: Any) -> None:
        rows = 2 if rings else 1
        grid = figure.add_gridspec(rows, 2, height_ratios=[1.3, 1.0][:rows])
        plots.diagram(figure.add_subplot(grid[0, 0]), {"branches": branches, "title": target})
        plots.diagram_by_twist(figure.add_subplot(grid[0, 1]), {"branches": branches})
        for i, ring in enumerate(rings):
            title = f"link {ring['link']}, {ring['energy']:.2f} RT"
            plots.ring_ribbon(figure.add_subplot(grid[1, i]), {**ring, "title": title})

    save_figure(path, (9.0, 8.0 if rings else 4.5), draw)
