"""Reader of 3DNA's ``.par`` files: a molecule with the shape that its base-pair steps had.

A file has the number of base pairs, a line of column names, and a row for each base pair with its
six base-pair parameters, which are not used, and the six of the step that leads to it from the pair
before (degrees and Å). The first row's step is that which closes a ring, or zero for an open
molecule. Lu & Olson, Nucleic Acids Res. 31, 5108 (2003).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dnacheck.model.molecules import Molecule
from dnacheck.model.parameter_files import FIELD_ORDER, rigid_units, size_complaint
from dnacheck.model.parameters import COORDINATES
from dnacheck.model.sequence import complement, parse_sequence
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

COLUMNS = (
    "shear", "stretch", "stagger", "buckle", "prop-tw", "opening",
    "shift", "slide", "rise", "tilt", "roll", "twist",
)  # fmt: skip
"""Columns of a file of local parameters, after the base pair's letters."""


def is_par(path: str) -> bool:
    """Whether a name is that of a ``.par`` file."""
    return path.lower().endswith(".par")


def read_par(path: Path) -> Molecule:
    """Molecule of a ``.par`` file, with the shape that its steps have there.

    Raises
    ------
    InputError
        One line with the file, the line and the mend: other columns, another number of base pairs,
        letters that do not pair, angles in radians.
    """

    def fail(number: int, message: str) -> InputError:
        return InputError(f"file '{path}', line {number}: {message}")

    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not text"
        raise InputError(f"file '{path}': {reason}; check the path") from None
    letters, rows, last = [], [], 0
    count: int | None = None
    header = False
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if not words:
            continue
        pairs = re.match(r"\s*(\d+)\s*#\s*base-pairs", line)
        if pairs is not None:
            count = int(pairs[1])
        elif words[0].startswith("#"):
            names = tuple(word.lower() for word in line.replace("#", " ").split())
            if names != COLUMNS:
                raise fail(
                    number,
                    f"columns are {' '.join(names[:14]) or 'not named'}, not {' '.join(COLUMNS)}; "
                    "give 3DNA's bp_step.par",
                )
            header = True
        elif "#" not in line:
            if not header:
                raise fail(number, f"no line with the column names # {' '.join(COLUMNS)} before it")
            letters.append(_letter(words[0], number, fail))
            try:
                row = [float(word) for word in words[1:]]
            except ValueError:
                raise fail(number, "a value is not a number") from None
            if len(row) != len(COLUMNS) or not np.isfinite(row).all():
                raise fail(
                    number, f"{len(row)} values, not {len(COLUMNS)} finite ones; other columns?"
                )
            rows.append(row)
            last = number
    if not rows:
        raise InputError(f"file '{path}': no base pairs; give 3DNA's bp_step.par")
    if count is not None and count != len(rows):
        raise fail(last, f"{len(rows)} base pairs, not the {count} of the first line")
    at = [COLUMNS.index(name) for name in FIELD_ORDER]
    order = [FIELD_ORDER.index(name) for name in COORDINATES["rigid"]]
    into = np.array(rows)[:, at][:, order] * rigid_units("degree")
    complaint = size_complaint("rigid", into[1:], None, "degree") if len(into) > 1 else ""
    if complaint:
        raise InputError(
            f"file '{path}': the mean twist is {np.degrees(np.abs(into[1:, 0]).mean()):.3g} "
            "degrees: these are radians; 3DNA's angles are in degrees"
        )
    # Row k is the step that leads to pair k; step k leads away from it.
    ground = np.roll(into, -1, axis=0)
    if not into[0].any():
        ground[-1] = np.nan
    ground.setflags(write=False)
    return Molecule(parse_sequence("".join(letters), path.stem), ground=ground)


def _letter(pair: str, number: int, fail: Callable[[int, str], InputError]) -> str:
    match = re.fullmatch(r"([ACGT])-?([ACGT])", pair.upper())
    if match is None or complement(match[1]) != match[2]:
        raise fail(number, f"'{pair}' is not a base pair such as A-T")
    return match[1]
