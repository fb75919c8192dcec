"""Regions of a molecule whose steps take the A-tract twist of an angle set.

Rule ``auto``: a run is six or more A, or six or more T, in a row. Runs at most two helical turns
(21 bp) apart belong to one tract region. A region reaches from two steps before the first base
pair of its first run to two steps past the last base pair of its last run. A ring has no ends: its
runs and regions go on across its first base pair; those of an open chain are cut at its ends. On
the eleven molecules of Table II this reproduces the regions that their published
energies demand (``data/molecules/kahn_crothers.fasta``). With ``tracts-only`` the region is just
the steps inside each run, the reading that meets the paper's Monte Carlo column best.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from dnacheck.numerics.outcome import InputError

SHORTEST_RUN = 6
"""Bases in a row that make an A-tract (Section X: six A-tracts of six)."""
LARGEST_GAP = 21
"""Base pairs between runs that still belong to one phased region: two turns of B-DNA."""
FLANK = 2
"""Steps beyond a region's outer runs that take its twist."""

Region = tuple[int, int]
"""First and last step of a region, counted from 0, both included. A region of a ring that goes on
across the first base pair has its first step after its last."""


def region_steps(region: Region, n_steps: int) -> NDArray[np.intp]:
    """Indices of a region's steps in a molecule of ``n_steps``."""
    first, last = region
    return np.arange(first, last + 1 if first <= last else last + 1 + n_steps) % n_steps


def mirrored_region(region: Region, n_steps: int) -> Region:
    """A ring's region as its other strand counts steps: step i is step N - 2 - i there."""
    first, last = region
    if (first, last) == (0, n_steps - 1):
        return region
    return (n_steps - 2 - last) % n_steps, (n_steps - 2 - first) % n_steps


def automatic_regions(letters: str, closed: bool = True) -> tuple[Region, ...]:
    """Regions that rule ``auto`` of this module finds, in order along the molecule.

    ``closed`` tells a ring from an open chain.
    """
    n = len(letters)
    origin, runs = _runs(letters, SHORTEST_RUN, closed)
    regions: list[list[int]] = []
    for first, last in runs:
        if regions and first - regions[-1][1] - 1 <= LARGEST_GAP:
            regions[-1][1] = last
        else:
            regions.append([first, last])
    if not closed:
        return tuple((max(0, a - FLANK), min(n - 1, b + FLANK)) for a, b in regions)
    if regions and regions[0][0] + n - regions[-1][1] - 1 <= LARGEST_GAP:
        if len(regions) == 1:
            return ((0, n - 1),)
        regions[0][0] = regions.pop()[0] - n
    return _from_origin([(a - FLANK, b + FLANK) for a, b in regions], origin, n)


def tract_regions(letters: str, closed: bool = True) -> tuple[Region, ...]:
    """Steps inside each run of at least five equal A or T: five steps in a run of six."""
    n = len(letters)
    origin, runs = _runs(letters, SHORTEST_RUN - 1, closed)
    if closed and runs == [(0, n - 1)]:
        return ((0, n - 1),)
    return _from_origin([(a, b - 1) for a, b in runs], origin, n)


def _runs(letters: str, shortest: int, closed: bool) -> tuple[int, list[Region]]:
    """Where counting starts, and first and last base pair of every run, counted from there.

    A ring is counted from a place where a run may end, so that none is parted.
    """
    origin = 0
    if closed:
        changes = (i for i in range(len(letters)) if letters[i - 1] != letters[i])
        origin = next(changes, 0)
    turned = letters[origin:] + letters[:origin]
    pattern = re.compile(f"A{{{shortest},}}|T{{{shortest},}}")
    return origin, [(m.start(), m.end() - 1) for m in pattern.finditer(turned)]


def _from_origin(regions: list[Region], origin: int, n: int) -> tuple[Region, ...]:
    """Regions counted from ``origin`` as the molecule is written, in order."""
    if any(last - first + 1 >= n for first, last in regions):
        return ((0, n - 1),)
    return tuple(sorted(((a + origin) % n, (b + origin) % n) for a, b in regions))


def parse_regions(text: str, n_steps: int) -> tuple[Region, ...]:
    """Regions given by hand as ``A..B`` or ``A..B,C..D`` (steps from 0, both ends included).

    Raises
    ------
    InputError
        The text does not have that form or a step lies outside the molecule.
    """
    regions = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d+)\.\.(\d+)\s*", part)
        if match is None:
            raise InputError(
                f"A-tract region '{part.strip()}': write it as A..B with step numbers from 0, "
                "or use auto, tracts-only or none"
            )
        first, last = int(match[1]), int(match[2])
        if first > last or last >= n_steps:
            raise InputError(
                f"A-tract region '{part.strip()}': steps run from 0 to {n_steps - 1} "
                "and the first must not exceed the last"
            )
        regions.append((first, last))
    return tuple(regions)
