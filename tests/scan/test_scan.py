"""Scans of FASTA files: right rows, resumed to the byte, nothing lost to a bad record."""

import csv
import json
import math
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from dnacheck.cyclization.laplace.isolated import laplace_log_j
from dnacheck.cyclization.laplace.quick import quick_j
from dnacheck.cyclization.methods import ClosureSampling, Laplace
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.io.sequences import SequenceSource
from dnacheck.model.chain import build_chain
from dnacheck.model.parameters import load_parameters
from dnacheck.model.sequence import parse_sequence, reverse_complement
from dnacheck.numerics.outcome import InputError
from dnacheck.scanning.scan import (
    COLUMNS,
    OTHER_STRAND_COLUMNS,
    STATUS_FOUND,
    ScanOptions,
    scan,
    scan_row,
    state_path,
)


def random_fasta(path, count, seed, lengths=(60, 160)):
    rng = np.random.default_rng(seed)
    lines = []
    for i in range(count):
        letters = "".join(rng.choice(list("ACGT"), rng.integers(*lengths)))
        lines.append(f">mol{i} random\n{letters}\n")
    path.write_text("".join(lines))
    return path


def rows_of(path):
    with path.open(newline="") as handle:
        return list(csv.DictReader(handle))


@pytest.fixture
def library(tmp_path):
    return random_fasta(tmp_path / "library.fasta", 40, 1)


def test_rows_equal_the_full_search(library, tmp_path):
    output = tmp_path / "out.csv"
    summary = scan(library, output)
    rows = rows_of(output)
    assert summary.rows == len(rows) == 40
    assert tuple(rows[0]) == COLUMNS
    for row, record in zip(rows, SequenceSource(library).records(), strict=True):
        search = find_rings(build_chain(record.molecule()))
        assert row["name"] == record.name
        assert int(row["n_bp"]) == len(record.letters)
        assert row["status"] == STATUS_FOUND
        assert int(row["link"]) == search.lowest.link
        assert float(row["energy_reduced"]) == pytest.approx(search.lowest.energy, abs=1e-7)
        assert float(row["energy_RT"]) == pytest.approx(search.lowest.energy_RT, abs=1e-5)
        quick = quick_j(search)
        assert row["quality"] == quick.quality
        # Other numbers for the draws: the scan's molecule is cut elsewhere.
        assert float(row["minus_lnJ"]) == pytest.approx(-quick.log_j, abs=8.0 * quick.stderr)


def test_the_other_strand_on_request(tmp_path):
    """Its columns are what a scan of the reverse complements finds; the mid-step form has none."""
    library = random_fasta(tmp_path / "few.fasta", 6, 3)
    records = list(SequenceSource(library).records())
    across = tmp_path / "across.fasta"
    across.write_text("".join(f">{r.name}\n{reverse_complement(r.letters)}\n" for r in records))
    files = {}
    for form in ("wedge", "midstep"):
        options = {"a_tracts": "none", "step_form": form}
        files[form] = tmp_path / f"{form}.csv", tmp_path / f"{form}_across.csv"
        scan(library, files[form][0], ScanOptions(options, other_strand=True))
        scan(across, files[form][1], ScanOptions(options))
    differ = 0
    for form, (both, other) in files.items():
        for row, reverse in zip(rows_of(both), rows_of(other), strict=True):
            assert tuple(row) == COLUMNS + OTHER_STRAND_COLUMNS
            assert row["other_strand_energy_RT"] == reverse["energy_RT"]
            assert row["other_strand_minus_lnJ"] == reverse["minus_lnJ"]
            apart = abs(float(row["energy_RT"]) - float(reverse["energy_RT"]))
            assert form == "wedge" or apart <= 2e-6
            differ += apart > 1e-3
    assert differ >= 4  # the wedge form: the check can tell strands apart
    with pytest.raises(InputError, match="other other_strand"):
        scan(library, files["wedge"][0], ScanOptions({"a_tracts": "none", "step_form": "wedge"}))


def test_model_options_reach_the_rows(library, tmp_path):
    default, stiff = tmp_path / "a.csv", tmp_path / "b.csv"
    scan(library, default)
    scan(library, stiff, ScanOptions({"twist_ratio": 0.6, "angles": "trifonov"}))
    molecule = next(SequenceSource(library).molecules())
    chain = build_chain(molecule, angles="trifonov", twist_ratio=0.6)
    assert float(rows_of(stiff)[0]["energy_reduced"]) == pytest.approx(
        find_rings(chain).lowest.energy, abs=1e-7
    )
    assert rows_of(default)[0] != rows_of(stiff)[0]


def test_bad_records_are_rows_and_the_scan_goes_on(tmp_path):
    source = tmp_path / "bad.fasta"
    good = "ACGTTGCATGCCGATAACGT" * 4
    source.write_bytes(
        b">first\n" + good.encode() + b"\n>letters\nACGTNACGTACGT\n>\n>short\nACGT\n"
        b'>quoted,"name\n'
        + good.encode()
        + b"\n>bytes\nACGT\xff\xfeACGTACGT\n>last\n"
        + good.encode()
    )
    output = tmp_path / "out.csv"
    summary = scan(source, output)
    rows = rows_of(output)
    assert [row["name"] for row in rows] == [
        "first", "letters", "record 3", "short", 'quoted,"name', "bytes", "last",
    ]  # fmt: skip
    found = [row["status"] == STATUS_FOUND for row in rows]
    assert found == [True, False, False, False, True, False, True]
    assert "position 5: 'N'" in rows[1]["status"]
    assert rows[1]["minus_lnJ"] == rows[1]["energy_RT"] == ""
    assert summary.failed_rows == 4
    assert summary.ok_rows == 3
    assert sum(summary.reasons.values()) == 4
    assert summary.reasons["'N' is not one of A, C, G, T"] == 1
    assert rows[0]["energy_RT"] == rows[6]["energy_RT"]


def test_a_molecule_too_long_is_a_row():
    row = scan_row("long", "A" * 100_001, {})
    assert row[1] == "100001"
    assert "more than 100000" in row[COLUMNS.index("status")]


def test_a_free_register_has_a_j_from_its_integral():
    """Straight steps of one kind make a straight molecule; its ring may be rolled freely."""
    table = load_parameters("trifonov2")
    straight = replace(table, ground=np.tile([2 * math.pi / 10.45, 0.0, 0.0], (16, 1)))
    arguments = {"angles": straight, "a_tracts": "none"}
    row = dict(zip(COLUMNS, scan_row("straight", "A" * 150, arguments), strict=True))
    assert float(row["energy_RT"]) == pytest.approx(21.288959, abs=1e-4)
    chain = build_chain(parse_sequence("A" * 150, "straight"), **arguments)
    sampled = ClosureSampling().compute(chain, rng=1, tolerance=0.02)
    assert row["status"] == STATUS_FOUND
    assert float(row["minus_lnJ"]) == pytest.approx(sampled.minus_lnJ, abs=0.15)


@pytest.mark.parametrize("angles", ["trifonov", "trifonov2", "desantis"])
def test_rows_agree_with_closure_sampling(angles):
    rng = np.random.default_rng(61)
    gaps = []
    for n in (70, 130, 220):
        letters = "".join(rng.choice(list("ACGT"), n))
        row = scan_row("x", letters, {"angles": angles})
        chain = build_chain(parse_sequence(letters, "x"), angles=angles)
        sampled = ClosureSampling().compute(chain, rng=3, tolerance=0.02)
        gaps.append(float(row[COLUMNS.index("minus_lnJ")]) - sampled.minus_lnJ)
        assert row[-1] == "good"
    assert np.abs(gaps).max() < 0.2
    # Control: Laplace's value is further off by its known error, 0.2 to 0.5.
    laplace = Laplace().compute(chain)
    assert abs(laplace.minus_lnJ - sampled.minus_lnJ) > 2.0 * np.abs(gaps).max()


def test_a_molecule_that_laplace_misses_by_four_fifths():
    letters = (
        "AAACTCGACTAGCACGATGAGATCCGTTCCAAGTCGACGGTGAAATGTCGATAGTCAGGAGGACTGTAATCAGTGGCAAGAGAAGGGTATC"
        "ATTCATGGAACTCAAGATGATAACCGCGACCCGCCAAATTCATAGTTGGAGTCTGCAAT"
    )
    row = scan_row("x", letters, {"angles": "trifonov"})
    # 22.41 +- 0.01 by closure sampling, 23.23 by Laplace.
    assert float(row[COLUMNS.index("minus_lnJ")]) == pytest.approx(22.41, abs=0.15)


def test_threads_do_not_matter(library, tmp_path):
    one, two = tmp_path / "one.csv", tmp_path / "two.csv"
    scan(library, one, ScanOptions(threads=1))
    scan(library, two, ScanOptions(threads=3))
    assert one.read_bytes() == two.read_bytes()


def test_resumes_to_the_byte_from_any_cut(library, tmp_path):
    whole = tmp_path / "whole.csv"
    scan(library, whole)
    expected = whole.read_bytes()
    rng = np.random.default_rng(2)
    header_end = expected.index(b"\n") + 1
    cuts = [0, 5, header_end, header_end + 1, len(expected) - 1, len(expected)]
    for cut in [*cuts, *rng.integers(header_end, len(expected), 6)]:
        for tail in (b"", b"\x00" * 20):  # zeros: what a power failure can leave
            output = tmp_path / "cut.csv"
            output.write_bytes(expected[:cut] + tail)
            state_path(output).write_bytes(state_path(whole).read_bytes())
            summary = scan(library, output)
            assert output.read_bytes() == expected
            assert summary.resumed_rows == max(0, expected[:cut].count(b"\n") - 1)


def test_resumes_after_bad_rows_with_quotes(tmp_path):
    source = tmp_path / "bad.fasta"
    good = "ACGTTGCATGCCGATAACGT" * 4
    source.write_text(f">a,b\nACGN\n>c\n{good}\n>d\n\n>e\n{good}\n")
    whole, part = tmp_path / "whole.csv", tmp_path / "part.csv"
    scan(source, whole)
    expected = whole.read_bytes()
    for cut in range(0, len(expected), 3):
        part.write_bytes(expected[:cut])
        state_path(part).write_bytes(state_path(whole).read_bytes())
        scan(source, part)
        assert part.read_bytes() == expected


def test_a_finished_scan_is_left_alone(library, tmp_path):
    output = tmp_path / "out.csv"
    scan(library, output)
    before = output.read_bytes()
    summary = scan(library, output)
    assert summary.resumed_rows == summary.rows == 40
    assert output.read_bytes() == before


def test_another_input_or_other_settings_are_refused(library, tmp_path):
    output = tmp_path / "out.csv"
    scan(library, output)
    with pytest.raises(InputError, match="other twist_ratio"):
        scan(library, output, ScanOptions({"twist_ratio": 0.7}))
    other = random_fasta(tmp_path / "other.fasta", 5, 3)
    with pytest.raises(InputError, match="input_sha256"):
        scan(other, output)
    assert scan(other, output, restart=True).rows == 5


def test_a_foreign_file_is_not_overwritten(library, tmp_path):
    output = tmp_path / "notes.csv"
    output.write_text("precious\n")
    with pytest.raises(InputError, match="no unfinished scan"):
        scan(library, output)
    assert output.read_text() == "precious\n"
    with pytest.raises(InputError, match="is the input"):
        scan(library, library)


def test_input_errors(tmp_path):
    with pytest.raises(InputError, match="check the path"):
        scan(tmp_path / "absent.fasta", tmp_path / "out.csv")
    empty = tmp_path / "empty.fasta"
    empty.write_text("no header\n")
    with pytest.raises(InputError, match="line 1: 'no header' stands before the first header"):
        scan(empty, tmp_path / "out.csv")
    source = random_fasta(tmp_path / "one.fasta", 1, 4)
    with pytest.raises(InputError, match="cannot write"):
        scan(source, tmp_path / "absent" / "out.csv")
    with pytest.raises(InputError, match="threads"):
        ScanOptions(threads=0)


def test_reasons_are_counted_over_all_rows_also_those_from_before(tmp_path):
    source, output = tmp_path / "bad.fasta", tmp_path / "out.csv"
    source.write_text(">a\nACGTNACGTACGT\n>b\nACGNACGTACGT\n>c\nACGT\n>d\nACGTAC\n>e\n\n")
    expected = {
        "'N' is not one of A, C, G, T": 2,
        "base pairs are too few for a ring; give at least 10": 2,
        "it is empty; give at least 10 bases": 1,
    }
    for resumed in (0, 5):
        summary = scan(source, output)
        assert (summary.rows, summary.resumed_rows, summary.ok_rows) == (5, resumed, 0)
        assert summary.reasons == expected


def test_state_names_what_the_rows_do_not(library, tmp_path):
    output = tmp_path / "out.csv"
    scan(library, output, ScanOptions({"twist_ratio": 0.8}))
    state = json.loads(state_path(output).read_text())
    assert state["twist_ratio"] == 0.8
    assert state["records"] == 40
    assert state["input_sha256"] == SequenceSource(library).digest


@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
def test_killed_and_restarted_it_ends_with_the_same_file(tmp_path):
    source = random_fasta(tmp_path / "library.fasta", 300, 5, (100, 160))
    whole, killed = tmp_path / "whole.csv", tmp_path / "killed.csv"
    command = [sys.executable, "-m", "dnacheck", "scan", str(source), "--quiet", "-o"]
    scan(source, whole)
    kills = 0
    for attempt in range(3):
        process = subprocess.Popen([*command, str(killed)])
        size = killed.stat().st_size if killed.exists() else 0
        deadline = time.monotonic() + 60.0
        while process.poll() is None and time.monotonic() < deadline and attempt < 2:
            if killed.exists() and killed.stat().st_size > size + 200:
                process.send_signal(signal.SIGKILL)
                kills += 1
                break
            time.sleep(0.002)
        process.wait(timeout=120)
    assert kills >= 1
    assert killed.read_bytes() == whole.read_bytes()


def test_numbers_are_finite(library, tmp_path):
    output = tmp_path / "out.csv"
    scan(library, output)
    for row in rows_of(output):
        assert all(math.isfinite(float(row[key])) for key in COLUMNS[1:-2])


def test_laplace_alone_is_said(library, tmp_path):
    output = tmp_path / "out.csv"
    scan(library, output, ScanOptions(laplace=True))
    rows = rows_of(output)
    assert {row["quality"] for row in rows if row["status"] == STATUS_FOUND} == {"laplace only"}
    record = next(SequenceSource(library).records())
    search = find_rings(build_chain(record.molecule()))
    expected = -np.logaddexp.reduce([laplace_log_j(ring) for ring in search.equilibria])
    assert float(rows[0]["minus_lnJ"]) == pytest.approx(expected, abs=1e-5)
    with pytest.raises(InputError, match="other laplace"):
        scan(library, output)
