"""Figures of a report as SVG text."""

from __future__ import annotations

import io
import re

from dnacheck.validation.report.record import Figure

_PATH = re.compile(r' d="M [^"]*"')
_PRECISE = re.compile(r"\d+\.\d{3,}")


def _compact(svg: str) -> str:
    """The drawing without comments, its paths to a hundredth of a point, which no eye resolves."""

    def number(match: re.Match[str]) -> str:
        return f"{float(match[0]):.2f}".rstrip("0").rstrip(".")

    bare = re.sub(r"<!--.*?-->\n?", "", svg, flags=re.DOTALL)
    return _PATH.sub(lambda path: _PRECISE.sub(number, path[0]).replace("\n", " "), bare)


def draw_svg(figure: Figure) -> list[str]:
    """One drawing per panel of a figure, side by side; equal input gives equal text."""
    import matplotlib
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure as Canvas

    from dnacheck.validation.plots import KINDS

    panels = KINDS[figure.kind]
    drawings = []
    for panel in panels:
        with matplotlib.rc_context({"svg.hashsalt": figure.id, "svg.fonttype": "path"}):
            canvas = Canvas(figsize=(figure.width, figure.height), layout="constrained")
            FigureCanvasSVG(canvas)
            panel(canvas.add_subplot(), figure.data)
            buffer = io.StringIO()
            canvas.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
        text = re.sub(r"^.*?(?=<svg)", "", buffer.getvalue(), flags=re.DOTALL)
        drawings.append(_compact(text))
    return drawings
