"""The process in which checks run: takes names, leaves findings in the state folder."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
import traceback
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path

from dnacheck.validation.engine.context import Context, seed_of
from dnacheck.validation.engine.registry import Findings, Level, find_check
from dnacheck.validation.engine.state import StateFolder
from dnacheck.validation.engine.verdict import failed
from dnacheck.validation.scene.scene import Scene


@dataclass(frozen=True)
class Job:
    """What a worker needs to know once."""

    scene: Scene
    level: Level
    seed: int
    state_root: str
    state_key: str


def perform(job: Job, name: str) -> Findings:
    """Run one check; an exception is that check's failure."""
    check = find_check(name)
    seed = seed_of(name, job.seed)
    began = time.perf_counter()
    try:
        findings = check.run(Context(job.scene, job.level, seed))
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(where.filename).name}:{where.lineno}"
        words = " ".join(f"{type(error).__name__}: {error}".split())
        findings = Findings([failed(f"{name}[crash]", check.title, f"{words} ({place})")])
    seconds = time.perf_counter() - began
    share = seconds / max(len(findings.results), 1)
    results = [replace(item, seconds=share, seed=seed) for item in findings.results]
    return Findings(results, findings.blocks)


def serve(job: Job, connection: Connection) -> None:
    """Run checks by name until the connection closes."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    state = StateFolder(Path(job.state_root), job.state_key)
    while True:
        try:
            name = connection.recv()
        except (EOFError, OSError):
            return
        state.save(name, perform(job, name))
        try:
            connection.send(name)
        except (BrokenPipeError, OSError):
            return


def _end_with_parent() -> None:
    """A killed run must not leave its workers behind."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
