"""Drawings of the report. Each function takes an axis and plain data, and returns the axis.

They compute nothing and leave matplotlib's settings alone; what is drawn was computed by a check.
``KINDS`` names them for :class:`dnacheck.validation.report.record.Figure`: each kind is a row of
panels, one function per panel.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from dnacheck.validation.plots import (
    bead_chain,
    binding,
    continuation,
    curves,
    mechanics,
    rigid,
    rod,
    shapes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Panel = Callable[["Axes", Mapping[str, Any]], "Axes"]


def _sweep(quantity: str) -> Panel:
    def panel(ax: Axes, data: Mapping[str, Any]) -> Axes:
        return continuation.sweep(ax, data["lines"], quantity)

    return panel


KINDS: dict[str, tuple[Panel, ...]] = {
    "superimposed_rings": (shapes.rings_from_above, shapes.rings_from_the_side),
    "centreline_scales": (rod.centreline_from_the_side, rod.centreline_end_on),
    "filters": (rod.filtered_once, rod.filtered_twice),
    "diagram": (continuation.diagram, continuation.diagram_by_twist),
    "ribbons": (continuation.ring_ribbon, continuation.ring_natural_ribbon),
    "robustness": (continuation.robustness, partial(continuation.robustness, which="by_width")),
    "drift": (curves.drift,),
    "work_precision": (curves.work_precision,),
    "named_lines": (curves.named_lines,),
    "binding": (binding.free_to_bound,),
    "fitted": (mechanics.fitted,),
    "rigid_ln_J": (rigid.ln_J_by_set,),
    "fluctuation": (bead_chain.fluctuation,),
    "bead_ring": (bead_chain.ring_from_above, bead_chain.ring_from_the_side),
    "sweep_energy": (_sweep("energy"),),
    "sweep_parts": (_sweep("bend"), _sweep("twist")),
}
