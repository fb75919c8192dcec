"""Figures of Metropolis sampling: J by MBAR, closed rings. Prints; asserts nothing.

    python validation/benchmarks/metropolis.py             all tables
    python validation/benchmarks/metropolis.py short ring  some of them

``long`` takes minutes, ``short`` about one a molecule. Kernels are compiled beforehand.
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np

from dnacheck.cyclization.closure.sampling import ClosureOptions, sample_closure
from dnacheck.cyclization.ensembles.metropolis import ClosedRingOptions, closed_ring_ensemble
from dnacheck.cyclization.half_chain.sampling import HalfChainOptions, half_chain
from dnacheck.cyclization.umbrella.sampling import UmbrellaOptions, umbrella_estimate
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import embedded

SEED = 1
CALIBRATION_RUNS = 16
BEST = ("09T15", "08T15", "08A17")


def warm_up() -> None:
    """Compile every kernel."""
    search = find_rings(build_chain(embedded("09T15")))
    small = UmbrellaOptions(samples=20, burn_in=8, copies=2, thinning=1)
    umbrella_estimate(search, small, np.random.default_rng(0))


def _umbrella(options: UmbrellaOptions) -> None:
    # A seed for each molecule: with one for all, their errors would be nearly the same.
    for seed, name in enumerate(BEST, start=SEED):
        search = find_rings(build_chain(embedded(name)))
        reference = half_chain(search, HalfChainOptions(halves=40_000, threads=2), seed)
        began, used = time.perf_counter(), time.process_time()
        e = umbrella_estimate(search, options, np.random.default_rng(seed))
        seconds, processor = time.perf_counter() - began, time.process_time() - used
        error = math.hypot(e.stderr, reference.stderr)
        print(
            f"{name}: -ln J = {-e.log_j:.3f} +- {e.stderr:.3f} (MBAR {e.mbar_error:.3f}, copies "
            f"{e.copies_error:.3f}), tilted half chains {reference.minus_lnJ:.3f} +- "
            f"{reference.stderr:.3f}: {abs(e.log_j + reference.minus_lnJ) / error:.2f} apart; "
            f"least overlap {e.least_overlap:.2f}, {e.decorrelated} records, {seconds:.0f} s, "
            f"{processor:.0f} s of processor"
        )


def long() -> None:
    """Long runs on two threads."""
    print("\nMetropolis with MBAR, 4 copies of 1,000 records")
    _umbrella(UmbrellaOptions(samples=1_000, threads=2))


def short() -> None:
    """The run of a report."""
    print("\nMetropolis with MBAR, 4 copies of 400 records")
    _umbrella(UmbrellaOptions(samples=400, threads=2))


def calibration() -> None:
    """Stated errors of short runs of many seeds against their scatter about exact closure."""
    print(f"\nMetropolis with MBAR over {CALIBRATION_RUNS} seeds, 4 copies of 100 sweeps")
    options = UmbrellaOptions(samples=100, burn_in=24, thinning=1, threads=2)
    for name in ("09T15", "08A17"):
        search = find_rings(build_chain(embedded(name)))
        exact = sample_closure(search, ClosureOptions(tolerance=0.005), SEED).minus_lnJ
        runs = [
            umbrella_estimate(search, options, np.random.default_rng(1000 + seed))
            for seed in range(CALIBRATION_RUNS)
        ]
        off = np.array([-run.log_j - exact for run in runs])
        stated = np.array([run.stderr for run in runs])
        mbar = np.array([run.mbar_error for run in runs])
        copies = np.array([run.copies_error for run in runs])
        print(
            f"{name}: mean difference {off.mean():+.3f} +- {off.std(ddof=1) / len(off) ** 0.5:.3f},"
            f" scatter {off.std(ddof=1):.3f}; stated error {np.sqrt(np.mean(stated**2)):.3f} (MBAR "
            f"{np.sqrt(np.mean(mbar**2)):.3f}, copies {np.sqrt(np.mean(copies**2)):.3f}); rms "
            f"difference over stated error {np.sqrt(np.mean((off / stated) ** 2)):.2f}, "
            f"{100 * np.mean(np.abs(off) < stated):.0f} % within one",
            flush=True,
        )


def ring() -> None:
    """Mean energy and shape of closed rings by each kind of move."""
    print("\nClosed rings: energy, expected from equipartition, writhe, radius of gyration in Å")
    chain = build_chain(embedded("09T15"))
    lowest = find_rings(chain).lowest
    expected = lowest.energy_RT + 0.5 * (3 * chain.n_steps - 6)
    for label, options in (
        ("both", ClosedRingOptions()),
        ("crankshafts", ClosedRingOptions(constrained=0)),
        ("constrained", ClosedRingOptions(crankshafts=0, constrained=10)),
    ):
        e = closed_ring_ensemble(chain, lowest, options, SEED)
        print(
            f"  {label:12s} {e.energy_RT.mean:8.2f} +- {e.energy_RT.stderr:.2f} ({expected:.2f})  "
            f"{e.writhe.mean:+.4f} +- {e.writhe.stderr:.4f}  {e.radius_of_gyration_A.mean:.2f} +- "
            f"{e.radius_of_gyration_A.stderr:.2f}  {e.seconds:.1f} s"
        )


TABLES = {"ring": ring, "calibration": calibration, "short": short, "long": long}


def main(names: list[str]) -> None:
    """Print the named tables, or all."""
    warm_up()
    for name in names or TABLES:
        TABLES[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
