"""Windows of genomes: the figures of docs/howto/scan_genome.md.

Run: python validation/benchmarks/windows.py NAME
with NAME one of throughput, exactness, overhead, scaling, memory, parquet.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from dnacheck.scanning.batch import Plan
from dnacheck.scanning.pieces import Piece, Settings, WindowOptions, plain_arguments
from dnacheck.scanning.scan import scan_row
from dnacheck.scanning.windows import WindowScanner, letter_codes
from dnacheck.scanning.workers import crew

PLAIN = {"a_tracts": "none"}


def letters(count: int, seed: int = 1) -> str:
    """Random letters."""
    return "".join(np.random.default_rng(seed).choice(list("ACGT"), count))


def throughput() -> None:
    """Windows of 150 bp, step 1, beside unrelated molecules of 150 bp; one core, in turns."""
    arguments = plain_arguments({})
    scanner = WindowScanner(150, arguments)
    text = letters(12_149)
    codes = letter_codes(text)
    molecules = [letters(150, 100 + k) for k in range(1000)]
    scanner.scan(codes[:400])
    scan_row("warm", molecules[0], arguments)
    ratios = []
    for _ in range(5):
        began = time.process_time()
        found = scanner.scan(codes)
        windows = len(found.start) / (time.process_time() - began)
        began = time.process_time()
        for molecule in molecules:
            scan_row("m", molecule, arguments, laplace=True)
        unrelated = len(molecules) / (time.process_time() - began)
        ratios.append((windows, unrelated, windows / unrelated))
        print(
            f"windows {windows:6.0f}/s   unrelated {unrelated:5.0f}/s   "
            f"ratio {windows / unrelated:.2f}   searches {found.searches}"
        )
    print("medians:", *(f"{value:.2f}" for value in np.median(ratios, axis=0)))


def exactness(count: int = 10_000) -> None:
    """Followed rings against a full search of every window."""
    for seed, name in ((1, "trifonov2"), (3, "trifonov"), (4, "desantis")):
        scanner = WindowScanner(150, {**PLAIN, "angles": name})
        codes = letter_codes(letters(count + 149, seed))
        full, ours = scanner.scan(codes, every=1), scanner.scan(codes)
        energy = np.abs(ours.energy_RT - full.energy_RT) > 1e-8 * full.energy_RT
        gap = np.abs(ours.minus_lnJ - full.minus_lnJ)
        print(
            f"{name}: {count} windows, energy differs in {energy.sum()}, ours lower in "
            f"{(ours.energy_RT < full.energy_RT * (1 - 1e-8)).sum()}; -ln J differs by more than "
            f"1e-3 in {(gap > 1e-3).sum()}, at most by {np.nanmax(gap):.3f}; "
            f"{ours.searches} searches, {ours.repaired} windows redone"
        )


def _null(settings: Settings, piece: Piece) -> int:
    return piece.number


def overhead(pieces: int = 400) -> None:
    """What Dask costs a window: pieces of 16,384 windows with nothing to compute."""
    import distributed

    text = letters(16_384 + 149)
    with (
        distributed.LocalCluster(2, threads_per_worker=1, dashboard_address=None) as local,
        distributed.Client(local) as client,
    ):
        pool = client.get_executor(pure=False)
        settings = client.scatter([Settings(plain_arguments({}), None)], broadcast=True)[0]
        pool.submit(_null, settings, Piece(0, "c", 0, text)).result()
        began = time.perf_counter()
        tasks = [pool.submit(_null, settings, Piece(k, "c", 0, text)) for k in range(pieces)]
        for task in tasks:
            task.result()
        seconds = (time.perf_counter() - began) / pieces
    scanner = WindowScanner(150, plain_arguments({}))
    codes = letter_codes(text[:4245])
    scanner.scan(codes[:400])
    began = time.perf_counter()
    scanner.scan(codes)
    window = (time.perf_counter() - began) / 4096
    print(
        f"{1e3 * seconds:.2f} ms a piece of 16,384 windows, {1e6 * seconds / 16_384:.3f} us a "
        f"window; a window takes {1e6 * window:.0f} us: {seconds / 16_384 / window:.2%}"
    )


def scaling(pieces: int = 24) -> None:
    """One worker against two, pieces of 4,096 windows, after both have compiled."""
    options = WindowOptions(150, piece=4096)
    settings = Settings(plain_arguments(PLAIN), options)
    text = letters(4096 + 149)
    work = [Piece(k, "c", 0, text) for k in range(pieces)]
    seconds = {}
    for workers in (1, 2, 1, 2):
        with crew(1, workers, None) as team:
            list(team.run(settings, work[: 2 * workers]))
            began = time.perf_counter()
            list(team.run(settings, work))
            taken = time.perf_counter() - began
        seconds[workers] = min(taken, seconds.get(workers, np.inf))
        print(f"{workers} worker(s): {taken:.2f} s")
    print(f"efficiency of two: {seconds[1] / (2.0 * seconds[2]):.2f}")


def memory(megabases: int = 12) -> None:
    """Peak resident size of a scan of a made-up genome, early and at its end."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "genome.fa"
        with path.open("w") as handle:
            handle.write(">c\n")
            for k in range(megabases):
                handle.write(letters(1_000_000, k) + "\n")
        for end in (1_000_000, 1_000_000 * megabases):
            code = (
                "import resource, sys; from dnacheck.cli import main; "
                f"main(['scan', {str(path)!r}, '--window', '150', '--step', '400', "
                "'--piece', '41', '--threads', "
                f"'1', '--quiet', '-o', {str(Path(folder) / f'o{end}.parquet')!r}, '--region', "
                f"'c:1-{end}']); print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
            )
            done = subprocess.run(
                [sys.executable, "-c", code], capture_output=True, text=True, check=True
            )
            print(f"{end / 1e6:.0f} Mbp: peak {int(done.stdout) / 1024:.0f} MiB")


def parquet() -> None:
    """Bytes a row of each form of output."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "genome.fa"
        path.write_text(f">c\n{letters(16_384 + 149)}\n")
        from dnacheck.scanning.batch import run

        outputs = [Path(folder) / f"o.{kind}" for kind in ("parquet", "csv", "bedgraph", "bw")]
        summary = run(Plan.of(path, dict(PLAIN), WindowOptions(150)), outputs)
        for output in outputs:
            files = output.iterdir() if output.is_dir() else [output]
            size = sum(file.stat().st_size for file in files)
            print(f"{output.suffix}: {size / summary.rows:.1f} bytes a row")
    print(f"peak of this process {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024} MiB")


if __name__ == "__main__":
    {f.__name__: f for f in (throughput, exactness, overhead, scaling, memory, parquet)}[
        sys.argv[1]
    ]()
