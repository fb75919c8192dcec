"""Files that a scan in pieces ends in: Parquet, CSV, bedGraph, bigWig and a page to read.

Every piece is one Parquet file from the moment it is done; a data set of Parquet files is finished
then, and the other forms are made from the pieces when all are there.
"""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from dnacheck.io.files import atomic_write
from dnacheck.numerics.outcome import InputError
from dnacheck.scanning.pieces import Result

UNITS = {
    "name": "first word of the record's header",
    "record": "first word of the record's header",
    "n_bp": "base pairs",
    "start": "first base pair of the window, from 0",
    "end": "base pair after the window, from 0",
    "strand": "+ as written, - its reverse complement",
    "link": "turns",
    "energy_RT": "RT",
    "energy_reduced": "reduced",
    "minus_lnJ": "-ln(J / 1 M)",
    "quality": "what the value of J was judged to be",
    "status": "ok, or the reason why there is no value",
}
DECIMALS = {"energy_RT": 6, "energy_reduced": 8, "minus_lnJ": 6}
OK = "ok"

PARQUET, CSV, BEDGRAPH, BIGWIG, PAGE = ".parquet", ".csv", ".bedgraph", ".bw", ".html"
SUFFIXES = {
    ".parquet": PARQUET,
    ".csv": CSV,
    ".bedgraph": BEDGRAPH,
    ".bdg": BEDGRAPH,
    ".bw": BIGWIG,
    ".bigwig": BIGWIG,
    ".html": PAGE,
}
TRACKS = (BEDGRAPH, BIGWIG)


def kind_of(path: Path) -> str:
    """The form of an output, by its suffix.

    Raises
    ------
    InputError
        No form has that suffix, or a library for it is missing.
    """
    kind = SUFFIXES.get(path.suffix.lower())
    if kind is None:
        raise InputError(f"output '{path}': give a name that ends in {', '.join(SUFFIXES)}")
    if kind == BIGWIG:
        try:
            import pyBigWig  # noqa: F401
        except ImportError:
            raise InputError(
                f"output '{path}': bigWig needs pyBigWig; install dnacheck[tracks], or name a "
                ".bedgraph"
            ) from None
    return kind


class Pieces:
    """The directory of the pieces of one scan.

    Parameters
    ----------
    directory : Path
    digest : str
        Of the scan's input and settings; a piece that holds another one is not taken for done.
    """

    def __init__(self, directory: Path, digest: str) -> None:
        self.directory = directory
        self.digest = digest

    def path(self, index: int) -> Path:
        """File of a piece; names sort as the pieces do."""
        return self.directory / f"part-{index:08d}.parquet"

    def done(self, index: int) -> dict[str, int] | None:
        """Counts of a finished piece, None if it has to be computed."""
        path = self.path(index)
        if not path.exists():
            return None
        try:
            metadata = pq.read_schema(path).metadata or {}
            counts = json.loads(metadata.get(b"dnacheck", b"{}"))
        except (OSError, ValueError, pa.ArrowException):
            return None
        return counts["counts"] if counts.get("scan") == self.digest else None

    def write(self, result: Result) -> dict[str, int]:
        """Write a piece whole; returns its counts."""
        columns = result.columns
        statuses, numbers = np.unique(columns["status"], return_counts=True)
        counts = {
            "rows": len(columns["status"]),
            "ok": int(numbers[statuses == OK].sum()),
            "skipped": result.skipped,
        }
        note = json.dumps({"scan": self.digest, "piece": result.number, "counts": counts})
        fields = [
            pa.field(
                name,
                pa.from_numpy_dtype(column.dtype) if column.dtype.kind != "U" else pa.string(),
                metadata={"units": UNITS[name]},
            )
            for name, column in columns.items()
        ]
        table = pa.table(
            [pa.array(column, from_pandas=column.dtype.kind == "f") for column in columns.values()],
            schema=pa.schema(fields, metadata={"dnacheck": note}),
        )
        buffer = io.BytesIO()
        pq.write_table(table, buffer, compression="zstd")
        atomic_write(self.path(result.number), buffer.getvalue())
        return counts

    def tables(self) -> Iterator[dict[str, Any]]:
        """Columns of every piece as numpy arrays, in order; missing numbers are NaN."""
        for path in sorted(self.directory.glob("part-*.parquet")):
            table = pq.read_table(path)
            yield {name: table[name].to_numpy(zero_copy_only=False) for name in table.column_names}


def write_csv(path: Path, pieces: Pieces) -> None:
    """All rows, numbers with a fixed number of decimals, an empty cell where there is none."""
    with whole_text(path) as handle:
        writer = csv.writer(handle, lineterminator="\n")
        for k, columns in enumerate(pieces.tables()):
            if k == 0:
                writer.writerow(columns)
            cells = [_cells(name, column, columns) for name, column in columns.items()]
            writer.writerows(zip(*cells, strict=True))


def _cells(name: str, column: Any, columns: dict[str, Any]) -> list[Any]:
    if name in DECIMALS:
        digits = DECIMALS[name]
        return ["" if np.isnan(value) else f"{value:.{digits}f}" for value in column]
    if name == "link":
        return [
            "" if np.isnan(energy) else link
            for link, energy in zip(column.tolist(), columns["energy_RT"], strict=True)
        ]
    return list(column.tolist())


def _runs(pieces: Pieces, step: int, length: dict[str, int]) -> Iterator[tuple[str, Any, Any, Any]]:
    """Record, first and end base pair and -ln J of the middles of windows read forward."""
    for columns in pieces.tables():
        forward = (columns["strand"] == "+") & ~np.isnan(columns["minus_lnJ"])
        if forward.any():
            name = str(columns["record"][0])
            middle = (columns["start"][forward] + columns["end"][forward]) // 2
            end = np.minimum(middle + step, length[name])
            yield name, middle, end, columns["minus_lnJ"][forward]


def write_bedgraph(path: Path, pieces: Pieces, step: int, found: list[tuple[str, int]]) -> None:
    """-ln J at the middle of each window, for a genome browser."""
    with whole_text(path) as handle:
        handle.write(f'track type=bedGraph name="-ln J" description="{_TRACK}"\n')
        for record, begin, end, value in _runs(pieces, step, dict(found)):
            for row in zip(begin.tolist(), end.tolist(), value.tolist(), strict=True):
                handle.write(f"{record}\t{row[0]}\t{row[1]}\t{row[2]:.4f}\n")


_TRACK = "-ln(J / 1 M) of the ring closed from the window around each base pair"


def write_bigwig(path: Path, pieces: Pieces, step: int, found: list[tuple[str, int]]) -> None:
    """The same track, indexed."""
    import pyBigWig

    scratch = path.with_name(f".{path.name}.part")
    try:
        track = pyBigWig.open(str(scratch), "w")
        track.addHeader([(name, length) for name, length in found if length])
        for record, begin, end, value in _runs(pieces, step, dict(found)):
            track.addEntries(
                [record] * len(begin), begin.tolist(), ends=end.tolist(), values=value.tolist()
            )
        track.close()
    except RuntimeError as error:
        scratch.unlink(missing_ok=True)
        raise InputError(f"output '{path}': bigWig takes no such track ({error})") from None
    os.replace(scratch, path)


@contextmanager
def whole_text(path: Path) -> Iterator[TextIO]:
    """A large text file that takes its name when it is finished."""
    scratch = path.with_name(f".{path.name}.part")
    try:
        with scratch.open("w", encoding="utf-8", newline="") as handle:
            yield handle
            handle.flush()
            os.fsync(handle.fileno())
        scratch.replace(path)
    except OSError as error:
        raise InputError(
            f"output '{path}': {error.strerror}; name a file in a writable directory"
        ) from None
    finally:
        scratch.unlink(missing_ok=True)
