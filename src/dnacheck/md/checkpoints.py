"""Checkpoints of an ensemble: blocks of configurations with the state that follows them.

A run writes each block whole or not at all, so a killed run can go on after its last block.
"""

from __future__ import annotations

import io
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dnacheck.io.files import atomic_write
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

_PATTERN = "replica*_block*.npz"


@dataclass(frozen=True)
class Samples:
    """Configurations of one replica, in the order of time.

    Attributes
    ----------
    positions : ndarray, shape (F, n_beads, 3)
        In Å.
    potential_RT, kinetic_RT : ndarray, shape (F,)
        Of steps, springs and measure term; and of the velocities.
    """

    positions: Array
    potential_RT: Array
    kinetic_RT: Array

    def __post_init__(self) -> None:
        for array in (self.positions, self.potential_RT, self.kinetic_RT):
            array.setflags(write=False)

    def __len__(self) -> int:
        return len(self.potential_RT)


@dataclass(frozen=True)
class Checkpoints:
    """Blocks of one run in a directory.

    Attributes
    ----------
    directory : Path
    platform : str
        OpenMM platform of the run.
    fingerprint : str
        Hash of everything that decides the configurations.
    """

    directory: Path
    platform: str
    fingerprint: str

    def save(self, replica: int, block: int, samples: Samples, state: dict[str, Any]) -> None:
        """Write a block and the walker's state after it."""
        arrays: dict[str, Any] = {
            "fingerprint": np.array(self.fingerprint),
            "platform": np.array(self.platform),
            "positions": samples.positions,
            "potential_RT": samples.potential_RT,
            "kinetic_RT": samples.kinetic_RT,
        }
        for key, value in state.items():
            whole = np.frombuffer(value, dtype=np.uint8) if isinstance(value, bytes) else value
            arrays[f"state_{key}"] = np.asarray(whole)
        buffer = io.BytesIO()
        np.savez(buffer, **arrays)
        atomic_write(self._path(replica, block), buffer.getvalue())

    def load(self, replica: int, wanted: int) -> list[tuple[Samples, dict[str, Any]]]:
        """Blocks of a replica that are there without a gap, up to ``wanted`` configurations.

        Raises
        ------
        InputError
            A block is damaged, or is of a run with other settings.
        """
        blocks: list[tuple[Samples, dict[str, Any]]] = []
        done = 0
        while done < wanted:
            path = self._path(replica, len(blocks))
            if not path.exists():
                break
            _, fingerprint, samples, state = _read(path)
            if fingerprint != self.fingerprint:
                raise InputError(
                    f"checkpoint '{path}' is of a run with other settings; give those, or "
                    "another directory"
                )
            blocks.append((samples, state))
            done += len(samples)
        return blocks

    def _path(self, replica: int, block: int) -> Path:
        return self.directory / f"replica{replica:02d}_block{block:05d}.npz"


def saved_platform(directory: Path) -> str:
    """OpenMM platform of the run whose checkpoints are in a directory."""
    return _read(sorted(directory.glob(_PATTERN))[0])[0]


def prepared_directory(directory: Path | str | None, resume: bool) -> Path | None:
    """The directory of checkpoints, made if need be.

    Raises
    ------
    InputError
        It cannot be used, holds nothing to resume, or holds what a new run would spoil.
    """
    if directory is None:
        if resume:
            raise InputError("there is nothing to resume without a directory of checkpoints")
        return None
    path = Path(directory)
    try:
        path.mkdir(parents=True, exist_ok=True)
        found = sorted(path.glob(_PATTERN))
    except OSError as error:
        raise InputError(f"cannot use directory '{path}': {error.strerror}") from error
    if resume and not found:
        raise InputError(f"directory '{path}' holds no checkpoint to resume from")
    if found and not resume:
        raise InputError(
            f"directory '{path}' holds checkpoints of another run; resume it, or name a new one"
        )
    return path


def _read(path: Path) -> tuple[str, str, Samples, dict[str, Any]]:
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as data:
            samples = Samples(data["positions"], data["potential_RT"], data["kinetic_RT"])
            state = {key[6:]: data[key] for key in data.files if key.startswith("state_")}
            return str(data["platform"]), str(data["fingerprint"]), samples, state
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"checkpoint '{path}' cannot be read ({error}); delete it") from error
