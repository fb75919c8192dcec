"""Continuum rod from a discrete chain (Sections V to VII)."""

from dnacheck.model.rod.options import RodOptions
from dnacheck.model.rod.rod import Rod, build_rod

__all__ = ["Rod", "RodOptions", "build_rod"]
