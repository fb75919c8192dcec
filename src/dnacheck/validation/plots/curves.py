"""Plain curves: errors against size and against cost."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from dnacheck.validation.plots.palette import CYCLE, HAIR, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def style(ax: Axes, across: str, up: str, title: str = "") -> Axes:
    """Labels and two spines."""
    ax.set_xlabel(across, fontsize=9, color=INK)
    ax.set_ylabel(up, fontsize=9, color=INK)
    if title:
        ax.set_title(title, fontsize=9, color=INK, loc="left")
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    ax.tick_params(colors=INK, labelsize=8)
    return ax


def drift(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """Errors against the number of steps, both logarithmic."""
    labels = {
        "orthonormality": "frames, renormalised",
        "plain": "frames, plain product",
        "position": "position of the end",
        "energy": "energy",
    }
    n = [row["n"] for row in data["rows"]]
    for index, (key, label) in enumerate(labels.items()):
        values = [max(row[key], 1e-17) for row in data["rows"]]
        ax.loglog(n, values, "o-", color=CYCLE[index], markersize=3.5, linewidth=1.1, label=label)
    ax.grid(axis="y", color=HAIR, linewidth=0.5)
    ax.legend(fontsize=8, frameon=False)
    return style(ax, "steps N", "error")


def work_precision(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """Error against time, one line per method, both logarithmic."""
    for index, line in enumerate(data["lines"]):
        colour = CYCLE[index % len(CYCLE)]
        ax.loglog(
            line["seconds"], [max(e, 1e-16) for e in line["errors"]], "o-", color=colour,
            markersize=4, linewidth=1.1, label=line["label"],
        )  # fmt: skip
        for x, y, text in zip(
            line["seconds"], line["errors"], line.get("points", ()), strict=False
        ):
            ax.annotate(
                text, (x, max(y, 1e-16)), (3, 3), textcoords="offset points", fontsize=6.5,
                color=colour,
            )  # fmt: skip
    ax.grid(color=HAIR, linewidth=0.5)
    ax.legend(fontsize=8, frameon=False)
    return style(ax, "seconds, one core, warm", data["up"], data.get("title", ""))


def named_lines(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """Lines with their names at the right edge, over a shaded band about zero."""
    if data.get("band"):
        ax.axhspan(-data["band"], data["band"], color=HAIR, alpha=0.5, linewidth=0)
    ends = []
    for index, line in enumerate(data["lines"]):
        colour = CYCLE[index % len(CYCLE)]
        ax.plot(line["x"], line["y"], color=colour, linewidth=1.2)
        ends.append((float(line["y"][-1]), line["name"], colour))
    low, high = ax.get_ylim()
    apart, place = 0.045 * (high - low), -float("inf")
    right = max(max(line["x"]) for line in data["lines"])
    for value, name, colour in sorted(ends):
        place = max(value, place + apart)
        ax.annotate(
            name, (right, place), (6, 0), textcoords="offset points", va="center", fontsize=8,
            color=colour, annotation_clip=False,
        )  # fmt: skip
    return style(ax, data["across"], data["up"])
