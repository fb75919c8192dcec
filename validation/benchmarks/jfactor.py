"""Figures of the Laplace values and of exact-closure sampling. Prints; asserts nothing.

    python validation/benchmarks/jfactor.py                    all tables
    python validation/benchmarks/jfactor.py eleven random      some of them

Times are wall times of one whole call (search, registers, sampling) on one core, kernels compiled
beforehand, and beside them the processor's own time, which other programs disturb less.
"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass

import numpy as np

from dnacheck.cyclization.closure.sampling import ClosureOptions, ClosureSampler
from dnacheck.cyclization.laplace.isolated import laplace
from dnacheck.cyclization.laplace.register import RegisterProfile, register_profile
from dnacheck.cyclization.result import JFactor
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.chain import Chain, build_chain, uniform_stiffness
from dnacheck.model.molecules import embedded, embedded_names
from dnacheck.model.sequence import parse_sequence
from dnacheck.numerics.outcome import SolveError
from dnacheck.validation.reference.work_precision import LONG, molecules, study, warm_up

SEED = 1
RANDOM_MOLECULES = 200
CALIBRATION_RUNS = 200


@dataclass
class Timed:
    """A J factor with the seconds that it took."""

    result: JFactor
    profile: RegisterProfile
    wall: float
    processor: float


def sampled(chain: Chain, tolerance: float, seed: int = SEED) -> Timed:
    """From the chain to its J factor."""
    wall, processor = time.perf_counter(), time.process_time()
    profile = register_profile(find_rings(chain))
    result = ClosureSampler(profile, ClosureOptions(tolerance=tolerance), seed).sample()
    return Timed(result, profile, time.perf_counter() - wall, time.process_time() - processor)


def straight(n: int) -> Chain:
    """A homopolymer without bends."""
    ground = np.zeros((n, 3))
    ground[:, 0] = 2.0 * math.pi / 10.45
    return Chain(f"straight {n}", ground, uniform_stiffness(n, 1.5), twist_ratio=1.5)


def random_molecules() -> list[Chain]:
    """Random sequences of 80-400 bp, two angle sets, twist ratios 0.5-2."""
    rng = np.random.default_rng(2024)
    chains = []
    for i in range(RANDOM_MOLECULES):
        n = int(rng.integers(80, 401))
        letters = "".join(rng.choice(list("ACGT"), n))
        ratio = float(rng.uniform(0.5, 2.0))
        angles = ("trifonov2", "trifonov")[i % 2]
        chains.append(
            build_chain(parse_sequence(letters, f"random {i}"), angles=angles, twist_ratio=ratio)
        )
    return chains


def eleven() -> None:
    """Exact closure at 0.02 on the eleven molecules, with Laplace's bias."""
    print("\nEleven molecules, exact closure, tolerance 0.02")
    print("name     -ln J   s.e.  bias bound  Laplace's bias  with registers  draws  wall s  cpu s")
    worst = 0.0
    for name in embedded_names():
        chain = build_chain(embedded(name))
        runs = [sampled(chain, 0.02) for _ in range(5)]
        run = min(runs, key=lambda r: r.wall)
        j = run.result
        worst = max(worst, j.stderr)
        print(
            f"{name} {j.minus_lnJ:8.3f} {j.stderr:6.4f} {j.bias_bound or 0.0:10.0e}"
            f" {laplace(run.profile.search).minus_lnJ - j.minus_lnJ:15.3f}"
            f" {-run.profile.log_j - j.minus_lnJ:15.3f} {j.samples:6d}"
            f" {np.median([r.wall for r in runs]):7.3f}"
            f" {np.median([r.processor for r in runs]):6.3f}"
        )
    print(f"largest standard error {worst:.4f}")


def random() -> None:
    """200 random sequences at 0.05."""
    print(f"\n{RANDOM_MOLECULES} random sequences, 80-400 bp, exact closure, tolerance 0.05")
    errors, walls, processors, biases, tails, folds, gaps = [], [], [], [], [], [], []
    without = []
    for chain in random_molecules():
        try:
            run = sampled(chain, 0.05)
        except SolveError as error:
            without.append(f"{chain.name}: {error}")
            continue
        j = run.result
        errors.append(j.stderr)
        walls.append(run.wall)
        processors.append(run.processor)
        biases.append(j.bias_bound or 0.0)
        tails.append(j.pareto_shape or 0.0)
        folds.append(any("no closed shape" in w for w in j.warnings))
        gaps.append(-run.profile.log_j - j.minus_lnJ)
        if not j.status.ok:
            print(f"  {chain.name} ({chain.n_steps} bp): {j.status.name}, s.e. {j.stderr:.3f}")
    print(
        f"standard error: median {np.median(errors):.3f}, largest {max(errors):.3f}; "
        f"within 0.05: {sum(e <= 0.05 for e in errors)}"
    )
    print(
        f"seconds: wall median {np.median(walls):.2f}, largest {max(walls):.2f}; "
        f"cpu median {np.median(processors):.2f}, largest {max(processors):.2f}"
    )
    print(
        f"bias bound: median {np.median(biases):.1e}, largest {max(biases):.3f}; "
        f"{sum(folds)} with over 1 % folded draws; Pareto shape largest {max(tails):.2f}"
    )
    print(f"register Laplace minus sampled: {min(gaps):.2f} to {max(gaps):.2f}")
    print(f"without an answer: {len(without)}")
    for line in without:
        print(f"  {line}")


def homopolymer() -> None:
    """Straight molecules, whose register is free."""
    print("\nStraight homopolymer: register Laplace, exact closure, and 0.514 L / 2P")
    print("  bp   register Laplace   closure     s.e.  difference  0.514 L/2P  effective  cpu s")
    for n in (100, 150, 200, 300, 400, 500):
        run = sampled(straight(n), 0.02)
        j = run.result
        print(
            f"{n:4d} {-run.profile.log_j:18.3f} {j.minus_lnJ:9.3f} {j.stderr:8.4f}"
            f" {-run.profile.log_j - j.minus_lnJ:11.3f} {0.514 * n * 3.4 / 926.0:11.3f}"
            f" {(j.effective_samples or 0.0) / j.samples:10.2f} {run.processor:6.2f}"
        )


def calibration() -> None:
    """Share of seeded runs whose one-sigma interval holds the long-run value."""
    print(f"\nCalibration over {CALIBRATION_RUNS} seeded runs of 320 draws")
    chains = [
        ("11T15", build_chain(embedded("11T15"))),
        ("straight 150", straight(150)),
        ("random 386 bp, ratio 0.6", molecules()["hard: random, 386 bp"]),
    ]
    for name, chain in chains:
        profile = register_profile(find_rings(chain))
        first = ClosureSampler(profile, ClosureOptions(tolerance=10.0), SEED).sample()
        # A tenth of one run's error: the long-run value then counts as known.
        exact = ClosureOptions(tolerance=0.1 * first.stderr)
        long_run = ClosureSampler(profile, exact, SEED).sample()
        inside = 0
        for seed in range(CALIBRATION_RUNS):
            run = ClosureSampler(profile, ClosureOptions(tolerance=10.0), 1000 + seed).sample()
            inside += abs(run.minus_lnJ - long_run.minus_lnJ) < run.stderr
        print(f"{name}: {100.0 * inside / CALIBRATION_RUNS:.1f} % inside one standard error")


def speed() -> None:
    """Error against time for an easy, a middling and a hard molecule, every method."""
    print("\nError of ln J against processor time, search included; Laplace's error is its bias")
    warm_up()
    for name, chain in molecules().items():
        found = study(name, chain, LONG, SEED)
        print(f"{name}: exact closure {found.reference:.3f} +- {found.reference_error:.3f}")
        for point in found.points:
            print(
                f"  {point.method:17s} {point.size:18s} {point.seconds:8.3f} s  error "
                f"{point.error:.4f}  off by {point.bias:+.3f}",
                flush=True,
            )
        for line in found.failed:
            print(f"  none: {line}")


TABLES = {
    "eleven": eleven,
    "random": random,
    "homopolymer": homopolymer,
    "calibration": calibration,
    "speed": speed,
}


def main(names: list[str]) -> None:
    """Print the tables asked for, all by default."""
    sampled(build_chain(embedded("09T15")), 0.05)
    for name in names or list(TABLES):
        TABLES[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
