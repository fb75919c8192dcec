"""What a check hands to the report besides verdicts: tables, figures, rings, notes.

All of it is plain data that goes to JSON and back, so that a resumed run can draw what an earlier
one computed. The report decides how it looks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any


@dataclass(frozen=True)
class Column:
    """A column of a table.

    ``digits`` is a format specification for numbers, such as ``.5f``; ``verdict_key`` names a key
    of the row whose verdict colours the cell; ``group`` is a heading over neighbouring columns.
    """

    key: str
    label: str
    unit: str = ""
    digits: str = ""
    verdict_key: str = ""
    group: str = ""
    help: str = ""


@dataclass(frozen=True)
class Table:
    """Rows of numbers and words; ``summary`` puts it on the first screen."""

    id: str
    title: str
    columns: Sequence[Column]
    rows: Sequence[Mapping[str, Any]]
    caption: str = ""
    paper: str = ""
    summary: bool = False
    collapsed: bool = False


@dataclass(frozen=True)
class Figure:
    """A drawing: ``kind`` is one of ``dnacheck.validation.plots.KINDS``, ``data`` its input."""

    id: str
    title: str
    kind: str
    data: Mapping[str, Any]
    caption: str = ""
    paper: str = ""
    width: float = 7.0
    height: float = 4.2
    summary: bool = False


@dataclass(frozen=True)
class Rings:
    """Closed curves to turn in three dimensions.

    Each ring has ``name`` and ``curves``: each of these ``label``, ``style`` ("tube", "beads" or
    "strand"), ``model`` and ``points`` (n, 3) in Å.
    """

    id: str
    title: str
    rings: Sequence[Mapping[str, Any]]
    caption: str = ""
    paper: str = ""


@dataclass(frozen=True)
class Note:
    """A paragraph."""

    id: str
    text: str
    title: str = ""


Block = Table | Figure | Rings | Note

_TYPES: dict[str, type] = {"table": Table, "figure": Figure, "rings": Rings, "note": Note}


def block_to_dict(block: Block) -> dict[str, Any]:
    """A block as JSON data."""
    name = next(key for key, kind in _TYPES.items() if isinstance(block, kind))
    values = {item.name: getattr(block, item.name) for item in fields(block)}
    if isinstance(block, Table):
        values["columns"] = [
            {item.name: getattr(column, item.name) for item in fields(column)}
            for column in block.columns
        ]
    return {"type": name, **values}


def block_from_dict(data: Mapping[str, Any]) -> Block:
    """The inverse of :func:`block_to_dict`."""
    values = {key: value for key, value in data.items() if key != "type"}
    if data["type"] == "table":
        values["columns"] = [Column(**column) for column in values["columns"]]
    block: Block = _TYPES[data["type"]](**values)
    return block


@dataclass(frozen=True)
class Section:
    """A chapter of the report: the blocks of all checks of a group."""

    name: str
    title: str
    intro: str
    blocks: Sequence[Block] = field(default=())
