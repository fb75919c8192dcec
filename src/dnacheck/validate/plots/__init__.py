"""Drawings of the report. Each function takes an axis and plain data, and returns the axis.

They compute nothing and leave matplotlib's settings alone; what is drawn was computed by a check.
``KINDS`` names them for :class:`dnacheck.validate.sections.Figure`: each kind is a row of panels,
one function per panel.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from dnacheck.validate.plots import shapes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Panel = Callable[["Axes", Mapping[str, Any]], "Axes"]

KINDS: dict[str, tuple[Panel, ...]] = {
    "superimposed_rings": (shapes.rings_from_above, shapes.rings_from_the_side),
}
