"""Regions of a molecule whose steps take the A-tract twist of an angle set.

Rule ``auto``: a run is six or more A, or six or more T, in a row. Runs at most two helical turns
(21 bp) apart belong to one tract region. A region reaches from two steps before the first base
pair of its first run to two steps past the last base pair of its last run, cut at the ends of the
molecule. On the eleven molecules of Table II this reproduces the regions that their published
energies demand (``data/molecules/kahn_crothers.fasta``). With ``tracts-only`` the region is just
the steps inside each run, the reading that meets the paper's Monte Carlo column best.
"""

from __future__ import annotations

import re

from dnacheck.numerics.outcome import InputError

SHORTEST_RUN = 6
"""Bases in a row that make an A-tract (Section X: six A-tracts of six)."""
LARGEST_GAP = 21
"""Base pairs between runs that still belong to one phased region: two turns of B-DNA."""
FLANK = 2
"""Steps beyond a region's outer runs that take its twist."""

Region = tuple[int, int]
"""First and last step of a region, counted from 0, both included."""

_RUN = re.compile(f"A{{{SHORTEST_RUN},}}|T{{{SHORTEST_RUN},}}")


def automatic_regions(letters: str) -> tuple[Region, ...]:
    """Regions that rule ``auto`` of this module finds, in order along the molecule."""
    regions: list[list[int]] = []
    for match in _RUN.finditer(letters):
        first, last = match.start(), match.end() - 1
        if regions and first - regions[-1][1] - 1 <= LARGEST_GAP:
            regions[-1][1] = last
        else:
            regions.append([first, last])
    steps = len(letters)
    return tuple((max(0, a - FLANK), min(steps - 1, b + FLANK)) for a, b in regions)


def tract_regions(letters: str) -> tuple[Region, ...]:
    """Steps inside each run of at least five equal A or T: five steps in a run of six."""
    pattern = re.compile(f"A{{{SHORTEST_RUN - 1},}}|T{{{SHORTEST_RUN - 1},}}")
    return tuple((m.start(), m.end() - 2) for m in pattern.finditer(letters))


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
