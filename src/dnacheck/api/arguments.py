"""Checks of arguments that several verbs take; every message names the argument and the mend."""

from __future__ import annotations

import difflib
import math
import numbers
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from dnacheck.numerics.outcome import InputError

Progress = bool | Callable[[int], None]
"""``True`` draws a bar on standard error if that is a terminal; a callable is told the pieces of
work that are done since its last call."""


def positive(name: str, value: Any) -> float:
    """A finite number greater than 0."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise InputError(f"{name} must be a number greater than 0, not {value!r}")
    number = float(value)
    if not (math.isfinite(number) and number > 0.0):
        raise InputError(f"{name} must be a finite number greater than 0, not {number}")
    return number


def positive_or_none(name: str, value: Any) -> float | None:
    """A finite number greater than 0, or None."""
    return None if value is None else positive(name, value)


def whole(name: str, value: Any, least: int) -> int:
    """An integer of at least ``least``."""
    if isinstance(value, bool) or not isinstance(value, numbers.Integral) or value < least:
        raise InputError(f"{name} must be an integer of {least} or more, not {value!r}")
    return int(value)


def one_of(name: str, value: Any, known: Iterable[str]) -> str:
    """One of the names that are known; others are answered with the nearest."""
    names = tuple(known)
    if isinstance(value, str) and value in names:
        return value
    raise InputError(
        f"{name} must be one of {', '.join(names)}, not {value!r}{nearest(value, names)}"
    )


def nearest(value: Any, known: Iterable[str]) -> str:
    """The question after the nearest of the known names, with its punctuation; empty for none."""
    by_lower = {name.lower(): name for name in known}
    close = difflib.get_close_matches(str(value).lower(), by_lower, n=3, cutoff=0.6)
    return f"; did you mean {' or '.join(by_lower[word] for word in close)}?" if close else ""


def thread_count(threads: int | None) -> int:
    """As given, or every processor that this process may use."""
    if threads is None:
        from dnacheck.numerics.processors import available_processors

        return available_processors()
    return whole("threads", threads, 1)


@contextmanager
def told(
    progress: Progress, description: str, total: int | None
) -> Iterator[Callable[[int], None]]:
    """``advance(n)`` of an argument ``progress``: so many more pieces are done."""
    if callable(progress):
        yield progress
        return
    if not isinstance(progress, bool):
        raise InputError(f"progress must be True, False or a callable, not {progress!r}")
    from dnacheck.io.progress import progress_bar

    with progress_bar(description, total, quiet=not progress) as advance:
        yield advance
