"""Runs the checks of a plan in worker processes, and survives what they do."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path

from dnacheck.validation.engine.registry import Check, Findings
from dnacheck.validation.engine.state import StateFolder
from dnacheck.validation.engine.verdict import failed
from dnacheck.validation.engine.worker import Job, serve

PATIENCE = 40.0
"""A check is given so many times its usual cost, and at least PATIENCE_FLOOR seconds."""
PATIENCE_FLOOR = 1200.0

Progress = Callable[[Check, Findings, bool], None]


class _Worker:
    """A process and the check it is working on."""

    def __init__(self, job: Job) -> None:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        self.connection: Connection = ours
        self.process: BaseProcess = context.Process(target=serve, args=(job, theirs), daemon=True)
        self.process.start()
        theirs.close()
        self.check: Check | None = None
        self.deadline = 0.0

    def give(self, check: Check) -> None:
        self.check = check
        self.deadline = time.monotonic() + max(PATIENCE_FLOOR, PATIENCE * check.seconds)
        with contextlib.suppress(OSError):  # a dead worker is noticed by its sentinel
            self.connection.send(check.name)

    def end(self) -> None:
        self.connection.close()
        self.process.terminate()
        self.process.join(5.0)
        if self.process.is_alive():
            self.process.kill()
            self.process.join()


@contextlib.contextmanager
def _one_library_thread() -> Iterator[None]:
    """Processes started here let linear algebra use one thread each: the cores are taken."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def run_checks(
    job: Job,
    checks: Sequence[Check],
    processes: int,
    progress: Progress = lambda check, findings, resumed: None,
) -> dict[str, Findings]:
    """Findings of every check by name, computed now or taken from the state folder.

    Costly checks start first. A check that raises, dies or overruns its time fails; the others go
    on. The order of work and the number of processes change no result.
    """
    state = StateFolder(Path(job.state_root), job.state_key)
    done: dict[str, Findings] = {}
    waiting: list[Check] = []
    for check in checks:
        findings = state.load(check.name)
        if findings is None:
            waiting.append(check)
        else:
            done[check.name] = findings
            progress(check, findings, True)
    waiting.sort(key=lambda check: -check.seconds)
    with _one_library_thread():
        workers = [_Worker(job) for _ in range(min(processes, len(waiting)))]
    try:
        while waiting or any(worker.check for worker in workers):
            for index, worker in enumerate(workers):
                if worker.check is None and waiting:
                    if not worker.process.is_alive():
                        worker.end()
                        with _one_library_thread():
                            workers[index] = worker = _Worker(job)
                    worker.give(waiting.pop(0))
            for worker in _events(workers):
                finished = worker.check
                assert finished is not None
                found = _collect(worker, finished, state)
                if found is not None:
                    worker.check = None
                    done[finished.name] = found
                    progress(finished, found, False)
    finally:
        for worker in workers:
            worker.end()
    return done


def _events(workers: Sequence[_Worker]) -> list[_Worker]:
    """Busy workers that answered, died or are late; waits for one."""
    busy = [worker for worker in workers if worker.check is not None]
    timeout = max(0.0, min(worker.deadline for worker in busy) - time.monotonic())
    handles = [handle for w in busy for handle in (w.connection, w.process.sentinel)]
    ready = wait(handles, timeout)
    now = time.monotonic()
    return [
        worker
        for worker in busy
        if worker.connection in ready or worker.process.sentinel in ready or worker.deadline <= now
    ]


def _collect(worker: _Worker, check: Check, state: StateFolder) -> Findings | None:
    """Findings of a worker that answered, died or is late; None if neither holds yet."""
    try:
        if worker.connection.poll():
            worker.connection.recv()
            findings = state.load(check.name)
            if findings is not None:
                return findings
            return _broken(check, state, "left no readable result")
    except (EOFError, OSError):
        pass
    if not worker.process.is_alive():
        worker.process.join()
        code = worker.process.exitcode
        how = f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"
        return _broken(check, state, f"its process ended with {how}")
    if worker.deadline <= time.monotonic():
        worker.process.kill()
        worker.process.join()
        return _broken(check, state, "it overran its time and was stopped")
    worker.process.join(0.05)
    return None


def _broken(check: Check, state: StateFolder, reason: str) -> Findings:
    findings = Findings([failed(f"{check.name}[crash]", check.title, reason)])
    state.save(check.name, findings)
    return findings
