"""Boundaries of a chain: what its end is held to.

A ring is closed in all six components. A nick leaves the end free to turn about its axis, a hinge
(a flexible joint, a long single-stranded gap) to turn in any way; a loop ends in a given pose, as
between two sites that a protein holds; a pulled chain has its end free to move under a force along
the axis of its clamped start.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.equilibria.boundary_kernels import Boundary
from dnacheck.model.chain import Chain
from dnacheck.model.units import TEMPERATURE_K, thermal_energy_pN_nm
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

_ROTATION_ERROR = 1e-6


@dataclass(frozen=True)
class Ring:
    """The end on the start in position and orientation."""

    label: ClassVar[str] = "ring"

    def for_chain(self, chain: Chain) -> Boundary:
        """The same for compiled kernels, in the chain's units."""
        return _boundary(range(6))


@dataclass(frozen=True)
class NickedRing:
    """The end on the start, its axis aligned, free to turn about it."""

    label: ClassVar[str] = "nicked"

    def for_chain(self, chain: Chain) -> Boundary:
        """The same for compiled kernels, in the chain's units."""
        return _boundary(range(5))


@dataclass(frozen=True)
class HingedRing:
    """The end on the start in position alone, free to turn in any way."""

    label: ClassVar[str] = "hinged"

    def for_chain(self, chain: Chain) -> Boundary:
        """The same for compiled kernels, in the chain's units."""
        return _boundary(range(3))


@dataclass(frozen=True)
class Loop:
    """The end in a given pose, seen from the first base pair.

    Parameters
    ----------
    position_A : array_like, shape (3,)
        Of the end's centre, along the directors of the first base pair; Å.
    rotation : array_like, shape (3, 3), optional
        The end's directors in the columns, components along those of the first base pair; by
        default the identity.

    Raises
    ------
    InputError
        Not three finite numbers, or no rotation.
    """

    position_A: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[tuple[float, ...], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    label: ClassVar[str] = "loop"

    def __post_init__(self) -> None:
        position = _numbers(self.position_A, (3,), "loop position_A", "three numbers in Å")
        rotation = _numbers(self.rotation, (3, 3), "loop rotation", "three rows of three numbers")
        error = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
        if error > _ROTATION_ERROR or np.linalg.det(rotation) < 0.0:
            raise InputError(
                f"loop rotation is no rotation: its columns must be unit, perpendicular and "
                f"right-handed to {_ROTATION_ERROR:g} (they are off by {error:.2g})"
            )
        object.__setattr__(self, "position_A", tuple(float(x) for x in position))
        object.__setattr__(self, "rotation", tuple(tuple(map(float, row)) for row in rotation))

    def for_chain(self, chain: Chain) -> Boundary:
        """The same for compiled kernels, in the chain's units.

        Raises
        ------
        InputError
            The pose is farther away than the chain is long.
        """
        reach = chain.n_steps * chain.rise_A
        distance = float(np.linalg.norm(self.position_A))
        if not chain.rigid and distance > reach * (1.0 + 1e-12):
            raise InputError(
                f"loop position_A is {distance:.1f} Å from the first base pair, and the "
                f"{chain.n_steps} steps of {chain.name} reach {reach:.1f} Å; give a closer pose"
            )
        return _boundary(
            range(6), np.array(self.position_A) / chain.rise_A, np.array(self.rotation)
        )


@dataclass(frozen=True)
class Pull:
    """The start clamped, the end free to move under a force along d3 of the first base pair.

    The end's axis is held along the force; under a torque, or without one, the end turns about it.

    Parameters
    ----------
    force_pN : float
        Along d3 of the first base pair; negative pushes.
    torque_pN_nm : float
        About the same axis on the end; positive overwinds. It counts with the turns of the end.
    temperature_K : float
        Converts the two to RT.

    Raises
    ------
    InputError
        A number is not finite, or the temperature is not positive.
    """

    force_pN: float
    torque_pN_nm: float = 0.0
    temperature_K: float = TEMPERATURE_K

    label: ClassVar[str] = "pull"

    def __post_init__(self) -> None:
        for name in ("force_pN", "torque_pN_nm", "temperature_K"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, float, np.number)):
                raise InputError(f"pull {name} must be a number, not {value!r}")
            if not math.isfinite(value):
                raise InputError(f"pull {name} must be finite, not {value}")
        if not self.temperature_K > 0.0:
            raise InputError(f"pull temperature_K must be positive, not {self.temperature_K}")

    def for_chain(self, chain: Chain) -> Boundary:
        """The same for compiled kernels, in the chain's units."""
        # pN nm per reduced unit of energy.
        unit = thermal_energy_pN_nm(self.temperature_K) * chain.energy_scale_RT
        loads = np.zeros(6)
        loads[2] = self.force_pN * 0.1 * chain.rise_A / unit
        loads[5] = self.torque_pN_nm / unit
        return _boundary((3, 4))._replace(loads=loads)


AnyBoundary = Ring | NickedRing | HingedRing | Loop | Pull
"""What the end of a chain can be held to."""

ENDS: dict[str, AnyBoundary] = {
    "ring": Ring(),
    "nicked": NickedRing(),
    "hinged": HingedRing(),
}
"""Boundaries that need no numbers, by the name that commands know them by."""


def _boundary(
    held: Sequence[int] | range, position: Array | None = None, rotation: Array | None = None
) -> Boundary:
    fixed = np.zeros(6, dtype=np.bool_)
    fixed[list(held)] = True
    return Boundary(
        np.zeros(3) if position is None else position,
        np.eye(3) if rotation is None else np.ascontiguousarray(rotation),
        fixed,
        np.zeros(6),
    )


def _numbers(value: ArrayLike, shape: tuple[int, ...], name: str, what: str) -> Array:
    try:
        array: NDArray[Any] = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name} must be {what}") from None
    if array.shape != shape or not np.isfinite(array).all():
        raise InputError(f"{name} must be {what}, all finite")
    return array
