"""Figures of the bead-chain check. Every line of them can be had by a command:

``md.py energies [MOLECULE ...]``     OpenMM's energies and minima beside the discrete rings
``md.py ensemble [MOLECULE ...]``     mean energy, writhe, radius beside Monte Carlo's
``md.py time-step [MOLECULE]``        the same ring at four time steps
``md.py fluctuation [MOLECULE]``      fluctuation along the sequence, MD against Metropolis
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from dnacheck.cyclization.ensembles.metropolis import (
    ClosedRingEnsemble,
    ClosedRingOptions,
    closed_ring_ensemble,
)
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.equilibria.ring import Equilibrium
from dnacheck.md.bead_chain import BeadChain, BeadEnergy, sabotaged
from dnacheck.md.check import MdOptions, run_md_check
from dnacheck.md.ensemble import Ensemble, EnsembleOptions, sample_ensemble
from dnacheck.md.ensemble_statistics import EnsembleStatistics, analyse_ensemble
from dnacheck.md.fluctuation import compare_profiles, fluctuation_profile
from dnacheck.md.harmonic import harmonic_fluctuation
from dnacheck.md.minimise import MinimiseOptions, minimise
from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.molecules import embedded
from dnacheck.numerics.outcome import SolveError


def stable_rings(chain: Chain) -> list[Equilibrium]:
    """All minima of a chain, lowest first."""
    return [ring for ring in find_rings(chain).equilibria if ring.stable]


def half_soft(chain: Chain) -> Chain:
    """The first half of the steps ten times softer; roll coupled to tilt and twist everywhere."""
    stiffness = chain.stiffness.copy()
    stiffness[:, 0, 1] = stiffness[:, 1, 0] = 0.2
    stiffness[:, 1, 2] = stiffness[:, 2, 1] = -0.15
    stiffness[: chain.n_steps // 2] *= 0.1
    return replace(chain, name=f"{chain.name}, half soft", stiffness=stiffness)


def show_energies(names: Sequence[str]) -> None:
    """Energies and minima by OpenMM, with the faults that must be caught."""
    for name in names:
        chain = build_chain(embedded(name))
        rings = stable_rings(chain)
        print(f"{name}  {chain.n_steps} bp")
        links = tuple(sorted({ring.link for ring in rings}))
        options = MdOptions(ensemble=None, minimise=MinimiseOptions(links=links))
        check = run_md_check(chain, np.stack([ring.angles for ring in rings]), options)
        for match in check.rings:
            print(
                f"  ring {match.energy_RT:10.5f} RT: evaluated {match.openmm_difference:8.1e}, "
                f"from noise {match.perturbed_difference:8.1e} ({match.perturbed_rms_A:.1e} Å), "
                f"own start {match.own_difference:8.1e} ({match.own_rms_A:.1e} Å)"
            )
        print(
            f"  seconds: energy {check.energy_seconds:.1f}, minima {check.minimise_seconds:.1f}; "
            f"passed {check.passed}"
        )
        only = MdOptions(ensemble=None, minimise=None)
        for kind in ("sign", "stiffness"):
            bad = run_md_check(chain, rings[0].angles, only, built_from=sabotaged(chain, kind, 40))
            worst = max(abs(f.difference) for f in bad.findings)
            print(f"  control, one {kind}: caught {not bad.passed}, worst difference {worst:.1e}")


def sampled(
    chain: Chain, ring: Equilibrium, options: EnsembleOptions, directory: Path | None = None
) -> tuple[Ensemble, EnsembleStatistics, float]:
    """Dynamics about a ring, its statistics, and the processor time it took."""
    began = time.process_time()
    # Rounded, so that a run can be resumed whatever the ring solver's last digits have become.
    start = np.round(BeadChain(chain).positions(ring.angles), 5)
    resume = directory is not None and directory.exists()
    ensemble = sample_ensemble(chain, start, True, options, None, 1, directory, resume)
    seconds = time.process_time() - began
    return ensemble, analyse_ensemble(ensemble, ring.energy_RT, start[0::2]), seconds


def monte_carlo(
    chain: Chain, ring: Equilibrium, samples: int
) -> tuple[ClosedRingEnsemble, np.ndarray, float]:
    """Metropolis ensemble, its centres (copies, samples, N, 3) in Å, and processor time."""
    began = time.process_time()
    options = ClosedRingOptions(samples=samples, copies=4)
    result = closed_ring_ensemble(chain, ring, options, 1)
    seconds = time.process_time() - began
    return result, result.centres_A.reshape(4, samples, chain.n_steps, 3), seconds


def show_ensembles(names: Sequence[str], samples: int) -> None:
    """Mean energy against equipartition and against Monte Carlo; writhe, radius, angles."""
    for name in names:
        chain = build_chain(embedded(name))
        ring = stable_rings(chain)[0]
        _, s, seconds = sampled(chain, ring, EnsembleOptions(samples=samples, interval=30))
        other, _, theirs = monte_carlo(chain, ring, 2 * samples)
        energy, expected = s.elastic_RT, s.equipartition_RT
        gap = energy.mean - other.energy_RT.mean
        sigma = float(np.hypot(energy.stderr, other.energy_RT.stderr))
        print(
            f"{name}  {chain.n_steps} bp; seconds of processor: MD {seconds:.0f}, MC {theirs:.0f}"
        )
        print(
            f"  mean elastic energy, MD {energy.mean:.2f} ± {energy.stderr:.2f} RT, "
            f"E_min + (3N-6)/2 = {expected:.2f} RT: {100 * (energy.mean / expected - 1):+.2f} % "
            f"± {100 * energy.stderr / expected:.2f} %"
        )
        print(
            f"  Monte Carlo {other.energy_RT.mean:.2f} ± {other.energy_RT.stderr:.2f} RT; "
            f"MD - MC = {gap:+.2f} RT = {gap / sigma:+.1f} σ"
        )
        print(
            f"  writhe {s.writhe.mean:.4f} ± {s.writhe.stderr:.4f}, "
            f"MC {other.writhe.mean:.4f} ± {other.writhe.stderr:.4f}; "
            f"radius of gyration {s.radius_of_gyration_A.mean:.3f} ± "
            f"{s.radius_of_gyration_A.stderr:.3f} Å, MC {other.radius_of_gyration_A.mean:.3f} ± "
            f"{other.radius_of_gyration_A.stderr:.3f} Å"
        )
        off = (s.angle_mean - other.angle_mean) / np.hypot(s.angle_mean_stderr, other.angle_stderr)
        variance = s.angle_variance.mean(axis=0) / (other.angle_deviation**2).mean(axis=0)
        print(
            f"  angle means, MD - MC: rms {np.sqrt(np.mean(off**2)):.2f} σ over {off.size}, "
            f"worst {np.abs(off).max():.1f} σ; variances of tau, theta, phi, MD / MC: "
            + ", ".join(f"{v:.4f}" for v in variance),
            flush=True,
        )


def show_time_steps(name: str, samples: int, fractions: Sequence[float]) -> None:
    """One ring at several time steps over the same stretch of time."""
    chain = build_chain(embedded(name))
    ring = stable_rings(chain)[0]
    print(f"{name}  {chain.n_steps} bp, E_min + (3N-6)/2 = ", end="")
    print(f"{ring.energy_RT + 0.5 * (3 * chain.n_steps - 6):.2f} RT")
    print("  fraction  step/fs   mean energy/RT   T/K             variances / those of the first")
    first = None
    for fraction in fractions:
        interval = round(30 * 0.45 / fraction)
        options = EnsembleOptions(samples=samples, interval=interval, step_fraction=fraction)
        try:
            ensemble, s, seconds = sampled(chain, ring, options)
        except SolveError as trouble:
            print(f"  {fraction:8.3f}  {trouble}", flush=True)
            continue
        variance = s.angle_variance.mean(axis=0)
        error = np.sqrt(np.mean(s.angle_variance_stderr**2, axis=0) / chain.n_steps)
        first = variance if first is None else first
        text = ", ".join(
            f"{v:.4f} ± {e:.4f}" for v, e in zip(variance / first, error / first, strict=True)
        )
        print(
            f"  {fraction:8.3f}  {1e3 * ensemble.time_step_ps:7.1f}   {s.elastic_RT.mean:.2f} ± "
            f"{s.elastic_RT.stderr:.2f}    {s.temperature_K.mean:.2f} ± "
            f"{s.temperature_K.stderr:.2f}   {text}   ({seconds:.0f} s)",
            flush=True,
        )


def show_fluctuation(
    chain: Chain, options: EnsembleOptions, metropolis: int, directory: Path | None
) -> None:
    """Profile by dynamics, by Metropolis sampling and by Laplace, and how well they agree."""
    ring = stable_rings(chain)[0]
    ensemble, s, seconds = sampled(chain, ring, options, directory)
    other, centres, theirs_seconds = monte_carlo(chain, ring, metropolis // 4)
    energy = BeadEnergy(BeadChain(chain))
    minimum = minimise(energy, energy.beads.positions(ring.angles))
    laplace = harmonic_fluctuation(energy, minimum)
    shape = (len(ensemble.replicas), -1, chain.n_steps, 3)
    ours = fluctuation_profile(ensemble.positions[:, 0::2].reshape(shape), minimum.centres_A)
    theirs = fluctuation_profile(centres.astype(float), minimum.centres_A)
    found = compare_profiles(ours, theirs)
    print(
        f"{chain.name}  {chain.n_steps} bp; MD {ours.frames} configurations every "
        f"{options.interval} steps ({s.elastic_RT.effective_samples:.0f} independent energies), "
        f"{seconds:.0f} s of processor; Metropolis {theirs.frames} configurations, "
        f"{theirs_seconds:.0f} s"
    )
    print(
        f"  mean elastic energy: MD {s.elastic_RT.mean:.2f} ± {s.elastic_RT.stderr:.2f} RT, "
        f"Metropolis {other.energy_RT.mean:.2f} ± {other.energy_RT.stderr:.2f} RT, "
        f"equipartition {s.equipartition_RT:.2f} RT"
    )
    print(
        f"  profile: mean {ours.fluctuation_A.mean():.3f} Å, varies by {100 * found.variation:.2f} "
        f"% along the sequence; statistical errors {100 * found.noise:.2f} %"
    )
    print(
        f"  MD against Metropolis: correlation {found.correlation:.4f} "
        f"(expected of these errors {found.expected_correlation:.4f}), mean ratio "
        f"{found.mean_ratio:.4f} ± {found.mean_ratio_stderr:.4f}"
    )
    for label, profile in (("MD", ours), ("Metropolis", theirs)):
        f = profile.fluctuation_A
        print(
            f"  {label} against Laplace: correlation {np.corrcoef(f, laplace)[0, 1]:.4f}, "
            f"mean ratio {f.mean() / laplace.mean():.4f}",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    kinds = parser.add_subparsers(dest="kind", required=True)
    kind = kinds.add_parser("energies")
    kind.add_argument("molecules", nargs="*", default=["11T15", "09T15"])
    kind = kinds.add_parser("ensemble")
    kind.add_argument("molecules", nargs="*", default=["11T15", "08T15", "09A17"])
    kind.add_argument("--samples", type=int, default=800, help="of each of two replicas")
    kind = kinds.add_parser("time-step")
    kind.add_argument("molecule", nargs="?", default="11T15")
    kind.add_argument("--samples", type=int, default=800, help="of each of two replicas")
    kind.add_argument("--fractions", type=float, nargs="+", default=[0.225, 0.45, 0.6, 0.9])
    kind = kinds.add_parser("fluctuation")
    kind.add_argument("molecule", nargs="?", default="11T15")
    kind.add_argument("--half-soft", action="store_true", help="soften half of it ten times")
    kind.add_argument("--samples", type=int, default=10000, help="of each of two replicas")
    kind.add_argument("--interval", type=int, default=45, help="time steps between two")
    kind.add_argument("--metropolis", type=int, default=60000, help="configurations in all")
    kind.add_argument("--directory", type=Path, help="of checkpoints; an existing one is resumed")
    a = parser.parse_args()
    if a.kind == "energies":
        show_energies(a.molecules)
    elif a.kind == "ensemble":
        show_ensembles(a.molecules, a.samples)
    elif a.kind == "time-step":
        show_time_steps(a.molecule, a.samples, a.fractions)
    else:
        chain = build_chain(embedded(a.molecule))
        options = EnsembleOptions(samples=a.samples, interval=a.interval, burn_in=30)
        chosen = half_soft(chain) if a.half_soft else chain
        show_fluctuation(chosen, options, a.metropolis, a.directory)


if __name__ == "__main__":
    main()
