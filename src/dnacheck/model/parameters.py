"""Parameter sets: ground values and stiffnesses of base-pair steps, with three angles or six.

A set of *hinge* steps has three angles about a pivot (tau, theta, phi: the paper's wedge angles); a
set of *rigid* steps has the six parameters of the field's convention. Both may depend on the step
alone (16 of them) or on its neighbours too (256 tetranucleotides, the step in the middle).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dnacheck.model.data_files import PARAMETER_SETS, data_directory
from dnacheck.model.sequence import BASES, STEP_NAMES, complement, reverse_complement
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]
StepKind = Literal["hinge", "rigid"]

COORDINATES: dict[StepKind, tuple[str, ...]] = {
    "hinge": ("tau", "theta", "phi"),
    "rigid": ("twist", "tilt", "roll", "shift", "slide", "rise"),
}
"""Order of a step's coordinates in the arrays of a set; the first is the twist of both kinds."""

STRAND_SIGNS: dict[StepKind, Array] = {
    "hinge": np.array([1.0, 1.0, -1.0]),
    "rigid": np.array([1.0, -1.0, 1.0, -1.0, 1.0, 1.0]),
}
"""What reading the other strand does to them: phi, or tilt and shift, change sign."""

TETRANUCLEOTIDES = tuple("".join(letters) for letters in itertools.product(BASES, repeat=4))

SYMMETRY_TOLERANCE = 1e-9
"""Largest departure from the strand relation that passes as rounding: radians, Å, or relative."""


@dataclass(frozen=True)
class ParameterSet:
    """Ground values and stiffnesses of all base-pair steps.

    Attributes
    ----------
    name, citation : str
        What it is called and where it comes from.
    kind : {"hinge", "rigid"}
        Three angles about a pivot, or six rigid-body parameters.
    ground : ndarray, shape (K, c)
        Unstressed coordinates of each step, in the order of ``COORDINATES[kind]``; radians and,
        for the three translations of a rigid step, Å. K is 16 (``STEP_NAMES``) or 256
        (``TETRANUCLEOTIDES``).
    stiffness : ndarray, shape (K, c, c), or None
        Symmetric positive stiffness in the same order. None, for hinges alone, stands for the
        paper's uniform diagonal one, whose ratio of twist to bend is chosen with the chain.
    stiffness_in_RT : bool
        Whether ``stiffness`` is in RT (per radian and Å); otherwise, for hinges, it is reduced (1
        is RT P/l).
    a_tract_twist : float or None
        Twist in radians of steps inside an A-tract region, if the set has one.
    strand_asymmetry : float
        Largest departure from the strand relation: in radians or Å, or relative stiffness.
    asymmetric_steps : tuple of str
        Steps that break the relation.
    unreversed_steps : tuple of str
        Those of them that are not printed in tables of the ten unique steps and have the values
        of their complement unreversed: somebody complemented the letters and stopped there.
    """

    name: str
    citation: str
    kind: StepKind
    ground: Array
    stiffness: Array | None
    stiffness_in_RT: bool
    a_tract_twist: float | None
    strand_asymmetry: float
    asymmetric_steps: tuple[str, ...] = ()
    unreversed_steps: tuple[str, ...] = ()

    @property
    def strand_symmetric(self) -> bool:
        """Whether both strands give the same parameters."""
        return self.strand_asymmetry <= SYMMETRY_TOLERANCE

    @property
    def context(self) -> int:
        """Letters that a step's parameters depend on: 2, or 4 with its neighbours."""
        return 2 if len(self.ground) == len(STEP_NAMES) else 4

    @property
    def strand_note(self) -> str:
        """One line on the strand relation; empty where it holds."""
        if self.strand_symmetric:
            return ""
        named = ", ".join(self.asymmetric_steps[:8])
        more = len(self.asymmetric_steps) - 8
        note = (
            f"parameter set '{self.name}' departs from the strand relation by "
            f"{self.strand_asymmetry:.3g} on step {named}"
            f"{f' and {more} more' if more > 0 else ''}; "
            "the two strands are different molecules to it"
        )
        if self.unreversed_steps:
            note += f"; {', '.join(self.unreversed_steps[:8])}: complemented without being reversed"
        return note

    def rows(self, step_indices: NDArray[np.intp]) -> NDArray[np.intp]:
        """Row of the set for each step of a closed molecule.

        Parameters
        ----------
        step_indices : ndarray of int, shape (N,)
            Of :meth:`dnacheck.model.sequence.Sequence.step_indices`.
        """
        if self.context == 2:
            return step_indices
        before = np.roll(step_indices, 1) // 4
        after = np.roll(step_indices, -1) % 4
        return (64 * before + 4 * step_indices + after).astype(np.intp)


def load_parameters(name: str) -> ParameterSet:
    """An embedded parameter set by name, or one from files of your own.

    Parameters
    ----------
    name : str
        One of ``PARAMETER_SETS``; the path of a TOML file (``data/angle_sets/README.md``); or two
        paths with a comma between, the step parameters and the force constants that emDNA packs
        (lines such as ``AA={...}`` with 6 and with 36 numbers).

    Raises
    ------
    InputError
        Unknown name, unreadable file, missing step, unknown key, non-positive or asymmetric
        stiffness, numbers in another unit, or a broken strand relation that a TOML file does not
        declare.
    """
    if name in PARAMETER_SETS:
        return _embedded(name)
    from dnacheck.model.parameter_files import read_emdna_pair, read_parameter_file

    if "," in name and not Path(name).exists():
        steps, _, forces = name.partition(",")
        return read_emdna_pair(Path(steps.strip()), Path(forces.strip()))
    path = Path(name)
    if not path.exists():
        raise InputError(
            f"parameter set '{name}' is neither {', '.join(PARAMETER_SETS)} nor a parameter file"
        )
    return read_parameter_file(path)


@lru_cache(maxsize=len(PARAMETER_SETS))
def _embedded(name: str) -> ParameterSet:
    from dnacheck.model.parameter_files import read_parameter_file

    return read_parameter_file(data_directory() / "angle_sets" / f"{name}.toml")


def step_names(count: int) -> tuple[str, ...]:
    """Names of the steps of a set with so many."""
    return STEP_NAMES if count == len(STEP_NAMES) else TETRANUCLEOTIDES


def other_strand(
    kind: StepKind,
    ground: Array,
    stiffness: Array | None,
    read: Callable[[str], str] = reverse_complement,
) -> tuple[Array, Array | None]:
    """The set as the other strand reads it: what each step's partner says of it.

    ``read`` gives the partner's letters; anything but the reverse complement is a mistake that
    people make.
    """
    names = step_names(len(ground))
    order = [names.index(read(name)) for name in names]
    signs = STRAND_SIGNS[kind]
    image = None if stiffness is None else stiffness[order] * np.outer(signs, signs)
    return ground[order] * signs, image


def strand_departures(
    kind: StepKind,
    ground: Array,
    stiffness: Array | None,
    read: Callable[[str], str] = reverse_complement,
) -> Array:
    """Departure of each step from the strand relation, shape (K,): radians or Å, or relative."""
    image, turned = other_strand(kind, ground, stiffness, read)
    departure = np.abs(ground - image).max(axis=1)
    if stiffness is not None and turned is not None:
        size = np.sqrt(np.einsum("kii,kjj->kij", stiffness, stiffness))
        departure = np.maximum(departure, (np.abs(stiffness - turned) / size).max(axis=(1, 2)))
    return np.asarray(departure)


def strand_report(
    kind: StepKind, ground: Array, stiffness: Array | None
) -> tuple[float, tuple[str, ...], tuple[str, ...]]:
    """Largest departure from the strand relation, the steps that break it, and those unreversed."""
    names = step_names(len(ground))
    departures = strand_departures(kind, ground, stiffness)
    wrong = strand_departures(kind, ground, stiffness, complement)
    broken = tuple(n for n, d in zip(names, departures, strict=True) if d > SYMMETRY_TOLERANCE)
    # Of a step and its reverse complement the first in the alphabet is the one that tables print.
    unreversed = tuple(
        name
        for name in broken
        if wrong[names.index(name)] <= SYMMETRY_TOLERANCE and name > reverse_complement(name)
    )
    return float(departures.max()), broken, unreversed
