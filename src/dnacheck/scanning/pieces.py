"""Pieces of a scan: what one is, how an input is cut into them, and what comes out of one.

A piece depends on the input and the settings alone, never on who computes it or what was computed
before, so that one process and a cluster give the same bytes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from dnacheck.io.sequences import SequenceSource
from dnacheck.model.parameters import ParameterSet, load_parameters
from dnacheck.model.sequence import MINIMUM_LENGTH
from dnacheck.numerics.outcome import InputError
from dnacheck.scanning import windows as win
from dnacheck.scanning.scan import COLUMNS, scan_row

PIECE_WINDOWS = 16_384
"""Windows of a piece: seconds of work, a fraction of a megabyte of results."""
PIECE_RECORDS = 512

FORWARD, REVERSE = "+", "-"
_COMPLEMENT = 3


@dataclass(frozen=True)
class Region:
    """Part of a record, ``name:first-last`` with base pairs from 1, both ends in it."""

    name: str
    first: int
    last: int

    @classmethod
    def parse(cls, text: str) -> Region:
        """Read ``name:first-last``; commas in the numbers are allowed.

        Raises
        ------
        InputError
            The text has another form, or the range is empty.
        """
        match = re.fullmatch(r"(\S+):([\d,]+)-([\d,]+)", text)
        if match is None:
            raise InputError(
                f"region '{text}': write it as name:first-last, such as chrI:1001-5000"
            )
        first, last = (int(match[k].replace(",", "")) for k in (2, 3))
        if not 1 <= first <= last < 2**62:
            raise InputError(
                f"region '{text}': base pairs count from 1 and first comes before last"
            )
        return cls(match[1], first, last)


@dataclass(frozen=True)
class WindowOptions:
    """Which windows are scanned.

    Attributes
    ----------
    window, step : int
        Length, and distance of starts, in base pairs.
    both_strands : bool
        Each window is also read from its other strand.
    region : Region, optional
        Windows inside it only.
    piece : int
        Windows of a piece of work.
    """

    window: int
    step: int = 1
    both_strands: bool = False
    region: Region | None = None
    piece: int = PIECE_WINDOWS

    def __post_init__(self) -> None:
        if not MINIMUM_LENGTH <= self.window <= win.LONGEST_WINDOW:
            raise InputError(
                f"window {self.window}: give {MINIMUM_LENGTH} to {win.LONGEST_WINDOW} base pairs"
            )
        if not 1 <= self.step <= win.LONGEST_WINDOW * 1000:
            raise InputError(f"step {self.step}: give 1 base pair or more")
        if not 1 <= self.piece <= 10**8:
            raise InputError(f"piece {self.piece}: give 1 to 100000000 windows")


class Piece(NamedTuple):
    """One piece of work.

    ``letters`` holds the stretch of a record that its windows cover, from base pair ``offset`` on;
    ``records`` the (name, letters) of whole records instead, where no windows were asked for;
    ``failure`` why a record has no window at all.
    """

    number: int
    name: str
    offset: int
    letters: str
    records: tuple[tuple[str, str], ...] = ()
    failure: str = ""


class Settings(NamedTuple):
    """What every piece of a scan shares; travels to the workers."""

    arguments: Mapping[str, Any]
    options: WindowOptions | None
    laplace: bool = False


class Result(NamedTuple):
    """Columns of a piece's rows by name, and how many windows were skipped for their letters."""

    number: int
    columns: dict[str, Any]
    skipped: int
    searches: int


def plain_arguments(arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of ``build_chain`` with the parameter set loaded, fit to travel."""
    table = arguments.get("angles", "trifonov2")
    return {**arguments, "angles": load_parameters(table) if isinstance(table, str) else table}


def lengths(source: SequenceSource) -> list[tuple[str, int]]:
    """Name and length of every record, in one pass that holds none whole."""
    found: list[tuple[str, int]] = []
    for stretch in source.stretches(1 << 20):
        if stretch.last:
            found.append((stretch.name, stretch.offset + len(stretch.letters)))
    return found


def _span(name: str, length: int, options: WindowOptions) -> tuple[int, int]:
    """First base pair, from 0, and end of what is scanned of a record."""
    region = options.region
    if region is None:
        return 0, length
    return (region.first - 1, region.last) if region.name == name else (0, 0)


def window_count(found: list[tuple[str, int]], options: WindowOptions) -> int:
    """Windows of all records; checks that there is one.

    Raises
    ------
    InputError
        A region that is not in the input, or a window longer than every record.
    """
    region = options.region
    if region is not None:
        known = dict(found)
        if region.name not in known:
            names = ", ".join(list(known)[:5])
            raise InputError(f"region: no record is called '{region.name}'; there are {names}")
        if region.last > known[region.name]:
            raise InputError(
                f"region: '{region.name}' ends at base pair {known[region.name]}, before "
                f"{region.last}"
            )
    total = 0
    for name, length in found:
        first, end = _span(name, length, options)
        total += max(0, (end - first - options.window) // options.step + 1)
    if not total:
        longest = max((e - b for b, e in (_span(n, k, options) for n, k in found)), default=0)
        raise InputError(
            f"window {options.window} is longer than every record or region (at most {longest} "
            "base pairs); give a smaller one"
        )
    return total


def cut_windows(source: SequenceSource, options: WindowOptions) -> Iterator[Piece]:
    """Pieces of the windows of every record, in order; a record without a window is one too."""
    advance = options.piece * options.step
    reach = advance - options.step + options.window
    index = 0
    held, held_from = "", 0
    for stretch in source.stretches(1 << 20):
        if stretch.offset == 0:
            held, begin = "", 0
            region = options.region
            wanted = region is None or region.name == stretch.name
            first = region.first - 1 if region else 0
            end = region.last if region else None
            held_from = begin = first
        if not wanted:
            continue
        part_from = max(0, held_from + len(held) - stretch.offset)
        part_to = len(stretch.letters) if end is None else max(0, end - stretch.offset)
        held += stretch.letters[part_from:part_to]
        while len(held) >= reach or (stretch.last and len(held) >= options.window):
            count = min(options.piece, (len(held) - options.window) // options.step + 1)
            letters = held[: (count - 1) * options.step + options.window]
            yield Piece(index, stretch.name, held_from, letters)
            index += 1
            held, held_from = held[count * options.step :], held_from + count * options.step
        if stretch.last and held_from == begin:
            length = stretch.offset + len(stretch.letters)
            reason = f"{length} base pairs are fewer than the window"
            yield Piece(index, stretch.name, 0, "", failure=reason)
            index += 1


def cut_records(source: SequenceSource, size: int = PIECE_RECORDS) -> Iterator[Piece]:
    """Pieces of whole records, in order."""
    block: list[tuple[str, str]] = []
    index = 0
    for record in source.records():
        block.append((record.name, record.letters))
        if len(block) == size:
            yield Piece(index, "", 0, "", tuple(block))
            block, index = [], index + 1
    if block:
        yield Piece(index, "", 0, "", tuple(block))


def compute(settings: Settings, piece: Piece) -> Result:
    """Rows of a piece; the function that workers call."""
    if piece.records:
        return _record_rows(settings, piece)
    options = settings.options
    assert options is not None
    if piece.failure:
        return _failed_record(piece)
    scanner = _scanner(options.window, _Hashed(settings.arguments))
    codes = win.letter_codes(piece.letters)
    passes = [(FORWARD, codes)]
    if options.both_strands:
        other = np.where(codes == win.wk.OTHER_LETTER, codes, _COMPLEMENT - codes)[::-1]
        passes.append((REVERSE, np.ascontiguousarray(other)))
    parts = []
    for strand, letters in passes:
        found = scanner.scan(letters, options.step)
        parts.append((strand, found))
    return _window_rows(piece, options, parts)


class _Hashed:
    """Arguments as a key of the cache of scanners: a set of parameters by its content."""

    def __init__(self, arguments: Mapping[str, Any]) -> None:
        self.arguments = arguments
        table: ParameterSet = arguments["angles"]
        rest = sorted((k, repr(v)) for k, v in arguments.items() if k != "angles")
        self.key = (table.name, table.ground.tobytes(), repr(table.a_tract_twist), repr(rest))

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Hashed) and self.key == other.key


@lru_cache(maxsize=2)
def _scanner(window: int, arguments: _Hashed) -> win.WindowScanner:
    return win.WindowScanner(window, arguments.arguments)


def _window_rows(
    piece: Piece, options: WindowOptions, parts: list[tuple[str, win.Windows]]
) -> Result:
    columns: dict[str, list[Any]] = {name: [] for name in WINDOW_COLUMNS}
    status = np.array(win.STATUS)
    skipped = searches = 0
    for strand, found in parts:
        # The other strand's windows begin at the far end.
        order = slice(None) if strand == FORWARD else slice(None, None, -1)
        code = found.code[order]
        kept = code != win.OTHER_LETTERS
        skipped += int((~kept).sum())
        searches += found.searches
        start = piece.offset + found.start[kept]
        columns["start"].append(start)
        columns["end"].append(start + options.window)
        columns["strand"].append(np.full(len(start), strand))
        columns["link"].append(found.link[order][kept])
        columns["energy_RT"].append(found.energy_RT[order][kept])
        columns["energy_reduced"].append(found.energy_reduced[order][kept])
        columns["minus_lnJ"].append(found.minus_lnJ[order][kept])
        columns["status"].append(status[code[kept]])
    joined = {name: np.concatenate(columns[name]) for name in WINDOW_COLUMNS[1:]}
    if len(parts) > 1:
        place = np.lexsort((joined["strand"] == REVERSE, joined["start"]))
        joined = {name: column[place] for name, column in joined.items()}
    names = np.full(len(joined["start"]), piece.name)
    return Result(piece.number, {"record": names, **joined}, skipped, searches)


def _failed_record(piece: Piece) -> Result:
    nothing = np.array([np.nan])
    zero = np.zeros(1, dtype=np.int64)
    values = (
        np.array([piece.name]),
        zero,
        zero,
        np.array([FORWARD]),
        zero,
        nothing,
        nothing,
        nothing,
        np.array([piece.failure]),
    )
    return Result(piece.number, dict(zip(WINDOW_COLUMNS, values, strict=True)), 0, 0)


def _record_rows(settings: Settings, piece: Piece) -> Result:
    rows = [
        scan_row(name, letters, settings.arguments, laplace=settings.laplace)
        for name, letters in piece.records
    ]
    columns: dict[str, Any] = {}
    for k, name in enumerate(COLUMNS):
        cells = [row[k] for row in rows]
        if name in ("n_bp", "link"):
            columns[name] = np.array([int(cell or 0) for cell in cells], dtype=np.int64)
        elif name in ("name", "status", "quality"):
            columns[name] = np.array(cells)
        else:
            columns[name] = np.array([float(cell or "nan") for cell in cells])
    return Result(piece.number, columns, 0, 0)


WINDOW_COLUMNS = (
    "record",
    "start",
    "end",
    "strand",
    "link",
    "energy_RT",
    "energy_reduced",
    "minus_lnJ",
    "status",
)
