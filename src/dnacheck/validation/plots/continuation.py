"""Bifurcation diagrams, sweeps over the twist ratio, and rings as tube and ribbon."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dnacheck.validation.plots.palette import BLUE, CYCLE, HAIR, INK, QUIET, RUST

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def _plain(ax: Axes, across: str, up: str, title: str) -> Axes:
    ax.set_xlabel(across, color=INK)
    ax.set_ylabel(up, color=INK)
    if title:
        ax.set_title(title, fontsize=9, color=INK, loc="left")
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    ax.tick_params(colors=INK, labelsize=8)
    return ax


def diagram(ax: Axes, data: Mapping[str, Any], across: str = "end_moment") -> Axes:
    """Energy against end moment (Figures 6 and 7), or against end twist (``across="alpha"``).

    Stable stretches are heavy, unstable ones light; rings whose d1 closes are circles, branch
    points squares.
    """
    for branch in data["branches"]:
        x, y = np.asarray(branch[across]), np.asarray(branch["energy"])
        directions = np.asarray(branch["negative_directions"])
        ax.plot(x, y, color=QUIET, linewidth=0.9, zorder=2)
        stable = np.where(directions == 0, y, np.nan)
        ax.plot(x, stable, color=BLUE, linewidth=1.8, zorder=2.5)
        for point in branch["special"]:
            where = point["end_moment"] if across == "end_moment" else point["value"] / (2 * np.pi)
            if point["kind"] == "mark":
                ax.plot(where, point["energy"], "o", mfc="white", mec=RUST, ms=5.5, zorder=4)
            elif point["kind"] == "branch point":
                ax.plot(where, point["energy"], "s", color=INK, ms=3.0, zorder=3)
    label = "end moment m₃(0) / RT" if across == "end_moment" else "end twist α / 2π"
    return _plain(ax, label, "energy / RT", data.get("title", ""))


def diagram_by_twist(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """Energy against end twist."""
    return diagram(ax, data, "alpha")


def sweep(ax: Axes, data: Sequence[Mapping[str, Any]], quantity: str = "energy") -> Axes:
    """Energy, or its bending or twisting part, against K3/K1: lines with their names at the end.

    ``data``: one mapping per line with name, model, ratios and the quantity in RT. The discrete
    model is drawn as dots.
    """
    ends: list[tuple[float, str, str]] = []
    colours: dict[str, str] = {}
    for line in data:
        name = str(line["name"])
        colour = colours.setdefault(name, CYCLE[len(colours) % len(CYCLE)])
        ratios, values = np.asarray(line["ratios"]), np.asarray(line[quantity])
        if line["model"] == "discrete":
            ax.plot(ratios, values, ".", color=colour, markersize=4, zorder=3)
        else:
            # no line joins two minima: each stretch of one link is its own
            links = np.asarray(line.get("link", np.zeros(len(ratios))))
            for part in np.split(np.arange(len(ratios)), np.flatnonzero(np.diff(links)) + 1):
                ax.plot(ratios[part], values[part], color=colour, linewidth=1.2, zorder=2)
        if name not in [end[1] for end in ends] and np.isfinite(values).any():
            ends.append((float(values[np.isfinite(values)][-1]), name, colour))
        for crossing in line.get("crossings", ()) if quantity == "energy" else ():
            ax.plot(crossing["ratio"], crossing["energy"], "x", color=INK, ms=5, zorder=4)
    _end_labels(ax, ends)
    words = {
        "energy": "energy / RT",
        "bend": "bending energy / RT",
        "twist": "twisting energy / RT",
    }
    return _plain(ax, "K₃ / K₁", words[quantity], "")


def _end_labels(ax: Axes, ends: list[tuple[float, str, str]]) -> None:
    """Names at the right edge, moved apart where they would overlap."""
    if not ends:
        return
    low, high = ax.get_ylim()
    apart = 0.04 * (high - low)
    right = ax.get_xlim()[1]
    place = -np.inf
    for value, name, colour in sorted(ends):
        place = max(value, place + apart)
        ax.annotate(
            name, (right, place), (4, 0), textcoords="offset points", va="center", fontsize=8,
            color=colour, annotation_clip=False,
        )  # fmt: skip


def robustness(ax: Axes, data: Mapping[str, Any], which: str = "by_fit") -> Axes:
    """Figure 10: energy against K3/K1 for choices of the fit or of the filter width."""
    for i, (choice, energy) in enumerate(data[which].items()):
        if energy is None:
            continue
        label = f"w = {choice}" if which == "by_width" else f"(k, m) = {choice}"
        ax.plot(data["ratios"], energy, color=CYCLE[i % len(CYCLE)], linewidth=0.9, label=label)
    ax.legend(fontsize=6, frameon=False, ncols=2)
    return _plain(ax, "K₃ / K₁", "energy / RT", data.get("title", ""))


def ring_ribbon(ax: Axes, data: Mapping[str, Any], which: str = "true_ribbon") -> Axes:
    """A ring as tube and ribbon (Figures 8 and 9), seen obliquely onto its plane."""
    line = np.asarray(data["centreline"])
    edge = np.asarray(data[which])
    centre = line.mean(axis=0)
    axes = np.linalg.svd(line - centre)[2]
    tilt = np.deg2rad(55.0)
    up = np.sin(tilt) * axes[1] + np.cos(tilt) * axes[2]
    depth = np.cos(tilt) * axes[1] - np.sin(tilt) * axes[2]
    view = np.stack([axes[0], up, depth])
    a, b = (line - centre) @ view.T, (edge - centre) @ view.T
    for i in np.argsort(-0.5 * (a[:-1, 2] + a[1:, 2])):
        corners = np.array([a[i], a[i + 1], b[i + 1], b[i]])
        near = (a[:, 2].max() - a[i, 2]) / (np.ptp(a[:, 2]) or 1.0)
        ax.fill(
            corners[:, 0], corners[:, 1], facecolor=RUST, alpha=0.35 + 0.4 * near, edgecolor=HAIR,
            linewidth=0.2,
        )  # fmt: skip
        ax.plot(
            a[i : i + 2, 0], a[i : i + 2, 1], color=BLUE, linewidth=1.2 + 2.2 * near,
            solid_capstyle="round",
        )  # fmt: skip
    ax.set_aspect("equal")
    ax.axis("off")
    if data.get("title"):
        ax.set_title(data["title"], fontsize=9, color=INK, loc="left")
    return ax


def ring_natural_ribbon(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """The same with the natural frame's D1."""
    return ring_ribbon(ax, data, "natural_ribbon")
