"""Data of Figures 6 to 10 and 12 to 16, as plain arrays; energies and moments in RT."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.continuation.branch import Branch, Kind
from dnacheck.equilibria.continuation.component import Component
from dnacheck.equilibria.continuation.diagram import lowest_component, perfect_diagram
from dnacheck.equilibria.continuation.follow import Bounds
from dnacheck.equilibria.continuation.options import ContinuationOptions
from dnacheck.equilibria.continuation.parameters import perfect_rod
from dnacheck.equilibria.continuation.twist_ratio import (
    RatioSweep,
    SweepOptions,
    sweep_continuum,
    sweep_discrete,
)
from dnacheck.equilibria.ring import Equilibrium
from dnacheck.model.chain import Chain
from dnacheck.model.rod import RodOptions, build_rod
from dnacheck.model.rod.rod import Rod

Array = NDArray[np.float64]

#: Figure 10: (k, m) at w = 15, and w at (k, m) = (20, 6).
FITS = tuple((k, m) for m in (4, 5, 6) for k in (10, 12, 14, 16, 18, 20))
WIDTHS = (5, 10, 15, 20, 25)
#: The sixteen ratios of Figures 12 to 16.
RATIOS = tuple(float(x) for x in np.linspace(0.5, 1.5, 16))


def branch_data(branch: Branch, link: bool = False) -> dict[str, Any]:
    """A branch as arrays.

    Returns
    -------
    dict
        alpha (M,) in turns, energy, bend, twist, end_moment (M,) in RT, residual (M,),
        negative_directions (M,), special: list of dict with kind, alpha, energy, end_moment,
        negative_directions, precision; status; with ``link``, link (M,).
    """
    scale = branch.disc.rod.energy_scale_RT
    data: dict[str, Any] = {
        "parameter": branch.active.name,
        "value": branch.parameter,
        "energy": branch.energy * scale,
        "bend": branch.bend * scale,
        "twist": branch.twist * scale,
        "end_moment": branch.end_moment * scale,
        "residual": branch.residual,
        "negative_directions": branch.negative_directions,
        "status": branch.status,
        "special": [
            {
                "kind": point.kind.value,
                "value": point.parameter,
                "energy": point.energy * scale,
                "bend": point.bend * scale,
                "twist": point.twist * scale,
                "end_moment": point.end_moment * scale,
                "negative_directions": point.negative_directions,
                "precision": point.precision,
                "residual": point.residual,
            }
            for point in branch.special
        ],
    }
    if branch.active.name == "end_twist":
        data["alpha"] = branch.parameter / (2.0 * np.pi)
    if link:
        data["link"] = branch.link
    return data


def component_data(component: Component, link: bool = False) -> dict[str, Any]:
    """Branches of a component as arrays, see :func:`branch_data`."""
    return {
        "branches": [branch_data(branch, link) for branch in component.branches],
        "status": component.status,
        "ok": component.ok,
    }


def figure_6(n_steps: int = 158, twist_ratio: float = 1.5, depth: int = 1) -> dict[str, Any]:
    """Perfect diagram for the stiffnesses of 11T15."""
    return component_data(perfect_diagram(perfect_rod(n_steps, twist_ratio), depth=depth))


def figure_7(rod: Rod, options: ContinuationOptions | None = None) -> dict[str, Any]:
    """Imperfect diagram: the component of the lowest ring, with the marked rings' shapes.

    The entry ``rings`` holds, lowest first, the data of Figures 8 and 9 (:func:`ring_shape`).
    """
    component = lowest_component(rod, options=options)
    data = component_data(component)
    data["rings"] = [ring_shape(ring) for ring in marked_rings(component)]
    return data


def marked_rings(component: Component) -> tuple[Equilibrium, ...]:
    """Rings with alpha = Omega(1) - Omega(0) modulo 2 pi, lowest first, each once."""
    first = component.branches[0]
    return tuple(first.ring(point) for point in component.of_kind(Kind.MARK))


def ring_shape(ring: Equilibrium, points: int = 400, width_A: float = 10.0) -> dict[str, Any]:
    """Tube and ribbon of a ring (Figures 8 and 9).

    Returns
    -------
    dict
        s (m,); centreline (m, 3) in Å; true_ribbon, natural_ribbon (m, 3): the edge
        r + width d1 and r + width D1; energy (RT), link, end_moment (RT), stable.
    """
    s = np.linspace(0.0, 1.0, points)
    length = ring.rod.n_steps * ring.rod.rise_A
    centreline = length * ring.curve.centreline(s)
    scale = ring.rod.energy_scale_RT
    return {
        "s": s,
        "centreline": centreline,
        "true_ribbon": centreline + width_A * ring.curve.true_frames(s)[..., 0],
        "natural_ribbon": centreline + width_A * ring.curve.natural_frames(s)[..., 0],
        "energy": ring.energy * scale,
        "end_moment": ring.curve.end_moment * scale,
        "link": ring.link,
        "stable": ring.stable,
    }


def robustness(
    chain: Chain,
    ratios: Sequence[float] = RATIOS,
    fits: Sequence[tuple[int, int]] = FITS,
    widths: Sequence[int] = WIDTHS,
    span: Literal["padded", "molecule"] = "padded",
) -> dict[str, Any]:
    """Figure 10: ring energy against the ratio for choices of w, k and m.

    ``span`` is :class:`RodOptions`' ``interval_span``: whether the k pieces cover the padded
    molecule or the molecule alone. The paper leaves it open.

    Returns
    -------
    dict
        ratios (R,); by_fit: {(k, m): energies (R,) in RT} at w = 15; by_width: {w: energies} at
        (20, 6); refused: {choice: reason}; spread_fit, spread_width, spread_all: largest
        difference at one ratio over (k, m) from (12, 5) up, over w from 10 to 25, over all;
        farthest: largest distance of any choice from (w, k, m) = (15, 20, 6).
    """
    refused: dict[str, str] = {}

    def energies(options: RodOptions, label: str) -> Array | None:
        from dnacheck.numerics.outcome import InputError

        try:
            rod = build_rod(chain, options)
        except InputError as error:
            refused[label] = str(error)
            return None
        once = SweepOptions(search_every=len(ratios))
        return sweep_continuum(rod, np.array(ratios), once).energy_RT

    by_fit = {
        (k, m): energies(RodOptions(15, k, m, interval_span=span), f"w 15, k {k}, m {m}")
        for k, m in fits
    }
    by_width = {
        w: energies(RodOptions(w, 20, 6, interval_span=span), f"w {w}, k 20, m 6") for w in widths
    }
    standard = energies(RodOptions(15, 20, 6, interval_span=span), "w 15, k 20, m 6")
    away = [
        float(np.max(np.abs(curve - standard)))
        for curve in (*by_fit.values(), *by_width.values())
        if curve is not None and standard is not None
    ]
    good = [e for (k, m), e in by_fit.items() if k >= 12 and m >= 5]
    middle = [e for w, e in by_width.items() if w >= 10]
    return {
        "ratios": np.array(ratios),
        "by_fit": by_fit,
        "by_width": by_width,
        "refused": refused,
        "spread_fit": _spread(good),
        "spread_width": _spread(middle),
        "spread_all": _spread([*by_fit.values(), *by_width.values()]),
        "farthest": max(away, default=float("nan")),
    }


def _spread(curves: Sequence[Array | None]) -> float:
    table = np.array([curve for curve in curves if curve is not None])
    return float(np.max(np.ptp(table, axis=0))) if len(table) else float("nan")


def sweep_data(sweep: RatioSweep) -> dict[str, Any]:
    """A sweep as arrays in RT (Figures 12 to 16)."""
    scale = sweep.energy_scale_RT
    return {
        "name": sweep.name,
        "model": sweep.model,
        "ratios": sweep.ratios,
        "energy": sweep.energy * scale,
        "bend": sweep.bend * scale,
        "twist": sweep.twist * scale,
        "link": sweep.link,
        "residual": sweep.residual,
        "tracks": [{"energy": track.energy * scale, "link": track.link} for track in sweep.tracks],
        "crossings": [
            {
                "ratio": crossing.ratio,
                "precision": crossing.precision,
                "energy": crossing.energy * scale,
                "links": crossing.links,
                "exchanged": crossing.exchanged,
            }
            for crossing in sweep.crossings
        ],
        "status": sweep.status,
    }


def sweeps(
    chains: Sequence[Chain],
    ratios: Sequence[float] = RATIOS,
    rod_options: RodOptions | None = None,
) -> list[dict[str, Any]]:
    """Figures 12 to 16 for one angle set: continuum and discrete sweep of every chain."""
    out: list[dict[str, Any]] = []
    values = np.array(ratios)
    for chain in chains:
        out.append(
            {
                "continuum": sweep_data(sweep_continuum(build_rod(chain, rod_options), values)),
                "discrete": sweep_data(sweep_discrete(chain, values)),
            }
        )
    return out


__all__ = [
    "FITS",
    "RATIOS",
    "WIDTHS",
    "Bounds",
    "branch_data",
    "component_data",
    "figure_6",
    "figure_7",
    "marked_rings",
    "ring_shape",
    "robustness",
    "sweep_data",
    "sweeps",
]
