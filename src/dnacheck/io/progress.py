"""Progress of long work, drawn on standard error."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(
    description: str, total: int | None, quiet: bool = False
) -> Iterator[Callable[[int], None]]:
    """Progress bar on standard error, if that is a terminal.

    Parameters
    ----------
    description : str
        What is being done.
    total : int or None
        Number of pieces of work, None if unknown.

    Yields
    ------
    callable
        ``advance(n)``: so many more pieces are done. It may be called from any thread.
    """
    if quiet or not sys.stderr.isatty():
        yield lambda pieces: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(description, total=total)

        def advance(pieces: int) -> None:
            bar.advance(task, pieces)

        yield advance
