"""What ``dnacheck md`` writes and prints of a check."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from dnacheck.md.check import MdCheck
    from dnacheck.md.ensemble_statistics import Estimate


def write_files(check: MdCheck, output: Path, suffix: str) -> None:
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


def record_of(check: MdCheck, seconds: float) -> dict[str, Any]:
    """The check as JSON data."""
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


def _verdict(check: MdCheck) -> str:
    if not check.passed:
        return "A CHECK FAILED"
    if not check.undecided:
        return "every check passed"
    return (
        f"no check failed, but {check.undecided} of {len(check.findings)} are undecided: "
        "more --samples decide them"
    )


def print_check(check: MdCheck) -> None:
    """The check as text; of its findings, those that did not pass."""
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
    if check.trouble:
        kept = 0 if ensemble is None else len(ensemble.positions)
        click.echo(f"  STOPPED EARLY, with {kept} configurations kept: {check.trouble}")
    else:
        click.echo(f"  {_verdict(check)}")
