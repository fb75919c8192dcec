"""Shapes superimposed, as in Figure 11, and rings to turn."""

from __future__ import annotations

from typing import Any

import numpy as np

from dnacheck.validation.checks.table2.case import Case, cases, judge_centres, judge_shape
from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Findings
from dnacheck.validation.report.record import Figure, Rings

_HELIX_2, _HELIX_1 = 2.521, -0.769
"""Sugar-phosphate helices r ± 2.521 d2 - 0.769 d1 in steps (caption of Figure 11)."""


def shape(context: Context) -> Findings:
    """Shapes superimposed, as in Figure 11."""
    found = cases(context)
    results = [
        judged
        for case in found
        for judged in (
            judge_shape(case.name, case.wide_rms_A, case.published.rms_A),
            judge_centres(case.name, case.rms_A, case.published.rms_A),
        )
    ]
    first = next((case for case in found if case.name == "12A09"), found[0])
    figure = Figure(
        "figure11",
        f"{first.name}: discrete and continuum ring superimposed",
        "superimposed_rings",
        {"name": first.name, "rms_A": first.rms_A, **_overlay(first, decimals=3)},
        "Sugar–phosphate helices r ± 2.521 d2 − 0.769 d1 (in steps): discrete as beads, continuum "
        "as lines, after optimal superposition; seen along the smallest and the largest principal "
        "axis.",
        "Figure 11",
        width=4.6,
        height=4.4,
    )
    shown = [{"name": case.name, "curves": _curves(case)} for case in found]
    turn = Rings(
        "rings3d",
        "Rings to turn",
        shown,
        "Discrete (beads) and continuum (lines) equilibria superimposed; lengths in Å.",
        "Figure 11",
    )
    return Findings(results, [figure, turn])


def _overlay(case: Case, decimals: int) -> dict[str, Any]:
    """Centres and helices of both rings in Å in the discrete ring's principal axes."""
    rise = case.chain.rise_A
    n = case.chain.n_steps
    fixed = case.discrete.centres[:n]
    centre = fixed.mean(axis=0)
    axes = np.linalg.svd(fixed - centre)[2]
    axes *= np.sign(np.linalg.det(axes))
    moving = case.base_pairs.centres[:n]
    u, _, vt = np.linalg.svd((moving - moving.mean(axis=0)).T @ (fixed - centre))
    turn = (u * np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])) @ vt
    onto = turn @ axes.T
    rings = {
        "discrete": _helices(case.discrete.centres - centre, case.discrete.frames, axes.T),
        "continuum": _helices(
            case.base_pairs.centres - moving.mean(axis=0), case.base_pairs.frames, onto
        ),
    }
    return {
        model: {part: np.round(rise * points, decimals).tolist() for part, points in parts.items()}
        for model, parts in rings.items()
    }


def _helices(centres: Any, frames: Any, rotation: Any) -> dict[str, Any]:
    d1, d2 = frames[..., 0], frames[..., 1]
    return {
        "axis": centres @ rotation,
        "strand1": (centres + _HELIX_2 * d2 + _HELIX_1 * d1) @ rotation,
        "strand2": (centres - _HELIX_2 * d2 + _HELIX_1 * d1) @ rotation,
    }


def _curves(case: Case) -> list[dict[str, Any]]:
    overlay = _overlay(case, decimals=1)
    return [
        {
            "label": f"{model}, {part}",
            "model": model,
            "style": {"discrete": "beads", "continuum": "line"}[model],
            "part": part,
            "points": overlay[model][part],
        }
        for model in ("discrete", "continuum")
        for part in ("axis", "strand1", "strand2")
    ]
