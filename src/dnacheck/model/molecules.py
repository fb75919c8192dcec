"""Molecules, and the eleven that are embedded; files are read by :mod:`dnacheck.io.sequences`."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dnacheck.model.a_tracts import Region, mirrored_region
from dnacheck.model.data_files import data_directory
from dnacheck.model.parameters import STRAND_SIGNS
from dnacheck.model.sequence import Sequence, parse_sequence
from dnacheck.numerics.outcome import InputError


@dataclass(frozen=True)
class Molecule:
    """A sequence and what is known of it from data.

    Attributes
    ----------
    sequence : Sequence
    a_tract_regions : tuple of (first, last), optional
        Steps that take the A-tract twist.
    ground : ndarray, shape (N, 6), optional
        Unstressed shape of its own, in place of a parameter set's: twist, tilt, roll in radians,
        shift, slide, rise in Å. A row that is not a number leaves the step to the set.
    """

    sequence: Sequence
    a_tract_regions: tuple[Region, ...] | None = None
    ground: NDArray[np.float64] | None = field(default=None, compare=False)

    @property
    def name(self) -> str:
        """Name of the molecule."""
        return self.sequence.name

    def other_strand(self, regions: tuple[Region, ...]) -> Molecule:
        """The same ring read on its other strand, with the steps that take the A-tract twist.

        ``regions`` are those that this strand takes; rule ``auto`` by itself, applied to the other
        strand, would move them by one step.
        """
        n = len(self.sequence)
        ground = self.ground
        if ground is not None:
            # Step s of the other strand is step n - 2 - s, the last one n - 1, read backwards.
            ground = np.roll(ground[::-1], -1, axis=0) * STRAND_SIGNS["rigid"]
        return Molecule(
            self.sequence.reverse_complement(),
            tuple(mirrored_region(region, n) for region in regions),
            ground,
        )


@cache
def _embedded() -> dict[str, Molecule]:
    molecules = {}
    for header, letters in _records(data_directory() / "molecules" / "kahn_crothers.fasta"):
        name = header.split()[0]
        match = re.search(r"steps_with_A_tract_twist=(\d+)\.\.(\d+)", header)
        regions = None if match is None else ((int(match[1]), int(match[2])),)
        molecules[name] = Molecule(parse_sequence(letters, name), regions)
    return molecules


def is_embedded(name: str) -> bool:
    """Whether a name, in upper or lower case, is that of an embedded molecule."""
    return name.upper() in _embedded()


def embedded_names() -> tuple[str, ...]:
    """Names of the eleven molecules of Tables II and III, in the order of those tables."""
    return tuple(_embedded())


def embedded(name: str) -> Molecule:
    """One of the eleven molecules by name, in upper or lower case.

    Raises
    ------
    InputError
        No such name.
    """
    try:
        return _embedded()[name.upper()]
    except KeyError:
        names = ", ".join(embedded_names())
        raise InputError(f"molecule '{name}' is not embedded; choose from {names}") from None


def _records(path: Path) -> Iterator[tuple[str, str]]:
    from Bio.SeqIO.FastaIO import SimpleFastaParser

    with path.open(encoding="utf-8") as handle:
        yield from SimpleFastaParser(handle)
