"""Figures of the half chains: plain, tilted, windows, straight molecules. Prints; asserts nothing.

    python validation/benchmarks/half_chain.py                all tables
    python validation/benchmarks/half_chain.py eleven plain   some of them

Times are wall times of one call on one core, kernels compiled beforehand.
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np

from dnacheck.cyclization.half_chain.sampling import HalfChainOptions, half_chain_estimate
from dnacheck.cyclization.half_chain.window import HalfChainEstimate
from dnacheck.cyclization.laplace.isolated import laplace
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.equilibria.ring import Equilibria
from dnacheck.model.chain import Chain, build_chain, uniform_stiffness
from dnacheck.model.molecules import embedded, embedded_names
from dnacheck.validation.reference.wormlike_chain import chain_rod_j

SEED = 1
BEST = ("09T15", "08T15", "08A17")


def timed(search: Equilibria, options: HalfChainOptions) -> tuple[HalfChainEstimate, float]:
    """One estimate and its seconds."""
    began = time.perf_counter()
    estimate = half_chain_estimate(search, options, np.random.default_rng(SEED))
    return estimate, time.perf_counter() - began


def warm_up() -> None:
    """Compile every kernel."""
    search = find_rings(build_chain(embedded("09T15")))
    half_chain_estimate(search, HalfChainOptions(halves=400), np.random.default_rng(0))


def eleven() -> None:
    """Tilted half chains beside Laplace on the eleven molecules."""
    print("\nEleven molecules, 2 x 20,000 tilted half chains")
    print("name    -ln J   s.e.   bias (s.e.)      k  effective  tilts  Laplace - this  seconds")
    for name in embedded_names():
        search = find_rings(build_chain(embedded(name)))
        e, seconds = timed(search, HalfChainOptions())
        tail = math.nan if e.pareto_shape is None else e.pareto_shape
        print(
            f"{name} {-e.log_j:8.3f} {e.stderr:6.3f} {e.bias:+7.3f} ({e.bias_stderr:.3f})"
            f" {tail:6.2f}"
            f" {e.effective_halves:9.0f} {e.tilts:6d} {laplace(search).minus_lnJ + e.log_j:13.2f}"
            f" {seconds:10.2f}"
        )


def plain() -> None:
    """Plain beside tilted on the three best cyclizers."""
    print("\nPlain (2 x 400,000) and tilted (2 x 40,000) half chains")
    for name in BEST:
        search = find_rings(build_chain(embedded(name)))
        tilted, _ = timed(search, HalfChainOptions(halves=40_000))
        free, seconds = timed(search, HalfChainOptions(halves=400_000, tilted=False))
        error = math.hypot(tilted.stderr, free.stderr)
        print(
            f"{name}: plain {-free.log_j:.3f} +- {free.stderr:.3f} ({seconds:.0f} s), tilted "
            f"{-tilted.log_j:.3f} +- {tilted.stderr:.3f}: "
            f"{abs(free.log_j - tilted.log_j) / error:.2f} standard errors apart"
        )


def windows() -> None:
    """Estimates without extrapolation, and with it, against the window's radius."""
    print("\nWindows of 09T15: radius, -ln J without extrapolation")
    search = find_rings(build_chain(embedded("09T15")))
    for radius in (0.45, 0.6, 0.9):
        e, _ = timed(search, HalfChainOptions(radius=radius))
        for w in e.windows:
            print(f"  {w.radius:.3f} {-w.log_j:8.3f} +- {w.stderr:.3f} ({w.pairs} pairs)")
        print(f"  to zero from {radius}: {-e.log_j:.3f} +- {e.stderr:.3f}")


def straight() -> None:
    """Straight homopolymers beside Shimada-Yamakawa without and with bend-twist coupling."""
    print("\nStraight molecules: half chain, Shimada-Yamakawa, the same with the writhe's variance")
    for n in (100, 200, 300, 500):
        for turns in (float(round(n / 10.5)), n / 10.5):
            ground = np.tile([2.0 * math.pi * turns / n, 0.0, 0.0], (n, 1))
            chain = Chain("straight", ground, uniform_stiffness(n, 1.5))
            e, seconds = timed(find_rings(chain), HalfChainOptions(halves=40_000))
            rod = chain_rod_j(chain)
            print(
                f"  {n} bp, {turns:6.2f} turns: {-e.log_j:7.3f} +- {e.stderr:.3f}  "
                f"{rod.minus_lnJ:7.3f}  {rod.minus_lnJ_coupled:7.3f}  ({seconds:.1f} s)"
            )


TABLES = {"eleven": eleven, "plain": plain, "windows": windows, "straight": straight}


def main(names: list[str]) -> None:
    """Print the named tables, or all."""
    warm_up()
    for name in names or TABLES:
        TABLES[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
