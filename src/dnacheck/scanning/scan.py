"""Lowest ring and J factor of every record of a sequence file, resumable and in order.

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
import re
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from dnacheck import __version__
from dnacheck.cyclization.half_chain.proposals import EASY_RT
from dnacheck.cyclization.laplace.isolated import log_prefactor
from dnacheck.cyclization.laplace.kernels.quick import KnownMinima
from dnacheck.cyclization.laplace.quick import QUICK_WINDOW_RT, QuickJ, quick_of_minima
from dnacheck.equilibria.discrete.kernels.cut import rotated
from dnacheck.equilibria.discrete.kernels.newton import ENERGY
from dnacheck.equilibria.discrete.search import room_for, search_plan
from dnacheck.equilibria.discrete.solve import NewtonOptions
from dnacheck.io.files import atomic_write
from dnacheck.io.sequences import Record, SequenceSource
from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.chain_kernels import HingeSteps
from dnacheck.model.cut_kernels import least_rotation
from dnacheck.model.molecules import Molecule
from dnacheck.model.parameters import ParameterSet, load_parameters
from dnacheck.model.sequence import parse_sequence
from dnacheck.numerics.outcome import InputError
from dnacheck.scanning import kernels as sk

COLUMNS = ("name", "n_bp", "link", "energy_RT", "energy_reduced", "minus_lnJ", "status", "quality")
OTHER_STRAND_COLUMNS = ("other_strand_energy_RT", "other_strand_minus_lnJ")
"""Behind the others where they are asked for; equal to them unless the step form is the wedge."""
_STATUS = COLUMNS.index("status")
STATUS_FOUND = "ok"
STATUS_NO_RING = "no stable ring found at any link searched"
QUALITY_LAPLACE = "laplace only"
"""Of a row whose J is Laplace's alone: where that was asked for, of rigid steps, and of molecules
too long for a picture of small fluctuations about a ring."""
STATUS_FREE = "free register, no Laplace value; use dnacheck jfactor"

_BLOCK = 8
"""Records handed to a thread at a time."""
_BLOCKS_IN_FLIGHT = 4
"""Blocks per thread read ahead; bounds the memory."""
_REASONS_NAMED = 5
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
    other_strand : bool
        Whether rows have the columns :data:`OTHER_STRAND_COLUMNS` too.
    laplace : bool
        Leave J at Laplace's value, which costs a fraction of the time.
    """

    chain_arguments: Mapping[str, Any] = field(default_factory=dict)
    threads: int = 1
    other_strand: bool = False
    laplace: bool = False

    def __post_init__(self) -> None:
        if self.threads < 1:
            raise InputError(f"threads must be at least 1, not {self.threads}")

    @property
    def columns(self) -> tuple[str, ...]:
        """The header of the file."""
        return COLUMNS + OTHER_STRAND_COLUMNS if self.other_strand else COLUMNS


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
    reasons : mapping
        Over all rows that are not ``ok``, how often each reason occurs, the most frequent first;
        names, positions and lengths are left out of the reason.
    """

    rows: int
    resumed_rows: int
    failed_rows: int
    seconds: float
    reasons: Mapping[str, int] = field(default_factory=dict)

    @property
    def ok_rows(self) -> int:
        """Rows of the finished file whose status is ``ok``."""
        return self.rows - sum(self.reasons.values())


def scan_row(
    name: str,
    letters: str,
    arguments: Mapping[str, Any],
    other_strand: bool = False,
    laplace: bool = False,
) -> list[str]:
    """The cells of one record; a record that cannot be computed has the reason as its status."""
    letters = "".join(letters.split())
    cells = [name, str(len(letters)), "", "", "", ""]
    others = [""] * len(OTHER_STRAND_COLUMNS) if other_strand else []
    try:
        if len(letters) > _LONGEST:
            raise InputError(f"{len(letters)} base pairs are more than {_LONGEST}; leave it out")
        molecule = Molecule(parse_sequence(letters, name))
        chain = build_chain(molecule, **arguments)
    except InputError as error:
        return [*cells, " ".join(str(error).split()), "", *others]
    if other_strand:
        across = molecule.other_strand(chain.a_tract_regions)
        row = dict(
            zip(
                COLUMNS,
                _row(name, build_chain(across, **{**arguments, "a_tracts": "auto"}), laplace),
                strict=True,
            )
        )
        others = [row["energy_RT"], row["minus_lnJ"]]
    return [*_row(name, chain, laplace), *others]


def _row(name: str, chain: Chain, laplace: bool) -> list[str]:
    """The cells of a chain."""
    cells = [name, str(chain.n_steps), "", "", "", ""]
    figures = np.empty(sk.N_SCAN_FIGURES)
    scale = chain.energy_scale_RT
    plan = search_plan(chain)
    ring = rotated(chain.arrays, least_rotation(chain.arrays))
    minima = room_for(plan, chain.n_steps, chain.ground.shape[1])
    found = sk.scan_molecule(
        ring, plan, NewtonOptions().limits, minima, scale, log_prefactor(chain), figures
    )
    if not found or not np.isfinite(figures).all():
        return [*cells, STATUS_NO_RING, ""]
    energy = float(figures[sk.LOWEST_ENERGY])
    quick = None if laplace else _quick(chain, ring, minima, int(figures[sk.MINIMA]))
    free = quick is None and figures[sk.FREE_REGISTERS] > 0
    log_j = figures[sk.LOG_J] if quick is None else quick.log_j
    return [
        name,
        str(chain.n_steps),
        str(int(figures[sk.LOWEST_LINK])),
        f"{energy * scale:.6f}",
        f"{energy:.8f}",
        "" if free else f"{-log_j:.6f}",
        STATUS_FREE if free else STATUS_FOUND,
        "" if free else QUALITY_LAPLACE if quick is None else quick.quality,
    ]


def _quick(chain: Chain, ring: Any, minima: Any, found: int) -> QuickJ | None:
    """ln J beyond Laplace's value; None where only that is known."""
    energies = chain.energy_scale_RT * minima.figures[:found, ENERGY]
    if not isinstance(ring, HingeSteps) or energies.min() < EASY_RT:
        return None
    near = np.flatnonzero(energies < energies.min() + QUICK_WINDOW_RT)
    near = near[np.argsort(energies[near], kind="stable")]
    links = [sk.link_of_shape(ring, minima.angles[k]) for k in near]
    known = KnownMinima(
        np.ascontiguousarray(minima.angles[near]),
        chain.energy_scale_RT * minima.multipliers[near],
        np.array(links, dtype=np.int64),
    )
    return quick_of_minima(chain, ring, known)


def _text(rows: list[list[str]]) -> bytes:
    """Rows as CSV text, one line each."""
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(rows)
    return buffer.getvalue().encode()


def _block_text(
    block: list[Record], options: ScanOptions, arguments: Mapping[str, Any]
) -> tuple[bytes, list[str]]:
    """Rows of a block as text, and the statuses that are not ``ok``."""
    rows = [
        scan_row(record.name, record.letters, arguments, options.other_strand, options.laplace)
        for record in block
    ]
    return _text(rows), [row[_STATUS] for row in rows if row[_STATUS] != STATUS_FOUND]


def _reason(status: str) -> str:
    """A status without what differs from record to record."""
    reason = re.sub(r"^sequence '.*?'(, position \d+)?: ", "", status)
    return re.sub(r"^\d+ base pairs", "base pairs", reason)


def state_path(output: Path) -> Path:
    """The state file of an output file."""
    return output.with_name(output.name + ".state.json")


def scan_settings(source: SequenceSource, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """What every row of a scan depends on: input, parameters and version."""
    plain = {
        key: value if isinstance(value, str | int | float | type(None)) else str(value)
        for key, value in arguments.items()
        if key != "angles"
    }
    table = arguments.get("angles", "trifonov2")
    table = load_parameters(table) if isinstance(table, str) else table
    return {
        "version": __version__,
        "input": Path(source.name).name,
        "input_sha256": source.digest,
        "records": source.count,
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


def _whole_rows(
    handle: BinaryIO, source: SequenceSource, columns: tuple[str, ...]
) -> tuple[int, int, list[str]]:
    """Rows of an unfinished output that agree with the input, their bytes, and what failed.

    A row counts if it ends in a newline, has all columns, and names the record at its place; what
    follows the last such row (half a line, blocks of zeros after a power failure) does not.
    """
    header = _text([list(columns)])
    handle.seek(0)
    if handle.readline() != header:
        return 0, 0, []
    rows, size = 0, len(header)
    failures: list[str] = []
    records = source.records()
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
        if record is None or len(cells) != len(columns) or cells[0] != record.name:
            break
        rows += 1
        if cells[_STATUS] != STATUS_FOUND:
            failures.append(cells[_STATUS])
        size += len(pending)
        pending = b""
    return rows, size, failures


def _opened(
    source: SequenceSource,
    output: Path,
    settings: dict[str, Any],
    restart: bool,
    columns: tuple[str, ...],
) -> tuple[BinaryIO, int, list[str]]:
    """The output ready for the next row, how many rows it has, and which of them failed."""
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
    rows, size, failures = (0, 0, []) if fresh else _whole_rows(handle, source, columns)
    handle.seek(size)
    handle.truncate()
    if size == 0:
        handle.write(_text([list(columns)]))
    return handle, rows, failures


def scan(
    source: Path | str | SequenceSource,
    output: Path,
    options: ScanOptions | None = None,
    progress: Callable[[int], None] | None = None,
    restart: bool = False,
) -> ScanSummary:
    """Scan a file of sequences into a CSV file, going on with an unfinished one.

    Parameters
    ----------
    source : path or SequenceSource
        FASTA or GenBank, as :class:`dnacheck.io.sequences.SequenceSource` reads it.
    output : Path
        CSV file with the columns of the options; J is that of
        :mod:`dnacheck.cyclization.laplace.quick`, and ``quality`` how far to believe it: good,
        fair or poor, or :data:`QUALITY_LAPLACE`.
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
    source = source if isinstance(source, SequenceSource) else SequenceSource(source)
    if Path(source.name).resolve() == output.resolve():
        raise InputError(f"file '{output}' is the input; name another one for the output")
    arguments = dict(options.chain_arguments)
    settings = scan_settings(source, arguments)
    if options.other_strand:
        settings["other_strand"] = True
    if options.laplace:
        settings["laplace"] = True
    angles = arguments.get("angles", "trifonov2")
    arguments["angles"] = load_parameters(angles) if isinstance(angles, str) else angles
    handle, resumed, failures = _opened(source, output, settings, restart, options.columns)
    reasons = Counter(map(_reason, failures))
    failed = 0
    done = resumed
    with handle:
        if progress is not None and resumed:
            progress(resumed)
        pending: deque[tuple[Future[tuple[bytes, list[str]]], int]] = deque()
        stream = islice(source.records(), resumed, None)
        synced = time.perf_counter()
        with ThreadPoolExecutor(options.threads) as pool:
            try:
                while True:
                    while len(pending) < _BLOCKS_IN_FLIGHT * options.threads:
                        block = list(islice(stream, _BLOCK))
                        if not block:
                            break
                        work = pool.submit(_block_text, block, options, arguments)
                        pending.append((work, len(block)))
                    if not pending:
                        break
                    future, size = pending.popleft()
                    text, bad = future.result()
                    handle.write(text)
                    handle.flush()
                    done += size
                    failed += len(bad)
                    reasons.update(map(_reason, bad))
                    if progress is not None:
                        progress(size)
                    if time.perf_counter() - synced > _SYNC_SECONDS:
                        _sync(handle)
                        synced = time.perf_counter()
            finally:
                for future, _ in pending:
                    future.cancel()
                _sync(handle)
    seconds = time.perf_counter() - began
    return ScanSummary(done, resumed, failed, seconds, dict(reasons.most_common()))


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
    if summary.reasons:
        text += f"; {summary.rows - summary.ok_rows} not ok"
        named = list(summary.reasons.items())
        text += f" ({'; '.join(f'{count}: {reason}' for reason, count in named[:_REASONS_NAMED])}"
        if len(named) > _REASONS_NAMED:
            text += f"; {len(named) - _REASONS_NAMED} more reasons"
        text += ")"
    return text
