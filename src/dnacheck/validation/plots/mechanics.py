"""Profiles over length, maps of substitutions, fits: drawn from what was computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dnacheck.validation.plots.curves import style
from dnacheck.validation.plots.palette import CYCLE, HAIR, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BASES = "ACGT"


def profile(
    ax: Axes,
    profiles: Sequence[Mapping[str, Any]],
    measured: Sequence[tuple[float, float, float]] = (),
) -> Axes:
    """-ln J against length, one line a profile with its error band; measured points over them.

    Parameters
    ----------
    profiles : sequence of mapping
        As ``LengthProfile.to_dict``.
    measured : sequence of (n_bp, minus_lnJ, stderr)
    """
    for index, data in enumerate(profiles):
        points = data["points"]
        n = np.array([point["n_bp"] for point in points], dtype=float)
        value = np.array([point["minus_lnJ"] for point in points])
        error = 2.0 * np.array([point["stderr"] for point in points])
        colour = CYCLE[index % len(CYCLE)]
        ax.fill_between(n, value - error, value + error, color=colour, alpha=0.2, linewidth=0)
        ax.plot(n, value, "o-", color=colour, markersize=3.0, linewidth=1.1, label=data["target"])
    if measured:
        n, value, error = (np.array(column) for column in zip(*measured, strict=True))
        ax.errorbar(n, value, yerr=error, fmt="s", color=INK, markersize=4, label="measured")
    ax.invert_yaxis()
    ax.grid(axis="y", color=HAIR, linewidth=0.5)
    if len(profiles) > 1 or measured:
        ax.legend(fontsize=8, frameon=False)
    return style(ax, "length, bp", "−ln J (J in mol/L); easy closure is up")


def substitutions(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """Heat map of what every letter in every place does to -ln J.

    ``data`` is as ``Sensitivity.to_dict``; the molecule's own letters are marked by dots.
    """
    n = data["n_bp"]
    change = np.zeros((4, n))
    letters = [step["letters"][0] for step in data["steps"]]
    for item in data["substitutions"]:
        best = item["predicted"] if item["computed"] is None else item["computed"]
        change[_BASES.index(item["new"]), item["position"]] = best
    top = float(np.abs(change).max()) or 1.0
    image = ax.imshow(
        change, aspect="auto", cmap="RdBu_r", vmin=-top, vmax=top, interpolation="nearest"
    )
    ax.plot(range(n), [_BASES.index(letter) for letter in letters], ".", color=INK, markersize=1.5)
    ax.set_yticks(range(4), list(_BASES))
    ax.figure.colorbar(image, ax=ax, label="change of −ln J", pad=0.01)
    return style(ax, "base pair, from 0", "new letter")


def step_derivatives(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """Derivatives of ln J along the molecule, one line per ground value, with error bands."""
    names = data["coordinates"]
    value = np.array([step["d_lnJ_d_ground_per_deg"] for step in data["steps"]])
    error = 2.0 * np.array([step["d_lnJ_d_ground_stderr"] for step in data["steps"]])
    place = np.arange(len(value))
    for index, name in enumerate(names[:3]):
        colour = CYCLE[index % len(CYCLE)]
        low, high = value[:, index] - error[:, index], value[:, index] + error[:, index]
        ax.fill_between(place, low, high, color=colour, alpha=0.25, linewidth=0)
        ax.plot(place, value[:, index], color=colour, linewidth=1.0, label=name)
    ax.axhline(0.0, color=HAIR, linewidth=0.7)
    ax.legend(fontsize=8, frameon=False, ncols=3)
    return style(ax, "step, from 0", "∂ ln J / ∂ ground value, per degree")


def fitted(ax: Axes, data: Mapping[str, Any]) -> Axes:
    """Computed against measured -ln J of a fit; ``data`` is as ``MechanicsFit.to_dict``."""
    rows = data["molecules"]
    x = np.array([row["measured"] for row in rows])
    y = np.array([row["computed"] for row in rows])
    left_out = x - np.array([row["leave_one_out_residual"] for row in rows])
    ends = [min(x.min(), y.min()) - 0.5, max(x.max(), y.max()) + 0.5]
    ax.plot(ends, ends, color=HAIR, linewidth=0.8)
    ax.errorbar(
        x,
        y,
        xerr=[row["stderr"] for row in rows],
        fmt="o",
        color=CYCLE[0],
        markersize=4,
        linewidth=0.8,
        label="fitted to all",
    )
    ax.plot(x, left_out, "x", color=CYCLE[1], markersize=5, label="predicted when left out")
    ax.legend(fontsize=8, frameon=False)
    return style(ax, "measured −ln J", "computed −ln J")
