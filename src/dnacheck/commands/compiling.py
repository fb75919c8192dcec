"""What is said while kernels compile: at a first use, and never again."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from dnacheck.commands.common import available_processors
from dnacheck.commands.output import note

SILENT = "DNACHECK_AHEAD"
"""Environment variable; at 0 kernels compile where they are used and nothing is said of it."""

_AHEAD = ("ring", "sweep")
_BAR = 30


@contextmanager
def on_compiled(
    finished: Callable[[], None], first: Callable[[], None] | None = None
) -> Iterator[None]:
    """Call ``finished`` for each kernel compiled, and ``first`` before the first one starts.

    A kernel that is loaded from disk is none.
    """
    from numba.core import event

    class Listener(event.Listener):
        started = False

        def on_start(self, event: Any) -> None:
            if not self.started and first is not None:
                self.started = True
                first()

        def on_end(self, event: Any) -> None:
            finished()

    with event.install_listener("numba:compile", Listener()):
        yield


class Bar:
    """One line on standard error, drawn anew on a terminal; elsewhere a line for each quarter."""

    def __init__(self, total: int, quiet: bool) -> None:
        self.count, self._total, self._quarter = 0, total, 0
        self._quiet, self._terminal = quiet, sys.stderr.isatty()
        self._began = time.monotonic()
        self._drawn = 0.0

    def draw(self) -> None:
        """Show how far it is; the count of kernels is known about, so the end waits for the end."""
        if self._quiet:
            return
        share = min(self.count / self._total, 0.99)
        filled = int(_BAR * share)
        text = f"[{'#' * filled}{'.' * (_BAR - filled)}] {share:4.0%} of {self._total} kernels"
        now = time.monotonic()
        if self._terminal and now - self._drawn > 0.1:
            self._drawn = now
            sys.stderr.write(f"\r{text}, {now - self._began:.0f} s")
        elif not self._terminal and (quarter := int(4.0 * share)) >= self._quarter:
            self._quarter = quarter + 1
            sys.stderr.write(f"dnacheck: {text}\n")
        sys.stderr.flush()

    def advance(self) -> None:
        """One more kernel is compiled."""
        self.count += 1
        self.draw()

    def close(self) -> None:
        """Take the line off the terminal and say how long it took."""
        if self._terminal and not self._quiet:
            sys.stderr.write("\r\x1b[K")
        seconds = time.monotonic() - self._began
        note(f"{self.count} kernels compiled in {seconds:.0f} s, and kept", self._quiet)


def compile_ahead(names: tuple[str, ...], processes: int, quiet: bool) -> int:
    """Compile the kernels of jobs of :mod:`dnacheck.commands.ahead`, with a bar; how many."""
    from dnacheck.commands.ahead import JOBS, compile_jobs

    bar = Bar(sum(JOBS[name].kernels for name in names), quiet)
    bar.draw()
    for word in compile_jobs(names, processes):
        if word == "kernel":
            bar.advance()
    bar.close()
    return bar.count


@contextmanager
def announced(command: str, processes: int, quiet: bool) -> Iterator[None]:
    """Say on standard error when a command has to compile, and compile on all processors.

    The kernels of rings are shared out among processes; the kernels of other commands compile
    where they are used.
    """
    if os.environ.get(SILENT) == "0":
        yield
        return

    def first() -> None:
        workers = min(processes, available_processors(), 2)
        if command in _AHEAD and workers > 1:
            from dnacheck.commands.ahead import RING

            note(
                f"compiling the kernels of '{command}' in {workers} processes, once for all runs",
                quiet,
            )
            compile_ahead(RING, workers, quiet)
        else:
            note(
                f"compiling kernels of '{command}', once for all runs; this may take a minute",
                quiet,
            )

    with on_compiled(lambda: None, first):
        yield
