"""What the scene asked for, by the cheapest model that is shown to be accurate enough."""

from __future__ import annotations

from dnacheck.validation.checks.requested.energies import continuum_energy, energy
from dnacheck.validation.checks.requested.ln_j import ln_J
from dnacheck.validation.checks.requested.shapes import shape
from dnacheck.validation.checks.requested.thermal import thermal_energy
from dnacheck.validation.engine.registry import Check, Group, Level

GROUP = Group(
    "wanted",
    "The quantities you asked for",
    "The scene file, its [wanted] table, names quantities and the accuracy each must have. Ring "
    "energies are the discrete chain's; the others are computed by the cheapest model or method "
    "whose measured error is within that accuracy.",
    (
        Check("wanted.energy", "ring energies of the discrete chain", energy, 2.0, ("energy",),
              Level.QUICK),
        Check("wanted.continuum_energy", "continuum energies on the coarsest mesh that suffices",
              continuum_energy, 3.0, ("continuum_energy",), Level.QUICK),
        Check("wanted.shape_A", "how far the two models' shapes are apart", shape, 2.0,
              ("shape_A",), Level.QUICK),
        Check("wanted.ln_J", "J factors by the cheapest method", ln_J, 3.0, ("ln_J",),
              Level.QUICK),
        Check("wanted.thermal_energy", "mean energies at temperature by the cheapest model",
              thermal_energy, 3.0, ("thermal_energy",), Level.QUICK),
    ),
)  # fmt: skip
