"""Speed of the search for rings and of the scan, against another version of the package.

    python validation/benchmarks/search.py [OTHER_SRC]

Both versions run in processes of their own and take turns, molecule set by molecule set, so that
what else the machine does falls on both alike; the figure is the median ratio of processor times.
Without another source tree the times of this one are printed alone.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
from pathlib import Path

_HERE = Path(__file__).resolve().parents[2] / "src"
_ROUNDS = 9
_WORKER = """
import sys, time
import numpy as np
try:
    from dnacheck.scanning.scan import scan_row
    from dnacheck.equilibria.discrete.search import find_rings
    from dnacheck.model.parameters import load_parameters as load
except ImportError:
    from dnacheck.jfactor.scan import scan_row
    from dnacheck.ring.search import find_rings
    from dnacheck.model.parameters import load_angle_set as load
from dnacheck.model.chain import build_chain
from dnacheck.model.sequence import Sequence

jobs = {}
for n, name in ((150, "trifonov2"), (100, "trifonov"), (90, "desantis")):
    rng = np.random.default_rng(5)
    letters = ["".join(rng.choice(list("ACGT"), n)) for _ in range(120)]
    arguments = {"angles": load(name)}
    chains = [build_chain(Sequence("x", text), **arguments) for text in letters]
    jobs[f"scan {n} bp {name}"] = (lambda x, a=arguments: scan_row("x", x, a), letters)
    jobs[f"search {n} bp {name}"] = (find_rings, chains)
for job, items in jobs.values():
    job(items[0])
print("\\t".join(jobs), flush=True)
for line in sys.stdin:
    job, items = jobs[line.strip()]
    began = time.process_time()
    for item in items:
        job(item)
    print(1e3 * (time.process_time() - began) / len(items), flush=True)
"""


def _start(source: Path) -> tuple[subprocess.Popen[str], list[str]]:
    process = subprocess.Popen(
        [sys.executable, "-c", _WORKER],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(source)},
    )
    assert process.stdout is not None
    return process, process.stdout.readline().strip().split("\t")


def _time(process: subprocess.Popen[str], job: str) -> float:
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(job + "\n")
    process.stdin.flush()
    return float(process.stdout.readline())


def main() -> None:
    """Print milliseconds a molecule, and the ratio to the other version."""
    new, jobs = _start(_HERE)
    old = _start(Path(sys.argv[1]))[0] if len(sys.argv) > 1 else None
    for job in jobs:
        mine, theirs = [], []
        for turn in range(_ROUNDS):
            if old is not None and turn % 2:
                theirs.append(_time(old, job))
            mine.append(_time(new, job))
            if old is not None and not turn % 2:
                theirs.append(_time(old, job))
        text = f"{job:24} {min(mine):.3f} ms"
        if theirs:
            ratio = statistics.median(a / b for a, b in zip(mine, theirs, strict=True))
            text += f", other {min(theirs):.3f} ms, ratio {ratio:.3f}"
        print(text, flush=True)
    for process in (new, old):
        if process is not None and process.stdin is not None:
            process.stdin.close()
            process.wait()


if __name__ == "__main__":
    main()
