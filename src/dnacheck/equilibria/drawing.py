"""A ring drawn on axes that are given, or on new ones."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dnacheck.io.structure import sugar_phosphate_helices

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from dnacheck.equilibria.ring import Equilibrium

Array = NDArray[np.float64]

_STRANDS = ("#2563a8", "#b4531f")
_AXIS = "#8a8f98"


def draw_ring(ring: Equilibrium, ax: Axes | None = None) -> Axes:
    """Centreline and both sugar-phosphate chains in Å, along the principal axes of the centres.

    Parameters
    ----------
    ring : Equilibrium
    ax : Axes, optional
        Two-dimensional ones show the ring along its thinnest axis, three-dimensional ones all.
    """
    if ax is None:
        import matplotlib.pyplot as plt

        ax = plt.figure().add_subplot()
    centres, frames = ring.shape
    scale = ring.source.rise_A
    middle = centres[:-1].mean(axis=0)
    axes = np.linalg.svd(centres[:-1] - middle, full_matrices=False)[2]
    lines = [centres, *sugar_phosphate_helices(centres, frames)]
    shown: Any = ax
    spatial = hasattr(ax, "get_zlim")
    for line, colour in zip(lines, (_AXIS, *_STRANDS), strict=True):
        place = scale * (line - middle) @ axes.T
        shown.plot(*place.T[: 3 if spatial else 2], color=colour, linewidth=1.2)
    shown.set_aspect("equal")
    shown.set_xlabel("Å")
    shown.set_ylabel("Å")
    shown.set_title(
        f"{ring.name}, {ring.model}: {ring.energy_RT:.2f} RT, link {ring.link}", fontsize=10
    )
    return ax
