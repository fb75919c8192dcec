"""Scans in pieces: same bytes whoever computes, nothing twice, read back by others."""

import contextlib
import csv
import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from dnacheck.cli import main
from dnacheck.numerics.outcome import InputError
from dnacheck.scanning import batch
from dnacheck.scanning.outputs import UNITS, kind_of
from dnacheck.scanning.pieces import Region, WindowOptions, compute
from dnacheck.scanning.scan import scan
from dnacheck.scanning.workers import Alone


@pytest.fixture(scope="module")
def genome(tmp_path_factory):
    rng = np.random.default_rng(2)
    path = tmp_path_factory.mktemp("genome") / "genome.fa"
    text = ""
    for name, length in (("chrI", 420), ("chrII", 260), ("tiny", 30)):
        letters = rng.choice(list("ACGT"), length)
        if name == "chrI":
            letters[200] = "N"
        text += f">{name} made up\n{''.join(letters)}\n"
    path.write_text(text)
    return path


OPTIONS = WindowOptions(100, 1, piece=64)


@pytest.fixture(scope="module")
def finished(genome, tmp_path_factory):
    """The genome scanned in one process, without a break."""
    folder = tmp_path_factory.mktemp("finished")
    outputs = [folder / f"out{suffix}" for suffix in (".csv", ".parquet", ".bedgraph", ".html")]
    summary = batch.run(batch.Plan.of(genome, {}, OPTIONS), outputs)
    return outputs, summary


def rows_of(path):
    with Path(path).open(newline="") as handle:
        return list(csv.DictReader(handle))


def bytes_of(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_every_window_is_a_row_or_counted(finished):
    outputs, summary = finished
    rows = rows_of(outputs[0])
    assert summary.rows == len(rows) == 321 - 100 + 161 + 1
    assert summary.skipped == 100
    assert summary.ok_rows == sum(row["status"] == "ok" for row in rows)
    starts = {(row["record"], int(row["start"])) for row in rows}
    assert len(starts) == len(rows)
    assert ("chrI", 100) in starts
    assert ("chrI", 101) not in starts
    assert ("chrI", 201) in starts
    assert rows[-1]["record"] == "tiny"
    assert "30 base pairs" in rows[-1]["status"]
    assert [p.suffix for p in sorted(outputs[0].parent.iterdir())] == [
        ".bedgraph",
        ".csv",
        ".json",
        ".html",
        ".parquet",
    ]  # no pieces, nothing half written


def test_a_window_is_scanned_like_a_record_of_its_letters(finished, genome, tmp_path):
    letters = genome.read_text().split("\n")[3]
    picks = range(0, 161, 40)
    library = tmp_path / "library.fa"
    library.write_text("".join(f">{k}\n{letters[k : k + 100]}\n" for k in picks))
    scan(library, tmp_path / "library.csv")
    windows = {int(r["start"]): r for r in rows_of(finished[0][0]) if r["record"] == "chrII"}
    for row in rows_of(tmp_path / "library.csv"):
        window = windows[int(row["name"])]
        assert float(window["energy_RT"]) == pytest.approx(float(row["energy_RT"]), abs=2e-6)
        assert window["link"] == row["link"]


def test_the_other_strand_is_that_of_the_reverse_complement(genome, tmp_path):
    letters = genome.read_text().split("\n")[3]
    turned = letters[::-1].translate(str.maketrans("ACGT", "TGCA"))
    other = tmp_path / "turned.fa"
    other.write_text(f">turned\n{turned}\n")
    region = Region("chrII", 1, 260)
    both = WindowOptions(100, 20, both_strands=True, region=region)
    batch.run(batch.Plan.of(genome, {}, both), [tmp_path / "both.csv"])
    batch.run(batch.Plan.of(other, {}, WindowOptions(100, 20)), [tmp_path / "turned.csv"])
    rows = rows_of(tmp_path / "both.csv")
    assert [row["strand"] for row in rows] == ["+", "-"] * 9
    back = {260 - int(row["end"]): row for row in rows if row["strand"] == "-"}
    for row in rows_of(tmp_path / "turned.csv"):
        assert float(back[int(row["start"])]["energy_RT"]) == pytest.approx(
            float(row["energy_RT"]), abs=2e-6
        )
    # The wedge form has a preferred strand: the two rows of a window differ.
    assert any(a["energy_RT"] != b["energy_RT"] for a, b in zip(rows[::2], rows[1::2], strict=True))


class Quits(Exception):
    pass


@contextlib.contextmanager
def quitting_crew(after):
    class Crew(Alone):
        def run(self, settings, pieces):
            for k, result in enumerate(super().run(settings, pieces)):
                if k == after:
                    raise Quits
                yield result

    yield Crew()


def test_broken_off_and_gone_on_with(genome, finished, tmp_path, monkeypatch):
    outputs = [tmp_path / "out.csv", tmp_path / "out.parquet"]
    plan = batch.Plan.of(genome, {}, OPTIONS)
    with monkeypatch.context() as patch:
        patch.setattr(batch, "crew", lambda *_: quitting_crew(2))
        for _ in range(2):
            with pytest.raises(Quits):
                batch.run(plan, outputs)
    assert not outputs[0].exists()
    # A piece that did not reach the disk whole, and a stray file of a writer that was killed.
    torn = sorted(outputs[1].iterdir())[1]
    torn.write_bytes(torn.read_bytes()[:-9])
    summary = batch.run(plan, outputs)
    assert summary.resumed_pieces == 3
    assert outputs[0].read_bytes() == finished[0][0].read_bytes()
    assert bytes_of(outputs[1]) == bytes_of(finished[0][1])
    again = batch.run(plan, outputs)
    assert again.new_rows == 0
    assert again.rows == summary.rows


def test_two_processes_give_the_same_bytes(genome, finished, tmp_path):
    outputs = [tmp_path / "out.csv", tmp_path / "out.parquet"]
    batch.run(batch.Plan.of(genome, {}, OPTIONS), outputs, processes=2)
    assert outputs[0].read_bytes() == finished[0][0].read_bytes()
    assert bytes_of(outputs[1]) == bytes_of(finished[0][1])


def test_parquet_is_read_by_others(finished):
    import duckdb
    import pandas as pd
    import polars as pl
    import pyarrow.parquet as pq

    folder = finished[0][1]
    rows = rows_of(finished[0][0])
    expected = [float(row["energy_RT"] or "nan") for row in rows]
    frame = pd.read_parquet(folder)
    np.testing.assert_allclose(frame["energy_RT"], expected, atol=1e-6)
    lazy = pl.read_parquet(folder / "*.parquet")
    assert lazy["minus_lnJ"].null_count() == sum(not row["minus_lnJ"] for row in rows)
    count, least = duckdb.sql(
        f"SELECT count(*), min(minus_lnJ) FROM '{folder}/*.parquet' WHERE status = 'ok'"
    ).fetchall()[0]
    assert count == finished[1].ok_rows
    assert least == pytest.approx(frame["minus_lnJ"].min())
    schema = pq.read_schema(next(folder.iterdir()))
    assert {f.name: f.metadata[b"units"].decode() for f in schema} == {
        name: UNITS[name] for name in schema.names
    }


def test_tracks_are_taken_by_bigwig(genome, finished, tmp_path):
    import pyBigWig

    lines = finished[0][2].read_text().splitlines()
    assert lines[0].startswith("track type=bedGraph")
    cells = [line.split("\t") for line in lines[1:]]
    target = pyBigWig.open(str(tmp_path / "check.bw"), "w")
    target.addHeader([("chrI", 420), ("chrII", 260)])
    target.addEntries(
        [c[0] for c in cells],
        [int(c[1]) for c in cells],
        ends=[int(c[2]) for c in cells],
        values=[float(c[3]) for c in cells],
    )
    target.close()
    output = tmp_path / "out.bw"
    batch.run(batch.Plan.of(genome, {}, OPTIONS), [output])
    window = next(r for r in rows_of(finished[0][0]) if r["record"] == "chrII")
    with contextlib.closing(pyBigWig.open(str(output))) as track:
        assert track.values("chrII", 50, 51)[0] == pytest.approx(
            float(window["minus_lnJ"]), rel=1e-6
        )
        assert np.isnan(track.values("chrII", 0, 50)).all()


def test_records_go_to_parquet_as_they_go_to_csv(genome, tmp_path):
    library = tmp_path / "library.fa"
    letters = genome.read_text().split("\n")[3]
    library.write_text(f">a\n{letters[:90]}\n>bad\nACGN\n>b<i>\n{letters[90:170]}\n")
    scan(library, tmp_path / "rows.csv")
    outputs = [tmp_path / "pieces.csv", tmp_path / "pieces.html"]
    batch.run(batch.Plan.of(library, {}), outputs)
    assert outputs[0].read_bytes() == (tmp_path / "rows.csv").read_bytes()
    page = outputs[1].read_text()
    assert "b&lt;i&gt;" in page
    assert "b<i>" not in page
    assert "is not one of A, C, G, T" in page


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--window", "500"], "longer than every record"),
        (["--window", "100", "--step", "0"], "give an integer from 1"),
        (["--window", "100", "--region", "chrX:1-200"], "no record is called 'chrX'"),
        (["--window", "100", "--region", "chrI:1-9000"], "ends at base pair 420"),
        (["--step", "5"], "add --window"),
        (["--window", "100", "-o", "out.xlsx"], "ends in"),
        (["-o", "out.bedgraph", "-o", "out.csv"], "add --window"),
        (
            ["--window", "99", "-o", "other.csv"],
            "with other a_tracts, step, step_form, window",
        ),
        (["--window", "99", "-o", "taken.csv"], "is no unfinished scan"),
        (["--window", "100", "-o", "missing/out.csv"], "writable directory"),
    ],
)
def test_bad_input_is_one_line(genome, tmp_path, monkeypatch, capsys, options, message):
    monkeypatch.chdir(tmp_path)
    Path("taken.csv").write_text("mine\n")
    if "other.csv" in options:
        batch.run(batch.Plan.of(genome, {}, WindowOptions(100, 40)), [Path("other.csv")])
    if "-o" not in options:
        options = [*options, "-o", "out.csv"]
    assert main(["scan", str(genome), *options]) == 2
    line = capsys.readouterr().err
    assert message in line
    assert line.count("\n") == 1
    assert Path("taken.csv").read_text() == "mine\n"


def test_a_folder_of_other_files_is_never_replaced(genome, tmp_path):
    folder = tmp_path / "mine.parquet"
    folder.mkdir()
    (folder / "precious.txt").write_text("keep")
    with pytest.raises(InputError, match="holds other files"):
        batch.run(batch.Plan.of(genome, {}, OPTIONS), [folder], restart=True)
    assert (folder / "precious.txt").read_text() == "keep"


def test_dry_run_writes_nothing(genome, tmp_path, capsys):
    output = tmp_path / "out.parquet"
    assert (
        main(["scan", str(genome), "--window", "100", "-o", str(output), "--dry-run", "--json"])
        == 0
    )
    found = json.loads(capsys.readouterr().out)
    assert found["rows"] == 321 + 161
    assert found["seconds"] > 0
    assert found["bytes"][str(output)] > 0
    assert list(tmp_path.iterdir()) == []


def test_suffixes_name_the_form():
    assert kind_of(Path("a.BigWig")) == kind_of(Path("b.bw"))
    with pytest.raises(InputError, match="ends in"):
        kind_of(Path("a.xlsx"))


def test_a_scheduler_that_is_not_there(genome, tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("dnacheck.scanning.workers._CONNECT_SECONDS", 0.5)
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        batch.run(
            batch.Plan.of(genome, {}, OPTIONS), [tmp_path / "o.csv"], scheduler="tcp://127.0.0.1:9"
        )


def run_cli(genome, output, *options):
    command = [
        sys.executable,
        "-m",
        "dnacheck",
        "scan",
        str(genome),
        "-o",
        str(output),
        "--window",
        "100",
        "--piece",
        "40",
        "--quiet",
        *options,
    ]
    return subprocess.Popen(command, start_new_session=True)


@pytest.mark.slow
@pytest.mark.parametrize("options", [("--threads", "2"), ("--workers", "2")])
def test_killed_ten_times(tmp_path, options):
    rng = np.random.default_rng(9)
    genome = tmp_path / "genome.fa"
    genome.write_text(">c\n" + "".join(rng.choice(list("ACGT"), 60_000)) + "\n")
    calm, killed = tmp_path / "calm.parquet", tmp_path / "killed.parquet"
    assert run_cli(genome, calm, "--threads", "1").wait() == 0
    seen = 0
    for _ in range(10):
        process = run_cli(genome, killed, *options)
        deadline = time.monotonic() + 60.0
        while process.poll() is None and time.monotonic() < deadline:
            count = len(list(killed.glob("part-*"))) if killed.exists() else 0
            if count > seen + 3:
                break
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        seen = len(list(killed.glob("part-*")))
    assert run_cli(genome, killed, *options).wait() == 0
    names = {path.name for path in killed.iterdir() if path.name.startswith("part-")}
    assert names == {path.name for path in calm.iterdir()}
    for name in names:
        assert (killed / name).read_bytes() == (calm / name).read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("options", [("--threads", "2"), ("--workers", "2")])
def test_a_worker_killed_in_the_middle_is_made_up_for(tmp_path, options):
    import psutil

    rng = np.random.default_rng(10)
    genome = tmp_path / "genome.fa"
    genome.write_text(">c\n" + "".join(rng.choice(list("ACGT"), 40_000)) + "\n")
    calm, hurt = tmp_path / "calm.parquet", tmp_path / "hurt.parquet"
    assert run_cli(genome, calm, "--threads", "1").wait() == 0
    process = run_cli(genome, hurt, *options)
    while not (hurt.exists() and len(list(hurt.glob("part-*"))) > 5):
        assert process.poll() is None
        time.sleep(0.02)
    children = psutil.Process(process.pid).children(recursive=True)
    max(children, key=lambda child: sum(child.cpu_times()[:2])).kill()
    assert process.wait() == 0
    assert bytes_of(hurt) == bytes_of(calm)


@pytest.mark.slow
def test_a_cluster_that_exists_already(genome, finished, tmp_path):
    """The recipe of docs/howto/scan_genome.md, on one machine."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    dask = [sys.executable, "-m", "dask"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    scheduler = [*dask, "scheduler", "--no-dashboard", "--port", address.rpartition(":")[2]]
    worker = [*dask, "worker", address, "--nthreads", "1", "--no-dashboard"]
    with contextlib.ExitStack() as stack:
        for command in (scheduler, worker, worker):
            process = stack.enter_context(subprocess.Popen(command, cwd=tmp_path, **quiet))
            stack.callback(process.terminate)
            time.sleep(3.0)
        outputs = [tmp_path / "out.csv", tmp_path / "out.parquet"]
        batch.run(batch.Plan.of(genome, {}, OPTIONS), outputs, scheduler=address)
    assert outputs[0].read_bytes() == finished[0][0].read_bytes()
    assert bytes_of(outputs[1]) == bytes_of(finished[0][1])


def test_results_do_not_depend_on_what_a_process_did_before(genome):
    plan = batch.Plan.of(genome, {}, OPTIONS)
    settings = batch.pc.Settings(plan.arguments, plan.options)
    pieces = [piece for piece in plan.pieces() if not piece.failure]
    forward = [compute(settings, piece).columns for piece in pieces]
    backward = [compute(settings, piece).columns for piece in reversed(pieces)][::-1]
    for one, other in zip(forward, backward, strict=True):
        for name in one:
            np.testing.assert_array_equal(one[name], other[name])
