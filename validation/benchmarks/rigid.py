"""Figures of rings of rigid base-pair steps: minima, brute force, speed, J, the limit of hinges.

    python validation/benchmarks/rigid.py [--part minima|brute|speed|long|j|limit] [--count N]

Prints one line a figure and asserts nothing. Times of the two kinds of steps are taken in turns.
"""

from __future__ import annotations

import argparse
import csv
import math
import time

import numpy as np

from dnacheck.cyclization.closure.method import ClosureSampling
from dnacheck.cyclization.half_chain.method import HalfChain
from dnacheck.cyclization.laplace.isolated import laplace
from dnacheck.cyclization.laplace.method import Laplace
from dnacheck.equilibria.discrete.kernels.search import best_register, fill_start
from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
from dnacheck.equilibria.discrete.solve import solve_ring
from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.data_files import data_directory
from dnacheck.model.molecules import embedded, embedded_names
from dnacheck.model.sequence import Sequence

_BRUTE_STARTS = 50


def _random(rng: np.random.Generator, n: int) -> Sequence:
    return Sequence("random", "".join(rng.choice(list("ACGT"), n)))


def minima(count: int) -> None:
    """Another program's minima: the nearest energy of the same link."""
    path = data_directory() / "published" / "rigid_base_pair_rings.csv"
    with path.open(encoding="utf-8") as handle:
        for row in csv.DictReader(handle):
            found = find_rings(build_chain(Sequence("ring", row["sequence"]), "olson1998"))
            gaps = [
                abs(ring.energy_RT - float(row["energy_kT"]))
                for ring in found.equilibria
                if ring.link == int(row["link"])
            ]
            lowest = found.lowest
            print(
                f"minimum {len(row['sequence'])} bp: link {row['link']} off by "
                f"{min(gaps, default=math.inf):.1e} kT; lowest {lowest.energy_RT:.4f} kT, "
                f"link {lowest.link}, residual {lowest.residual:.0e}"
            )


def brute(count: int) -> None:
    """Random sequences: starts at many links and registers find nothing below the search."""
    rng = np.random.default_rng(12)
    lower, worst, unstable, failed = 0, 0.0, 0, 0
    for _ in range(count):
        n = int(rng.integers(60, 401))
        chain = build_chain(_random(rng, n), "olson1998")
        found = find_rings(chain)
        failed += found.failed_starts
        worst = max([worst, *(ring.residual for ring in found.equilibria)])
        unstable += found.lowest.stable is not True
        best = math.inf
        middle = round(chain.relaxed_turns)
        start = np.empty(chain.ground.shape)
        for _ in range(_BRUTE_STARTS):
            link = middle + int(rng.integers(-1, 2))
            fill_start(chain.arrays, link, float(rng.uniform(0.0, 2.0 * math.pi)), start)
            ring = solve_ring(chain, start, throw=False)
            if ring.status.ok and ring.stable:
                best = min(best, ring.energy_RT)
        if best < found.lowest.energy_RT - 1e-6:
            lower += 1
            print(f"  {n} bp: {found.lowest.energy_RT - best:.4f} kT lower: {chain.letters}")
    print(
        f"brute force: {lower} of {count} sequences have a lower minimum in {_BRUTE_STARTS} random "
        f"starts; {unstable} without a stable minimum, {failed} failed starts, largest residual "
        f"{worst:.1e}"
    )


def speed(count: int) -> None:
    """One equilibrium and one search, rigid over wedge, in turns."""
    rng = np.random.default_rng(3)
    ratios: dict[str, list[float]] = {"equilibrium": [], "search": []}
    times: dict[str, list[tuple[float, float]]] = {"equilibrium": [], "search": []}
    for _ in range(count):
        sequence = _random(rng, 155)
        pair = (build_chain(sequence), build_chain(sequence, "olson1998"))
        starts = []
        for chain in pair:
            link = round(chain.relaxed_turns)
            start = np.empty(chain.ground.shape)
            fill_start(chain.arrays, link, best_register(chain.arrays, link), start)
            starts.append(start)
        seconds: dict[str, list[list[float]]] = {"equilibrium": [[], []], "search": [[], []]}
        for _ in range(7):
            for k in range(2):
                began = time.perf_counter()
                solve_ring(pair[k], starts[k], throw=False)
                middle = time.perf_counter()
                find_rings(pair[k], SearchOptions())
                seconds["equilibrium"][k].append(middle - began)
                seconds["search"][k].append(time.perf_counter() - middle)
        for what in seconds:
            wedge, rigid = (min(one) for one in seconds[what])
            ratios[what].append(rigid / wedge)
            times[what].append((wedge, rigid))
    for what, values in ratios.items():
        wedge, rigid = np.median(times[what], axis=0)
        print(
            f"{what} at 155 bp: wedge {1e3 * wedge:.3f} ms, rigid {1e3 * rigid:.3f} ms; ratio "
            f"median {np.median(values):.2f}, from {min(values):.2f} to {max(values):.2f}"
        )


def long(count: int) -> None:
    """Time of a Newton iteration over the number of base pairs."""
    rng = np.random.default_rng(4)
    for n in (155, 1_000, 10_000):
        chain = build_chain(_random(rng, n), "olson1998")
        link = round(chain.relaxed_turns)
        start = np.empty(chain.ground.shape)
        fill_start(chain.arrays, link, best_register(chain.arrays, link), start)
        whole = best = math.inf
        for _ in range(3):
            began = time.perf_counter()
            ring = solve_ring(chain, start, throw=False)
            whole = min(whole, time.perf_counter() - began)
            best = min(best, ring.seconds)
        print(
            f"{n} bp: {1e3 * best:.2f} ms, {ring.iterations} iterations, "
            f"{1e9 * best / max(ring.iterations, 1) / n:.0f} ns a base pair and iteration; with "
            f"link and writhe, whose exact sum is quadratic, {1e3 * whole:.2f} ms; "
            f"residual {ring.residual:.0e}"
        )


def j(count: int) -> None:
    """J by three methods on random sequences."""
    rng = np.random.default_rng(5)
    worst: list[float] = []
    for _ in range(count):
        chain = build_chain(_random(rng, int(rng.integers(110, 181))), "olson1998")
        found = find_rings(chain)
        began = time.perf_counter()
        closure = ClosureSampling().compute(found, rng=1, tolerance=0.02)
        seconds = time.perf_counter() - began
        corrected = Laplace(register=True, order=1).compute(found, rng=2)
        halves = HalfChain(halves=8_000).compute(found, rng=3)
        sigmas = []
        results = (closure, corrected, halves)
        for a, one in enumerate(results):
            for other in results[:a]:
                error = math.hypot(one.total_error, other.total_error)
                sigmas.append(abs(one.minus_lnJ - other.minus_lnJ) / error)
        worst.append(max(sigmas))
        print(
            f"J {chain.n_steps} bp: closure {closure.minus_lnJ:.3f} ± {closure.stderr:.3f} in "
            f"{seconds:.2f} s, corrected Laplace {corrected.minus_lnJ:.3f} ± "
            f"{corrected.total_error:.3f}, half chains {halves.minus_lnJ:.3f} ± "
            f"{halves.total_error:.3f}; {max(sigmas):.1f} combined errors apart"
        )
    print(f"J: {sum(value > 3.0 for value in worst)} of {count} differ by more than 3")


def hinge_limit(chain: Chain, factor: float = 1e8) -> Chain:
    """Rigid steps with the bends and twists of a mid-step chain, translations so much stiffer."""
    n = chain.n_steps
    ground = np.zeros((n, 6))
    # R_theta turns by -theta about d1, R_phi by phi about d2.
    ground[:, :3] = chain.ground * [1.0, -1.0, 1.0]
    ground[:, 5] = 1.0
    stiffness = np.zeros((n, 6, 6))
    stiffness[:, :3, :3] = chain.energy_scale_RT * chain.stiffness
    stiffness[:, [3, 4, 5], [3, 4, 5]] = factor * chain.energy_scale_RT
    return Chain(
        "limit",
        ground,
        stiffness,
        step_form="rigid",
        rise_A=chain.rise_A,
        persistence_length_A=chain.rise_A,
    )


def limit(count: int) -> None:
    """Energies and Laplace's ln J of the eleven molecules as rigid steps and as hinges."""
    for name in embedded_names()[:count]:
        chain = build_chain(embedded(name), step_form="midstep")
        hinges, rigid = find_rings(chain), find_rings(hinge_limit(chain))
        print(
            f"limit {name}: energy {rigid.lowest.energy_RT / hinges.lowest.energy_RT - 1.0:+.1e} "
            f"relative, ln J {laplace(hinges).minus_lnJ - laplace(rigid).minus_lnJ:+.4f}"
        )


PARTS = {"minima": minima, "brute": brute, "speed": speed, "long": long, "j": j, "limit": limit}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--part", choices=[*PARTS, "all"], default="all")
    parser.add_argument("--count", type=int, default=20)
    options = parser.parse_args()
    for name, part in PARTS.items():
        if options.part in (name, "all"):
            part(options.count)
