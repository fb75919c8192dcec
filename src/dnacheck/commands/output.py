"""Standard output and standard error of the commands: JSON, notes, progress."""

from __future__ import annotations

import enum
import json
import math
import os
import sys
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from dnacheck.io.progress import progress_bar as progress

__all__ = ["json_text", "note", "plain", "print_json", "progress"]


def plain(value: Any) -> Any:
    """A copy made of what JSON has: dict, list, str, int, float, bool and None.

    Numbers that are not finite become None; numpy scalars and arrays become numbers and nested
    lists; an enumeration becomes its value, a path its text, a dataclass a dict of its fields.

    Raises
    ------
    TypeError
        For any other type: a number must not turn into its text unnoticed.
    """
    if isinstance(value, enum.Enum):
        return plain(value.value)
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {_key(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if hasattr(value, "tolist"):  # numpy scalars and arrays, without importing numpy here
        return plain(value.tolist())
    raise TypeError(f"{type(value).__name__} has no place in JSON")


def _key(key: Any) -> str:
    if isinstance(key, enum.Enum):
        key = key.value
    if isinstance(key, bool) or not isinstance(key, str | int):
        raise TypeError(f"{key!r} cannot name a JSON member")
    return str(key)


def json_text(value: Any, indent: int | None = 2) -> str:
    """JSON text of a value, ending in a newline; see :func:`plain`."""
    return json.dumps(plain(value), indent=indent, allow_nan=False) + "\n"


def print_json(value: Mapping[str, Any]) -> None:
    """Write one JSON object to standard output, in one piece."""
    sys.stdout.write(json_text(value))


def note(text: str, quiet: bool = False) -> None:
    """One line for the reader on standard error, unless quiet."""
    if not quiet:
        print(f"dnacheck: {' '.join(text.split())}", file=sys.stderr)
