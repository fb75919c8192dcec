"""Compiling kernels ahead of their use, in several processes at once.

Compiled kernels are kept on disk, so what one process compiles another one loads. A worker
(``python -m dnacheck.commands.ahead``) reads the names of jobs from standard input; on standard
output it writes ``kernel`` for each kernel that it compiled and ``done`` after each job.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import queue
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_MOLECULE = "11T15"


@dataclass(frozen=True)
class Job:
    """Kernels that one process compiles in a row.

    Attributes
    ----------
    run : callable
        Uses the kernels, in a fraction of a second once they are compiled.
    kernels : int
        How many it compiles when those of ``after`` are there, about.
    after : tuple of str
        Jobs whose kernels these hold; they would be compiled twice otherwise.
    """

    run: Callable[[], None]
    kernels: int
    after: tuple[str, ...] = ()


def _chain() -> Any:
    from dnacheck.io.sequences import read_target
    from dnacheck.model.chain import build_chain

    (molecule,) = read_target(_MOLECULE)
    if isinstance(molecule, Exception):
        raise molecule
    return build_chain(molecule)


def _search_arguments() -> tuple[Any, ...]:
    """Chain, link, arrays of a ring to be found, plan and limits, as the search has them."""
    import numpy as np

    from dnacheck.equilibria.discrete.kernels.newton import N_FIGURES
    from dnacheck.equilibria.discrete.search import search_plan
    from dnacheck.equilibria.discrete.solve import NewtonOptions

    chain = _chain()
    ring = (np.zeros(chain.ground.shape), np.zeros(6), np.zeros(N_FIGURES))
    turns = np.zeros((2, chain.n_steps + 1, 3))
    limits = NewtonOptions().limits._replace(minima_only=True)
    return chain, round(chain.relaxed_turns), ring, turns, search_plan(chain), limits


def _nothing_known(chain: Any) -> Any:
    import numpy as np

    from dnacheck.equilibria.discrete.kernels.registers import KnownRegister

    return KnownRegister(np.zeros((chain.n_steps, 3)), np.zeros((chain.n_steps, 3)), 0.0, -1.0)


def _newton() -> None:
    from dnacheck.equilibria.boundary_kernels import ring_boundary
    from dnacheck.equilibria.discrete.kernels.newton import newton_away

    chain, _, ring, _, _, limits = _search_arguments()
    angles, multipliers, figures = ring
    angles[:] = chain.ground
    known = _nothing_known(chain)
    newton_away(angles, multipliers, chain.arrays, ring_boundary(), limits, known, figures)


def _moves() -> None:
    import numpy as np

    from dnacheck.equilibria.boundary_kernels import ring_boundary
    from dnacheck.equilibria.discrete.kernels.moves import line_search
    from dnacheck.equilibria.discrete.kernels.states import evaluate, new_state

    chain, _, _, _, _, _ = _search_arguments()
    state = new_state(chain.arrays, ring_boundary())
    trial = new_state(chain.arrays, ring_boundary())
    state.angles[:] = chain.ground
    energy = evaluate(state, chain.arrays)
    step, target = np.zeros(chain.ground.shape), np.zeros(6)
    line_search(state, trial, step, 0.0, 1.0, energy, 1.0, target, chain.arrays)


def _registers() -> None:
    import numpy as np

    from dnacheck.equilibria.discrete.kernels.starts import circle_registers

    chain, link, _, turns, _, _ = _search_arguments()
    circle_registers(chain.arrays, link, np.empty(3), turns)


def _cut() -> None:
    from dnacheck.equilibria.discrete.kernels.cut import roll_back, rotated
    from dnacheck.model.cut_kernels import least_rotation

    chain, _, ring, _, _, _ = _search_arguments()
    rotated(chain.arrays, least_rotation(chain.arrays))
    roll_back(chain.arrays, 1, ring[0], ring[1])


def _starts() -> None:
    from dnacheck.equilibria.discrete.kernels.search import from_planar

    chain, link, ring, turns, _, limits = _search_arguments()
    from_planar(chain.arrays, link, 0.0, turns, limits, _nothing_known(chain), ring)


def _as_cut() -> None:
    import numpy as np

    from dnacheck.equilibria.discrete.kernels.newton import N_FIGURES
    from dnacheck.equilibria.discrete.kernels.search import Minima, search_as_cut

    chain, _, _, _, plan, limits = _search_arguments()
    minima = Minima(
        np.empty((4, *chain.ground.shape)),
        np.empty((4, 6)),
        np.empty((4, N_FIGURES)),
        np.zeros(len(plan.links), dtype=bool),
    )
    search_as_cut(chain.arrays, plan, limits, minima)


def _discrete() -> None:
    from dnacheck.equilibria.discrete.search import find_rings

    find_rings(_chain())


def _continuum() -> None:
    from dnacheck.equilibria.bridge.reconstruct import reconstruct
    from dnacheck.equilibria.continuum import lowest_continuum_ring
    from dnacheck.model.rod import build_rod

    reconstruct(lowest_continuum_ring(build_rod(_chain()), "auto").lowest)


def _command(name: str, *arguments: str) -> Callable[[], None]:
    """A command of the command line, run for its kernels alone; ``@`` is a folder of its own."""

    def run() -> None:
        command = importlib.import_module(f"dnacheck.commands.{name}").command
        with tempfile.TemporaryDirectory() as folder:
            there = Path(folder)
            (there / "in.fasta").write_text(">a\n" + "GAAAAAACCGTCTAGGATCC" * 5 + "\n")
            given = [part.replace("@", f"{there}/") for part in arguments]
            command.main([*given, "--quiet"], standalone_mode=False)

    return run


JOBS: Mapping[str, Job] = {
    "newton": Job(_newton, 95),
    "moves": Job(_moves, 30),
    "continuum": Job(_continuum, 35),
    "registers": Job(_registers, 15),
    "cut": Job(_cut, 15, ("newton",)),
    "starts": Job(_starts, 10, ("newton",)),
    "as cut": Job(_as_cut, 15, ("registers", "starts")),
    "discrete": Job(_discrete, 30, ("as cut", "cut")),
    "laplace": Job(_command("jfactor", _MOLECULE, "--method", "laplace"), 30, ("discrete",)),
    "half chains": Job(
        _command("jfactor", _MOLECULE, "--method", "half-chain", "--tolerance", "0.5"), 60
    ),
    "closure": Job(
        _command("jfactor", _MOLECULE, "--method", "metropolis", "--tolerance", "0.5"),
        60,
        ("discrete",),
    ),
    "automatic": Job(_command("jfactor", _MOLECULE, "--tolerance", "0.3"), 60, ("laplace",)),
    "scan": Job(_command("scan", "@in.fasta", "-o", "@out.csv"), 15, ("discrete",)),
    "diagram": Job(_command("diagram", _MOLECULE), 60, ("continuum",)),
}

RING = ("newton", "moves", "continuum", "registers", "cut", "starts", "as cut", "discrete")
"""Jobs of ``dnacheck ring``, in the order of their start."""


def compile_jobs(names: tuple[str, ...], processes: int) -> Iterator[str]:
    """Run jobs in worker processes; those that another one of them waits for come first.

    Yields
    ------
    str
        ``kernel`` each time one is compiled, the name of a job each time one is done. A job that
        fails is done too: its kernels are compiled where they are first used, and fail there.
    """
    events: queue.Queue[tuple[int, str]] = queue.Queue()
    workers = [_start() for _ in range(min(processes, len(names)))]
    threads = [_listen(i, workers[i], events) for i in range(len(workers))]
    waiting, running, done = list(names), dict[int, str](), set[str]()
    alive = set(range(len(workers)))
    try:
        while (waiting or running) and alive:
            for i in sorted(alive - set(running)):
                ready = (n for n in waiting if done.issuperset(set(JOBS[n].after) & set(names)))
                name = next(ready, None)
                if name is None:
                    break
                waiting.remove(name)
                running[i] = name
                pipe = workers[i].stdin
                assert pipe is not None
                with contextlib.suppress(BrokenPipeError):
                    pipe.write(name + "\n")
                    pipe.flush()
            index, word = events.get()
            if word == "kernel":
                yield word
                continue
            if word == "end":
                alive.discard(index)
            finished = running.pop(index, None)
            if finished is not None:
                done.add(finished)
                yield finished
    finally:
        for worker, thread in zip(workers, threads, strict=True):
            worker.kill()
            worker.wait()
            thread.join()
            for pipe in (worker.stdin, worker.stdout):
                assert pipe is not None
                with contextlib.suppress(BrokenPipeError):
                    pipe.close()


def _start() -> subprocess.Popen[str]:
    package = str(Path(__file__).parents[2])
    path = os.pathsep.join(filter(None, (package, os.environ.get("PYTHONPATH"))))
    return subprocess.Popen(
        [sys.executable, "-m", __name__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "PYTHONPATH": path, "DNACHECK_AHEAD": "0"},
    )


def _listen(
    index: int, worker: subprocess.Popen[str], events: queue.Queue[tuple[int, str]]
) -> threading.Thread:
    """A thread that puts what a worker says among the events, and ``end`` when it is gone."""

    def listen() -> None:
        assert worker.stdout is not None
        for line in worker.stdout:
            events.put((index, line.strip()))
        events.put((index, "end"))

    thread = threading.Thread(target=listen, daemon=True)
    thread.start()
    return thread


def _work() -> None:
    """Run the jobs that standard input names."""
    from dnacheck.commands.compiling import on_compiled

    out = sys.stdout

    def say(word: str) -> None:
        out.write(word + "\n")
        out.flush()

    with on_compiled(lambda: say("kernel")):
        for line in sys.stdin:
            # What a job prints is no part of the protocol, and its failure is told by who needs it.
            with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(Exception):
                JOBS[line.strip()].run()
            say("done")


if __name__ == "__main__":
    _work()
