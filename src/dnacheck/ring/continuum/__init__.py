"""Continuum rings: the boundary-value problem (4.9) with (4.11) by Gauss collocation."""

from dnacheck.ring.continuum.options import ContinuumOptions
from dnacheck.ring.continuum.ring import ContinuumRing
from dnacheck.ring.continuum.search import ContinuumSearch, lowest_continuum_ring
from dnacheck.ring.continuum.solver import solve_continuum_ring

__all__ = [
    "ContinuumOptions",
    "ContinuumRing",
    "ContinuumSearch",
    "lowest_continuum_ring",
    "solve_continuum_ring",
]
