"""Rings as PDB or GRO files that MDAnalysis, VMD and PyMOL open."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

HELIX_ALONG_D2 = 2.521
HELIX_ALONG_D1 = -0.769
"""Phosphates of idealised B-DNA in the caption of Figure 11, in steps: 8.57 Å and -2.61 Å at a
rise of 3.4 Å, a radius of 8.96 Å as it should be."""

FORMATS = (".pdb", ".gro")
_LARGEST_PDB_RING = 9999


def sugar_phosphate_helices(centres: ArrayLike, frames: ArrayLike) -> tuple[Array, Array]:
    """The two helices of Figure 11, r +- 2.521 d2 - 0.769 d1.

    Parameters
    ----------
    centres : array_like, shape (n, 3)
        In steps.
    frames : array_like, shape (n, 3, 3)
        Directors in the columns.

    Returns
    -------
    first, second : ndarray, shape (n, 3)
        In steps.
    """
    centres, frames = np.asarray(centres, dtype=float), np.asarray(frames, dtype=float)
    shared = centres + HELIX_ALONG_D1 * frames[:, :, 0]
    across = HELIX_ALONG_D2 * frames[:, :, 1]
    return shared + across, shared - across


def write_ring_structure(
    path: Path, centres: ArrayLike, frames: ArrayLike, letters: str, rise_A: float, name: str
) -> None:
    """Write a ring's centres and helices, three atoms per base pair, whole or not at all.

    Atom ``C`` is the base-pair centre, ``P1`` and ``P2`` lie on the two sugar-phosphate helices.
    Residue i is base pair i (from 1), named after the base that is read; successive atoms of a
    kind are bonded around the ring.

    Parameters
    ----------
    centres : array_like, shape (N + 1, 3)
        In steps; the last repeats the first and is left out.
    frames : array_like, shape (N + 1, 3, 3)
    letters : str
        The N bases; empty for a chain without a sequence.
    rise_A : float
        Length of a step.

    Raises
    ------
    InputError
        The ending is not .pdb or .gro, the ring has more residues than a PDB file can number, or
        the folder cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise InputError(f"structure file '{path}': the name must end in .pdb or .gro")
    n = len(np.asarray(centres)) - 1
    if suffix == ".pdb" and n > _LARGEST_PDB_RING:
        raise InputError(
            f"structure file '{path}': a PDB file numbers at most {_LARGEST_PDB_RING} base pairs, "
            f"this ring has {n}; write a .gro file"
        )
    centres = np.asarray(centres, dtype=float)[:n]
    frames = np.asarray(frames, dtype=float)[:n]
    first, second = sugar_phosphate_helices(centres, frames)
    positions = rise_A * np.stack([centres, first, second], axis=1).reshape(-1, 3)
    positions -= positions.mean(axis=0)

    import MDAnalysis

    universe = MDAnalysis.Universe.empty(
        3 * n, n_residues=n, atom_resindex=np.repeat(np.arange(n), 3), trajectory=True
    )
    bases = letters or "N" * n
    for attribute, values in (
        ("name", ["C", "P1", "P2"] * n),
        ("type", ["C", "P", "P"] * n),
        ("element", ["C", "P", "P"] * n),
        ("resname", [f"D{base}" for base in bases]),
        ("resid", np.arange(1, n + 1)),
        ("segid", ["A"]),
        ("chainID", ["A"] * (3 * n)),
        ("occupancy", np.ones(3 * n)),
        ("tempfactor", np.zeros(3 * n)),
        ("altLoc", [""] * (3 * n)),
        ("icode", [""] * n),
        ("record_type", ["ATOM"] * (3 * n)),
        ("formalcharge", np.zeros(3 * n, dtype=int)),
    ):
        universe.add_TopologyAttr(attribute, values)
    around = (np.arange(3 * n) + 3) % (3 * n)
    universe.add_TopologyAttr("bonds", np.column_stack([np.arange(3 * n), around]))
    universe.atoms.positions = positions
    edge = float(np.ptp(positions, axis=0).max()) + 20.0
    universe.dimensions = [edge, edge, edge, 90.0, 90.0, 90.0]
    try:
        handle, scratch = tempfile.mkstemp(suffix=suffix, dir=path.parent)
        os.close(handle)
    except OSError as error:
        raise InputError(f"structure file '{path}': {error.strerror}; check the folder") from None
    try:
        universe.atoms.write(scratch, **({"bonds": "all"} if suffix == ".pdb" else {}))
        os.replace(scratch, path)
    except BaseException:
        Path(scratch).unlink(missing_ok=True)
        raise
