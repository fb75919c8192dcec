"""Line numbers of the keys of a TOML text, which the standard parser does not keep."""

from __future__ import annotations

import re
import tomllib

Path = tuple[str | int, ...]

_HEADER = re.compile(r"\s*(\[\[?)\s*(.+?)\s*\]\]?\s*(#.*)?$")
_NAME = r"""(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')"""
_KEY = re.compile(rf"\s*({_NAME}(?:\s*\.\s*{_NAME})*)\s*=")


def _parts(dotted: str) -> list[str]:
    found = re.findall(_NAME, dotted)
    return [part[1:-1] if part[0] in "\"'" else part for part in found]


def _complete(text: str) -> bool:
    """Whether a key's value ends with this text."""
    try:
        tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return False
    return True


def line_numbers(text: str) -> dict[Path, int]:
    """Line, from 1, of every table header and key of a valid TOML text.

    Keys inside inline tables and arrays have no entry of their own; look up the longest prefix
    with :func:`line_of`.
    """
    numbers: dict[Path, int] = {}
    table: Path = ()
    counts: dict[Path, int] = {}
    lines = text.splitlines()
    index = 0
    while index < len(lines):
        line, number = lines[index], index + 1
        index += 1
        header = _HEADER.match(line)
        if header:
            table = tuple(_parts(header[2]))
            if header[1] == "[[":
                counts[table] = counts.get(table, -1) + 1
                table = (*table, counts[table])
            numbers.setdefault(table, number)
            continue
        key = _KEY.match(line)
        if not key:
            continue
        path = (*table, *_parts(key[1]))
        for length in range(len(table) + 1, len(path) + 1):
            numbers.setdefault(path[:length], number)
        value = line
        while not _complete(value) and index < len(lines):
            value += "\n" + lines[index]
            index += 1
    return numbers


def line_of(numbers: dict[Path, int], path: Path) -> int | None:
    """Line of the longest prefix of ``path`` that has one."""
    for length in range(len(path), 0, -1):
        if path[:length] in numbers:
            return numbers[path[:length]]
    return None
