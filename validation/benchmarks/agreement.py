"""All methods for J beside each other. Prints; asserts nothing.

    python validation/benchmarks/agreement.py                    all tables
    python validation/benchmarks/agreement.py pairwise           the eleven molecules (minutes)
    python validation/benchmarks/agreement.py homopolymer        straight molecules, 100-500 bp

Seeds are fixed: every number but the seconds is reproducible.
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np

from dnacheck.cyclization.closure.sampling import ClosureOptions, ClosureSampler
from dnacheck.cyclization.half_chain.sampling import HalfChainOptions, half_chain
from dnacheck.cyclization.laplace.anharmonic import AnharmonicOptions, corrected_laplace
from dnacheck.cyclization.laplace.register import register_profile
from dnacheck.cyclization.methods import Umbrella
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.chain import Chain, build_chain, uniform_stiffness
from dnacheck.model.molecules import embedded, embedded_names
from dnacheck.validation.reference.agreement import (
    APPROXIMATE,
    CompareOptions,
    compare_methods,
    differences,
    standard_error,
)
from dnacheck.validation.reference.wormlike_chain import chain_rod_j

SEED = 1
BEST = ("09T15", "08T15", "08A17")
LONG = Umbrella(samples=1_000, burn_in=100)
SHORT = Umbrella(samples=100, burn_in=50, thinning=2)
WIDTHS = {
    "closure": 14,
    "corrected-laplace": 17,
    "half-chain": 14,
    "half-chain-plain": 16,
    "metropolis": 14,
}


def pairwise() -> None:
    """Every method on the eleven molecules, and the largest difference of two."""
    print("\n-ln J by every method; Laplace's two columns are its bias against exact closure")
    print(
        "Metropolis with MBAR: 4 copies of 1,000 records for the three best cyclizers, of 100 for "
        "the rest; plain half chains: 2 x 400,000"
    )
    heads = "".join(f"{name:>{width}}" for name, width in WIDTHS.items())
    print(f"name  {heads}  Laplace  register  largest difference")
    worst, count, beyond = 0.0, 0, 0
    squares = 0.0
    began, used = time.perf_counter(), time.process_time()
    for index, name in enumerate(embedded_names()):
        search = find_rings(build_chain(embedded(name)))
        options = CompareOptions(
            plain_halves=400_000 if name in BEST else 0,
            umbrella=LONG if name in BEST else SHORT,
            threads=2,
        )
        results = compare_methods(search, options, SEED + index)
        cells = ""
        for method, width in WIDTHS.items():
            j = results.get(method)
            text = f"{j.minus_lnJ:.3f}±{standard_error(j):.3f}" if j else "-"
            cells += f"{text:>{width}}"
        best = results["closure"].minus_lnJ
        biases = "".join(f"{results[m].minus_lnJ - best:+9.3f}" for m in APPROXIMATE)
        found = differences(results)
        worst = max(worst, found[0].sigmas)
        count += len(found)
        beyond += sum(pair.sigmas > 3.0 for pair in found)
        squares += sum(pair.sigmas**2 for pair in found)
        print(
            f"{name} {cells}{biases}  {found[0].sigmas:.2f} s.e. "
            f"({found[0].first}, {found[0].second})",
            flush=True,
        )
        if name in BEST:
            seconds = ", ".join(f"{method} {j.seconds:.1f} s" for method, j in results.items())
            print(f"        {seconds}", flush=True)
    print(
        f"{count} pairs: largest difference {worst:.2f} combined standard errors, {beyond} beyond "
        f"3, root mean square {math.sqrt(squares / count):.2f}; "
        f"{time.perf_counter() - began:.0f} s, {time.process_time() - used:.0f} s of processor"
    )


def straight(n: int, turns: float) -> Chain:
    """A homopolymer without bends, of so many relaxed turns."""
    ground = np.tile([2.0 * math.pi * turns / n, 0.0, 0.0], (n, 1))
    return Chain(f"straight {n}", ground, uniform_stiffness(n, 1.5), twist_ratio=1.5)


def _lengthwise() -> None:
    """What of the difference from the rod is the discrete chain's."""
    print("\nThe same length of rod (150 x 3.4 A) in ever shorter steps, 14.29 turns")
    print("steps  register Laplace + 1st term    minus writhe-coupled Shimada-Yamakawa")
    for n in (75, 150, 300, 600):
        ground = np.tile([2.0 * math.pi * 14.29 / n, 0.0, 0.0], (n, 1))
        rise = 3.4 * 150.0 / n
        chain = Chain("rod", ground, uniform_stiffness(n, 1.5), rise_A=rise, twist_ratio=1.5)
        found = corrected_laplace(chain, AnharmonicOptions(tolerance=0.005), SEED)
        rod = chain_rod_j(chain)
        print(
            f"{n:5d} {found.minus_lnJ:18.3f} ± {standard_error(found):.3f} "
            f"{found.minus_lnJ - rod.minus_lnJ_coupled:20.3f}"
        )


def homopolymer() -> None:
    """Straight molecules: Laplace, its first anharmonic term, samplers, the rod."""
    print("\nStraight homopolymers, -ln J; register: register-integrated Laplace")
    print(
        "  bp turns  register    + 1st term        closure          half chain     S-Y     "
        "S-Y+writhe  half chain - (+ 1st term)  half chain - closure"
    )
    largest = 0.0
    for n in (100, 150, 200, 300, 500):
        for turns in (float(round(n / 10.5)), n / 10.5):
            chain = straight(n, turns)
            search = find_rings(chain)
            profile = register_profile(search)
            term = corrected_laplace(profile, AnharmonicOptions(tolerance=0.005), SEED)
            exact = ClosureSampler(profile, ClosureOptions(tolerance=0.005), SEED).sample()
            halves = half_chain(
                search, HalfChainOptions(halves=240_000 if n <= 150 else 120_000, threads=2), SEED
            )
            rod = chain_rod_j(chain)
            apart = halves.minus_lnJ - term.minus_lnJ
            largest = max(largest, abs(apart))
            print(
                f"{n:4d} {turns:5.2f} {-profile.log_j:9.3f} "
                f"{term.minus_lnJ:8.3f} ± {standard_error(term):.3f} "
                f"{exact.minus_lnJ:8.3f} ± {exact.stderr:.3f} "
                f"{halves.minus_lnJ:8.3f} ± {halves.stderr:.3f} "
                f"{rod.minus_lnJ:8.3f} {rod.minus_lnJ_coupled:8.3f} {apart:+16.3f} "
                f"{halves.minus_lnJ - exact.minus_lnJ:+24.3f}",
                flush=True,
            )
    print(
        "largest difference of half chains and register-integrated Laplace with its first term: "
        f"{largest:.3f}"
    )
    _lengthwise()


TABLES = {"homopolymer": homopolymer, "pairwise": pairwise}


def main(names: list[str]) -> None:
    """Print the named tables, or all."""
    for name in names or TABLES:
        TABLES[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
