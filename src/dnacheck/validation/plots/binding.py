"""What binding a protein does to the J factors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from dnacheck.validation.plots.curves import style
from dnacheck.validation.plots.palette import BLUE, HAIR, INK, QUIET, RUST

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLOURS = {"C": RUST, "S": BLUE, "": INK}
_NAMES = {"C": "C-shaped", "S": "S-shaped", "": "molecules"}


def free_to_bound(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """An arrow for each molecule from -ln J free (open) to bound (full), shapes apart."""
    rows = data["rows"]
    place, places, last, shown = 0.0, [], None, set()
    for row in rows:
        if last is not None and row["shape"] != last:
            place += 0.6
        last = row["shape"]
        places.append(place)
        colour = _COLOURS[row["shape"]]
        ax.annotate(
            "", (row["bound"], place), (row["free"], place),
            arrowprops={"arrowstyle": "->", "color": colour, "linewidth": 1.2},
        )  # fmt: skip
        label = None if row["shape"] in shown else _NAMES[row["shape"]]
        shown.add(row["shape"])
        ax.plot(row["free"], place, "o", color="white", markeredgecolor=QUIET, markersize=5)
        ax.plot(row["bound"], place, "o", color=colour, markersize=5, label=label)
        place += 1.0
    ax.set_yticks(places, [row["name"] for row in rows])
    ax.invert_yaxis()
    ax.grid(axis="x", color=HAIR, linewidth=0.5)
    if shown:
        ax.legend(fontsize=8, frameon=False)
    return style(ax, "−ln J (open: free, full: bound)", "")
