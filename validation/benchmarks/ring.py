"""Speed of discrete rings: one solve, the full search, growth with length, beside solve_bvp.

Run ``python validation/benchmarks/ring.py``. Every figure is the median over warm repetitions in
one process; the machine's load shows in the spread between minimum and median.
"""

from __future__ import annotations

import statistics
import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from dnacheck.equilibria.discrete.kernels.starts import fill_circle
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.equilibria.discrete.solve import solve_ring
from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import embedded, embedded_names
from dnacheck.model.rod import build_rod
from dnacheck.model.sequence import Sequence


def timed(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Minimum and median wall time of a call in milliseconds."""
    work()
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - began))
    return min(times), statistics.median(times)


def molecules() -> None:
    """One solve from the search's own start, and the search, for the eleven molecules."""
    print("molecule   bp  solve ms (min median)  iterations   search ms (min median)  minima")
    for name in embedded_names():
        chain = build_chain(embedded(name))
        found = find_rings(chain)
        ring = found.lowest
        best = None
        for register in np.arange(16) * (np.pi / 8):
            start = np.empty((chain.n_steps, 3))
            fill_circle(chain.ground, 0, ring.link, float(register), start)
            trial = solve_ring(chain, start, throw=False)
            if trial.status.ok and (best is None or trial.iterations < best[0]):
                best = (trial.iterations, start)
        assert best is not None
        start = best[1]
        low, middle = timed(lambda c=chain, s=start: solve_ring(c, s), 200)
        least, median = timed(lambda c=chain: find_rings(c), 50)
        print(
            f"{name:8s} {chain.n_steps:4d}  {low:8.3f} {middle:8.3f}        {best[0]:3d}      "
            f"{least:8.2f} {median:8.2f}          {len(found.equilibria)}"
        )


def growth() -> None:
    """Time per iteration and memory at 1,000 and 10,000 base pairs."""
    print("\n    bp   ms per iteration   peak MB   residual   stable")
    rng = np.random.default_rng(7)
    figures = []
    for n in (1_000, 10_000):
        chain = build_chain(Sequence("random", "".join(rng.choice(list("ACGT"), n))))
        start = np.empty((n, 3))
        fill_circle(chain.ground, 0, round(chain.relaxed_turns), 0.0, start)
        ring = solve_ring(chain, start)
        times = []
        for _ in range(5):
            began = time.perf_counter()
            ring = solve_ring(chain, start)
            times.append(1e3 * (time.perf_counter() - began) / (ring.iterations + 1))
        tracemalloc.start()
        solve_ring(chain, start)
        peak = tracemalloc.get_traced_memory()[1] / 1e6
        tracemalloc.stop()
        figures.append((min(times), peak))
        print(f"{n:6d}   {min(times):12.3f}      {peak:7.2f}   {ring.residual:.1e}   {ring.stable}")
    (t1, m1), (t2, m2) = figures
    print(f"ratio 10,000 to 1,000: time {t2 / t1:.1f}, memory {m2 / m1:.1f}")


def beside_solve_bvp() -> None:
    """The full search beside one solve_bvp call on the same molecule's rod."""
    from oracles import scipy_bvp

    chain = build_chain(embedded("11T15"))
    rod = build_rod(chain)
    began = time.perf_counter()
    scipy_bvp.solve(rod, find_rings(chain).lowest.link, 1e-4)
    peer = 1e3 * (time.perf_counter() - began)
    _, mine = timed(lambda: find_rings(chain), 50)
    print(f"\n11T15: solve_bvp (tol 1e-4) {peer:.0f} ms, full search {mine:.2f} ms", end="")
    print(f", ratio {peer / mine:.0f}")


if __name__ == "__main__":
    molecules()
    growth()
    beside_solve_bvp()
