"""From the noisy centreline of a chain to a smooth rod (Figures 4 and 5)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dnacheck.validation.plots.palette import BLUE, INK, QUIET, RUST

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def _bare(ax: Axes, title: str) -> Axes:
    ax.set_aspect("equal")
    ax.axis("off")
    ax.set_title(title, fontsize=9, color=INK, loc="left")
    return ax


def centreline_from_the_side(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """A molecule's centreline, its beginning drawn heavy."""
    points = np.asarray(data["side"])
    ax.plot(points[:, 0], points[:, 1], color=QUIET, linewidth=0.9)
    ax.plot(points[:48, 0], points[:48, 1], color=BLUE, linewidth=2.2)
    left, low = points.min(axis=0)
    ax.plot([left, left + 50.0], [low - 12.0] * 2, color=INK, linewidth=1.2)
    ax.annotate("50 Å", (left + 25.0, low - 14.0), ha="center", va="top", fontsize=8, color=INK)
    return _bare(ax, "from the side")


def centreline_end_on(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """The first 47 base pairs seen along their axis."""
    points = np.asarray(data["end"])
    ax.plot(points[:, 0], points[:, 1], color=BLUE, linewidth=1.0, marker="o", markersize=2.2)
    left, low = points.min(axis=0)
    ax.plot([left, left + 5.0], [low - 1.2] * 2, color=INK, linewidth=1.2)
    ax.annotate("5 Å", (left + 2.5, low - 1.4), ha="center", va="top", fontsize=8, color=INK)
    return _bare(ax, "the first 47, end on")


def filtered_once(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """Base-pair centres and the once filtered centreline."""
    return _filtered(ax, data, "once", "filtered once")


def filtered_twice(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """Base-pair centres and the doubly filtered centreline."""
    return _filtered(ax, data, "twice", "filtered twice, as the model does")


def _filtered(ax: Axes, data: Mapping[str, Any], which: str, title: str) -> Axes:
    raw, line = np.asarray(data["raw"]), np.asarray(data[which])
    ax.plot(raw[:, 0], raw[:, 1], ".", color=QUIET, markersize=2.5)
    ax.plot(line[:, 0], line[:, 1], color=RUST, linewidth=1.3)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    ax.tick_params(colors=INK, labelsize=8)
    ax.set_xlabel("along the molecule / Å", fontsize=8.5, color=INK)
    ax.set_ylabel("across / Å", fontsize=8.5, color=INK)
    ax.set_title(f"{title} (w = {data['width']})", fontsize=9, color=INK, loc="left")
    return ax
