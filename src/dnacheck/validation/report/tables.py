"""Tables of a report as CSV, and their cells as text."""

from __future__ import annotations

import csv
import io
import math
from typing import Any

from dnacheck.validation.report.record import Column, Table


def cell_text(value: Any, digits: str) -> str:
    """A cell as the report shows it; absent or undefined numbers are a dash."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float) and digits:
        text = format(int(value) if digits.endswith("d") else value, digits)
        return _typeset(text)
    if isinstance(value, float):
        return _typeset(f"{value:.6g}")
    return str(value)


def _typeset(text: str) -> str:
    mantissa, mark, exponent = text.partition("e")
    if mark:
        power = "".join("⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".index(c)] for c in str(int(exponent)))
        return f"{mantissa}·10{power}".replace("-", "−")
    return text.replace("-", "−")


def column_label(column: Column) -> str:
    """Heading of a column with its group and unit, for files."""
    name = f"{column.group}: {column.label}" if column.group else column.label
    return f"{name} ({column.unit})" if column.unit else name


def table_csv(table: Table) -> str:
    """The table with all digits, one row per line."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow([column_label(column) for column in table.columns])
    for row in table.rows:
        writer.writerow([guarded(row.get(column.key)) for column in table.columns])
    return buffer.getvalue()


def guarded(value: Any) -> Any:
    """Text that a spreadsheet would run as a formula is marked as text."""
    if isinstance(value, str) and value[:1] in "=+-@\t\r" and value[1:]:
        return "'" + value
    return value
