"""Figures of the scan: rate, memory, and equality after kills. Prints; asserts nothing.

python validation/benchmarks/scan.py              rate and kills
python validation/benchmarks/scan.py memory       100,000 records (minutes)
"""

from __future__ import annotations

import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from dnacheck.scanning.scan import ScanOptions, scan

LENGTH = 150


def library(path: Path, count: int) -> Path:
    """A FASTA file of random sequences."""
    rng = np.random.default_rng(11)
    with path.open("w", encoding="ascii") as handle:
        for i in range(count):
            handle.write(f">r{i}\n{''.join(rng.choice(list('ACGT'), LENGTH))}\n")
    return path


def rate(folder: Path) -> None:
    """Sequences a second, warm, on one and two threads."""
    source = library(folder / "rate.fasta", 4000)
    scan(library(folder / "warm.fasta", 20), folder / "warm.csv")
    for threads in (1, 2):
        rates, processors = [], []
        for repeat in range(3):
            began = time.process_time()
            done = scan(source, folder / f"{threads}.{repeat}.csv", ScanOptions(threads=threads))
            rates.append(done.rows / done.seconds)
            processors.append((time.process_time() - began) / done.rows)
        print(
            f"{threads} thread(s): {max(rates):.0f} sequences of {LENGTH} bp a second (best of 3; "
            f"median {np.median(rates):.0f}); {1e3 * min(processors):.2f} ms of processor each, "
            f"so {threads / min(processors):.0f} a second on {threads} idle core(s)"
        )


def kills(folder: Path) -> None:
    """A scan killed ten times at random moments, against an uninterrupted one."""
    source = library(folder / "kills.fasta", 12_000)
    scan(source, folder / "whole.csv", ScanOptions(threads=2))
    output = folder / "killed.csv"
    command = [sys.executable, "-m", "dnacheck", "scan", str(source), "-o", str(output), "--quiet"]
    rng = np.random.default_rng(3)
    killed = 0
    for _ in range(40):
        process = subprocess.Popen(command)
        try:
            process.wait(timeout=rng.uniform(1.5, 3.5) if killed < 10 else None)
            break
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.wait()
            killed += 1
    same = output.read_bytes() == (folder / "whole.csv").read_bytes()
    print(f"killed {killed} times, then finished: the files are {'equal' if same else 'DIFFERENT'}")


def memory(folder: Path) -> None:
    """Largest resident memory after 2,000, 20,000 and 100,000 records of one scan."""
    source = library(folder / "memory.fasta", 100_000)
    done = 0

    def watch(pieces: int) -> None:
        nonlocal done
        for mark in (2_000, 20_000, 100_000):
            if done < mark <= done + pieces:
                size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
                print(f"after {mark} records: {size:.0f} MiB at most", flush=True)
        done += pieces

    summary = scan(source, folder / "memory.csv", ScanOptions(threads=2), watch)
    for line in (folder / "memory.csv").read_text().splitlines()[1:]:
        if not line.endswith(",ok"):
            print(f"not ok: {line}")
    print(f"{summary.rows} rows in {summary.seconds:.0f} s, {summary.failed_rows} without a ring")


TABLES = {"rate": rate, "kills": kills, "memory": memory}


def main(names: list[str]) -> None:
    """Print the tables asked for; by default all but the long one."""
    with tempfile.TemporaryDirectory() as folder:
        for name in names or ["rate", "kills"]:
            TABLES[name](Path(folder))


if __name__ == "__main__":
    main(sys.argv[1:])
