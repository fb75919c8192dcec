"""Rings as PDB, GRO or mmCIF files that MDAnalysis, VMD and PyMOL open.

PDB and GRO files have columns of fixed width; what a file can hold is checked from its name and the
number of base pairs alone, so that it can be asked before anything is solved.
"""

from __future__ import annotations

import gzip
import io
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.io.files import atomic_write
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

HELIX_ALONG_D2 = 2.521
HELIX_ALONG_D1 = -0.769
"""Phosphates of idealised B-DNA in the caption of Figure 11, in steps: 8.57 Å and -2.61 Å at a
rise of 3.4 Å, a radius of 8.96 Å as it should be."""

COLUMNS_A = {".pdb": (-999.999, 9999.999), ".gro": (-9999.99, 99999.99)}
"""Least and largest coordinate, in Å, that the columns of a format hold."""
LARGEST_PDB_RING = 9999
"""Residues that a PDB file can number."""
FORMATS = (".pdb", ".gro", ".cif")

_HELIX_REACH = 3.0
"""Steps by which a helix may stand off its centre line; more than the two constants above give."""


@dataclass(frozen=True)
class StructureFile:
    """A structure file that can be written and can hold a ring.

    Attributes
    ----------
    path : Path
    suffix : str
        One of ``FORMATS``.
    packed : bool
        Whether the name ends in ``.gz``.
    """

    path: Path
    suffix: str
    packed: bool


def structure_file(path: Path, n_bp: int, rise_A: float) -> StructureFile:
    """The file of a structure, checked before there is one.

    A closed curve of length L is nowhere wider than L/2, which bounds the coordinates of any ring.

    Parameters
    ----------
    path : Path
        Ends in .pdb, .gro or .cif, or one of these and .gz.
    n_bp : int
        Base pairs of the ring.
    rise_A : float
        Length of a step.

    Raises
    ------
    InputError
        Another ending, a ring that the format cannot hold, or a place that cannot be written.
    """
    packed = path.suffix.lower() == ".gz"
    suffix = (path.with_suffix("") if packed else path).suffix.lower()
    label = f"structure file '{path}'"
    if suffix not in FORMATS:
        raise InputError(f"{label}: the name must end in .pdb, .gro or .cif, or these and .gz")
    if suffix == ".pdb" and n_bp > LARGEST_PDB_RING:
        raise InputError(
            f"{label}: a PDB file numbers at most {LARGEST_PDB_RING} base pairs, "
            f"this ring has {n_bp}; write a .cif file"
        )
    if suffix in COLUMNS_A:
        least, largest = COLUMNS_A[suffix]
        most = int((largest - least) / rise_A * 2.0 - 4.0 * _HELIX_REACH)
        if n_bp > most:
            raise InputError(
                f"{label}: a ring of {n_bp} base pairs may be wider than the columns of "
                f"{suffix} files, which hold any ring of up to {most}; write a .cif file"
            )
    folder = path.parent
    if path.is_dir():
        raise InputError(f"{label}: it is a directory; name a file")
    if not folder.is_dir():
        raise InputError(f"{label}: there is no folder '{folder}'; make it or name another")
    if not os.access(path if path.exists() else folder, os.W_OK):
        raise InputError(f"{label}: it may not be written; name a file in a writable folder")
    return StructureFile(path, suffix, packed)


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
    Residue i is base pair i (from 1), named after the base that is read. Successive atoms of a
    kind are bonded around the ring; of the formats, PDB has the bonds. The atoms are centred on
    the origin, or, where only that makes them fit, on the middle of the format's columns.

    Parameters
    ----------
    path : Path
        As :func:`structure_file` takes it.
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
        Of :func:`structure_file`, or the atoms (of an open chain) are wider than the columns.
    """
    n = len(np.asarray(centres)) - 1
    file = structure_file(path, n, rise_A)
    centres = np.asarray(centres, dtype=float)[:n]
    frames = np.asarray(frames, dtype=float)[:n]
    first, second = sugar_phosphate_helices(centres, frames)
    positions = rise_A * np.stack([centres, first, second], axis=1).reshape(-1, 3)
    positions = _placed(positions, file)
    bases = letters or "N" * n
    if file.suffix == ".cif":
        content = _mmcif(positions, bases, name)
    else:
        content = _columns(positions, bases, file.suffix)
    atomic_write(path, gzip.compress(content, mtime=0) if file.packed else content)


def _placed(positions: Array, file: StructureFile) -> Array:
    """Positions moved to where the format holds them."""
    centred = np.asarray(positions - positions.mean(axis=0))
    if file.suffix not in COLUMNS_A:
        return centred
    least, largest = COLUMNS_A[file.suffix]
    if centred.min() > least and centred.max() < largest:
        return centred
    low, high = centred.min(axis=0), centred.max(axis=0)
    if not np.all(high - low < largest - least):
        raise InputError(
            f"structure file '{file.path}': the chain is wider than the columns of {file.suffix} "
            "files; write a .cif file"
        )
    return np.asarray(centred + 0.5 * (least + largest) - 0.5 * (low + high))


def _columns(positions: Array, bases: str, suffix: str) -> bytes:
    """A PDB or GRO file."""
    import MDAnalysis

    n = len(bases)
    universe = MDAnalysis.Universe.empty(
        3 * n, n_residues=n, atom_resindex=np.repeat(np.arange(n), 3), trajectory=True
    )
    attributes: tuple[tuple[str, Any], ...] = (
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
    )
    for attribute, values in attributes:
        universe.add_TopologyAttr(attribute, values)
    around = (np.arange(3 * n) + 3) % (3 * n)
    universe.add_TopologyAttr("bonds", np.column_stack([np.arange(3 * n), around]))
    universe.atoms.positions = positions
    edge = float(np.ptp(positions, axis=0).max()) + 20.0
    universe.dimensions = [edge, edge, edge, 90.0, 90.0, 90.0]
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder) / f"ring{suffix}"
        universe.atoms.write(str(scratch), **({"bonds": "all"} if suffix == ".pdb" else {}))
        return scratch.read_bytes()


def _mmcif(positions: Array, bases: str, name: str) -> bytes:
    """An mmCIF file: one chain of one entity, an atom a line."""
    from Bio.PDB.mmcifio import MMCIFIO

    n = len(bases)
    atoms = ["C", "P1", "P2"] * n
    residues = np.repeat([f"D{base}" for base in bases], 3).tolist()
    numbers = np.repeat(np.arange(1, n + 1), 3).astype(str).tolist()
    columns: dict[str, list[str]] = {
        "group_PDB": ["ATOM"] * (3 * n),
        "id": np.arange(1, 3 * n + 1).astype(str).tolist(),
        "type_symbol": ["C", "P", "P"] * n,
        "label_atom_id": atoms,
        "label_alt_id": ["."] * (3 * n),
        "label_comp_id": residues,
        "label_asym_id": ["A"] * (3 * n),
        "label_entity_id": ["1"] * (3 * n),
        "label_seq_id": numbers,
        "pdbx_PDB_ins_code": ["?"] * (3 * n),
        **{
            f"Cartn_{axis}": [f"{value:.3f}" for value in positions[:, i]]
            for i, axis in enumerate("xyz")
        },
        "occupancy": ["1.00"] * (3 * n),
        "B_iso_or_equiv": ["0.00"] * (3 * n),
        "auth_seq_id": numbers,
        "auth_comp_id": residues,
        "auth_asym_id": ["A"] * (3 * n),
        "auth_atom_id": atoms,
        "pdbx_PDB_model_num": ["1"] * (3 * n),
    }
    writer = MMCIFIO()
    entry = "".join(letter if letter.isalnum() and letter.isascii() else "_" for letter in name)
    writer.set_dict(
        {"data_": entry or "ring", **{f"_atom_site.{key}": value for key, value in columns.items()}}
    )
    text = io.StringIO()
    writer.save(text)
    return text.getvalue().encode()
