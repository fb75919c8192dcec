"""Nicked and hinged rings, loops and pulled chains against theory. Prints; asserts nothing.

    python validation/benchmarks/ends.py             all tables
    python validation/benchmarks/ends.py nicked      one of nicked, hinged, turn, pull, one, speed

Seeds are fixed: every number but the seconds is reproducible.
"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import replace

import numpy as np

from dnacheck.cyclization.ensembles.pulled import marko_siggia_extension, pulled_mean
from dnacheck.cyclization.methods import ClosureSampling
from dnacheck.equilibria.boundary import HingedRing, Loop, NickedRing, Pull, Ring
from dnacheck.equilibria.discrete.boundary_search import find_equilibria
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.equilibria.discrete.solve import solve_ring
from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.molecules import embedded, embedded_names
from dnacheck.model.units import thermal_energy_pN_nm

MOLAR = 1e27 / 6.02214076e23
PERSISTENCE_A, RISE_A = 463.0, 3.4


def straight(n: int) -> Chain:
    ground = np.tile([2.0 * math.pi / 10.45, 0.0, 0.0], (n, 1))
    return Chain("straight", ground, np.tile(np.diag([1.5, 1.0, 1.0]), (n, 1, 1)))


def aligned(n: int) -> float:
    """Shimada & Yamakawa, tangents aligned, twist averaged."""
    length, b = n * RISE_A, 2.0 * PERSISTENCE_A
    factor = 4.0 * math.pi**3 * b**3 / length**6
    return -math.log(factor * math.exp(-(math.pi**2) * b / length + 0.514 * length / b) * MOLAR)


def free(n: int) -> float:
    """Shimada & Yamakawa, free ends."""
    length = n * RISE_A
    k = PERSISTENCE_A / length
    return -math.log(112.04 * k**2 * math.exp(0.246 / k - 14.054 * k) / length**3 * MOLAR)


def homopolymer(boundary: NickedRing | HingedRing) -> None:
    form = aligned if isinstance(boundary, NickedRing) else free
    print(f"{boundary.label}: straight homopolymer, -ln J")
    print("   bp    sampled  error  Shimada-Yamakawa  difference")
    for n in (100, 150, 200, 300, 500):
        search = find_equilibria(straight(n), boundary)
        j = ClosureSampling().compute(search, tolerance=0.01, rng=1)
        print(
            f"{n:5d}  {j.minus_lnJ:9.4f}  {j.stderr:.4f}  {form(n):16.4f}  "
            f"{j.minus_lnJ - form(n):+10.4f}"
        )


def turn() -> None:
    """Nicked J against the mean of the ring's J over the first step's twist."""
    print("nicked J against the ring's integrated over the turn of its end, -ln J")
    print("molecule    nicked   error   integral   error   difference/error")
    for name in embedded_names():
        chain = build_chain(embedded(name))
        results = []
        for k in range(12):
            ground = chain.ground.copy()
            ground[0, 0] = 2.0 * math.pi * (k + 0.5) / 12 - math.pi
            results.append(
                ClosureSampling().compute(replace(chain, ground=ground), tolerance=0.02, rng=k)
            )
        total = sum(r.molar for r in results)
        error = math.sqrt(sum((r.molar * r.stderr) ** 2 for r in results)) / total
        search = find_equilibria(chain, NickedRing())
        j = ClosureSampling().compute(search, tolerance=0.006, rng=1)
        mean = -math.log(total / 12)
        print(
            f"{name:8s}  {j.minus_lnJ:8.4f}  {j.stderr:.4f}  {mean:9.4f}  {error:.4f}  "
            f"{(j.minus_lnJ - mean) / math.hypot(error, j.stderr):+17.2f}"
        )


def worm_like_chain(length_A: float, force_pN: float, top: int = 40) -> float:
    """Extension of a worm-like chain clamped along the force at one end, by diagonalisation."""
    kt = thermal_energy_pN_nm()
    level = np.arange(top)
    coupling = (level[:-1] + 1) / np.sqrt((2 * level[:-1] + 1) * (2 * level[:-1] + 3))
    cosine = np.diag(coupling, 1) + np.diag(coupling, -1)
    kinetic = np.diag(level * (level + 1) / (2.0 * PERSISTENCE_A))

    def log_partition(force: float) -> float:
        energies, modes = np.linalg.eigh(kinetic - 0.1 * force / kt * cosine)
        decays = np.exp(-length_A * (energies - energies[0]))
        amplitude = np.sum(modes[0] * decays * (np.sqrt(2 * level + 1) @ modes))
        return float(np.log(amplitude) - length_A * energies[0])

    h = 1e-4 * force_pN
    slope = (log_partition(force_pN + h) - log_partition(force_pN - h)) / (2.0 * h)
    return 10.0 * kt * slope


def pull() -> None:
    print("pull: straight homopolymer of 1,000 bp, extension in \u00c5")
    print("   pN    sampled   error      exact  difference  Marko-Siggia")
    for force, populations in ((0.1, 100), (0.3, 60), (1.0, 20), (3.0, 16), (10.0, 16)):
        mean = pulled_mean(straight(1000), Pull(force), populations=populations, rng=1)
        exact = worm_like_chain(1000 * RISE_A, force)
        formula = marko_siggia_extension(1000 * RISE_A, PERSISTENCE_A, Pull(force))
        print(
            f"{force:5.1f}  {mean.extension_A:9.2f}  {mean.extension_stderr_A:6.2f}  "
            f"{exact:9.2f}  {mean.extension_A / exact - 1.0:+9.3%}  {formula:12.2f}"
        )


def one(rounds: int = 40) -> None:
    """One equilibrium of each kind, from as far from its minimum; least times."""
    print("time of one equilibrium over the ring's, from 0.01 rad beside it, least of the rounds")
    boundaries = {"ring": Ring(), "nicked": NickedRing(), "loop": Loop((20.0, 0.0, 10.0))}
    boundaries["hinged"] = HingedRing()
    for name in embedded_names()[:4]:
        chain = build_chain(embedded(name))
        beside = 0.01 * np.sin(np.arange(chain.n_steps))[:, None]
        starts = {
            k: find_equilibria(chain, b).lowest.angles + beside for k, b in boundaries.items()
        }
        least = dict.fromkeys(boundaries, math.inf)
        for _ in range(rounds):
            for label, boundary in boundaries.items():
                seconds = solve_ring(chain, starts[label], boundary=boundary).seconds
                least[label] = min(least[label], seconds)
        text = "  ".join(f"{k} {v / least['ring']:.2f}" for k, v in least.items() if k != "ring")
        print(f"{name:8s} ring {1e3 * least['ring']:.2f} ms;  {text}")


def speed(rounds: int = 15) -> None:
    """Searches beside each other, in turn; the median of the ratios to the ring's."""
    print("time of a search over the ring's, median over molecules and rounds")
    ratios: dict[str, list[float]] = {"nicked": [], "hinged": [], "loop": []}
    beside = Loop(position_A=(20.0, 0.0, 10.0))
    for round_ in range(rounds + 1):
        for name in embedded_names()[:4]:
            chain = build_chain(embedded(name))
            seconds = {}
            for label, boundary in (
                ("ring", None),
                ("nicked", NickedRing()),
                ("hinged", HingedRing()),
                ("loop", beside),
            ):
                began = time.perf_counter()
                if boundary is None:
                    find_rings(chain)
                else:
                    find_equilibria(chain, boundary)
                seconds[label] = time.perf_counter() - began
            if round_ > 0:  # the first compiles
                for label, values in ratios.items():
                    values.append(seconds[label] / seconds["ring"])
    for label, values in ratios.items():
        print(f"{label:8s} {np.median(values):6.2f}")


TABLES = {
    "nicked": lambda: homopolymer(NickedRing()),
    "hinged": lambda: homopolymer(HingedRing()),
    "turn": turn,
    "pull": pull,
    "one": one,
    "speed": speed,
}

if __name__ == "__main__":
    for table in sys.argv[1:] or TABLES:
        TABLES[table]()
        print()
