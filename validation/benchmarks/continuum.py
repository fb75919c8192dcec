"""Figures of the continuum rings: accuracy, time, meshes. Prints; asserts nothing.

    python validation/benchmarks/continuum.py             all tables
    python validation/benchmarks/continuum.py speed mesh  some of them

Times are the best and the median of repeated calls on one core, kernels compiled beforehand.
"""

from __future__ import annotations

import csv
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from oracles import scipy_bvp

from dnacheck.equilibria.bridge.reconstruct import reconstruct, rms_difference
from dnacheck.equilibria.continuum import (
    ContinuumOptions,
    lowest_continuum_ring,
    solve_continuum_ring,
)
from dnacheck.equilibria.continuum.collocation import aligned_mesh, discretise
from dnacheck.equilibria.continuum.state import (
    new_state,
    register_roll,
    run_newton,
    start_from_perfect_ring,
)
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.data_files import data_directory
from dnacheck.model.molecules import embedded, embedded_names
from dnacheck.model.rod import Rod, RodOptions, build_rod
from dnacheck.model.sequence import Sequence


def milliseconds(call: Callable[[], object], repeats: int = 40) -> tuple[float, float]:
    """Best and median time of a call."""
    call()
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - began))
    return min(times), statistics.median(times)


def chains() -> dict[str, Chain]:
    return {name: build_chain(embedded(name)) for name in embedded_names()}


def table_two() -> None:
    """Table II beside the computed energies, at w = 15 (the text) and w = 20 (the rms column)."""
    with open(data_directory() / "published" / "table2_ring_energies.csv", newline="") as file:
        published = {row["name"]: row for row in csv.DictReader(file)}
    print("\nTable II: energy against the published continuum, gap to the discrete, rms in Å")
    print(
        "name     E(15,20,6)  vs paper   gap     rms    E(20,20,6)  vs paper   gap     rms   paper"
    )
    for name, chain in chains().items():
        discrete = find_rings(chain).lowest
        line = f"{name:8s}"
        for width in (15, 20):
            ring = lowest_continuum_ring(build_rod(chain, RodOptions(filter_width=width))).lowest
            paper = float(published[name]["E_continuum_reduced"])
            rms = rms_difference(reconstruct(ring).centres, discrete.centres, chain.rise_A)
            line += (
                f" {ring.energy:10.6f} {100 * (ring.energy / paper - 1):+8.3f}%"
                f" {100 * (ring.energy / discrete.energy - 1):+7.3f}% {rms:6.3f} "
            )
        print(line + f"  {published[name]['rms_configuration_difference_angstrom']}")


def speed() -> None:
    """One equilibrium at 1e-4 relative energy error, beside solve_bvp at equal error."""
    print("\nOne equilibrium, rod given; error against a solution good to 1e-10")
    print("name      best    median ms  error    K    solve_bvp: ms     error   nodes   ratio")
    wanted = ContinuumOptions(energy_tolerance=1e-4)
    for name, chain in chains().items():
        rod = build_rod(chain)
        link = lowest_continuum_ring(rod).lowest.link
        fine = ContinuumOptions(degree=8, energy_tolerance=1e-10)
        exact = solve_continuum_ring(rod, link, options=fine).energy
        ring = solve_continuum_ring(rod, link, options=wanted)
        best, median = milliseconds(
            lambda r=rod, k=link: solve_continuum_ring(r, k, options=wanted)
        )
        oracle, oracle_ms = _equal_error(rod, link, exact, abs(ring.energy / exact - 1.0))
        print(
            f"{name:8s} {best:6.2f}  {median:6.2f}     {abs(ring.energy / exact - 1):.0e} "
            f"{ring.curve.intervals:4d}      {oracle_ms:8.1f}     "
            f"{abs(oracle.energy / exact - 1):.0e} "
            f"{oracle.nodes:6d}   {oracle_ms / median:6.0f}"
        )


def _equal_error(
    rod: Rod, link: int, exact: float, error: float
) -> tuple[scipy_bvp.OracleRing, float]:
    """The loosest solve_bvp run of the error asked for (or 1e-4), and its time."""
    for tol in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
        began = time.perf_counter()
        oracle = scipy_bvp.solve(rod, link, tol=tol, nodes=20)
        took = 1e3 * (time.perf_counter() - began)
        if oracle.success and abs(oracle.energy / exact - 1.0) <= max(error, 1e-4):
            break
    return oracle, took


def oracle() -> None:
    """Energies against solve_bvp at tol 1e-8."""
    print("\nSame rod, solve_bvp at tol 1e-8")
    print("name     energy            difference   error estimate")
    for name, chain in chains().items():
        rod = build_rod(chain)
        link = lowest_continuum_ring(rod).lowest.link
        options = ContinuumOptions(energy_tolerance=1e-8)
        ring = solve_continuum_ring(rod, link, options=options)
        other = scipy_bvp.solve(rod, link, tol=1e-8)
        print(
            f"{name:8s} {ring.energy:.12f}  {ring.energy / other.energy - 1:+.1e}      "
            f"{(ring.curve.energy_error or 0.0) / ring.energy:.1e}"
        )


def mesh() -> None:
    """Largest change of energy over meshes and degrees (Section VIII)."""
    print("\nLargest |E/E_fine - 1| over the eleven molecules, fixed meshes")
    print("degree " + "".join(f"{k:>10d}" for k in (15, 20, 30, 45, 60)) + "  intervals")
    rods = [build_rod(chain) for chain in chains().values()]
    links = [lowest_continuum_ring(rod).lowest.link for rod in rods]
    fine = ContinuumOptions(degree=8, energy_tolerance=1e-10)
    exact = [
        solve_continuum_ring(rod, link, options=fine).energy
        for rod, link in zip(rods, links, strict=True)
    ]
    for degree in (3, 4, 5, 6):
        row = []
        for intervals in (15, 20, 30, 45, 60):
            options = ContinuumOptions(intervals=intervals, degree=degree, adapt=False)
            row.append(
                max(
                    abs(solve_continuum_ring(rod, link, options=options).energy / e - 1.0)
                    for rod, link, e in zip(rods, links, exact, strict=True)
                )
            )
        print(f"{degree:5d}  " + "".join(f"{value:10.1e}" for value in row))


def stages() -> None:
    """Time of each stage, and of one Newton iteration."""
    chain = chains()["11T15"]
    rod = build_rod(chain)
    print("\n11T15, best and median ms")
    print("rod                   {:8.3f} {:8.3f}".format(*milliseconds(lambda: build_rod(chain))))
    print(
        "search, all equilibria{:8.3f} {:8.3f}".format(
            *milliseconds(lambda: lowest_continuum_ring(rod))
        )
    )
    ring = lowest_continuum_ring(rod).lowest
    print("reconstruction        {:8.3f} {:8.3f}".format(*milliseconds(lambda: reconstruct(ring))))
    print(
        "solution at 160 points{:8.3f} {:8.3f}".format(
            *milliseconds(lambda: ring.curve.solution(np.linspace(0.0, 1.0, 160)))
        )
    )
    options = ContinuumOptions(max_iterations=1, tolerance=1e-13)
    for intervals, degree in ((14, 4), (30, 6), (50, 4)):
        disc = discretise(rod, aligned_mesh(rod.breaks, intervals), degree)
        state = new_state(disc)
        start_from_perfect_ring(state, ring.curve.alpha, register_roll(disc, ring.curve.alpha))
        run_newton(state, disc.coefficients(), ring.curve.alpha, ContinuumOptions())
        coefficients = disc.coefficients()
        best, median = milliseconds(
            lambda s=state, c=coefficients: run_newton(s, c, ring.curve.alpha, options), 400
        )
        print(f"sweep, {intervals} x {degree}        {best:8.3f} {median:8.3f}")


def sample() -> None:
    """Random sequences: does the search agree with the discrete one, and how long does it take."""
    print("\n25 random sequences of 60-400 bp per twist ratio, three angle sets")
    print("K3/K1   unstable  gap to discrete: median  largest   ms: median  largest")
    for ratio in (0.05, 0.2, 0.5, 1.5, 5.0, 20.0):
        rng = np.random.default_rng(1)
        gaps, times, unstable = [], [], 0
        for j in range(25):
            letters = "".join(rng.choice(list("ACGT"), int(rng.integers(60, 401))))
            angles = ("trifonov2", "trifonov", "desantis")[j % 3]
            chain = build_chain(Sequence(f"random-{j}", letters), angles, ratio)
            rod = build_rod(chain)
            began = time.perf_counter()
            ring = lowest_continuum_ring(rod).lowest
            times.append(1e3 * (time.perf_counter() - began))
            unstable += ring.stable is False
            gaps.append(abs(ring.energy / find_rings(chain).lowest.energy - 1.0))
        print(
            f"{ratio:5.2f}   {unstable:5d}     {100 * np.median(gaps):16.3f}%  "
            f"{100 * max(gaps):8.3f}%  {np.median(times):8.1f}  {max(times):8.1f}"
        )


TABLES = {
    "table2": table_two,
    "speed": speed,
    "stages": stages,
    "mesh": mesh,
    "oracle": oracle,
    "sample": sample,
}


def main(names: list[str]) -> int:
    unknown = [name for name in names if name not in TABLES]
    if unknown:
        print(f"unknown table {unknown[0]}: choose from {', '.join(TABLES)}", file=sys.stderr)
        return 2
    for name in names or TABLES:
        TABLES[name]()
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
