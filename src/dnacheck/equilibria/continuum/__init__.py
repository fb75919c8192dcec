"""Continuum rings: the boundary-value problem (4.9) with (4.11) by Gauss collocation."""

from dnacheck.equilibria.continuum.options import ContinuumOptions
from dnacheck.equilibria.continuum.search import Equilibria, lowest_continuum_ring
from dnacheck.equilibria.continuum.solver import solve_continuum_ring
from dnacheck.equilibria.ring import Equilibrium

__all__ = [
    "ContinuumOptions",
    "Equilibria",
    "Equilibrium",
    "lowest_continuum_ring",
    "solve_continuum_ring",
]
