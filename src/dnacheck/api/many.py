"""``scan`` and ``validate``: many sequences, and the comparison report."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from dnacheck.api.arguments import Progress, one_of, thread_count, told, whole
from dnacheck.api.molecules import chain
from dnacheck.numerics.outcome import InputError

if TYPE_CHECKING:
    import pandas

    from dnacheck.validation.report.write import RunRecord


@dataclass(frozen=True, eq=False)
class Scan:
    """Lowest ring and Laplace J of many sequences.

    Attributes
    ----------
    table : pandas.DataFrame
        name, n_bp, link, energy_RT, energy_reduced, minus_lnJ, status, quality; in the order of
        the input.
    rows, ok_rows : int
        All rows, and those whose status is ``ok``.
    seconds : float
    """

    table: pandas.DataFrame
    rows: int
    ok_rows: int
    seconds: float

    def __len__(self) -> int:
        return self.rows

    def to_frame(self) -> pandas.DataFrame:
        """A copy of the table."""
        return self.table.copy()

    def to_dict(self) -> dict[str, Any]:
        """Column names and their values."""
        return {str(key): list(values) for key, values in self.table.to_dict("list").items()}

    def __repr__(self) -> str:
        return f"<scan of {self.rows} sequences, {self.ok_rows} ok>\n{self.table!r}"

    def _repr_html_(self) -> str:
        return str(self.table.to_html(max_rows=20))


def scan(
    source: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    *,
    restart: bool = False,
    threads: int | None = None,
    progress: Progress = False,
    **parameters: Any,
) -> Scan:
    """Lowest ring and Laplace J of every record of a FASTA or GenBank file.

    Parameters
    ----------
    source : path, or "-" for standard input
    output : path, optional
        CSV file that is written as the scan goes; an unfinished one is gone on with.
    restart : bool
        Replace an existing output.
    threads : int, optional
    progress : bool or callable
        A callable is told the records done since its last call.
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
    """
    import pandas

    from dnacheck.io.sequences import SequenceSource
    from dnacheck.scanning.scan import ScanOptions
    from dnacheck.scanning.scan import scan as run

    if not isinstance(source, (str, os.PathLike)):
        raise InputError(f"source must be a path or '-', not {source!r}")
    records = SequenceSource(source)
    # What no molecule could be built with is refused before any is read.
    chain("ACGTTGCATCA", **{key: value for key, value in parameters.items() if key != "a_tracts"})
    arguments = dict(parameters)
    arguments["angles"] = arguments.pop("parameters", "trifonov2")
    options = ScanOptions(arguments, thread_count(threads))
    with (
        tempfile.TemporaryDirectory() as folder,
        told(progress, "sequences", records.count if progress else None) as advance,
    ):
        path = Path(folder) / "scan.csv" if output is None else Path(output)
        if not path.parent.is_dir():
            raise InputError(
                f"output '{path}': there is no folder '{path.parent}'; make it or name another"
            )
        done = run(records, path, options, advance, restart)
        table = pandas.read_csv(path)
    return Scan(table, done.rows, done.ok_rows, done.seconds)


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
