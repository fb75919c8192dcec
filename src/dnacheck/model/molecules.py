"""Molecules by name, by letters or from a FASTA file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from dnacheck.model.a_tracts import Region
from dnacheck.model.data_files import data_directory
from dnacheck.model.sequence import Sequence, parse_sequence
from dnacheck.numerics.outcome import InputError


@dataclass(frozen=True)
class Molecule:
    """A sequence and, where it is known from data, the steps that take the A-tract twist."""

    sequence: Sequence
    a_tract_regions: tuple[Region, ...] | None = None

    @property
    def name(self) -> str:
        """Name of the molecule."""
        return self.sequence.name


@cache
def _embedded() -> dict[str, Molecule]:
    molecules = {}
    for header, letters in _records(data_directory() / "molecules" / "kahn_crothers.fasta"):
        name = header.split()[0]
        match = re.search(r"steps_with_A_tract_twist=(\d+)\.\.(\d+)", header)
        regions = None if match is None else ((int(match[1]), int(match[2])),)
        molecules[name] = Molecule(parse_sequence(letters, name), regions)
    return molecules


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


def read_fasta(path: Path) -> Iterator[Molecule | InputError]:
    """Molecules of a FASTA file in order, one at a time; a bad record comes as its error.

    Raises
    ------
    InputError
        The file cannot be read, is not text, or holds no record.
    """
    found = False
    try:
        for number, (header, letters) in enumerate(_records(path), start=1):
            found = True
            name = header.split()[0] if header.split() else f"record {number}"
            try:
                yield Molecule(parse_sequence(letters, name))
            except InputError as error:
                yield error
    except OSError as error:
        raise InputError(f"file '{path}': {error.strerror or error}; check the path") from None
    except UnicodeDecodeError:
        raise InputError(f"file '{path}': not a text file; give a FASTA file") from None
    except ValueError as error:
        raise InputError(f"file '{path}': not FASTA ({error}); records start with '>'") from None
    if not found:
        raise InputError(f"file '{path}': no FASTA record; a record starts with a line '>name'")


def read_target(target: str) -> Iterator[Molecule | InputError]:
    """Molecules that a command-line TARGET names: embedded name, FASTA file or literal letters.

    Raises
    ------
    InputError
        The target is none of these, or its file cannot be read.
    """
    if target.upper() in _embedded():
        yield embedded(target)
        return
    path = Path(target)
    looks_like_path = "/" in target or "." in target or "\\" in target
    try:
        is_file = bool(target.strip()) and path.exists()
    except OSError:
        is_file = False
    if is_file or looks_like_path:
        yield from read_fasta(path)
    elif not re.fullmatch(r"[A-Za-z\s]*", target):
        names = ", ".join(embedded_names())
        raise InputError(
            f"target '{target}' is neither an embedded molecule ({names}), nor a file, "
            "nor a sequence of A, C, G, T"
        )
    else:
        yield Molecule(parse_sequence(target, "sequence"))
