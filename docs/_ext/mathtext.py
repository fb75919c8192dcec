"""Formulas as SVG drawn by matplotlib, so that no page loads a script for them.

A display formula may have several lines, separated by ``\\\\``; each is set by itself.
"""

from __future__ import annotations

import html
import re
from functools import cache
from typing import Any

from docutils import nodes
from matplotlib import rc_context
from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import MathTextParser
from matplotlib.path import Path as Outline
from matplotlib.textpath import TextPath
from sphinx.util import logging

LOG = logging.getLogger(__name__)
SIZE = 100.0
"""Size in points at which outlines are made; one em of the page."""
MARGIN = 3.0
"""Space around a formula, so that no stroke is cut."""
_LETTERS = {Outline.MOVETO: "M", Outline.LINETO: "L", Outline.CURVE3: "Q", Outline.CURVE4: "C"}


_ARGUMENTS = {
    name: count
    for count, names in (
        (1, "mathbf mathrm mathsf mathcal sqrt hat bar dot vec tilde"),
        (2, "frac"),
    )
    for name in names.split()
}
_NAMES = {"le": "leq", "ge": "geq", "tfrac": "frac", "dfrac": "frac", "lvert": "vert"}
_SIZES = re.compile(r"\\(?:big|Big|bigg|Bigg)[lr]?(?![A-Za-z])")
_TOKEN = re.compile(r"\s*(\\[A-Za-z]+|\\.|[^\s{}\[])")


def normalised(latex: str) -> str:
    r"""LaTeX as mathtext reads it: ``\frac\phi2`` becomes ``\frac{\phi}{2}``; no sizes."""
    text = _SIZES.sub("", " ".join(latex.split()))
    text = re.sub(r"\\([A-Za-z]+)", lambda found: "\\" + _NAMES.get(found[1], found[1]), text)
    # From the right, so that an argument that is itself a command has its own braces already.
    for found in reversed(list(re.finditer(r"\\([A-Za-z]+)", text))):
        end = found.end()
        for _ in range(_ARGUMENTS.get(found[1], 0)):
            token = _TOKEN.match(text, end)
            if token is None:
                end = _after_group(text, end)
                continue
            stop = token.end()
            for _ in range(_ARGUMENTS.get(token[1][1:], 0)):
                stop = _after_group(text, stop)
            inside = "{" + text[token.start(1) : stop] + "}"
            text = text[:end] + inside + text[stop:]
            end += len(inside)
    return text


def _after_group(text: str, start: int) -> int:
    """Position after the braced group that begins at or after ``start``."""
    depth = 0
    for place in range(start, len(text)):
        depth += {"{": 1, "}": -1}.get(text[place], 0)
        if depth == 0 and text[place] == "}":
            return place + 1
    return len(text)


@cache
def _drawn(latex: str) -> tuple[float, float, float, str]:
    """Width, height above and depth below the baseline in 1/SIZE em, and SVG path data."""
    with rc_context({"mathtext.fontset": "stix"}):
        font = FontProperties(family="STIXGeneral", size=SIZE)
        width = float(MathTextParser("path").parse(f"${latex}$", dpi=72, prop=font).width)
        outline = TextPath((0, 0), f"${latex}$", prop=font)
    pieces = []
    for points, code in outline.iter_segments(curves=True, simplify=False):
        if code == Outline.CLOSEPOLY:
            pieces.append("Z")
        else:
            turned = (f"{-p if i % 2 else p:.1f}" for i, p in enumerate(points))
            pieces.append(_LETTERS[code] + " ".join(turned))
    extents = outline.get_extents()
    return width, max(extents.y1, 0.0), max(-extents.y0, 0.0), "".join(pieces)


def svg(latex: str) -> str:
    """An ``<svg>`` whose baseline sits on that of the text."""
    width, height, depth, path = _drawn(normalised(latex))
    wide, tall = width + 2.0 * MARGIN, height + depth + 2.0 * MARGIN
    return (
        f'<svg class="math" role="img" aria-label="{html.escape(latex, quote=True)}" '
        f'viewBox="{-MARGIN:g} {-height - MARGIN:.1f} {wide:.1f} {tall:.1f}" '
        f'style="height:{tall / SIZE:.3f}em;vertical-align:{-(depth + MARGIN) / SIZE:.3f}em" '
        f'fill="currentColor"><path d="{path}"/></svg>'
    )


def _safe(latex: str, node: nodes.Node) -> str:
    try:
        return svg(latex)
    except (ValueError, KeyError) as error:
        reason = str(error).strip().splitlines()[-1] if str(error).strip() else repr(error)
        LOG.warning("formula can't be set: %s (%s)", latex, reason, location=node)
        return f"<code>{html.escape(latex)}</code>"


def visit_inline(self: Any, node: nodes.math) -> None:
    """Write a formula inside a line of text."""
    self.body.append(_safe(node.astext(), node))
    raise nodes.SkipNode


def visit_block(self: Any, node: nodes.math_block) -> None:
    """Write a formula on lines of its own, with its number if it has one."""
    lines = [line.replace("&", "").strip() for line in node.astext().split("\\\\")]
    drawn = "".join(f"<div>{_safe(line, node)}</div>" for line in lines if line)
    number = f'<span class="eqno">({node["number"]})</span>' if node.get("number") else ""
    self.body.append(self.starttag(node, "div", CLASS="math-block") + number + drawn + "</div>\n")
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, Any]:
    """Register the renderer; its style is in ``_static/dnacheck.css``."""
    app.add_html_math_renderer("mathtext", (visit_inline, None), (visit_block, None))
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
