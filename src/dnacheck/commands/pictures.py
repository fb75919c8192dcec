"""Figures written by commands, without a display and without touching matplotlib's settings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any


def save_figure(path: Path, inches: tuple[float, float], draw: Callable[[Any], None]) -> None:
    """Draw on a new figure and write it; the ending of the name chooses the format.

    Raises
    ------
    InputError
        An ending that is no picture format, or a folder that can't be written to.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from dnacheck.numerics.outcome import InputError

    figure = Figure(figsize=inches, layout="constrained")
    FigureCanvasAgg(figure)
    known = figure.canvas.get_supported_filetypes()
    ending = path.suffix.lstrip(".").lower()
    if ending not in known:
        raise InputError(f"picture '{path}': give a name ending in .png, .svg or .pdf")
    draw(figure)
    try:
        figure.savefig(path, dpi=200)
    except OSError as error:
        raise InputError(f"picture '{path}' can't be written: {error.strerror}") from error
