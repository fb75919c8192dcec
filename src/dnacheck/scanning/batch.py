"""A scan in pieces: planned, computed by anyone, each piece kept when done, assembled at the end.

A directory holds one Parquet file per finished piece; beside the first output stands a state file
with the settings and the fingerprint of the input. The same command goes on with the pieces that
are missing, so that each is done exactly once whatever died in between.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from dnacheck.io.files import atomic_write
from dnacheck.io.sequences import SequenceSource
from dnacheck.numerics.outcome import InputError
from dnacheck.scanning import pieces as pc
from dnacheck.scanning import windows as win
from dnacheck.scanning.outputs import (
    BEDGRAPH,
    BIGWIG,
    CSV,
    PAGE,
    PARQUET,
    TRACKS,
    Pieces,
    kind_of,
    write_bedgraph,
    write_bigwig,
    write_csv,
)
from dnacheck.scanning.page import write_page
from dnacheck.scanning.scan import scan_settings, state_path
from dnacheck.scanning.workers import crew

_SAMPLE_WINDOWS = 1024
_BYTES_A_ROW = {PARQUET: 21.0, CSV: 85.0, BEDGRAPH: 32.0, BIGWIG: 12.0, PAGE: 0.0}
"""Measured on random sequences; for the estimate of --dry-run only."""


@dataclass(frozen=True)
class BatchSummary:
    """What a scan in pieces did.

    Attributes
    ----------
    rows, ok_rows : int
        Rows of the finished outputs, and how many have a value.
    skipped : int
        Windows left out because a letter other than A, C, G, T stands in them.
    pieces, resumed_pieces : int
        Pieces of work, and how many of them were there already.
    new_rows : int
        Rows computed now.
    seconds : float
    """

    rows: int
    ok_rows: int
    skipped: int
    pieces: int
    resumed_pieces: int
    new_rows: int
    seconds: float

    @property
    def rate(self) -> float:
        """Rows computed a second; NaN where nothing was."""
        return self.new_rows / self.seconds if self.new_rows else float("nan")


@dataclass(frozen=True)
class Plan:
    """What a scan will do.

    Attributes
    ----------
    source : SequenceSource
    arguments : mapping
        Keyword arguments of :func:`dnacheck.model.chain.build_chain`.
    options : WindowOptions, optional
        None scans whole records.
    laplace : bool
        Leave J of records at Laplace's value; that of windows is.
    """

    source: SequenceSource
    arguments: dict[str, Any]
    options: pc.WindowOptions | None = None
    laplace: bool = False
    _lengths: list[tuple[str, int]] = field(default_factory=list, repr=False)

    @classmethod
    def of(
        cls,
        source: SequenceSource | Path | str,
        arguments: dict[str, Any],
        options: pc.WindowOptions | None = None,
        laplace: bool = False,
    ) -> Plan:
        """Read the input once and check that there is something to do.

        Raises
        ------
        InputError
            The input cannot be read, or holds no window.
        """
        source = source if isinstance(source, SequenceSource) else SequenceSource(source)
        found = pc.lengths(source)
        if options is not None:
            pc.window_count(found, options)
        return cls(source, pc.plain_arguments(arguments), options, laplace, found)

    @property
    def rows(self) -> int:
        """Windows on all strands, or records."""
        if self.options is None:
            return len(self._lengths)
        return pc.window_count(self._lengths, self.options) * (1 + self.options.both_strands)

    @property
    def record_lengths(self) -> list[tuple[str, int]]:
        """Name and length of every record."""
        return self._lengths

    def pieces(self) -> Iterator[pc.Piece]:
        """Pieces of work, in order."""
        if self.options is None:
            return pc.cut_records(self.source)
        return pc.cut_windows(self.source, self.options)

    def settings(self) -> dict[str, Any]:
        """Everything that the result depends on, as JSON has it."""
        found = scan_settings(self.source, self.arguments)
        if self.options is not None:
            region = self.options.region
            found |= asdict(self.options) | {"region": asdict(region) if region else None}
        elif self.laplace:
            found["laplace"] = True
        return found

    def estimate(self, outputs: Sequence[Path], workers: int) -> dict[str, Any]:
        """Rows, seconds and bytes to expect, from a short sample computed now."""
        settings = pc.Settings(self.arguments, self.options, self.laplace)
        first = next(p for p in self.pieces() if not p.failure)
        if self.options is not None:
            reach = (_SAMPLE_WINDOWS - 1) * self.options.step + self.options.window
            first = first._replace(letters=first.letters[:reach])
        else:
            first = first._replace(records=first.records[:_SAMPLE_WINDOWS])
        small = first._replace(letters=first.letters[: 2 * win.SEARCH_EVERY * 10])
        pc.compute(settings, small if self.options is not None else first)  # compiles
        began = time.perf_counter()
        result = pc.compute(settings, first)
        rate = len(result.columns["status"]) / (time.perf_counter() - began)
        return {
            "rows": self.rows,
            "rows_a_second_and_worker": rate,
            "workers": workers,
            "seconds": self.rows / (rate * workers),
            "bytes": {str(path): int(self.rows * _BYTES_A_ROW[kind_of(path)]) for path in outputs},
        }


def run(
    plan: Plan,
    outputs: Sequence[Path],
    processes: int = 1,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int], None] | None = None,
    restart: bool = False,
) -> BatchSummary:
    """Do what a plan says and write its outputs.

    Parameters
    ----------
    outputs : sequence of path
        Forms by suffix, see :data:`dnacheck.scanning.outputs.SUFFIXES`; the first names the state
        file. A ``.parquet`` is a directory with one file a piece.
    processes, workers, scheduler
        See :func:`dnacheck.scanning.workers.crew`.
    progress : callable, optional
        Called with the number of rows finished since the last call.
    restart : bool
        Replace the pieces of another scan.

    Raises
    ------
    InputError
        An output cannot be written or holds another scan, or no scheduler answers.
    """
    began = time.perf_counter()
    kinds = {path: kind_of(path) for path in outputs}
    if plan.options is None and any(kind in TRACKS for kind in kinds.values()):
        raise InputError("a track is of windows along a record; add --window, or name a .csv")
    if any(kind in TRACKS for kind in kinds.values()):
        _tracks_fit(plan)
    settings = plan.settings()
    digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()
    directory, keep = _directory(outputs, kinds)
    state = state_path(outputs[0])
    finished = _prepare(state, directory, settings, outputs, restart)
    if finished is not None:
        untouched = {"resumed_pieces": finished["pieces"], "new_rows": 0, "seconds": 0.0}
        return BatchSummary(**{**finished, **untouched})
    store = Pieces(directory, digest)
    total: Counter[str] = Counter()
    count = resumed = new = 0

    def missing() -> Iterator[pc.Piece]:
        nonlocal count, resumed
        for piece in plan.pieces():
            count += 1
            done = store.done(piece.number)
            if done is None:
                yield piece
                continue
            resumed += 1
            total.update(done)
            if progress is not None:
                progress(done["rows"])

    with crew(processes, workers, scheduler) as team:
        shared = pc.Settings(plan.arguments, plan.options, plan.laplace)
        for result in team.run(shared, missing()):
            done = store.write(result)
            total.update(done)
            new += done["rows"]
            if progress is not None:
                progress(done["rows"])
    seconds = time.perf_counter() - began
    summary = BatchSummary(
        total["rows"], total["ok"], total["skipped"], count, resumed, new, seconds
    )
    for path, kind in kinds.items():
        _assemble(path, kind, store, plan, settings, summary)
    atomic_write(state, json.dumps({**settings, "finished": asdict(summary)}, indent=2) + "\n")
    if not keep:
        shutil.rmtree(directory)
    return summary


def _tracks_fit(plan: Plan) -> None:
    names = Counter(name for name, _ in plan.record_lengths)
    twice = [name for name, count in names.items() if count > 1]
    if twice:
        raise InputError(f"a track needs records of different names; '{twice[0]}' occurs twice")


def _directory(outputs: Sequence[Path], kinds: dict[Path, str]) -> tuple[Path, bool]:
    """Where the pieces lie, and whether they stay."""
    data_sets = [path for path in outputs if kinds[path] == PARQUET]
    if len(data_sets) > 1:
        raise InputError(f"outputs '{data_sets[0]}' and '{data_sets[1]}': one Parquet is enough")
    if data_sets:
        return data_sets[0], True
    return outputs[0].with_name(outputs[0].name + ".pieces"), False


def _prepare(
    state: Path,
    directory: Path,
    settings: dict[str, Any],
    outputs: Sequence[Path],
    restart: bool,
) -> dict[str, Any] | None:
    """Make the directory ready; the summary of a scan that is finished already."""
    try:
        old = json.loads(state.read_text()) if state.exists() else None
    except (OSError, ValueError):
        old = None
    there = [path for path in (directory, *outputs) if path.exists()]
    if restart:
        for path in there:
            if path.is_dir():
                if any(not found.match("part-*.parquet") for found in path.iterdir()):
                    raise InputError(f"folder '{path}' holds other files; name another one")
                shutil.rmtree(path)
        old = None
        there = []
    if there and old is None:
        raise InputError(
            f"'{there[0]}' exists and is no unfinished scan; name another one or add --restart "
            "to replace it"
        )
    if old is not None:
        finished = old.pop("finished", None)
        if old != json.loads(json.dumps(settings)):
            changed = sorted(k for k in {*old, *settings} if old.get(k) != settings.get(k))
            if there:
                raise InputError(
                    f"'{there[0]}' belongs to a scan with other {', '.join(changed)}; name "
                    "another one or add --restart to replace it"
                )
        elif finished is not None and all(path.exists() for path in outputs):
            return dict(finished)
    try:
        directory.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(
            f"output '{directory}': {error.strerror}; name one in a writable directory"
        ) from None
    atomic_write(state, json.dumps(settings, indent=2) + "\n")
    return None


def _assemble(
    path: Path,
    kind: str,
    store: Pieces,
    plan: Plan,
    settings: dict[str, Any],
    summary: BatchSummary,
) -> None:
    step = plan.options.step if plan.options else 1
    if kind == CSV:
        write_csv(path, store)
    elif kind == BEDGRAPH:
        write_bedgraph(path, store, step, plan.record_lengths)
    elif kind == BIGWIG:
        write_bigwig(path, store, step, plan.record_lengths)
    elif kind == PAGE:
        speed = f"{summary.new_rows:,} rows now in {summary.seconds:.1f} s"
        if summary.new_rows:
            speed += f" ({summary.rate:,.0f} a second)"
        title = Path(plan.source.name).name
        write_page(path, store, title, settings, summary.skipped, speed + ".")


def batch_line(summary: BatchSummary, outputs: Sequence[Path]) -> str:
    """One line for the reader."""
    text = f"{summary.rows:,} rows in {', '.join(map(str, outputs))}"
    if summary.resumed_pieces:
        text += f", {summary.resumed_pieces} of {summary.pieces} pieces from before"
    if summary.new_rows:
        text += f"; {summary.new_rows:,} now in {summary.seconds:.1f} s"
        text += f" ({summary.rate:,.0f} a second)"
    if summary.skipped:
        text += f"; {summary.skipped:,} windows skipped for letters other than A, C, G, T"
    if summary.rows > summary.ok_rows:
        text += f"; {summary.rows - summary.ok_rows:,} rows not ok, their reason in 'status'"
    return text
