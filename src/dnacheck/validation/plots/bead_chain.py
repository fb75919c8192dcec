"""The bead chain beside the models that it checks: its ring, and fluctuation along the sequence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dnacheck.validation.plots.curves import style
from dnacheck.validation.plots.palette import BLUE, HAIR, INK, QUIET, RUST

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def fluctuation(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """Rms displacement of every base pair; bands are two standard errors either way."""
    for line, colour in zip(data["lines"], (RUST, BLUE, INK), strict=False):
        values = np.asarray(line["values"])
        places = np.arange(1, len(values) + 1)
        if line.get("errors"):
            errors = 2.0 * np.asarray(line["errors"])
            ax.fill_between(
                places, values - errors, values + errors, color=colour, alpha=0.22, linewidth=0.0
            )
        dashes = "-" if line.get("errors") else (0, (4, 2))
        ax.plot(places, values, color=colour, linewidth=1.2, linestyle=dashes, label=line["label"])
    ax.set_ylim(bottom=0.0)
    ax.grid(axis="y", color=HAIR, linewidth=0.5)
    ax.legend(fontsize=8, frameon=False, loc="lower right", ncols=3)
    return style(ax, "base pair", "rms displacement / Å", data.get("title", ""))


def ring_from_above(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """Beads of the bead chain's minimum over the discrete ring, along the smallest axis."""
    return _ring(ax, data, 1, "from above")


def ring_from_the_side(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """The same along the middle axis."""
    return _ring(ax, data, 2, "from the side")


def _ring(ax: Axes, data: Mapping[str, Any], up: int, title: str) -> Axes:
    discrete, beads = np.asarray(data["discrete"]), np.asarray(data["beads"])
    closed = np.concatenate([discrete, discrete[:1]])
    ax.plot(closed[:, 0], closed[:, up], color=QUIET, linewidth=2.6, label="discrete solver")
    ax.plot(
        beads[:, 0], beads[:, up], ".", color=RUST, markersize=3.0, label="bead chain in OpenMM"
    )
    left, low = discrete[:, 0].min(), discrete[:, up].min() - 6.0
    ax.plot([left, left + 20.0], [low, low], color=INK, linewidth=1.2)
    ax.annotate(
        "20 Å", (left + 10.0, low), (0, -3), textcoords="offset points", ha="center", va="top",
        fontsize=8, color=INK,
    )  # fmt: skip
    ax.set_aspect("equal")
    ax.axis("off")
    ax.set_title(title, fontsize=9, color=INK, loc="left")
    if up == 1:
        ax.legend(fontsize=8, frameon=False, loc="center")
    return ax
