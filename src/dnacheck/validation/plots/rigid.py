"""J factors by rigid steps and by wedges, beside measured ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from dnacheck.validation.plots.curves import style
from dnacheck.validation.plots.palette import BLUE, HAIR, INK, RUST

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def ln_J_by_set(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """-ln J of every molecule: one dot a parameter set, the measured value with its error."""
    rows = data["rows"]
    places = list(range(len(rows)))
    for key, colour in (("trifonov", BLUE), ("olson", RUST)):
        values = [row[key] for row in rows]
        ax.plot(values, places, "o", color=colour, markersize=5, label=data["labels"][key])
    measured = [(row["experiment"], y) for y, row in enumerate(rows) if row["experiment"]]
    if measured:
        x, y = zip(*measured, strict=True)
        ax.errorbar(x, y, xerr=data["experiment_error"], fmt="s", color=INK, markersize=4,
                    linewidth=0.8, label="experiment")  # fmt: skip
    ax.set_yticks(places, [row["name"] for row in rows])
    ax.invert_yaxis()
    ax.grid(axis="x", color=HAIR, linewidth=0.5)
    ax.legend(fontsize=8, frameon=False)
    return style(ax, "−ln J (J in mol/L)", "")
