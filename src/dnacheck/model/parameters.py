"""Angle sets: ground angles and stiffnesses of the 16 base-pair steps, from TOML files."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dnacheck.model.data_files import data_directory
from dnacheck.model.sequence import STEP_NAMES, reverse_complement
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

EMBEDDED_SETS = ("trifonov2", "trifonov", "desantis")
ANGLE_NAMES = ("tau", "theta", "phi")
SYMMETRY_TOLERANCE_RAD = 1e-9
"""Largest departure from the strand relation that passes as rounding, in radians or relative."""

# Signs that the strand relation gives to tau, theta, phi.
_STRAND_SIGNS = np.array([1.0, 1.0, -1.0])
_COMPLEMENT_STEP = tuple(STEP_NAMES.index(reverse_complement(name)) for name in STEP_NAMES)
_KNOWN_KEYS = {
    "name", "citation", "unit", "steps", "stiffness_unit", "strand_symmetric",
    "derived_from", "bend_scale", "helical_repeat_bp", "a_tract_helical_repeat_bp",
}  # fmt: skip
_KNOWN_STEP_KEYS = {"tau", "theta", "phi", "stiffness"}


@dataclass(frozen=True)
class AngleSet:
    """Ground angles and stiffnesses of all base-pair steps.

    Attributes
    ----------
    name, citation : str
        What it is called and where it comes from.
    ground : ndarray, shape (16, 3)
        Unstressed tau, theta, phi of each step of ``STEP_NAMES``, in radians.
    stiffness : ndarray, shape (16, 3, 3), or None
        Symmetric positive stiffness in the same order. None stands for the paper's uniform
        diagonal one, whose ratio of twist to bend is chosen with the chain.
    stiffness_in_RT : bool
        Whether ``stiffness`` is in RT/rad^2; otherwise it is reduced (1 is RT P/l).
    a_tract_twist : float or None
        Twist in radians of steps inside an A-tract region, if the set has one.
    strand_asymmetry : float
        Largest departure from the strand relation, in radians or relative stiffness.
    """

    name: str
    citation: str
    ground: Array
    stiffness: Array | None
    stiffness_in_RT: bool
    a_tract_twist: float | None
    strand_asymmetry: float

    @property
    def strand_symmetric(self) -> bool:
        """Whether both strands give the same parameters."""
        return self.strand_asymmetry <= SYMMETRY_TOLERANCE_RAD


def load_angle_set(name: str) -> AngleSet:
    """An embedded angle set by name, or one from a TOML file (``data/angle_sets/README.md``).

    Raises
    ------
    InputError
        Unknown name, unreadable file, missing step, unknown key, non-positive or asymmetric
        stiffness, or a broken strand relation that the file does not declare.
    """
    if name in EMBEDDED_SETS:
        return _load(data_directory() / "angle_sets" / f"{name}.toml")
    path = Path(name)
    if not path.exists():
        raise InputError(
            f"angle set '{name}' is neither {', '.join(EMBEDDED_SETS)} nor a parameter file"
        )
    return _read(path)


@lru_cache(maxsize=8)
def _load(path: Path) -> AngleSet:
    return _read(path)


def _read(path: Path) -> AngleSet:
    try:
        text = path.read_text(encoding="utf-8")
        table = tomllib.loads(text)
    except OSError as error:
        raise InputError(f"file '{path}': {error.strerror or error}; check the path") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"file '{path}': not valid TOML: {error}") from None
    return _Reader(path, text, table).angle_set()


class _Reader:
    """Checks one parameter file; every complaint names the file, the line and the mend."""

    def __init__(self, path: Path, text: str, table: dict[str, Any]) -> None:
        self.path, self.text, self.table = path, text, table

    def fail(self, message: str, *anchors: str) -> InputError:
        """An error at the line where the anchors follow one another in the file."""
        line = 0
        lines = self.text.splitlines()
        for anchor in anchors:
            for number in range(line, len(lines)):
                if anchor in lines[number]:
                    line = number + 1
                    break
        place = f", line {line}" if line else ""
        return InputError(f"file '{self.path}'{place}: {message}")

    def number(self, table: dict[str, Any], key: str, *anchors: str) -> float:
        value = table.get(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.fail(f"'{key}' must be a number, not {value!r}", *anchors, key)
        if not math.isfinite(value):
            raise self.fail(f"'{key}' must be finite", *anchors, key)
        return float(value)

    def text_value(self, key: str, default: str) -> str:
        value = self.table.get(key, default)
        if not isinstance(value, str):
            raise self.fail(f"'{key}' must be text in quotes", key)
        return value

    def angle_set(self) -> AngleSet:
        unknown = sorted(set(self.table) - _KNOWN_KEYS)
        if unknown:
            raise self.fail(
                f"unknown key '{unknown[0]}'; known are {', '.join(sorted(_KNOWN_KEYS))}",
                unknown[0],
            )
        ground, stiffness = self.derived() if "derived_from" in self.table else self.steps()
        if "helical_repeat_bp" in self.table:
            ground[:, 0] = self.repeat("helical_repeat_bp")
        tract = None
        if "a_tract_helical_repeat_bp" in self.table:
            tract = self.repeat("a_tract_helical_repeat_bp")
        asymmetry = strand_asymmetry(ground, stiffness)
        meant = self.table.get("strand_symmetric", True) is False
        if asymmetry > SYMMETRY_TOLERANCE_RAD and not meant:
            step = STEP_NAMES[_worst_step(ground, stiffness)]
            raise self.fail(
                f"step {step} and its reverse complement {reverse_complement(step)} break the "
                "strand relation (same tau and theta, opposite phi); mend the table, or say "
                "strand_symmetric = false if it is meant",
                f"[steps.{step}]",
            )
        unit = self.text_value("stiffness_unit", "reduced")
        if unit not in ("reduced", "RT/rad^2"):
            raise self.fail('\'stiffness_unit\' must be "reduced" or "RT/rad^2"', "stiffness_unit")
        ground.setflags(write=False)
        if stiffness is not None:
            stiffness.setflags(write=False)
        return AngleSet(
            name=self.text_value("name", self.path.stem),
            citation=self.text_value("citation", "no citation given"),
            ground=ground,
            stiffness=stiffness,
            stiffness_in_RT=unit == "RT/rad^2",
            a_tract_twist=tract,
            strand_asymmetry=asymmetry,
        )

    def repeat(self, key: str) -> float:
        value = self.number(self.table, key)
        if value <= 0.0:
            raise self.fail(f"'{key}' must be positive (base pairs per turn)", key)
        return 2.0 * math.pi / value

    def derived(self) -> tuple[Array, Array | None]:
        base = self.text_value("derived_from", "")
        if base not in EMBEDDED_SETS or base == self.path.stem:
            raise self.fail(
                f"'derived_from' must be one of {', '.join(EMBEDDED_SETS)}", "derived_from"
            )
        if "steps" in self.table:
            raise self.fail("give either 'derived_from' or [steps.XY] tables, not both", "[steps")
        parent = load_angle_set(base)
        ground = parent.ground.copy()
        ground[:, 1:] *= self.number(self.table, "bend_scale") if "bend_scale" in self.table else 1
        return ground, None

    def steps(self) -> tuple[Array, Array | None]:
        steps = self.table.get("steps")
        if not isinstance(steps, dict):
            raise self.fail("no [steps.XY] tables; give one for each of the 16 steps")
        unknown = sorted(set(steps) - set(STEP_NAMES))
        if unknown:
            raise self.fail(f"'{unknown[0]}' is not a base-pair step", f"[steps.{unknown[0]}")
        missing = [name for name in STEP_NAMES if name not in steps]
        if missing:
            raise self.fail(f"missing step {', '.join(missing)}; all 16 are needed")
        unit = self.text_value("unit", "degree")
        if unit not in ("degree", "radian"):
            raise self.fail('\'unit\' must be "degree" or "radian"', "unit")
        factor = math.pi / 180.0 if unit == "degree" else 1.0
        ground = np.empty((16, 3))
        matrices: list[Array] = []
        for index, name in enumerate(STEP_NAMES):
            table, anchor = steps[name], f"[steps.{name}]"
            if not isinstance(table, dict):
                raise self.fail(f"step {name} must be a table [steps.{name}]", name)
            extra = sorted(set(table) - _KNOWN_STEP_KEYS)
            if extra:
                raise self.fail(
                    f"unknown key '{extra[0]}' in step {name}; "
                    f"known are {', '.join(sorted(_KNOWN_STEP_KEYS))}",
                    anchor,
                    extra[0],
                )
            for column, key in enumerate(ANGLE_NAMES):
                if key not in table:
                    raise self.fail(f"step {name} lacks '{key}'", anchor)
                ground[index, column] = factor * self.number(table, key, anchor)
            if "stiffness" in table:
                matrices.append(self.matrix(table["stiffness"], name, anchor))
        if not matrices:
            return ground, None
        if len(matrices) < 16:
            lacking = [name for name in STEP_NAMES if "stiffness" not in steps[name]]
            raise self.fail(
                f"step {lacking[0]} has no stiffness although others have; "
                "give it for all 16 steps or for none",
                f"[steps.{lacking[0]}]",
            )
        return ground, np.array(matrices)

    def matrix(self, value: Any, name: str, anchor: str) -> Array:
        try:
            matrix = np.array(value, dtype=float)
        except (TypeError, ValueError):
            matrix = np.empty(0)
        if matrix.shape != (3, 3) or not np.all(np.isfinite(matrix)):
            raise self.fail(
                f"stiffness of step {name} must be 3 rows of 3 numbers", anchor, "stiffness"
            )
        if not np.allclose(matrix, matrix.T, rtol=1e-12, atol=0.0):
            raise self.fail(f"stiffness of step {name} is not symmetric", anchor, "stiffness")
        if np.linalg.eigvalsh(matrix)[0] <= 0.0:
            raise self.fail(
                f"stiffness of step {name} is not positive definite", anchor, "stiffness"
            )
        return matrix


def _departures(ground: Array, stiffness: Array | None) -> Array:
    """Departure of each step from the strand relation, shape (16,)."""
    other = list(_COMPLEMENT_STEP)
    departure = np.abs(ground - ground[other] * _STRAND_SIGNS).max(axis=1)
    if stiffness is not None:
        image = stiffness[other] * np.outer(_STRAND_SIGNS, _STRAND_SIGNS)
        relative = np.abs(stiffness - image).max(axis=(1, 2)) / np.abs(stiffness).max(axis=(1, 2))
        departure = np.maximum(departure, relative)
    return np.asarray(departure)


def _worst_step(ground: Array, stiffness: Array | None) -> int:
    return int(np.argmax(_departures(ground, stiffness)))


def strand_asymmetry(ground: Array, stiffness: Array | None) -> float:
    """Largest departure from the strand relation over the 16 steps.

    Reading the other strand, a step becomes its reverse complement: tau and theta stay, phi
    changes sign (Table I), and so do the stiffness couplings of phi.
    """
    return float(_departures(ground, stiffness).max())
