"""Table II: discrete and continuum rings of the eleven molecules against the paper."""

from __future__ import annotations

from dnacheck.validation.checks.table2.controls import controls
from dnacheck.validation.checks.table2.energies import continuum, discrete, gap
from dnacheck.validation.checks.table2.shapes import shape
from dnacheck.validation.engine.registry import Check, Group, Level
from dnacheck.validation.scene.scene import Scene


def _applies(scene: Scene) -> str | None:
    if not scene.checks.against_paper:
        return "the scene does not ask for the paper's values"
    return None


_BOTH = ("energy", "continuum_energy")

GROUP = Group(
    "table2",
    "Rings against the paper",
    "The eleven molecules of Kahn and Crothers: letters to discrete and continuum rings.",
    (
        Check("table2.discrete", "discrete energies of Table II", discrete, 1.0, ("energy",),
              Level.QUICK, _applies),
        Check("table2.continuum", "continuum energies of Table II", continuum, 1.0,
              ("continuum_energy",), Level.QUICK, _applies),
        Check("table2.gap", "continuum against discrete, side by side", gap, 1.5, _BOTH,
              Level.QUICK, _applies),
        Check("table2.shape", "shapes superimposed (Figure 11)", shape, 1.0,
              (*_BOTH, "shape_A"), Level.QUICK, _applies),
        Check("table2.controls", "wrong models must be refused", controls, 1.0, ("energy",),
              Level.QUICK, _applies),
    ),
)  # fmt: skip
