"""Elastic DNA rings: discrete chains and continuum rods, each checked against the other.

    import dnacheck as dc
    ring = dc.rings("11T15").lowest
    ring.energy_RT, ring.link, dc.jfactor("11T15").minus_lnJ

chain             discrete chain of a molecule: name, letters or FASTA file
rod               continuum rod of the same molecule
bind              the chain with a protein's steps held
rings             equilibria of a chain or a rod, lowest energy first
jfactor           J factor, by the cheapest method that meets the tolerance
diagram           bifurcation diagram against the end twist
twist_ratio_scan  ring energies over twisting / bending stiffness
ensemble          a ring in thermal motion, by Monte Carlo or OpenMM
scan              lowest ring and J of many sequences
sensitivity       what each step and each letter does to ln J
profile           J against length
fit               mechanics from measured J factors
validate          the validation report of a scene
Ring, NickedRing, HingedRing, Loop, Pull                 what an end is held to
Auto, Laplace, ClosureSampling, HalfChain, Umbrella      ways to compute J
InputError        bad input: one line that names the argument and the mend
SolveError        no solution: partial holds what there was

Energies are in RT, lengths in Å, angles in radians unless a name ends in another unit.
help(dc.rings) and so on tell the rest. Everything is loaded when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dnacheck.api.cyclization import jfactor as jfactor
    from dnacheck.api.equilibria import diagram as diagram
    from dnacheck.api.equilibria import rings as rings
    from dnacheck.api.equilibria import twist_ratio_scan as twist_ratio_scan
    from dnacheck.api.many import scan as scan
    from dnacheck.api.many import validate as validate
    from dnacheck.api.mechanics import fit as fit
    from dnacheck.api.mechanics import profile as profile
    from dnacheck.api.mechanics import sensitivity as sensitivity
    from dnacheck.api.molecules import chain as chain
    from dnacheck.api.molecules import rod as rod
    from dnacheck.api.thermal import ensemble as ensemble
    from dnacheck.cyclization.methods import Auto as Auto
    from dnacheck.cyclization.methods import ClosureSampling as ClosureSampling
    from dnacheck.cyclization.methods import HalfChain as HalfChain
    from dnacheck.cyclization.methods import Laplace as Laplace
    from dnacheck.cyclization.methods import Umbrella as Umbrella
    from dnacheck.equilibria.boundary import HingedRing as HingedRing
    from dnacheck.equilibria.boundary import Loop as Loop
    from dnacheck.equilibria.boundary import NickedRing as NickedRing
    from dnacheck.equilibria.boundary import Pull as Pull
    from dnacheck.equilibria.boundary import Ring as Ring
    from dnacheck.model.guests import bind as bind
    from dnacheck.numerics.outcome import InputError as InputError
    from dnacheck.numerics.outcome import SolveError as SolveError

__version__ = "0.1.0"

# A new public name is a line here, one among the imports above, and one in the text at the top.
_HOME = {
    "chain": "api.molecules",
    "rod": "api.molecules",
    "bind": "model.guests",
    "rings": "api.equilibria",
    "jfactor": "api.cyclization",
    "diagram": "api.equilibria",
    "twist_ratio_scan": "api.equilibria",
    "ensemble": "api.thermal",
    "scan": "api.many",
    "sensitivity": "api.mechanics",
    "profile": "api.mechanics",
    "fit": "api.mechanics",
    "validate": "api.many",
    "Ring": "equilibria.boundary",
    "NickedRing": "equilibria.boundary",
    "HingedRing": "equilibria.boundary",
    "Loop": "equilibria.boundary",
    "Pull": "equilibria.boundary",
    "Auto": "cyclization.methods",
    "Laplace": "cyclization.methods",
    "ClosureSampling": "cyclization.methods",
    "HalfChain": "cyclization.methods",
    "Umbrella": "cyclization.methods",
    "InputError": "numerics.outcome",
    "SolveError": "numerics.outcome",
}


def __getattr__(name: str) -> Any:
    """Load a public name (PEP 562)."""
    if name not in _HOME:
        import difflib

        close = difflib.get_close_matches(name, _HOME, n=1)
        meant = f"; did you mean '{close[0]}'?" if close else ""
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'{meant}")
    from importlib import import_module

    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public names."""
    return [*_HOME, "__version__"]
