"""``dnacheck loop``: the part of a molecule between two sites that a protein holds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import dnacheck as dc
from dnacheck.commands.common import (
    ModelSettings,
    RunSettings,
    common_options,
    model_options,
    target_argument,
)
from dnacheck.commands.option_types import integer, shown
from dnacheck.commands.output import note, print_json, progress

if TYPE_CHECKING:
    from dnacheck.cyclization.result import JFactor
    from dnacheck.equilibria.ring import Equilibria

EXIT_NOT_CONVERGED = 3
_TOLERANCE = 0.02


class Sites(click.ParamType):
    """Two base pairs, ``A,B``."""

    name = "A,B"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[int, int]:
        if isinstance(value, tuple):
            return value
        parts = str(value).split(",")
        numbers = [number for part in parts if (number := integer(part)) is not None]
        if not len(numbers) == len(parts) == 2:
            self.fail(f"{shown(value)} is not two base pairs such as 10,102", param, ctx)
        first, last = numbers
        return first, last


@click.command(epilog="Example:  dnacheck loop 11T15 --sites 20,112 --pose lac.toml")
@target_argument
@click.option(
    "--sites",
    type=Sites(),
    required=True,
    help="Base pairs at the two ends of the loop, from 0, such as 20,112.",
)
@click.option(
    "--pose",
    type=click.Path(path_type=Path, dir_okay=False),
    required=True,
    help="TOML file: position_A and rotation (or rotation_vector_deg) of the second site.",
)
@model_options
@common_options
def command(
    target: str,
    sites: tuple[int, int],
    pose: Path,
    model: ModelSettings,
    run: RunSettings,
) -> int | None:
    """Loops of TARGET between two sites: energies, and J, the concentration one site sees.

    The pose is that of the second site seen from the first, along its directors: d1 and d2 across
    the axis, d3 along it.
    """
    from dnacheck.io.poses import read_pose
    from dnacheck.io.sequences import read_one
    from dnacheck.model.segments import between

    molecule = read_one(target, "a loop")
    chain = between(dc.chain(molecule, **model.chain_arguments(), closed=False), *sites)
    position, rotation = read_pose(pose)
    search = dc.rings(chain, ends=dc.Loop(tuple(position), tuple(map(tuple, rotation))))
    results: list[JFactor] = []
    warnings = list(chain.warnings)
    if chain.rigid:
        warnings.append("J: left out, for steps of six parameters have none yet")
    else:
        methods = [dc.Laplace(), dc.Laplace(register=True, order=1), dc.ClosureSampling()]
        with progress(f"{chain.name}: J", len(methods), run.quiet or run.json) as advance:
            for method in methods:
                try:
                    results.append(
                        dc.jfactor(
                            search,
                            method,
                            rng=run.seed,
                            threads=run.threads,
                            tolerance=_TOLERANCE,
                        )
                    )
                except dc.SolveError as error:
                    warnings.append(f"{method.name}: {error}")
                advance(1)
    record = {
        "target": molecule.name,
        "sites": list(sites),
        "n_bp": chain.n_steps,
        "pose": {"position_A": list(position), "rotation": [list(row) for row in rotation]},
        "equilibria": [ring.to_dict() for ring in search],
        "J": [result.to_dict() for result in results],
        "warnings": warnings,
    }
    if run.json:
        print_json(record)
    else:
        _print(search, results)
        for warning in warnings:
            note(warning, run.quiet)
    return None if chain.rigid or results else EXIT_NOT_CONVERGED


def _print(search: Equilibria, results: list[JFactor]) -> None:
    chain = search.chain
    print(f"{chain.name}: {chain.n_steps} bp")
    print("energy/RT  bend/RT  twist/RT  twist/turns  stable  residual")
    for ring in search:
        print(
            f"{ring.energy_RT:9.4f}  {ring.bend_RT:7.4f}  {ring.twist_RT:8.4f}  "
            f"{ring.twist_turns:11.4f}  {'yes' if ring.stable else '-':>6}  {ring.residual:8.0e}"
        )
    for result in results:
        error = f" ± {result.stderr:.4f}" if result.stderr > 0.0 else ""
        print(f"-ln J = {result.minus_lnJ:.4f}{error} ({result.method}); J = {result.molar:.3g} M")
