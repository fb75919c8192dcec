"""The one reader of molecules: the same records however they are written, and no silent loss."""

import gzip
import io
import os
import subprocess
import sys
import threading
from contextlib import contextmanager

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from dnacheck.cli import main
from dnacheck.io.sequences import SequenceSource, read_one, read_target
from dnacheck.model.molecules import embedded
from dnacheck.numerics.outcome import InputError

GOOD = "ACGTTGCATGCCGATAACGT" * 4
BOM = b"\xef\xbb\xbf"

names = st.text(
    st.characters(min_codepoint=33, max_codepoint=0x2FF, exclude_categories=("C", "Z")),
    min_size=1,
    max_size=12,
)
molecule_letters = st.text("ACGTacgt", min_size=10, max_size=90)
record_lists = st.lists(st.tuples(names, molecule_letters), min_size=1, max_size=5)


def genbank(records):
    from Bio import SeqIO
    from Bio.Seq import Seq
    from Bio.SeqRecord import SeqRecord

    text = io.StringIO()
    made = [
        SeqRecord(Seq(letters), id=name, name=name, annotations={"molecule_type": "DNA"})
        for name, letters in records
    ]
    SeqIO.write(made, text, "genbank")
    return text.getvalue()


@st.composite
def renderings(draw):
    """Records, and bytes that say the same: wrapping, line ends, blanks, marks, encodings, gzip."""
    records = draw(record_lists)
    end = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    width = draw(st.integers(1, 100))
    blank_lines = draw(st.integers(0, 2))
    text = end * draw(st.integers(0, 2))
    for name, letters in records:
        lines = [letters[i : i + width] for i in range(0, len(letters), width)]
        header = f">{name} {draw(st.sampled_from(['', 'a description', 'x > y']))}"
        text += end.join([header, *lines, *[""] * blank_lines])
        text += draw(st.sampled_from(["", " ", "\t"])) + end
    if draw(st.booleans()):
        text = text.rstrip("\r\n")
    latin = draw(st.booleans()) and max(map(ord, text)) < 256
    content = text.encode("latin-1" if latin else "utf-8")
    if latin and not text.isascii():
        # only lines that are not UTF-8 by accident come back as they were
        latin_lines = content.replace(b"\r", b"\n").split(b"\n")
        for line in latin_lines:
            try:
                line.decode("utf-8")
            except UnicodeDecodeError:
                continue
            if not line.isascii():
                content = text.encode("utf-8")
                break
    if draw(st.booleans()) and not latin:
        content = BOM + content
    if draw(st.booleans()):
        half = draw(st.integers(0, len(content)))
        content = gzip.compress(content[:half], mtime=0) + gzip.compress(content[half:])
    return records, content


@contextmanager
def piped(content):
    """Path of a pipe that another thread writes the content to."""
    reader, writer = os.pipe()

    def write():
        with os.fdopen(writer, "wb") as stream:
            stream.write(content)

    thread = threading.Thread(target=write)
    thread.start()
    try:
        yield f"/dev/fd/{reader}"
    finally:
        os.close(reader)
        thread.join()


def standard_input(monkeypatch, content):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(content)))


def found(source):
    return [(m.name, m.sequence.letters) for m in SequenceSource(source).molecules()]


@given(renderings())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@example(([("é", GOOD)], f">é\n{GOOD}\n".encode("latin-1")))
def test_all_renderings_of_the_same_records_give_the_same_molecules(
    tmp_path, monkeypatch, rendering
):
    records, content = rendering
    expected = [(name, letters.upper()) for name, letters in records]
    path = tmp_path / "records"
    path.write_bytes(content)
    assert found(path) == expected
    assert SequenceSource(path).count == len(expected)
    with piped(content) as pipe:
        source = SequenceSource(pipe)
        assert [r.name for r in source.records()] == [name for name, _ in records]
        assert [m.sequence.letters for m in source.molecules()] == [x for _, x in expected]
        assert source.digest == SequenceSource(path).digest
    standard_input(monkeypatch, content)
    assert [m.name for m in read_target("-")] == [name for name, _ in records]


@given(records=record_lists, place=st.integers(0, 10**6), letter=st.sampled_from("NURYKMX*-.é>1"))
def test_a_foreign_letter_is_refused_with_its_position(tmp_path_factory, records, place, letter):
    name, letters = records[0]
    place %= len(letters) - 1
    spoilt = letters[: place + 1] + letter + letters[place + 2 :]
    path = tmp_path_factory.mktemp("x") / "m.fasta"
    lines = [f">{name}", *(spoilt[i : i + 60] for i in range(0, len(spoilt), 60))]
    if any(line.startswith(">") for line in lines[1:]):
        lines = [f">{name}", spoilt]
    path.write_text("\n".join(lines), encoding="utf-8")
    (error,) = SequenceSource(path).molecules()
    assert f"position {place + 2}: '{letter.upper()}' is not one of A, C, G, T" in str(error)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "no FASTA record"),
        (b"\n\r\n", "no FASTA record"),
        (b"ACGTACGTACGT\n", "line 1: 'ACGTACGTACGT' stands before the first header"),
        (b"\n\nlost\n>a\n" + GOOD.encode(), "line 3: 'lost' stands before the first header"),
        (BOM + b"; remark\n>a\nACGT\n", "line 1: '; remark' stands before"),
        (b" >a\n" + GOOD.encode(), "line 1: a blank stands before '>'"),
        (b">a\r" + GOOD.encode() + b"\r\t>b\rACGT", "line 3: a blank stands before '>'"),
        (b"@read\n" + GOOD.encode() + b"\n+\nIIII\n", "line 1: this is FASTQ, which is not read"),
        (b"ID   X56734; SV 1; linear\n", "line 1: this is EMBL"),
        (b"\xff\xfe>\x00a\x00", "UTF-16 and not a text file"),
        (b">a\nAC\0GT\n", "not a text file"),
        (b">a\n" + GOOD.encode() * 40_000 + b"\nAC\0GT\n", "line 3: not a text file"),
        (b"PK\x03\x04rest", "a ZIP archive"),
        (gzip.compress(b">a\n" + GOOD.encode(), mtime=0)[:-9], "damaged gzip data"),
        (b"\x1f\x8bnot gzip at all", "damaged gzip data"),
        (gzip.compress(b"@read\nACGT\n+\nIIII\n", mtime=0), "this is FASTQ"),
        (b"LOCUS       broken\nORIGIN\n        1 acgt\n", "no end '//'"),
        (genbank([("short", GOOD)]).replace(" ccgataacgt", "", 1).encode(), "damaged GenBank"),
    ],
)
def test_what_is_no_fasta_is_refused_alike_from_a_file_and_a_pipe(tmp_path, content, message):
    path = tmp_path / "m.fasta"
    path.write_bytes(content)
    with pytest.raises(InputError) as by_file:
        SequenceSource(path).count  # noqa: B018
    assert message in str(by_file.value)
    assert "\n" not in str(by_file.value)
    with piped(content) as pipe, pytest.raises(InputError) as by_pipe:
        SequenceSource(pipe).count  # noqa: B018
    reason = str(by_file.value).partition("m.fasta'")[2]
    assert str(by_pipe.value).endswith(reason)


def test_a_bad_record_comes_as_its_error_between_its_neighbours(tmp_path):
    path = tmp_path / "m.fasta"
    path.write_text(f">a first\nACGTACGT\nACGT\n>b\nACGTXACGTACGT\n>\n{GOOD}\n>\n>a\n{GOOD}\n>z")
    first, bad, nameless, empty, again, last = SequenceSource(path).molecules()
    assert (first.name, first.sequence.letters) == ("a", "ACGTACGTACGT")
    assert "sequence 'b', position 5: 'X'" in str(bad)
    assert nameless.name == "record 3"
    assert "'record 4': it is empty" in str(empty)
    assert again.name == "a"
    assert "'z': it is empty" in str(last)


def test_a_mark_between_joined_files_loses_nothing(tmp_path):
    path = tmp_path / "m.fasta"
    path.write_bytes((BOM + f">a\n{GOOD}\n".encode()) + (BOM + f">b\n{GOOD}\n".encode()))
    assert [name for name, _ in found(path)] == ["a", "b"]


@given(
    records=st.lists(
        st.tuples(st.text("abcdXYZ0123_", min_size=1, max_size=9), molecule_letters),
        min_size=1,
        max_size=3,
    ),
    end=st.sampled_from(["\n", "\r\n"]),
    packed=st.booleans(),
    mark=st.booleans(),
)
def test_genbank_gives_the_molecules_of_its_fasta(tmp_path_factory, records, end, packed, mark):
    path = tmp_path_factory.mktemp("x") / "m.gb"
    content = (BOM if mark else b"") + genbank(records).replace("\n", end).encode()
    path.write_bytes(gzip.compress(content, mtime=0) if packed else content)
    assert found(path) == [(name, letters.upper()) for name, letters in records]


def test_genbank_without_letters_is_an_empty_record(tmp_path):
    path = tmp_path / "m.gb"
    whole = genbank([("one", GOOD)])
    path.write_text(whole[: whole.index("ORIGIN")] + "ORIGIN\n//\n")
    (error,) = SequenceSource(path).molecules()
    assert "'one': it is empty" in str(error)


def test_targets(tmp_path):
    assert next(read_target("11t15")) == embedded("11T15")
    assert next(read_target("acgtacgtacgt")).sequence.letters == "ACGTACGTACGT"
    for target, message in (
        ("12X99", "neither an embedded molecule"),
        ("missing.fasta", "missing.fasta"),
        ("foo", "position 1: 'F'"),
        ("nul\0byte", "neither an embedded molecule"),
        (str(tmp_path), "Is a directory"),
    ):
        with pytest.raises(InputError, match=message):
            list(read_target(target))


def test_one_molecule_where_one_is_meant(tmp_path):
    path = tmp_path / "m.fasta"
    path.write_text(f">a\n{GOOD}\n>b\n{GOOD}\n")
    with pytest.raises(InputError, match=r"a diagram is of one molecule, .* holds 2"):
        read_one(str(path), "a diagram")
    path.write_text(">a\nACGN\n")
    with pytest.raises(InputError, match="position 4"):
        read_one(str(path), "a diagram")


def test_closed_standard_input_is_an_input_error(monkeypatch):
    monkeypatch.setattr(sys, "stdin", None)
    with pytest.raises(InputError, match="standard input: standard input is closed"):
        list(read_target("-"))


FAULTY = (
    b" >a\n" + GOOD.encode(),
    b"junk\n>a\n" + GOOD.encode(),
    b"@a\n" + GOOD.encode(),
    b"",
    b">a\nAC\0GT",
    b"\xff\xfe>\x00",
)
COMMANDS = (
    ("ring", "{}", "--model", "discrete"),
    ("jfactor", "{}", "--method", "laplace"),
    ("sweep", "{}", "--model", "discrete", "--ratios", "1"),
    ("diagram", "{}"),
    ("md", "{}", "--no-ensemble"),
    ("scan", "{}", "-o", "OUT"),
)


@pytest.mark.parametrize("content", FAULTY)
def test_every_command_refuses_a_faulty_file_with_the_same_line(
    content, tmp_path, capsys, monkeypatch
):
    path = tmp_path / "m.fasta"
    path.write_bytes(content)
    messages = set()
    for arguments in COMMANDS:
        words = [w.format(path).replace("OUT", str(tmp_path / "out.csv")) for w in arguments]
        assert main(words) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        messages.add(captured.err)
        standard_input(monkeypatch, content)
        assert main([w.replace(str(path), "-") for w in words]) == 2
        messages.add(capsys.readouterr().err.replace("standard input", f"file '{path}'"))
    assert len(messages) == 1
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize(
    "content",
    [
        BOM + f">a x\n{GOOD}\n".encode(),
        f">\xe9t\xe9\n{GOOD}\n>b\n{GOOD}\n".encode("latin-1"),
        gzip.compress(f">a\r\n{GOOD[:40]}\r\n{GOOD[40:]}\r\n".encode(), mtime=0),
        genbank([("plasmid", GOOD)]).encode(),
    ],
)
def test_ring_jfactor_and_scan_agree_on_every_file(content, tmp_path, capsys, monkeypatch):
    import csv
    import json

    output = tmp_path / "out.csv"
    for target in ("file", "-"):
        path = tmp_path / "m"
        path.write_bytes(content)
        target = str(path) if target == "file" else "-"
        got = {}
        for words in (("ring", "--model", "discrete"), ("jfactor", "--method", "laplace")):
            standard_input(monkeypatch, content)
            assert main([words[0], target, *words[1:], "--json", "--quiet"]) == 0
            data = json.loads(capsys.readouterr().out)
            records = data.get("molecules", data.get("results", [data]))
            got[words[0]] = [(r["target"], r["n_bp"]) for r in records]
        standard_input(monkeypatch, content)
        assert main(["scan", target, "-o", str(output), "--restart", "--quiet"]) == 0
        with output.open(encoding="utf-8") as handle:
            got["scan"] = [(row["name"], int(row["n_bp"])) for row in csv.DictReader(handle)]
        assert got["ring"] == got["jfactor"] == got["scan"]
        assert {n for _, n in got["scan"]} == {len(GOOD)}


def test_a_scan_without_one_good_row_ends_with_3_and_says_why(tmp_path, capsys):
    source, output = tmp_path / "m.fasta", tmp_path / "out.csv"
    source.write_text(">a\nACGN\n>b\nACGTN\n>c\nACGT\n")
    for _ in range(2):  # computed, and found finished
        assert main(["scan", str(source), "-o", str(output)]) == 3
        text = capsys.readouterr().err
        assert "3 not ok (2: 'N' is not one of A, C, G, T; 1: base pairs are too few" in text
    source.write_text(f">a\nACGN\n>b\n{GOOD}\n")
    assert main(["scan", str(source), "-o", str(output), "--restart"]) == 0


@pytest.mark.skipif(not os.path.exists("/bin/bash"), reason="needs process substitution")
def test_process_substitution():
    command = (
        f"{sys.executable} -m dnacheck ring --model discrete --quiet <(printf '>a\\n{GOOD}\\n')"
    )
    done = subprocess.run(
        ["/bin/bash", "-c", command], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("a: 80 bp")
