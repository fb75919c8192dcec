"""Continuum rings: the boundary-value problem (4.9) with (4.11) by Gauss collocation."""

from dnacheck.equilibria.continuum.options import ContinuumOptions
from dnacheck.equilibria.continuum.ring import ContinuumRing
from dnacheck.equilibria.continuum.search import ContinuumSearch, lowest_continuum_ring
from dnacheck.equilibria.continuum.solver import solve_continuum_ring

__all__ = [
    "ContinuumOptions",
    "ContinuumRing",
    "ContinuumSearch",
    "lowest_continuum_ring",
    "solve_continuum_ring",
]
