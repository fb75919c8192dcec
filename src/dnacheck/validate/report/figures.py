"""Figures of a report as SVG text."""

from __future__ import annotations

import io
import re

from dnacheck.validate.sections import Figure


def draw_svg(figure: Figure) -> str:
    """Draw a figure; equal input gives equal text."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure as Canvas

    from dnacheck.validate.plots import KINDS

    panels = KINDS[figure.kind]
    with matplotlib.rc_context({"svg.hashsalt": figure.id, "svg.fonttype": "path"}):
        canvas = Canvas(figsize=(figure.width, figure.height), layout="constrained")
        FigureCanvasSVG(canvas)
        for index, panel in enumerate(panels):
            panel(canvas.add_subplot(1, len(panels), index + 1), figure.data)
        buffer = io.StringIO()
        canvas.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    return re.sub(r"^.*?(?=<svg)", "", text, flags=re.DOTALL)
