"""Readers of parameter sets: TOML files, and the pair of text files that emDNA packs."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from dnacheck.model.data_files import PARAMETER_SETS
from dnacheck.model.parameters import (
    COORDINATES,
    STRAND_SIGNS,
    SYMMETRY_TOLERANCE,
    TETRANUCLEOTIDES,
    ParameterSet,
    StepKind,
    load_parameters,
    step_names,
    strand_departures,
    strand_report,
)
from dnacheck.model.sequence import STEP_NAMES, reverse_complement
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

FIELD_ORDER = ("tilt", "roll", "twist", "shift", "slide", "rise")
"""Order of six parameters and their 6 x 6 stiffness in files, as the field writes them."""
_TO_FIELD = [FIELD_ORDER.index(name) for name in COORDINATES["rigid"]]

_KNOWN_KEYS = {
    "name", "citation", "unit", "steps", "stiffness_unit", "strand_symmetric", "unusual_sizes",
    "complete_by_reversal", "derived_from", "bend_scale", "helical_repeat_bp",
    "a_tract_helical_repeat_bp",
}  # fmt: skip

# Bounds of the geometric mean of force constants of B-DNA, generous by a factor of ten and more:
# outside, the numbers are in another unit. kT per square degree, and kT per square angstrom.
_ANGULAR_BOUNDS = (0.002, 2.0)
_LINEAR_BOUNDS = (0.1, 300.0)
# A mean twist between these, in what is said to be degrees, is one in radians; one above the last,
# in what is said to be radians, is one in degrees.
_RADIANS = (0.3, 2.0)
_DEGREES = 6.5


def read_parameter_file(path: Path) -> ParameterSet:
    """Parameter set of a TOML file (``data/angle_sets/README.md``).

    Raises
    ------
    InputError
        One line with the file, the line and the mend.
    """
    text = _text(path)
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"file '{path}': not valid TOML: {error}") from None
    return _TomlReader(path, text, table).parameter_set()


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"file '{path}': {error.strerror or error}; check the path") from None
    except UnicodeDecodeError as error:
        raise InputError(f"file '{path}': not valid TOML: {error}") from None


def rigid_units(unit: str) -> Array:
    """Radians and Å in one unit of each of the six parameters, in the package's order."""
    return np.array([math.pi / 180.0 if unit == "degree" else 1.0] * 3 + [1.0] * 3)


def from_field(values: Array, matrices: Array, unit: str) -> tuple[Array, Array]:
    """Six parameters (K, 6) and stiffnesses (K, 6, 6) of a file, in the package's order and units.

    Files have the order of ``FIELD_ORDER``, angles in ``unit``, lengths in Å and energies in kT.
    """
    units = rigid_units(unit)
    ground = values[:, _TO_FIELD] * units
    stiffness = matrices[:, _TO_FIELD][:, :, _TO_FIELD] / np.outer(units, units)
    return ground, stiffness


def size_complaint(kind: StepKind, ground: Array, stiffness: Array | None, unit: str) -> str:
    """What is odd about the size of a set's numbers (radians, Å, kT); empty if nothing is."""
    twist = float(np.mean(np.abs(ground[:, 0])))
    if unit == "degree" and _RADIANS[0] < math.degrees(twist) < _RADIANS[1]:
        return (
            f"the mean twist is {math.degrees(twist):.3g} degrees: these are radians; "
            'say unit = "radian"'
        )
    if unit == "radian" and twist > _DEGREES:
        return f'the mean twist is {twist:.3g} radians: these are degrees; say unit = "degree"'
    if kind == "hinge" or stiffness is None:
        return ""
    diagonal = np.log(np.diagonal(stiffness, axis1=1, axis2=2))
    angular = math.exp(float(diagonal[:, :3].mean())) * math.radians(1.0) ** 2
    linear = math.exp(float(diagonal[:, 3:].mean()))
    for value, bounds, what, other in (
        (angular, _ANGULAR_BOUNDS, "kT/degree^2", "kT/radian^2, or another unit of energy"),
        (linear, _LINEAR_BOUNDS, "kT/Å^2", "kT/nm^2, or another unit of energy"),
    ):
        if not bounds[0] <= value <= bounds[1]:
            return (
                f"the mean force constant is {value:.3g} {what}, outside {bounds[0]:g} to "
                f"{bounds[1]:g}: it may be in {other}; mend the unit, or say unusual_sizes = true "
                "if it is meant"
            )
    return ""


class _TomlReader:
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

    def flag(self, key: str, default: bool) -> bool:
        value = self.table.get(key, default)
        if not isinstance(value, bool):
            raise self.fail(f"'{key}' must be true or false", key)
        return value

    def parameter_set(self) -> ParameterSet:
        unknown = sorted(set(self.table) - _KNOWN_KEYS)
        if unknown:
            raise self.fail(
                f"unknown key '{unknown[0]}'; known are {', '.join(sorted(_KNOWN_KEYS))}",
                unknown[0],
            )
        kind: StepKind = "hinge"
        if "derived_from" in self.table:
            ground, stiffness = self.derived()
        else:
            kind, ground, stiffness = self.steps()
        if "helical_repeat_bp" in self.table:
            ground[:, 0] = self.repeat("helical_repeat_bp")
        tract = None
        if "a_tract_helical_repeat_bp" in self.table:
            tract = self.repeat("a_tract_helical_repeat_bp")
        complaint = size_complaint(kind, ground, stiffness, self.unit())
        if complaint and not self.flag("unusual_sizes", False):
            raise self.fail(complaint, "[steps.")
        asymmetry, broken, unreversed = strand_report(kind, ground, stiffness)
        if broken and self.flag("strand_symmetric", True):
            self.complain_of_strands(kind, ground, stiffness, unreversed)
        choices = ("reduced", "RT/rad^2") if kind == "hinge" else ("kT",)
        unit = self.text_value("stiffness_unit", choices[0])
        if unit not in choices:
            named = " or ".join(f'"{choice}"' for choice in choices)
            raise self.fail(f"'stiffness_unit' must be {named}", "stiffness_unit")
        ground.setflags(write=False)
        if stiffness is not None:
            stiffness.setflags(write=False)
        return ParameterSet(
            name=self.text_value("name", self.path.stem),
            citation=self.text_value("citation", "no citation given"),
            kind=kind,
            ground=ground,
            stiffness=stiffness,
            stiffness_in_RT=unit != "reduced",
            a_tract_twist=tract,
            strand_asymmetry=asymmetry,
            asymmetric_steps=broken,
            unreversed_steps=unreversed,
        )

    def complain_of_strands(
        self, kind: StepKind, ground: Array, stiffness: Array | None, unreversed: tuple[str, ...]
    ) -> NoReturn:
        relation = (
            "same tau and theta, opposite phi"
            if kind == "hinge"
            else "same twist, roll, slide and rise, opposite tilt and shift"
        )
        names = step_names(len(ground))
        step = names[int(np.argmax(strand_departures(kind, ground, stiffness)))]
        message = (
            f"step {step} and its reverse complement {reverse_complement(step)} break the "
            f"strand relation ({relation}); mend the table, or say "
            "strand_symmetric = false if it is meant"
        )
        if unreversed:
            message += f"; {', '.join(unreversed[:8])}: complemented without being reversed"
        raise self.fail(message, f"[steps.{step}]")

    def unit(self) -> str:
        unit = self.text_value("unit", "degree")
        if unit not in ("degree", "radian"):
            raise self.fail('\'unit\' must be "degree" or "radian"', "unit")
        return unit

    def repeat(self, key: str) -> float:
        value = self.number(self.table, key)
        if value <= 0.0:
            raise self.fail(f"'{key}' must be positive (base pairs per turn)", key)
        return 2.0 * math.pi / value

    def derived(self) -> tuple[Array, Array | None]:
        base = self.text_value("derived_from", "")
        if base not in PARAMETER_SETS or base == self.path.stem:
            raise self.fail(
                f"'derived_from' must be one of {', '.join(PARAMETER_SETS)}", "derived_from"
            )
        if "steps" in self.table:
            raise self.fail("give either 'derived_from' or [steps.XY] tables, not both", "[steps")
        parent = load_parameters(base)
        if parent.kind == "rigid":
            raise self.fail(
                f"'{base}' has six parameters a step and cannot be scaled; write [steps.XY] tables",
                "derived_from",
            )
        ground = parent.ground.copy()
        ground[:, 1:] *= self.number(self.table, "bend_scale") if "bend_scale" in self.table else 1
        return ground, None

    def steps(self) -> tuple[StepKind, Array, Array | None]:
        steps = self.table.get("steps")
        if not isinstance(steps, dict):
            raise self.fail("no [steps.XY] tables; give one for each of the 16 steps")
        four = all(len(name) == 4 for name in steps) and bool(steps)
        names = TETRANUCLEOTIDES if four else STEP_NAMES
        unknown = sorted(set(steps) - set(names))
        if unknown:
            what = "tetranucleotide" if four else "base-pair step"
            raise self.fail(f"'{unknown[0]}' is not a {what}", f"[steps.{unknown[0]}")
        for name, table in steps.items():
            if not isinstance(table, dict):
                raise self.fail(f"step {name} must be a table [steps.{name}]", name)
        complete = self.flag("complete_by_reversal", False)
        missing = [
            name
            for name in names
            if name not in steps and not (complete and reverse_complement(name) in steps)
        ]
        if missing:
            shown = ", ".join(missing[:12]) + (" and more" if len(missing) > 12 else "")
            raise self.fail(f"missing step {shown}; all {len(names)} are needed")
        rigid = any(set(FIELD_ORDER) & set(table) for table in steps.values())
        kind: StepKind = "rigid" if rigid else "hinge"
        order = FIELD_ORDER if rigid else COORDINATES["hinge"]
        given = [name for name in names if name in steps]
        values = np.array([self.values(name, steps[name], order) for name in given])
        matrices = self.matrices(given, steps, order)
        unit = self.unit()
        if rigid:
            if matrices is None:
                raise self.fail(
                    f"step {given[0]} has no stiffness; six parameters need a 6 x 6 one",
                    f"[steps.{given[0]}]",
                )
            values, matrices = from_field(values, matrices, unit)
        else:
            values = values * (math.pi / 180.0 if unit == "degree" else 1.0)
        return kind, *completed(kind, given, names, values, matrices)

    def values(self, name: str, table: dict[str, Any], order: tuple[str, ...]) -> list[float]:
        anchor = f"[steps.{name}]"
        known = {*order, "stiffness"}
        extra = sorted(set(table) - known)
        if extra:
            raise self.fail(
                f"unknown key '{extra[0]}' in step {name}; known are {', '.join(sorted(known))}",
                anchor,
                extra[0],
            )
        for key in order:
            if key not in table:
                raise self.fail(f"step {name} lacks '{key}'", anchor)
        return [self.number(table, key, anchor) for key in order]

    def matrices(
        self, given: list[str], steps: dict[str, Any], order: tuple[str, ...]
    ) -> Array | None:
        lacking = [name for name in given if "stiffness" not in steps[name]]
        if len(lacking) == len(given):
            return None
        if lacking:
            raise self.fail(
                f"step {lacking[0]} has no stiffness although others have; "
                f"give it for all {len(given)} steps or for none",
                f"[steps.{lacking[0]}]",
            )
        return np.array([self.matrix(steps[name]["stiffness"], name, len(order)) for name in given])

    def matrix(self, value: Any, name: str, size: int) -> Array:
        try:
            matrix = np.array(value, dtype=float)
        except (TypeError, ValueError):
            matrix = np.empty(0)
        complaint = matrix_complaint(matrix, size)
        if complaint:
            raise self.fail(f"stiffness of step {name} {complaint}", f"[steps.{name}]", "stiffness")
        return matrix


def matrix_complaint(matrix: Array, size: int) -> str:
    """What keeps a matrix from being a stiffness; empty if nothing does."""
    if matrix.shape != (size, size) or not np.all(np.isfinite(matrix)):
        return f"must be {size} rows of {size} numbers"
    if not np.allclose(matrix, matrix.T, rtol=1e-12, atol=0.0):
        return "is not symmetric"
    lowest = float(np.linalg.eigvalsh(matrix)[0])
    if lowest <= 0.0:
        return f"is not positive definite: eigenvalue {lowest:.4g}"
    return ""


def completed(
    kind: StepKind, given: list[str], names: tuple[str, ...], values: Array, matrices: Array | None
) -> tuple[Array, Array | None]:
    """Values and matrices of all ``names``; those not ``given`` follow from strand reversal."""
    signs = STRAND_SIGNS[kind]
    place = {name: index for index, name in enumerate(given)}
    ground, stiffness = [], []
    for name in names:
        own = name in place
        index = place[name if own else reverse_complement(name)]
        sign = np.ones_like(signs) if own else signs
        # The sum with zero turns -0 into 0.
        ground.append(values[index] * sign + 0.0)
        if matrices is not None:
            stiffness.append(matrices[index] * np.outer(sign, sign) + 0.0)
    return np.array(ground), np.array(stiffness) if matrices is not None else None


def read_emdna_pair(steps: Path, forces: Path) -> ParameterSet:
    """Parameter set of the two text files that emDNA packs into a force field.

    Parameters
    ----------
    steps, forces : Path
        Lines ``AA={...}`` with 6 numbers (tilt, roll, twist in degrees, shift, slide, rise in Å)
        and with 36 (their force constants by rows, in kT), for 16 steps or 256 tetranucleotides.

    Raises
    ------
    InputError
        One line with the file, the step and the mend. A broken strand relation is not an error,
        for such files exist; the set says so.
    """
    values, matrices = _braced(steps, 6), _braced(forces, 36)
    four = all(len(name) == 4 for name in values)
    names = TETRANUCLEOTIDES if four else STEP_NAMES
    for path, table in ((steps, values), (forces, matrices)):
        unknown = sorted(set(table) - set(names))
        if unknown:
            raise InputError(f"file '{path}': '{unknown[0]}' is not one of {len(names)} steps")
        missing = [name for name in names if name not in table]
        if missing:
            shown = ", ".join(missing[:12]) + (" and more" if len(missing) > 12 else "")
            raise InputError(f"file '{path}': missing step {shown}; all {len(names)} are needed")
    stiffness = np.array([matrices[name].reshape(6, 6) for name in names])
    for name, matrix in zip(names, stiffness, strict=True):
        complaint = matrix_complaint(matrix, 6)
        if complaint:
            raise InputError(f"file '{forces}': stiffness of step {name} {complaint}")
    ground, stiffness = from_field(np.array([values[n] for n in names]), stiffness, "degree")
    complaint = size_complaint("rigid", ground, stiffness, "degree")
    if complaint:
        raise InputError(f"file '{steps if 'twist' in complaint else forces}': {complaint}")
    asymmetry, broken, unreversed = strand_report("rigid", ground, stiffness)
    ground.setflags(write=False)
    stiffness.setflags(write=False)
    return ParameterSet(
        name=steps.stem,
        citation=f"files {steps.name} and {forces.name}",
        kind="rigid",
        ground=ground,
        stiffness=stiffness,
        stiffness_in_RT=True,
        a_tract_twist=None,
        strand_asymmetry=asymmetry if asymmetry > SYMMETRY_TOLERANCE else 0.0,
        asymmetric_steps=broken,
        unreversed_steps=unreversed,
    )


_BRACED = re.compile(r'\s*"?\s*([ACGT]+)\s*=\s*\{([^}]*)\}\s*"?\s*[,;]?\s*')


def _braced(path: Path, count: int) -> dict[str, Array]:
    table: dict[str, Array] = {}
    for number, line in enumerate(_text(path).splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith(("#", "//")):
            continue
        match = _BRACED.fullmatch(line)
        if match is None:
            raise InputError(
                f"file '{path}', line {number}: expected a line such as AA={{...}} with {count} "
                "numbers"
            )
        try:
            row = np.array([float(part) for part in match[2].split(",")])
        except ValueError:
            raise InputError(f"file '{path}', line {number}: not a number in {match[1]}") from None
        if row.size != count or not np.isfinite(row).all():
            raise InputError(
                f"file '{path}', line {number}: {match[1]} has {row.size} numbers, not {count} "
                "finite ones"
            )
        if match[1] in table:
            raise InputError(f"file '{path}', line {number}: {match[1]} is given twice")
        table[match[1]] = row
    if not table:
        raise InputError(f"file '{path}': no line such as AA={{...}}")
    return table
