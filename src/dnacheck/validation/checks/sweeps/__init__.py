"""Following rings: bifurcation diagrams, sweeps of the twist ratio, robustness."""

from __future__ import annotations

from dnacheck.validation.checks.sweeps.diagrams import imperfect, perfect
from dnacheck.validation.checks.sweeps.ratios import ratios, robustness
from dnacheck.validation.engine.registry import Check, Group
from dnacheck.validation.scene.scene import Scene

_MODULE = "dnacheck.equilibria.continuation.figures"


def _applies(scene: Scene) -> str | None:
    if not scene.checks.against_paper:
        return "the scene does not ask for the paper's figures"
    return None


_BOTH = ("energy", "continuum_energy")

GROUP = Group(
    "sweeps",
    "Diagrams and sweeps",
    "Solutions followed in the end twist and in the twist ratio (Sections VII, VIII and X).",
    (
        Check("sweeps.perfect", "perfect diagram (Figure 6)", perfect, 8.0, _BOTH,
              applies=_applies, requires=(_MODULE,)),
        Check("sweeps.imperfect", "imperfect diagram (Figures 7, 8 and 9)", imperfect, 1.0, _BOTH,
              applies=_applies, requires=(_MODULE,)),
        Check("sweeps.ratios", "sweeps of K3/K1 (Figures 12 to 16)", ratios, 5.0, _BOTH,
              applies=_applies, requires=(_MODULE,)),
        Check("sweeps.robustness", "filters and fits (Figure 10)", robustness, 2.0, _BOTH,
              applies=_applies, requires=(_MODULE,)),
    ),
)  # fmt: skip
