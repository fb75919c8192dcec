"""``dnacheck md``: the ring as an OpenMM bead chain, and angles of a user's trajectory."""

from __future__ import annotations

import time
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
from dnacheck.commands.option_types import Count, Number
from dnacheck.commands.output import note, print_json, progress

if TYPE_CHECKING:
    from dnacheck.model.chain import Chain

EXIT_CHECK_FAILED = 1
EXIT_NOT_CONVERGED = 3


@click.command(
    epilog="Examples:  dnacheck md 11T15 --no-ensemble    "
    "dnacheck md 11T15 -o run --samples 3000    "
    "dnacheck md 11T15 --trajectory mine.dcd --topology mine.pdb"
)
@target_argument
@click.option(
    "--ensemble/--no-ensemble", default=True, help="Sample the thermal ensemble.  [default: yes]"
)
@click.option(
    "--samples",
    type=Count(allowed.SAMPLES),
    default=1500,
    show_default=True,
    help="Configurations kept of each replica.",
)
@click.option(
    "--iterations",
    type=Count(allowed.ITERATIONS),
    default=None,
    help="Of each minimisation, at most.  [default: 200, more beyond 200 bp]",
)
@click.option(
    "--replicas",
    type=Count(allowed.REPLICAS),
    default=2,
    show_default=True,
    help="Independent runs.",
)
@click.option(
    "--integrator",
    type=click.Choice(["bond-langevin", "langevin-middle"]),
    default="bond-langevin",
    show_default=True,
    help="Masses on bonds and groove arms, or on the beads with OpenMM's integrator.",
)
@click.option(
    "--step-fraction",
    type=Number(allowed.STEP_FRACTION),
    default=0.45,
    show_default=True,
    help="Time step over its limit of stability.",
)
@click.option(
    "--measure",
    type=click.Choice(["angles", "frames"]),
    default="angles",
    show_default=True,
    help="Weight of the angles, as Monte Carlo has it, or of the rotations.",
)
@click.option(
    "--platform",
    default="fastest",
    show_default=True,
    metavar="NAME",
    help="OpenMM platform of the dynamics; energies and minima use Reference.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    default=None,
    help="Directory for topology, trajectory and checkpoints.",
)
@click.option(
    "--format",
    "suffix",
    type=click.Choice(["dcd", "xtc"]),
    default="dcd",
    show_default=True,
    help="Of the trajectory in the output directory.",
)
@click.option("--resume", is_flag=True, help="Go on with the run in the output directory.")
@click.option(
    "--trajectory",
    type=click.Path(path_type=Path, dir_okay=False),
    default=None,
    help="Only recover the angles of this file.",
)
@click.option(
    "--topology",
    type=click.Path(path_type=Path, dir_okay=False),
    default=None,
    help="PDB that names the trajectory's atoms.",
)
@click.option(
    "--centres", default="name CEN", show_default=True, help="Selection of the centre beads."
)
@click.option(
    "--grooves", default="name GRV", show_default=True, help="Selection of the groove beads."
)
@click.option(
    "--start",
    type=Count(allowed.FRAMES),
    default=None,
    help="First frame of the trajectory to analyse.",
)
@click.option("--stop", type=Count(allowed.FRAMES), default=None, help="Frame to stop before.")
@click.option(
    "--step", type=Count(allowed.FRAMES), default=None, help="Frames from one to the next."
)
@model_options
@common_options
def command(
    target: str,
    ensemble: bool,
    samples: int,
    iterations: int | None,
    replicas: int,
    integrator: str,
    step_fraction: float,
    measure: str,
    platform: str,
    output: Path | None,
    suffix: str,
    resume: bool,
    trajectory: Path | None,
    topology: Path | None,
    centres: str,
    grooves: str,
    start: int | None,
    stop: int | None,
    step: int | None,
    model: ModelSettings,
    run: RunSettings,
) -> int | None:
    """Check the ring of TARGET with an OpenMM bead chain, built from the sequence alone.

    Its energy at the discrete ring, the minima it finds by itself and its thermal ensemble are
    compared with the discrete model. With --trajectory, frames and wedge angles are recovered
    from a bead trajectory of TARGET instead.
    """
    from dnacheck.io.sequences import read_one
    from dnacheck.numerics.outcome import InputError

    chain = dc.chain(read_one(target, "a bead-chain check"), **model.chain_arguments())
    for warning in chain.warnings:
        note(f"{chain.name}: {warning}", run.quiet)
    if trajectory is not None:
        from dnacheck.commands.md_trajectory import recover

        return recover(chain, trajectory, topology, centres, grooves, (start, stop, step), run)
    if topology is not None:
        raise InputError("--topology belongs to --trajectory; give that too")
    if resume and output is None:
        raise InputError("--resume needs the --output directory of the run")
    from dnacheck.md.check import MdOptions
    from dnacheck.md.ensemble import EnsembleOptions
    from dnacheck.md.minimise import MinimiseOptions

    dynamics = EnsembleOptions(
        samples=samples,
        replicas=replicas,
        integrator=integrator,  # type: ignore[arg-type]
        # Masses on the beads make the slow modes some twenty times slower.
        interval=20 if integrator == "bond-langevin" else 400,
        step_fraction=step_fraction,
        measure=measure,  # type: ignore[arg-type]
        platform=platform,
        seed=run.seed,
    )
    options = MdOptions(
        minimise=MinimiseOptions(
            max_iterations=max(200, chain.n_steps) if iterations is None else iterations
        ),
        ensemble=dynamics if ensemble else None,
        seed=run.seed,
        threads=run.threads,
    )
    return _check(chain, options, output, suffix, resume, run)


def _check(
    chain: Chain, options: Any, output: Path | None, suffix: str, resume: bool, run: RunSettings
) -> int | None:
    from dataclasses import replace

    import numpy as np

    from dnacheck.commands.md_output import print_check, record_of, write_files
    from dnacheck.md.check import run_md_check

    begin = time.perf_counter()
    search = dc.rings(chain, throw=False)
    minima = [ring for ring in search if ring.stable]
    angles = np.stack([ring.angles for ring in minima]) if minima else None
    nearest = int(np.floor(chain.relaxed_turns))
    links = {nearest, nearest + 1} | {ring.link for ring in minima}
    options = replace(options, minimise=replace(options.minimise, links=tuple(sorted(links))))
    dynamics = options.ensemble
    total = dynamics.samples * dynamics.replicas if dynamics else None
    with progress("configurations", total, run.quiet) as advance:
        check = run_md_check(
            chain,
            angles,
            options,
            directory=output / "checkpoints" if output is not None and dynamics else None,
            resume=resume,
            progress=advance,
        )
    if output is not None:
        write_files(check, output, suffix)
    if run.json:
        print_json(record_of(check, time.perf_counter() - begin))
    else:
        print_check(check)
    if check.trouble:
        note(check.trouble)
        return EXIT_NOT_CONVERGED
    return None if check.passed else EXIT_CHECK_FAILED
