"""Lowest ring and Laplace J factor of every record of a FASTA file, resumable and in order.

Rows are appended to the CSV file in the order of the input; a state file beside it (its name with
``.state.json``) holds the settings and the fingerprint of the input. A scan that was killed at any
moment goes on from the last whole row that agrees with both, so that the finished file is the
same, byte for byte, as that of an uninterrupted scan. No result depends on the number of threads.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from dnacheck import __version__
from dnacheck.cyclization.laplace.isolated import log_prefactor
from dnacheck.equilibria.discrete.search import candidate_links
from dnacheck.io.files import atomic_write
from dnacheck.model.chain import build_chain
from dnacheck.model.parameters import ParameterSet, load_parameters
from dnacheck.model.sequence import parse_sequence
from dnacheck.numerics.outcome import InputError
from dnacheck.scan import kernels as sk

COLUMNS = ("name", "n_bp", "link", "energy_RT", "energy_reduced", "minus_lnJ", "status")
STATUS_FOUND = "ok"
STATUS_NO_RING = "no stable ring found at any link searched"
STATUS_FREE = "free register, no Laplace value; use dnacheck jfactor"

_BLOCK = 8
"""Records handed to a thread at a time."""
_BLOCKS_IN_FLIGHT = 4
"""Blocks per thread read ahead; bounds the memory."""
_SYNC_SECONDS = 2.0
"""Longest time for which finished rows may be lost by a power failure."""
_LONGEST = 100_000
"""Longest molecule that is scanned, in base pairs; a longer record is a row with its reason."""


@dataclass(frozen=True)
class ScanOptions:
    """What is computed for every record, and with how many threads.

    Attributes
    ----------
    chain_arguments : mapping
        Keyword arguments of :func:`dnacheck.model.chain.build_chain`.
    threads : int
    """

    chain_arguments: Mapping[str, Any] = field(default_factory=dict)
    threads: int = 1

    def __post_init__(self) -> None:
        if self.threads < 1:
            raise InputError(f"threads must be at least 1, not {self.threads}")


@dataclass(frozen=True)
class ScanSummary:
    """What a scan did.

    Attributes
    ----------
    rows : int
        Rows of the finished file.
    resumed_rows : int
        Of them, rows that were there already.
    failed_rows : int
        Rows computed now whose status is not ``ok``.
    seconds : float
    """

    rows: int
    resumed_rows: int
    failed_rows: int
    seconds: float


def fasta_records(path: Path) -> Iterator[tuple[str, str]]:
    """Name and letters of each record, in order; nothing is checked.

    Bytes that are not UTF-8 become letters that no sequence has, so that they spoil their own
    record and no other.

    Raises
    ------
    InputError
        The file cannot be read or is not FASTA.
    """
    from Bio.SeqIO.FastaIO import SimpleFastaParser

    try:
        with path.open(encoding="utf-8", errors="replace") as handle:
            for number, (header, letters) in enumerate(SimpleFastaParser(handle), start=1):
                words = header.split()
                yield (words[0] if words else f"record {number}"), letters
    except OSError as error:
        raise InputError(f"file '{path}': {error.strerror or error}; check the path") from None
    except ValueError as error:
        raise InputError(f"file '{path}': not FASTA ({error}); records start with '>'") from None


def fingerprint(path: Path) -> tuple[str, int]:
    """SHA-256 of a file and its number of FASTA records.

    Raises
    ------
    InputError
        The file cannot be read or holds no record.
    """
    digest = hashlib.sha256()
    records = 0
    last = b"\n"
    try:
        with path.open("rb") as handle:
            while chunk := handle.read(1 << 20):
                digest.update(chunk)
                records += (last + chunk).count(b"\n>") + (last + chunk).count(b"\r>")
                last = chunk[-1:]
    except OSError as error:
        raise InputError(f"file '{path}': {error.strerror or error}; check the path") from None
    if not records:
        raise InputError(f"file '{path}': no FASTA record; a record starts with a line '>name'")
    return digest.hexdigest(), records


def scan_row(name: str, letters: str, arguments: Mapping[str, Any]) -> list[str]:
    """The cells of one record; a record that cannot be computed has the reason as its status."""
    letters = "".join(letters.split())
    cells = [name, str(len(letters)), "", "", "", ""]
    try:
        if len(letters) > _LONGEST:
            raise InputError(f"{len(letters)} base pairs are more than {_LONGEST}; leave it out")
        chain = build_chain(parse_sequence(letters, name), **arguments)
    except InputError as error:
        return [*cells, " ".join(str(error).split())]
    figures = np.empty(sk.N_SCAN_FIGURES)
    scale = chain.energy_scale_RT
    found = sk.scan_molecule(
        chain.ground,
        chain.stiffness,
        chain.form_code,
        np.array(candidate_links(chain), dtype=np.int64),
        scale,
        log_prefactor(chain),
        figures,
    )
    if not found or not np.isfinite(figures).all():
        return [*cells, STATUS_NO_RING]
    energy = float(figures[sk.LOWEST_ENERGY])
    free = figures[sk.FREE_REGISTERS] > 0
    return [
        name,
        str(chain.n_steps),
        str(int(figures[sk.LOWEST_LINK])),
        f"{energy * scale:.6f}",
        f"{energy:.8f}",
        "" if free else f"{-figures[sk.LOG_J]:.6f}",
        STATUS_FREE if free else STATUS_FOUND,
    ]


def _text(rows: list[list[str]]) -> bytes:
    """Rows as CSV text, one line each."""
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(rows)
    return buffer.getvalue().encode()


def _block_text(block: list[tuple[str, str]], arguments: Mapping[str, Any]) -> tuple[bytes, int]:
    rows = [scan_row(name, letters, arguments) for name, letters in block]
    return _text(rows), sum(row[-1] != STATUS_FOUND for row in rows)


def state_path(output: Path) -> Path:
    """The state file of an output file."""
    return output.with_name(output.name + ".state.json")


def _settings(
    source: Path, records: int, digest: str, arguments: Mapping[str, Any]
) -> dict[str, Any]:
    plain = {
        key: value if isinstance(value, str | int | float | type(None)) else str(value)
        for key, value in arguments.items()
        if key != "angles"
    }
    table = arguments.get("angles", "trifonov2")
    table = load_parameters(table) if isinstance(table, str) else table
    return {
        "version": __version__,
        "input": source.name,
        "input_sha256": digest,
        "records": records,
        "angles": table.name,
        "angles_sha256": _angle_digest(table),
        **plain,
    }


def _angle_digest(table: ParameterSet) -> str:
    digest = hashlib.sha256(np.ascontiguousarray(table.ground).tobytes())
    if table.stiffness is not None:
        digest.update(np.ascontiguousarray(table.stiffness).tobytes())
    digest.update(repr(table.a_tract_twist).encode())
    return digest.hexdigest()


def _whole_rows(handle: BinaryIO, source: Path) -> tuple[int, int]:
    """Rows of an unfinished output that agree with the input, and the bytes they take.

    A row counts if it ends in a newline, has all columns, and names the record at its place; what
    follows the last such row (half a line, blocks of zeros after a power failure) does not.
    """
    header = _text([list(COLUMNS)])
    handle.seek(0)
    if handle.readline() != header:
        return 0, 0
    rows, size = 0, len(header)
    records = fasta_records(source)
    pending = b""
    for line in handle:
        pending += line
        if not line.endswith(b"\n"):
            break
        if pending.count(b'"') % 2:  # a quoted cell goes on in the next line
            continue
        record = next(records, None)
        try:
            cells = next(csv.reader(io.StringIO(pending.decode())))
        except (UnicodeDecodeError, csv.Error, StopIteration):
            break
        if record is None or len(cells) != len(COLUMNS) or cells[0] != record[0]:
            break
        rows += 1
        size += len(pending)
        pending = b""
    return rows, size


def _opened(
    source: Path, output: Path, settings: dict[str, Any], restart: bool
) -> tuple[BinaryIO, int]:
    """The output ready for the next row, and how many rows it has."""
    state = state_path(output)
    try:
        old = json.loads(state.read_text()) if state.exists() and not restart else None
    except (OSError, ValueError):
        old = None
    if output.exists() and not restart and old != settings:
        if old is None:
            raise InputError(
                f"file '{output}' exists and is no unfinished scan; name another one or add "
                "--restart to replace it"
            )
        changed = sorted(k for k in {*old, *settings} if old.get(k) != settings.get(k))
        raise InputError(
            f"file '{output}' belongs to a scan with other {', '.join(changed)}; name another "
            "one or add --restart to replace it"
        )
    fresh = restart or not output.exists()
    atomic_write(state, json.dumps(settings, indent=2) + "\n")
    try:
        handle = output.open("w+b" if fresh else "r+b")
    except OSError as error:
        raise InputError(
            f"cannot write '{output}': {error.strerror}; name a file in a writable directory"
        ) from error
    rows, size = (0, 0) if fresh else _whole_rows(handle, source)
    handle.seek(size)
    handle.truncate()
    if size == 0:
        handle.write(_text([list(COLUMNS)]))
    return handle, rows


def scan(
    source: Path,
    output: Path,
    options: ScanOptions | None = None,
    progress: Callable[[int], None] | None = None,
    restart: bool = False,
) -> ScanSummary:
    """Scan a FASTA file into a CSV file, going on with an unfinished one.

    Parameters
    ----------
    source : Path
        FASTA file.
    output : Path
        CSV file with the columns :data:`COLUMNS`; J is Laplace's, summed over minima and links.
    progress : callable, optional
        Called with the number of records finished since the last call.
    restart : bool
        Replace an existing output instead of going on with it.

    Raises
    ------
    InputError
        The input cannot be read, the output cannot be written, or the output exists and belongs
        to another input or other settings.
    """
    options = options or ScanOptions()
    began = time.perf_counter()
    if source.resolve() == output.resolve():
        raise InputError(f"file '{output}' is the input; name another one for the output")
    digest, records = fingerprint(source)
    arguments = dict(options.chain_arguments)
    settings = _settings(source, records, digest, arguments)
    angles = arguments.get("angles", "trifonov2")
    arguments["angles"] = load_parameters(angles) if isinstance(angles, str) else angles
    handle, resumed = _opened(source, output, settings, restart)
    failed = 0
    done = resumed
    with handle:
        if progress is not None and resumed:
            progress(resumed)
        pending: deque[tuple[Future[tuple[bytes, int]], int]] = deque()
        stream = islice(fasta_records(source), resumed, None)
        synced = time.perf_counter()
        with ThreadPoolExecutor(options.threads) as pool:
            try:
                while True:
                    while len(pending) < _BLOCKS_IN_FLIGHT * options.threads:
                        block = list(islice(stream, _BLOCK))
                        if not block:
                            break
                        pending.append((pool.submit(_block_text, block, arguments), len(block)))
                    if not pending:
                        break
                    future, size = pending.popleft()
                    text, bad = future.result()
                    handle.write(text)
                    handle.flush()
                    done += size
                    failed += bad
                    if progress is not None:
                        progress(size)
                    if time.perf_counter() - synced > _SYNC_SECONDS:
                        _sync(handle)
                        synced = time.perf_counter()
            finally:
                for future, _ in pending:
                    future.cancel()
                _sync(handle)
    return ScanSummary(done, resumed, failed, time.perf_counter() - began)


def _sync(handle: BinaryIO) -> None:
    handle.flush()
    os.fsync(handle.fileno())


def summary_line(summary: ScanSummary, output: Path) -> str:
    """One line for the reader."""
    new = summary.rows - summary.resumed_rows
    rate = new / summary.seconds if summary.seconds > 0.0 else math.nan
    text = f"{summary.rows} rows in {output}"
    if summary.resumed_rows:
        text += f", {summary.resumed_rows} of them from before"
    text += f"; {new} now in {summary.seconds:.1f} s ({rate:.0f} a second)"
    if summary.failed_rows:
        text += f"; {summary.failed_rows} without a ring, see their status"
    return text
