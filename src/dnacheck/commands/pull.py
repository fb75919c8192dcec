"""``dnacheck pull``: a molecule under force and torque."""

from __future__ import annotations

import math
from dataclasses import asdict
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
from dnacheck.commands.option_types import Number
from dnacheck.commands.output import note, print_json


@click.command(epilog="Example:  dnacheck pull 11T15 --force-pN 1 --torque-pN-nm 5")
@target_argument
@click.option(
    "--force-pN",
    "force",
    type=Number(allowed.FORCE_PN),
    required=True,
    help="Along the axis of the first base pair; negative pushes.",
)
@click.option(
    "--torque-pN-nm",
    "torque",
    type=Number(allowed.TORQUE_PN_NM),
    default=0.0,
    show_default=True,
    help="On the end, about the same axis; positive overwinds.",
)
@model_options
@common_options
def command(
    target: str, force: float, torque: float, model: ModelSettings, run: RunSettings
) -> int | None:
    """TARGET under force and torque: its equilibrium, and mean extension and turns at 300 K.

    The start is clamped along the force. In equilibrium the end's axis is held along it as well; in
    the thermal average the end is free.
    """
    from dnacheck.cyclization.ensembles.pulled import marko_siggia_extension, pulled_mean
    from dnacheck.equilibria.boundary import Pull
    from dnacheck.equilibria.discrete.boundary_search import find_equilibria
    from dnacheck.io.sequences import read_one
    from dnacheck.numerics.outcome import InputError

    boundary = Pull(force, torque)
    chain = dc.chain(read_one(target, "a pull"), **model.chain_arguments(), closed=False)
    search = find_equilibria(chain, boundary)
    if not search.equilibria:
        raise InputError(
            f"pull of {force:g} pN and {torque:g} pN nm: {chain.name} has no stable shape; "
            "pull harder or twist less"
        )
    warnings = list(chain.warnings)
    lowest = search.lowest
    record: dict[str, Any] = {
        "target": chain.name,
        "n_bp": chain.n_steps,
        "force_pN": force,
        "torque_pN_nm": torque,
        "temperature_K": boundary.temperature_K,
        "equilibrium": lowest.to_dict()
        | {"extension_A": chain.rise_A * float(lowest.centres[-1, 2])},
        "thermal": None,
        "marko_siggia_A": None,
        "warnings": warnings,
    }
    if chain.rigid:
        warnings.append("thermal average: left out, for steps of six parameters have none yet")
    else:
        mean = pulled_mean(chain, boundary, rng=run.seed)
        record["thermal"] = asdict(mean)
        if mean.winds_up(chain, boundary):
            warnings.append(
                "chains wind back over their start, where the turn of an end has no bound: under "
                "this torque the stretched shape does not last; pull harder or twist less"
            )
        if force >= 0.0:
            length = chain.n_steps * chain.rise_A
            # What bends of random phase leave of it is the sequence's own affair.
            persistence = chain.persistence_length_A * float(
                2.0 / (chain.flexibility[:, 1, 1] + chain.flexibility[:, 2, 2]).mean()
            )
            record["marko_siggia_A"] = marko_siggia_extension(length, persistence, boundary)
    if run.json:
        print_json(record)
    else:
        _print(record)
        for warning in warnings:
            note(warning, run.quiet)
    return None


def _print(record: dict[str, Any]) -> None:
    equilibrium, thermal = record["equilibrium"], record["thermal"]
    print(
        f"{record['target']}: {record['n_bp']} bp, {record['force_pN']:g} pN, "
        f"{record['torque_pN_nm']:g} pN nm"
    )
    print(
        f"equilibrium: {equilibrium['energy_RT']:.4f} RT, extension "
        f"{equilibrium['extension_A']:.2f} Å, softest eigenvalue "
        f"{equilibrium['smallest_eigenvalue'] or math.nan:.3g}"
    )
    if thermal is not None:
        print(
            f"thermal mean: extension {thermal['extension_A']:.2f} ± "
            f"{thermal['extension_stderr_A']:.2f} Å, turns {thermal['turns']:.4f} ± "
            f"{thermal['turns_stderr']:.4f} ({thermal['excess_turns']:+.4f} beyond unstressed)"
        )
    if record["marko_siggia_A"] is not None:
        print(f"Marko & Siggia, straight and without ends: {record['marko_siggia_A']:.2f} Å")
