"""Measured J factors from a CSV file, checked row by row.

Columns: ``molecule`` (embedded name, letters, or ``file.fasta:record``), one of ``minus_lnJ``
(J in mol/L) or ``J_molar``, one of ``stderr`` (of -ln J) or ``J_stderr_molar``, and optionally
``group`` (molecules measured together) and ``name``.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from dnacheck.io.sequences import read_target
from dnacheck.model.molecules import Molecule
from dnacheck.numerics.outcome import InputError

_LARGEST_J = 1.0
"""mol/L; the J factors of DNA are 1e-12 to 1e-6 M, so a larger one was given in other units."""


@dataclass(frozen=True)
class Measurement:
    """One measured molecule; ``minus_lnJ`` (J in mol/L) and its standard error."""

    molecule: Molecule
    minus_lnJ: float
    stderr: float
    group: str = ""

    @property
    def name(self) -> str:
        """Name of the molecule."""
        return self.molecule.name


def read_measurements(path: Path | str) -> tuple[Measurement, ...]:
    """Measurements of a CSV file; lines that start with ``#`` are remarks.

    Raises
    ------
    InputError
        The file cannot be read, lacks a column, or a row is bad; the message names row and mend.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"file '{path}': {error.strerror or error}; check the path") from None
    except UnicodeDecodeError:
        raise InputError(f"file '{path}': not a text file; give a CSV file") from None
    lines = [line for line in io.StringIO(text, newline=None) if not line.startswith("#")]
    rows = csv.DictReader(lines)
    columns = [name.strip() for name in rows.fieldnames or ()]
    _check_columns(path, columns)
    found = tuple(
        _measurement(path, number, {k.strip(): (v or "").strip() for k, v in row.items() if k})
        for number, row in enumerate(rows, start=1)
    )
    if not found:
        raise InputError(f"file '{path}': no row; give one measured molecule a line")
    return found


def _check_columns(path: Path, columns: Iterable[str]) -> None:
    have = set(columns)
    if "molecule" not in have:
        raise InputError(f"file '{path}': no column 'molecule'; the first line names the columns")
    if len(have & {"minus_lnJ", "J_molar"}) != 1:
        raise InputError(f"file '{path}': give one of the columns 'minus_lnJ' and 'J_molar'")
    if len(have & {"stderr", "J_stderr_molar"}) != 1:
        raise InputError(
            f"file '{path}': give one of the columns 'stderr' (of -ln J) and 'J_stderr_molar'"
        )
    if "J_stderr_molar" in have and "J_molar" not in have:
        raise InputError(f"file '{path}': 'J_stderr_molar' goes with 'J_molar'")


def _number(path: Path, number: int, row: dict[str, str], column: str) -> float:
    try:
        value = float(row[column])
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"file '{path}', row {number}: {column} '{row[column]}' is no number")
    return value


def _measurement(path: Path, number: int, row: dict[str, str]) -> Measurement:
    where = f"file '{path}', row {number}"
    molecule = _molecule(path, where, row["molecule"], row.get("name", ""))
    if "J_molar" in row:
        j = _number(path, number, row, "J_molar")
        if not j > 0.0:
            raise InputError(f"{where}: J is {j:g}; give a positive J in mol/L")
        if j > _LARGEST_J:
            raise InputError(f"{where}: J is {j:g} M; more than 1 M is another unit, give mol/L")
        value = -math.log(j)
    else:
        j = 0.0
        value = _number(path, number, row, "minus_lnJ")
        if value < 0.0:
            raise InputError(
                f"{where}: -ln J is {value:g}, J above 1 M; give the logarithm of J in mol/L"
            )
    column = "stderr" if "stderr" in row else "J_stderr_molar"
    error = _number(path, number, row, column)
    if not error > 0.0:
        raise InputError(f"{where}: the error is {error:g}; give a positive standard error")
    if column == "J_stderr_molar":
        error /= j
    return Measurement(molecule, value, error, row.get("group", ""))


def _molecule(path: Path, where: str, text: str, name: str) -> Molecule:
    if not text:
        raise InputError(f"{where}: no molecule; give a name, letters or file.fasta:record")
    target, record = text, ""
    if ":" in text:
        file, _, record = text.rpartition(":")
        target = str(path.parent / file)
    try:
        found = [item for item in read_target(target) if isinstance(item, Molecule)]
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    if record:
        found = [item for item in found if item.name == record]
    if len(found) != 1:
        what = "no such record" if record else f"{len(found)} molecules"
        raise InputError(f"{where}: molecule '{text}': {what}; name one molecule")
    if not name:
        return found[0]
    from dataclasses import replace

    return replace(found[0], sequence=replace(found[0].sequence, name=name))
