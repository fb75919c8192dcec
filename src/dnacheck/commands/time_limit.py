"""The time limit of a command, counted from its start and holding also while code is compiled."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import TypeVar

import click

from dnacheck.numerics.outcome import TimeLimitReachedError

Result = TypeVar("Result")

LEFT_BEHIND = "left behind"
"""Name of a thread that goes on after its result was given up."""
_MARGIN = 0.05
_LEAST_MARGIN_SECONDS = 1.0
"""How much longer than its limit a method may take to hand over what it has."""


def within(max_seconds: float | None, work: Callable[[float], Result]) -> Result:
    """Result of work that has to come before the command has run for so long.

    Work that watches the time itself is told the seconds left and returns the best it has. What
    cannot watch it (compilation, a search for rings, one long call of a kernel) goes on in a
    thread that nobody waits for: compiled code cannot be interrupted, only left behind.

    Parameters
    ----------
    max_seconds : float or None
        From the start of the command; None for no limit, and no thread.
    work : callable
        Gets the seconds left when it starts.

    Raises
    ------
    TimeLimitReachedError
        The limit came before the result.
    """
    if max_seconds is None:
        return work(math.inf)
    left = max_seconds - (time.perf_counter() - _start())
    outcome: list[Result] = []
    failure: list[BaseException] = []

    def run() -> None:
        try:
            outcome.append(work(left))
        except BaseException as error:
            failure.append(error)

    if left > 0.0:
        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        try:
            thread.join(left + max(_LEAST_MARGIN_SECONDS, _MARGIN * max_seconds))
        finally:
            thread.name = LEFT_BEHIND
    if failure:
        raise failure[0]
    if not outcome:
        raise TimeLimitReachedError(
            f"stopped at --max-seconds {max_seconds:g} before there was a result; give more "
            "seconds, or the same command again, for code compiled so far is kept"
        )
    return outcome[0]


def _start() -> float:
    """When the command began, on the clock of time.perf_counter."""
    context = click.get_current_context(silent=True)
    began = None if context is None else context.find_root().obj
    return began if isinstance(began, float) else time.perf_counter()
