"""Shapes of rings, projected onto a plane."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dnacheck.validation.plots.palette import BLUE, INK, QUIET, RUST

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def rings_from_above(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """Superimposed rings seen along their smallest principal axis."""
    return _projection(ax, data, 0, 1, 2, "from above")


def rings_from_the_side(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """Superimposed rings seen along their middle principal axis."""
    return _projection(ax, data, 0, 2, 1, "from the side")


def _projection(
    ax: Axes, data: Mapping[str, Any], across: int, up: int, depth: int, title: str
) -> Axes:
    """Strands as beads (discrete) and lines (continuum), nearer parts darker and on top."""
    from matplotlib.collections import LineCollection
    from matplotlib.colors import to_rgb

    for strand, colour in (("strand1", BLUE), ("strand2", RUST)):
        line = np.asarray(data["continuum"][strand])
        beads = np.asarray(data["discrete"][strand])
        order = np.argsort(line[:-1, depth])
        near = _nearness(line[:-1, depth])[order]
        flat = line[:, [across, up]]
        segments = LineCollection(
            np.stack([flat[:-1], flat[1:]], axis=1)[order].tolist(),
            colors=[(*to_rgb(colour), 0.25 + 0.35 * value) for value in near],
            linewidths=1.1 + 1.1 * near,
            capstyle="round",
            zorder=2,
        )
        ax.add_collection(segments)
        near = _nearness(beads[:, depth])
        ax.scatter(
            beads[:, across],
            beads[:, up],
            s=3.0 + 5.0 * near,
            color=colour,
            alpha=None,
            linewidths=0.0,
            zorder=3.1,
        )
    axis = np.asarray(data["discrete"]["axis"])
    ax.plot(axis[:, across], axis[:, up], color=QUIET, linewidth=0.7, zorder=1)
    reach = 1.04 * float(np.abs(np.asarray(data["discrete"]["strand1"])[:, 0]).max()) + 8.0
    ax.set_aspect("equal")
    ax.set_xlim(-reach, reach)
    ax.set_title(title, fontsize=9, color=INK, loc="left")
    _scale_bar(ax, data)
    ax.axis("off")
    return ax


def _nearness(depth: Any) -> Any:
    span = float(np.ptp(depth)) or 1.0
    return (depth - depth.min()) / span


def _scale_bar(ax: Axes, data: Mapping[str, Any]) -> None:
    points = np.concatenate([data["discrete"]["strand1"], data["discrete"]["strand2"]])
    left, bottom = points[:, 0].min(), ax.get_ylim()[0]
    ax.plot([left, left + 20.0], [bottom, bottom], color=INK, linewidth=1.4)
    ax.annotate(
        "20 Å", (left + 10.0, bottom), (0, -3), textcoords="offset points",
        ha="center", va="top", fontsize=8, color=INK,
    )  # fmt: skip
