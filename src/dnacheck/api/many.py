"""``scan`` and ``validate``: many sequences, and the comparison report."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from dnacheck.api.arguments import Progress, one_of, thread_count, told, whole
from dnacheck.api.molecules import chain
from dnacheck.numerics.outcome import InputError

if TYPE_CHECKING:
    import pandas

    from dnacheck.io.sequences import SequenceSource
    from dnacheck.scanning.scan import ScanOptions
    from dnacheck.validation.report.write import RunRecord


@dataclass(frozen=True, eq=False)
class Scan:
    """Lowest ring and J of many sequences or windows; the table is read when asked for.

    Attributes
    ----------
    rows, ok_rows : int
        All rows, and those whose status is ``ok``.
    seconds : float
    path : Path or None
        The output that holds the table; None if it is in memory alone.
    """

    rows: int
    ok_rows: int
    seconds: float
    path: Path | None
    _read: Callable[[], pandas.DataFrame] = field(repr=False)

    @cached_property
    def table(self) -> pandas.DataFrame:
        """The rows in the order of the input; columns as ``dnacheck scan`` writes them."""
        return self._read()

    def __len__(self) -> int:
        return self.rows

    def to_frame(self) -> pandas.DataFrame:
        """A copy of the table."""
        return self.table.copy()

    def to_dict(self) -> dict[str, Any]:
        """Column names and their values."""
        return {str(key): list(values) for key, values in self.table.to_dict("list").items()}

    def __repr__(self) -> str:
        where = f" in {self.path}" if self.path else ""
        return f"<scan of {self.rows} rows, {self.ok_rows} ok{where}>"

    def _repr_html_(self) -> str:
        return str(self.table.to_html(max_rows=20))


def scan(
    source: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    *,
    window: int | None = None,
    step: int = 1,
    both_strands: bool = False,
    region: str | None = None,
    laplace: bool = False,
    restart: bool = False,
    threads: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress = False,
    **parameters: Any,
) -> Scan:
    """Lowest ring and J of every record, or of every window, of a FASTA or GenBank file.

    Parameters
    ----------
    source : path, or "-" for standard input
    output : path, optional
        Written as the scan goes, its form by its suffix (.csv, .parquet, .bedgraph, .bw, .html);
        an unfinished one is gone on with.
    window, step : int, optional
        Scan the windows of so many base pairs, so far apart, instead of whole records.
    both_strands : bool
        Read each window from both strands.
    region : str, optional
        ``name:first-last``, base pairs from 1: windows inside it only.
    laplace : bool
        Leave J of records at Laplace's value, several times faster; that of windows always is.
    restart : bool
        Replace an existing output.
    threads : int, optional
        Threads, or processes where windows are scanned.
    workers, scheduler : int, str, optional
        A local Dask cluster of so many workers, or the address of a running scheduler.
    progress : bool or callable
        A callable is told the rows done since its last call.
    **parameters
        Of :func:`dnacheck.chain`: parameters, twist_ratio, a_tracts ...

    Returns
    -------
    Scan
        ``.to_frame()``; a bad record is a row with its reason in the column ``status``.

    Raises
    ------
    InputError
        The file cannot be read, or the output cannot be written or is another scan's.

    Examples
    --------
    >>> import dnacheck as dc, pathlib
    >>> letters = dc.chain("11T15").letters
    >>> _ = pathlib.Path("two.fasta").write_text(f">a\\n{letters}\\n>b\\nACG\\n")
    >>> table = dc.scan("two.fasta").to_frame()
    >>> list(table["name"]), list(table["status"])[0]
    (['a', 'b'], 'ok')
    >>> table = dc.scan("two.fasta", window=120, step=10).to_frame()
    >>> [int(start) for start in table["start"]]
    [0, 10, 20, 30, 0]
    """
    from dnacheck.io.sequences import SequenceSource

    if not isinstance(source, (str, os.PathLike)):
        raise InputError(f"source must be a path or '-', not {source!r}")
    records = SequenceSource(source)
    # What no molecule could be built with is refused before any is read.
    chain("ACGTTGCATCA", **{key: value for key, value in parameters.items() if key != "a_tracts"})
    arguments = dict(parameters)
    arguments["angles"] = arguments.pop("parameters", "trifonov2")
    path = None if output is None else Path(output)
    if path is not None and not path.parent.is_dir():
        raise InputError(
            f"output '{path}': there is no folder '{path.parent}'; make it or name another"
        )
    from dnacheck.scanning.batch import Plan
    from dnacheck.scanning.batch import run as run_plan
    from dnacheck.scanning.pieces import Region, WindowOptions
    from dnacheck.scanning.scan import ScanOptions

    plain = path is None or path.suffix.lower() == ".csv"
    if window is None and plain and workers is None and scheduler is None:
        if both_strands or region is not None or step != 1:
            raise InputError("step, both_strands and region are of windows: give window")
        return _scan_records(
            records,
            path,
            ScanOptions(arguments, thread_count(threads), laplace=laplace),
            progress,
            restart,
        )
    options = None
    if window is not None:
        place = None if region is None else Region.parse(region)
        options = WindowOptions(
            whole("window", window, 1), whole("step", step, 0), both_strands, place
        )
    plan = Plan.of(records, arguments, options, laplace)
    processes = 1 if threads is None else thread_count(threads)
    with (
        tempfile.TemporaryDirectory() as folder,
        told(progress, "rows", plan.rows if progress else None) as advance,
    ):
        target = Path(folder) / "scan.parquet" if path is None else path
        done = run_plan(plan, [target], processes, workers, scheduler, advance, restart)
        held = _table(target) if path is None else None
    return Scan(
        done.rows,
        done.ok_rows,
        done.seconds,
        path,
        lambda: _table(target) if held is None else held,
    )


def _scan_records(
    records: SequenceSource,
    path: Path | None,
    options: ScanOptions,
    progress: Progress,
    restart: bool,
) -> Scan:
    from dnacheck.scanning.scan import scan as run

    with (
        tempfile.TemporaryDirectory() as folder,
        told(progress, "sequences", records.count if progress else None) as advance,
    ):
        target = Path(folder) / "scan.csv" if path is None else path
        done = run(records, target, options, advance, restart)
        held = _table(target) if path is None else None
    return Scan(
        done.rows,
        done.ok_rows,
        done.seconds,
        path,
        lambda: _table(target) if held is None else held,
    )


def _table(path: Path) -> pandas.DataFrame:
    import pandas

    suffix = path.suffix.lower()
    if suffix not in (".csv", ".parquet"):
        raise InputError(f"output '{path}' is no table; scan to a .csv or .parquet to read it back")
    return pandas.read_parquet(path) if suffix == ".parquet" else pandas.read_csv(path)


def validate(
    scene: str | os.PathLike[str] = "default",
    output: str | os.PathLike[str] = "report",
    *,
    level: Literal["quick", "default", "full"] = "default",
    only: Sequence[str] = (),
    baseline: str | os.PathLike[str] | None = None,
    rng: int = 0,
    threads: int | None = None,
    progress: Progress = False,
) -> RunRecord:
    """Run a validation scene and write its report.

    Parameters
    ----------
    scene : path or name
        A TOML file, or a scene that ships: "default" (the paper's eleven molecules) or "quick".
    output : path
        Folder of report.html, report.json and checks.csv; an interrupted run there is gone on with.
    level : {"quick", "default", "full"}
        Under 10 s, minutes, or everything.
    only : sequence of str
        Checks or groups by name; ``*`` is wild.
    baseline : path, optional
        report.json of an earlier run, to show what changed.
    rng : int
        Seed of every random stream.
    threads, progress
        As in :func:`dnacheck.jfactor`; a callable is told the checks done since its last call.

    Returns
    -------
    RunRecord
        ``.verdict``, ``.results``.

    Raises
    ------
    InputError
        One line that names the argument, or the place in the scene, and the mend.

    Examples
    --------
    >>> import dnacheck as dc
    >>> record = dc.validate("quick", level="quick", only=["table2"])  # doctest: +SKIP
    >>> record.verdict.value  # doctest: +SKIP
    'pass'
    """
    from dnacheck.validation.engine.registry import Check, Findings, Level, select
    from dnacheck.validation.engine.run import RunOptions, run_scene
    from dnacheck.validation.scene.file import load_scene

    one_of("level", level, ("quick", "default", "full"))
    if isinstance(only, str):
        raise InputError(f"only must be a sequence of names, such as ['{only}']")
    options = RunOptions(
        Path(output),
        Level[level.upper()],
        whole("rng", rng, 0),
        thread_count(threads),
        select(only) if only else None,
        None if baseline is None else Path(baseline),
    )
    loaded = load_scene(os.fspath(scene))
    with told(progress, "checks", None) as advance:

        def done(check: Check, findings: Findings, resumed: bool) -> None:
            advance(1)

        return run_scene(loaded, options, done)
