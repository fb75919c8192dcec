"""Topology and trajectory files of bead chains, through MDAnalysis."""

from __future__ import annotations

import secrets
import struct
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dnacheck.md.geometry import bead_count
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import InputError

if TYPE_CHECKING:
    import MDAnalysis as mda

Array = NDArray[np.float64]

CENTRE_NAME, GROOVE_NAME = "CEN", "GRV"
TRAJECTORY_SUFFIXES = (".dcd", ".xtc")
# Decimals of a nanometre in XTC files, as many as the format can hold, found by reading back; its
# usual three would give angles to 0.005 rad.
_XTC_DECIMALS = (6, 5, 4, 3)
_DCD_HEADER_BYTES = 84
_SELF_CONTAINED = (".pdb", ".gro", ".ent")


def bead_universe(chain: Chain, closed: bool = True) -> mda.Universe:
    """MDAnalysis universe of a bead chain, with room for one frame.

    Base pairs are residues named DA, DC, DG, DT after the strand that is read (UNK without
    letters), with the atoms CEN and GRV; the bare last centre of an open chain is one more.
    """
    import MDAnalysis as mda

    n_beads = bead_count(chain.n_steps, closed)
    residue = np.arange(n_beads) // 2
    n_residues = int(residue[-1]) + 1
    centre = np.arange(n_beads) % 2 == 0
    universe = mda.Universe.empty(
        n_beads,
        n_residues=n_residues,
        atom_resindex=residue,
        residue_segindex=np.zeros(n_residues, dtype=int),
        trajectory=True,
    )
    letters = chain.letters + chain.letters[:1] if chain.letters else ""
    names = [f"D{letters[i]}" if i < len(letters) else "UNK" for i in range(n_residues)]
    elements = np.where(centre, "P", "N")
    values: dict[str, object] = {
        "name": np.where(centre, CENTRE_NAME, GROOVE_NAME),
        "type": elements,
        "element": elements,
        "mass": np.ones(n_beads),
        "record_type": ["ATOM"] * n_beads,
        "altLoc": [""] * n_beads,
        "occupancy": np.ones(n_beads),
        "tempfactor": np.zeros(n_beads),
        "formalcharge": np.zeros(n_beads, dtype=int),
        "chainID": ["A"] * n_beads,
        "resname": names,
        "resid": np.arange(1, n_residues + 1),
        "icode": [""] * n_residues,
        "segid": ["A"],
    }
    for name, value in values.items():
        universe.add_TopologyAttr(name, value)
    centres = np.flatnonzero(centre)
    following = np.roll(centres, -1) if closed else centres[1:]
    along = list(zip(centres.tolist(), following.tolist(), strict=False))
    grooves = [(i, i + 1) for i in centres.tolist() if i + 1 < n_beads]
    universe.add_TopologyAttr("bonds", along + grooves)
    return universe


def write_topology(path: str | Path, chain: Chain, positions: Array, closed: bool = True) -> None:
    """Write a PDB of beads (n_beads, 3), in Å, with their bonds.

    Raises
    ------
    InputError
        The file cannot be written, or its name does not end in .pdb.
    """
    path = Path(path)
    if path.suffix.lower() != ".pdb":
        raise InputError(f"topology '{path}' must be a .pdb file")
    universe = bead_universe(chain, closed)
    universe.atoms.positions = positions - positions[0::2].mean(axis=0)
    with _replacing(path) as scratch:
        universe.atoms.write(str(scratch), bonds="all")
        # MDAnalysis writes a unit cell of 1 Å³ where there is none, and warns when it reads it.
        lines = scratch.read_text().splitlines(keepends=True)
        kept = [line for line in lines if not line.startswith(("CRYST1", "REMARK     285"))]
        scratch.write_text("".join(kept))


def write_trajectory(
    path: str | Path,
    chain: Chain,
    positions: Array,
    closed: bool = True,
    interval_ps: float = 1.0,
    reference: Array | None = None,
) -> None:
    """Write configurations (n_frames, n_beads, 3), in Å, as DCD or XTC by the file's name.

    Each is moved so that the ring is centred on the origin and lies on ``reference`` (n_beads, 3)
    as well as it can, which changes no angle and leaves single precision its last digits: DCD
    positions of a ring of 150 base pairs are good to 4e-6 Å and angles to about 4e-6 rad; XTC is
    written with as many decimals as it holds, for 3e-5 Å and 2e-5 rad at this size.

    Raises
    ------
    InputError
        The name ends in neither .dcd nor .xtc, or the file cannot be written.
    """
    from dnacheck.md.geometry import superposed

    path = Path(path)
    if path.suffix.lower() not in TRAJECTORY_SUFFIXES:
        raise InputError(f"trajectory '{path}' must be a .dcd or .xtc file")
    reference = positions[0] if reference is None else reference
    moved = superposed(positions, reference - reference.mean(axis=0))
    universe = bead_universe(chain, closed)
    with _replacing(path) as scratch:
        if path.suffix.lower() == ".dcd":
            _write_frames(scratch, universe, moved, interval_ps, {"dt": interval_ps})
            return
        for decimals in _XTC_DECIMALS:
            _write_frames(scratch, universe, moved, interval_ps, {"precision": decimals})
            if _xtc_error(scratch, moved) < 5.0 * 10.0 ** (1 - decimals):
                return
        raise InputError(f"the chain is too large for the XTC format; write '{path}' as .dcd")


def _write_frames(
    path: Path, universe: mda.Universe, frames: Array, interval_ps: float, settings: dict[str, Any]
) -> None:
    import MDAnalysis as mda

    with mda.Writer(str(path), n_atoms=len(universe.atoms), **settings) as writer:
        for i, frame in enumerate(frames):
            universe.atoms.positions = frame
            universe.trajectory.ts.frame = i
            universe.trajectory.ts.time = i * interval_ps
            writer.write(universe.atoms)


def _xtc_error(path: Path, frames: Array) -> float:
    """Largest error, in Å, of what an XTC file gives back."""
    from MDAnalysis.lib.formats.libmdaxdr import XTCFile

    with XTCFile(str(path)) as stream:
        return max(
            float(np.max(np.abs(10.0 * got.x - frame)))
            for got, frame in zip(stream, frames, strict=True)
        )


def open_trajectory(trajectory: str | Path, topology: str | Path | None = None) -> mda.Universe:
    """Open a trajectory for analysis.

    Parameters
    ----------
    trajectory : path
        Any file that MDAnalysis reads.
    topology : path, optional
        Needed unless the trajectory file names its own atoms (PDB, GRO).

    Raises
    ------
    InputError
        A file is missing or unreadable, the topology is missing, or the two do not fit.
    """
    import MDAnalysis as mda
    from MDAnalysis.lib.formats.libdcd import DCDFile

    for path in (trajectory, topology):
        if path is not None and not Path(path).is_file():
            raise InputError(f"there is no file '{path}'")
    if topology is None and Path(trajectory).suffix.lower() not in _SELF_CONTAINED:
        raise InputError(
            f"trajectory '{trajectory}' does not name its atoms; give a PDB with --topology"
        )
    names = [str(trajectory)] if topology is None else [str(topology), str(trajectory)]
    # Files of structures have no time; without a step MDAnalysis warns at every frame.
    settings = {"dt": 1.0} if Path(trajectory).suffix.lower() in _SELF_CONTAINED else {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            if Path(trajectory).suffix.lower() == ".dcd":
                # A reader that fails to open would complain again when it is deleted.
                with DCDFile(str(trajectory)):
                    pass
            return mda.Universe(*names, **settings)
        except Exception as error:  # readers of many formats raise what they like
            first = str(error).strip().splitlines()[0] if str(error).strip() else repr(error)
            raise InputError(f"cannot read {' with '.join(names)}: {first}") from error


def missing_frames(trajectory: str | Path, frames: int) -> int:
    """How many frames a DCD file promises in its header beyond those that it holds.

    0 for other formats, which promise nothing, and where the header's number was never filled in.
    """
    path = Path(trajectory)
    if path.suffix.lower() != ".dcd":
        return 0
    with path.open("rb") as stream:
        head = stream.read(12)
    if len(head) < 12:
        return 0
    order = "<i" if head[0] == _DCD_HEADER_BYTES else ">i"
    promised: int = struct.unpack(order, head[8:12])[0]
    return max(promised - frames, 0)


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """A new file beside ``path`` that takes its place when it is complete."""
    if not path.parent.is_dir():
        raise InputError(f"cannot write '{path}': there is no directory '{path.parent}'")
    scratch = path.with_name(f".{secrets.token_hex(8)}{path.suffix.lower()}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a ring has no unit cell, and needs none
            yield scratch
        scratch.replace(path)
    except OSError as error:
        raise InputError(f"cannot write '{path}': {error.strerror or error}") from error
    finally:
        with suppress(OSError):
            scratch.unlink()
