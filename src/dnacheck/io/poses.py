"""Poses of a second site seen from a first, from TOML."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

_KEYS = {"position_A", "rotation", "rotation_vector_deg", "citation", "name"}


def read_pose(path: Path) -> tuple[Array, Array]:
    """Position (3,) in Å and rotation (3, 3) of a TOML file.

    ``position_A`` gives the centre of the second site along the directors d1, d2, d3 of the first.
    ``rotation`` gives its directors in the columns of three rows, or ``rotation_vector_deg`` the
    axis times the angle in degrees; without either the two sites are parallel. Whether the matrix
    is a rotation is for :class:`dnacheck.equilibria.boundary.Loop` to say.

    Raises
    ------
    InputError
        The file cannot be read, or a member is missing, unknown or not made of numbers.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"pose '{path}': {error.strerror or error}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"pose '{path}': no TOML, {' '.join(str(error).split())}") from None
    unknown = sorted(set(table) - _KEYS)
    if unknown:
        raise InputError(f"pose '{path}': unknown '{unknown[0]}'; it may have {_names()}")
    if "position_A" not in table:
        raise InputError(f"pose '{path}': position_A is missing, three numbers in Å")
    if {"rotation", "rotation_vector_deg"} <= set(table):
        raise InputError(f"pose '{path}': give rotation or rotation_vector_deg, not both")
    position = _array(table["position_A"], (3,), f"pose '{path}': position_A")
    if "rotation_vector_deg" in table:
        from scipy.spatial.transform import Rotation

        vector = _array(table["rotation_vector_deg"], (3,), f"pose '{path}': rotation_vector_deg")
        return position, np.array(Rotation.from_rotvec(vector, degrees=True).as_matrix())
    rotation = table.get("rotation", np.eye(3).tolist())
    return position, _array(rotation, (3, 3), f"pose '{path}': rotation")


def _names() -> str:
    return ", ".join(sorted(_KEYS))


def _array(value: object, shape: tuple[int, ...], what: str) -> Array:
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != shape or not np.isfinite(array).all():
        size = " by ".join(map(str, shape))
        raise InputError(f"{what} must be {size} finite numbers")
    return array
