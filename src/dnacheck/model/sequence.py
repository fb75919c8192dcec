"""Validated DNA sequences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.numerics.outcome import InputError

BASES = "ACGT"
MINIMUM_LENGTH = 10
"""Shortest molecule that is accepted, in base pairs; below it the ring models mean nothing."""

STEP_NAMES = tuple(first + second for first in BASES for second in BASES)
"""The 16 base-pair steps, 5' to 3' on the strand that is read, in the order of all step tables."""

_COMPLEMENT = str.maketrans("ACGT", "TGCA")


@dataclass(frozen=True)
class Sequence:
    """A molecule's letters on one strand, 5' to 3', upper case A, C, G, T only."""

    name: str
    letters: str

    def __len__(self) -> int:
        return len(self.letters)

    def reverse_complement(self) -> Sequence:
        """The same molecule read on its other strand."""
        return Sequence(self.name, reverse_complement(self.letters))

    def step_indices(self) -> NDArray[np.intp]:
        """Index into the step tables of each of the N steps, shape (N,).

        Step i leads from base pair i to base pair i+1; the last one leads back to a copy of the
        first base pair (the fictitious base pair of Section II).
        """
        codes = np.frombuffer(self.letters.encode(), dtype=np.uint8)
        index = np.searchsorted(np.frombuffer(BASES.encode(), dtype=np.uint8), codes)
        return (4 * index + np.roll(index, -1)).astype(np.intp)


def complement(letters: str) -> str:
    """Letters that pair with the given ones, in the same order: the other strand 3' to 5'."""
    return letters.translate(_COMPLEMENT)


def reverse_complement(letters: str) -> str:
    """Letters of the other strand, 5' to 3'."""
    return letters.translate(_COMPLEMENT)[::-1]


def parse_sequence(text: str, name: str) -> Sequence:
    """Check and normalise a sequence; white space is dropped and lower case accepted.

    Raises
    ------
    InputError
        Empty, shorter than 10 base pairs, or a letter other than A, C, G, T (the message names
        its position, counted from 1).
    """
    letters = "".join(text.split()).upper()
    if not letters:
        raise InputError(f"sequence '{name}': it is empty; give at least {MINIMUM_LENGTH} bases")
    if letters.strip(BASES):
        for position, letter in enumerate(letters, start=1):
            if letter not in BASES:
                raise InputError(
                    f"sequence '{name}', position {position}: '{letter}' is not one of A, C, G, T"
                )
    if len(letters) < MINIMUM_LENGTH:
        raise InputError(
            f"sequence '{name}': {len(letters)} base pairs are too few for a ring; "
            f"give at least {MINIMUM_LENGTH}"
        )
    return Sequence(name, letters)
