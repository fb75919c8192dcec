"""-ln J of scanned rows against closure sampling, over random molecules. Prints; asserts nothing.

python validation/benchmarks/quick_j.py [molecules]      300 by default, of 60 to 250 bp, three sets
"""

from __future__ import annotations

import random
import sys
import time

import numpy as np

from dnacheck.cyclization.closure.method import ClosureSampling
from dnacheck.cyclization.laplace.isolated import laplace
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.chain import build_chain
from dnacheck.model.sequence import parse_sequence
from dnacheck.numerics.outcome import SolveError
from dnacheck.scanning.scan import COLUMNS, scan_row

SETS = ("trifonov2", "trifonov", "desantis")
TOLERANCE = 0.015


def main(count: int) -> None:
    rng = random.Random(16)
    rows, seconds = [], 0.0
    scan_row("warm", "ACGTTGCATGCCGATAACGT" * 4, {})
    for i in range(count):
        letters = "".join(rng.choice("ACGT") for _ in range(rng.randint(60, 250)))
        angles = SETS[i % 3]
        began = time.process_time()
        row = dict(zip(COLUMNS, scan_row("x", letters, {"angles": angles}), strict=True))
        seconds += time.process_time() - began
        search = find_rings(build_chain(parse_sequence(letters, "x"), angles=angles))
        try:
            sampled = ClosureSampling().compute(search, rng=i, tolerance=TOLERANCE)
            gap = laplace(search).minus_lnJ - sampled.minus_lnJ
        except SolveError as error:
            print(f"left out: {error}")
            continue
        if row["minus_lnJ"] == "":
            print(f"left out: {row['status']} ({letters}, {angles})")
            continue
        quick = float(row["minus_lnJ"]) - sampled.minus_lnJ
        rows.append((len(letters), quick, gap))
        if abs(quick) > 0.2:
            print(f"{quick:+.3f} {row['quality']}, {sampled.status.name}: {angles} {letters}")
    n, quick, gap = np.array(rows).T
    for low, high in ((60, 250), (60, 100), (101, 150), (151, 200), (201, 250)):
        part = (n >= low) & (n <= high)
        for name, values in (("row", quick[part]), ("Laplace", gap[part])):
            print(
                f"{low:3d}-{high} bp, {part.sum():4d} molecules, {name:8s} less closure sampling: "
                f"mean {values.mean():+.3f}, sd {values.std(ddof=1):.3f}, "
                f"largest {np.abs(values).max():.3f}"
            )
    each = seconds / count
    print(f"{1e3 * each:.2f} ms of processor a row: {2.0 / each:.0f} a second on two idle cores")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 300)
