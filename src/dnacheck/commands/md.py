"""``dnacheck md``: the ring as an OpenMM bead chain, and angles of a user's trajectory."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dnacheck.commands.common import (
    ModelSettings,
    PositiveNumber,
    RunSettings,
    common_options,
    model_options,
    target_argument,
)
from dnacheck.commands.output import note, print_json, progress

if TYPE_CHECKING:
    from dnacheck.md.check import MdCheck
    from dnacheck.md.ensemble_statistics import Estimate
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
    type=click.IntRange(min=20),
    default=1500,
    show_default=True,
    help="Configurations kept of each replica.",
)
@click.option(
    "--replicas", type=click.IntRange(min=1), default=2, show_default=True, help="Independent runs."
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
    type=PositiveNumber(),
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
@click.option("--start", type=int, default=None, help="First frame of the trajectory to analyse.")
@click.option("--stop", type=int, default=None, help="Frame to stop before.")
@click.option("--step", type=int, default=None, help="Frames from one to the next.")
@model_options
@common_options
def command(
    target: str,
    ensemble: bool,
    samples: int,
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
    from dnacheck.model.chain import build_chain
    from dnacheck.model.molecules import read_target
    from dnacheck.numerics.outcome import InputError

    molecules = list(read_target(target))
    if len(molecules) != 1:
        raise InputError(f"'{target}' holds {len(molecules)} records; give one molecule")
    molecule = molecules[0]
    if isinstance(molecule, InputError):
        raise molecule
    chain = build_chain(molecule, **model.chain_arguments())
    for warning in chain.warnings:
        note(f"{chain.name}: {warning}", run.quiet)
    if trajectory is not None:
        return _recover(chain, trajectory, topology, centres, grooves, (start, stop, step), run)
    if topology is not None:
        raise InputError("--topology belongs to --trajectory; give that too")
    if resume and output is None:
        raise InputError("--resume needs the --output directory of the run")
    from dnacheck.md.check import MdOptions
    from dnacheck.md.ensemble import EnsembleOptions

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
    options = MdOptions(ensemble=dynamics if ensemble else None, seed=run.seed, threads=run.threads)
    return _check(chain, options, output, suffix, resume, run)


def _check(
    chain: Chain, options: Any, output: Path | None, suffix: str, resume: bool, run: RunSettings
) -> int | None:
    from dataclasses import replace

    import numpy as np

    from dnacheck.md.check import run_md_check
    from dnacheck.ring.search import find_rings

    begin = time.perf_counter()
    search = find_rings(chain)
    minima = [ring for ring in search.equilibria if ring.stable]
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
        _write(check, output, suffix)
    record = _record(check, time.perf_counter() - begin)
    if run.json:
        print_json(record)
    else:
        _print(check, record)
    if check.trouble:
        note(check.trouble)
        return EXIT_NOT_CONVERGED
    return None if check.passed else EXIT_CHECK_FAILED


def _write(check: MdCheck, output: Path, suffix: str) -> None:
    """Topology of the lowest minimum, and the trajectory, replica after replica."""
    from dnacheck.md.trajectory import write_topology, write_trajectory
    from dnacheck.numerics.outcome import InputError

    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot use directory '{output}': {error.strerror}") from error
    if not check.minima:
        return
    lowest = check.minima[0].positions
    write_topology(output / "topology.pdb", check.chain, lowest)
    ensemble = check.ensemble
    if ensemble is not None and len(ensemble.positions):
        write_trajectory(
            output / f"trajectory.{suffix}",
            check.chain,
            ensemble.positions,
            interval_ps=ensemble.options.interval * ensemble.time_step_ps,
            reference=lowest,
        )


def _record(check: MdCheck, seconds: float) -> dict[str, Any]:
    chain = check.chain
    first = check.rings[0] if check.rings else None
    return {
        "target": chain.name,
        "n_bp": chain.n_steps,
        "angles": chain.angle_set,
        "twist_ratio": chain.twist_ratio,
        "persistence_length_A": chain.persistence_length_A,
        "rise_A": chain.rise_A,
        "strand": chain.letters,
        "energy_RT": check.energy_RT,
        "discrete_energy_RT": first.energy_RT if first else None,
        "relative_difference": first.own_difference if first else None,
        "rms_A": first.own_rms_A if first else None,
        "evaluated_relative_difference": first.openmm_difference if first else None,
        "platform": check.platform,
        "minima": [
            {
                "energy_RT": m.energy_RT,
                "link": m.link,
                "writhe": m.writhe,
                "starts": m.starts,
                "max_force_RT_per_A": m.max_force,
                "bond_error": m.bond_error,
                "iterations": m.iterations,
                "status": m.status,
            }
            for m in check.minima
        ],
        "ensemble": _ensemble(check),
        "findings": [
            {
                "name": f.name,
                "difference": f.difference,
                "tolerance": f.tolerance,
                "sigma": f.sigma,
                "verdict": f.verdict,
            }
            for f in check.findings
        ],
        "status": check.status,
        "seconds": seconds,
        "warnings": [*chain.warnings, *([check.trouble] if check.trouble else [])],
    }


def _ensemble(check: MdCheck) -> dict[str, Any] | None:
    ensemble, statistics = check.ensemble, check.statistics
    if ensemble is None:
        return None
    record: dict[str, Any] = {
        "integrator": ensemble.options.integrator,
        "measure": ensemble.options.measure,
        "platform": ensemble.platform,
        "replicas": len(ensemble.replicas),
        "frames": len(ensemble.positions),
        "interval_steps": ensemble.options.interval,
        "time_step_ps": ensemble.time_step_ps,
        "friction_per_ps": ensemble.friction_per_ps,
        "seed": ensemble.options.seed,
        "seconds": ensemble.seconds,
        "status": ensemble.status,
    }
    if statistics is None:
        return record
    return record | {
        "elastic_RT": _estimate(statistics.elastic_RT),
        "equipartition_RT": statistics.equipartition_RT,
        "temperature_K": _estimate(statistics.temperature_K),
        "writhe": _estimate(statistics.writhe),
        "radius_of_gyration_A": _estimate(statistics.radius_of_gyration_A),
        "fluctuation_A": statistics.fluctuation_A,
        "fluctuation_stderr_A": statistics.fluctuation_stderr_A,
        "harmonic_fluctuation_A": check.harmonic_fluctuation_A,
        "angle_mean": statistics.angle_mean,
        "angle_mean_stderr": statistics.angle_mean_stderr,
        "angle_variance": statistics.angle_variance,
        "angle_variance_stderr": statistics.angle_variance_stderr,
    }


def _estimate(value: Estimate) -> dict[str, float]:
    return {
        "mean": value.mean,
        "stderr": value.stderr,
        "effective_samples": value.effective_samples,
    }


def _print(check: MdCheck, record: dict[str, Any]) -> None:
    click.echo(f"{check.chain.name}  {check.chain.n_steps} bp  OpenMM {check.platform}")
    for m in check.minima:
        click.echo(f"  minimum {m.energy_RT:.6f} RT, link {m.link}, writhe {m.writhe:.5f}")
    for ring in check.rings:
        click.echo(
            f"  discrete ring {ring.energy_RT:.6f} RT: evaluated {ring.openmm_difference:.1e}, "
            f"minimised {ring.own_difference:.1e} relative, rms {ring.own_rms_A:.1e} Å"
        )
    statistics, ensemble = check.statistics, check.ensemble
    if ensemble is not None and statistics is not None:
        energy, writhe = statistics.elastic_RT, statistics.writhe
        radius = statistics.radius_of_gyration_A
        click.echo(
            f"  ensemble of {statistics.frames} configurations ({ensemble.options.integrator}, "
            f"{ensemble.platform}, {ensemble.seconds:.0f} s)"
        )
        click.echo(
            f"    elastic energy {energy.mean:.2f} ± {energy.stderr:.2f} RT, "
            f"E_min + (3N-6)/2 = {statistics.equipartition_RT:.2f} RT"
        )
        click.echo(f"    writhe {writhe.mean:.4f} ± {writhe.stderr:.4f}")
        click.echo(f"    radius of gyration {radius.mean:.2f} ± {radius.stderr:.2f} Å")
        mean = float(statistics.fluctuation_A.mean())
        click.echo(f"    fluctuation of a base pair {mean:.2f} Å")
    for finding in check.findings:
        if finding.verdict != "pass":
            click.echo(
                f"  {finding.verdict}: {finding.name}: {finding.difference:.2e} "
                f"(tolerance {finding.tolerance:.0e}, standard error {finding.sigma:.0e})"
            )
    click.echo(f"  {'every check passed' if check.passed else 'A CHECK FAILED'}")


def _recover(
    chain: Chain,
    trajectory: Path,
    topology: Path | None,
    centres: str,
    grooves: str,
    frames: tuple[int | None, int | None, int | None],
    run: RunSettings,
) -> int | None:
    from dnacheck.md.trajectory import open_trajectory
    from dnacheck.md.wedge_analysis import WedgeAngles
    from dnacheck.numerics.outcome import InputError, SolveError

    begin = time.perf_counter()
    start, stop, step = frames
    if step is not None and step < 1:
        raise InputError(f"--step {step}: give 1 or more")
    universe = open_trajectory(trajectory, topology)
    analysis = WedgeAngles(universe, chain, centres=centres, grooves=grooves)
    trouble = ""
    try:
        analysis.run(start=start, stop=stop, step=step)
    except SolveError as error:
        trouble = str(error)
    results = analysis.results
    count = len(results.angles)
    record = {
        "target": chain.name,
        "n_bp": chain.n_steps,
        "trajectory": trajectory,
        "closed": analysis.closed,
        "frames": count,
        "elastic_RT": results.elastic_RT,
        "angle_mean": results.angles.mean(axis=0) if count else None,
        "angle_variance": results.angles.var(axis=0) if count else None,
        "angles": results.angles,
        "seconds": time.perf_counter() - begin,
        "warnings": [trouble] if trouble else [],
    }
    if run.json:
        print_json(record)
    else:
        kind = "ring" if analysis.closed else "open chain"
        click.echo(f"{chain.name}  {kind} of {chain.n_steps} steps, {count} frames")
        if count:
            energy = results.elastic_RT
            click.echo(
                f"  elastic energy {energy.mean():.4f} RT "
                f"(from {energy.min():.4f} to {energy.max():.4f})"
            )
            click.echo("  step  tau, theta, phi: mean (standard deviation), degrees")
            mean, spread = results.angles.mean(axis=0), results.angles.std(axis=0)
            for i, (centre, width) in enumerate(zip(mean, spread, strict=True)):
                words = [
                    f"{57.29577951308232 * a:9.4f} ({57.29577951308232 * b:7.4f})"
                    for a, b in zip(centre, width, strict=True)
                ]
                click.echo(f"  {i:4d} {'  '.join(words)}")
    if trouble:
        note(trouble)
        return EXIT_NOT_CONVERGED
    return None
