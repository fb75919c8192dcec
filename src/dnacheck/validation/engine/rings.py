"""Chains, rods and lowest rings of a scene, each computed once per process."""

from __future__ import annotations

from functools import lru_cache

from dnacheck.equilibria.continuum import ContinuumOptions, lowest_continuum_ring
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.equilibria.ring import Equilibria, Equilibrium
from dnacheck.model.a_tracts import Region
from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.molecules import Molecule
from dnacheck.model.rod import Rod, RodOptions, build_rod
from dnacheck.model.sequence import Sequence
from dnacheck.validation.scene.scene import Scene


@lru_cache(maxsize=4096)
def _chain(
    name: str,
    letters: str,
    regions: tuple[Region, ...] | None,
    angles: str,
    ratio: float | None,
    persistence_length_A: float,
    rise_A: float,
    a_tracts: str,
) -> Chain:
    return build_chain(
        Molecule(Sequence(name, letters), regions),
        angles,
        twist_ratio=ratio,
        persistence_length_A=persistence_length_A,
        rise_A=rise_A,
        a_tracts=a_tracts,
    )


def scene_chain(
    scene: Scene, molecule: Molecule, angles: str | None = None, ratio: float | None = None
) -> Chain:
    """Chain of a molecule with the scene's parameters, or another angle set or twist ratio."""
    model = scene.model
    angles = model.angles[0] if angles is None else angles
    ratio = model.twist_ratios[0] if ratio is None else ratio
    file = scene.angle_file(angles)
    twisted = angles == "trifonov2" if file is None else file.has_a_tract_twist
    return _chain(
        molecule.name,
        molecule.sequence.letters,
        molecule.a_tract_regions,
        angles if file is None else file.path,
        None if file is not None and file.has_stiffness else ratio,
        model.persistence_length_A,
        model.rise_A,
        model.a_tracts if twisted else "auto",
    )


_SEARCHES: dict[int, tuple[Chain, Equilibria]] = {}
_RODS: dict[tuple[int, RodOptions], tuple[Chain, Rod]] = {}
_CONTINUA: dict[tuple[int, RodOptions], tuple[Chain, Equilibrium]] = {}


def rings(chain: Chain) -> Equilibria:
    """Minima of the discrete chain, lowest first."""
    key = id(chain)
    if key not in _SEARCHES:
        _SEARCHES[key] = (chain, find_rings(chain))
    return _SEARCHES[key][1]


def lowest_ring(chain: Chain) -> Equilibrium:
    """Lowest discrete ring; raises SolveError where none is found."""
    return rings(chain).lowest


def rod_options(scene: Scene) -> RodOptions:
    """The scene's w, k, m and padding."""
    choice = scene.continuum
    return RodOptions(
        filter_width=choice.filter_width,
        intervals=choice.intervals,
        degree=choice.degree,
        padding=choice.padding,
    )


def rod_of(chain: Chain, options: RodOptions) -> Rod:
    """Continuum rod of a chain."""
    key = (id(chain), options)
    if key not in _RODS:
        _RODS[key] = (chain, build_rod(chain, options))
    return _RODS[key][1]


def lowest_continuum(chain: Chain, options: RodOptions) -> Equilibrium:
    """Lowest continuum ring, its energy converged to 1e-6."""
    key = (id(chain), options)
    if key not in _CONTINUA:
        found = lowest_continuum_ring(rod_of(chain, options), options=ContinuumOptions())
        _CONTINUA[key] = (chain, found.lowest)
    return _CONTINUA[key][1]
