"""Angles of a user's own trajectory: ``dnacheck md --trajectory FILE``."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dnacheck.commands.common import RunSettings
from dnacheck.commands.output import note, print_json

if TYPE_CHECKING:
    from dnacheck.model.chain import Chain

EXIT_NOT_CONVERGED = 3


def recover(
    chain: Chain,
    trajectory: Path,
    topology: Path | None,
    centres: str,
    grooves: str,
    frames: tuple[int | None, int | None, int | None],
    run: RunSettings,
) -> int | None:
    """Recover frames and step angles of a trajectory; what came before a bad frame is kept."""
    from dnacheck.md.trajectory import missing_frames, open_trajectory
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
    held = len(universe.trajectory)
    missing = missing_frames(trajectory, held)
    if missing and not trouble:
        trouble = (
            f"'{trajectory}' is cut short: its header promises {held + missing} frames, "
            f"{held} are there; copy it again, or let its writer finish"
        )
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
