"""The one reader of molecules: FASTA and GenBank from files, pipes and standard input.

Every command, the scenes of a validation and a scan take their records from here, so that they
agree on every file. Biopython parses; what it would drop or misread without a word (text before the
first header, a header that does not start its line, another format) is refused with its line.
"""

from __future__ import annotations

import contextlib
import gzip
import hashlib
import io
import os
import re
import stat
import sys
import warnings
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import BinaryIO, NamedTuple

from dnacheck.model.molecules import Molecule, embedded, embedded_names, is_embedded
from dnacheck.model.par_files import is_par, read_par
from dnacheck.model.sequence import parse_sequence
from dnacheck.numerics.outcome import InputError

STANDARD_INPUT = "-"
LARGEST_STREAM = 1 << 30
"""Bytes taken from a pipe or standard input, which cannot be read twice; a file has no limit."""

_CHUNK = 1 << 20
_GZIP = b"\x1f\x8b"
_BYTE_ORDER_MARK = "\ufeff"
_SHOWN = 20
_HEADER_HINT = "a record starts with a line '>name'"
_BINARY_FORMATS = (
    (b"\xff\xfe", "UTF-16 and not a text file in UTF-8; save it as UTF-8"),
    (b"\xfe\xff", "UTF-16 and not a text file in UTF-8; save it as UTF-8"),
    (b"PK\x03\x04", "a ZIP archive; unpack it, or compress with gzip"),
    (b"BZh", "compressed with bzip2; unpack it, or compress with gzip"),
    (b"\xfd7zXZ", "compressed with xz; unpack it, or compress with gzip"),
    (b"\x28\xb5\x2f\xfd", "compressed with zstd; unpack it, or compress with gzip"),
)
_TEXT_FORMATS = (
    ("@", "FASTQ"),
    ("ID   ", "EMBL"),
    ("CLUSTAL", "a Clustal alignment"),
    ("#NEXUS", "NEXUS"),
    ("{\\rtf", "RTF"),
    ("<?xml", "XML"),
)


@dataclass(frozen=True)
class Record:
    """A record as it stands in its file; nothing is checked but the format."""

    name: str
    """First word of the header, or "record N"."""
    letters: str
    """Without white space."""

    def molecule(self) -> Molecule:
        """The record's molecule.

        Raises
        ------
        InputError
            A letter other than A, C, G, T (with its position), or too few of them.
        """
        return Molecule(parse_sequence(self.letters, self.name))


class Stretch(NamedTuple):
    """Consecutive letters of a record."""

    record: int
    """Place of the record in its file, from 0."""
    name: str
    offset: int
    """Letters of the record before these."""
    letters: str
    last: bool


class SequenceSource:
    """A file, a pipe or standard input whose records can be read more than once.

    Compression (gzip) and format (FASTA, GenBank) are told from the content, not from the name. A
    byte-order mark is dropped, line ends may be LF, CR LF or CR, and a line that is not UTF-8 is
    read as Latin-1.

    Parameters
    ----------
    path : path or "-"
        "-" is standard input.

    Raises
    ------
    InputError
        It cannot be read.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.name = os.fspath(path)
        self.label = (
            "standard input" if self.name == STANDARD_INPUT else f"file '{_shown(self.name, 200)}'"
        )
        self._content: bytes | None = None
        try:
            if self.name == STANDARD_INPUT:
                self._content = self._whole(_standard_input())
            elif not stat.S_ISREG(os.stat(self.name).st_mode):
                with open(self.name, "rb") as stream:
                    self._content = self._whole(stream)
        except (OSError, ValueError) as error:
            raise self._unreadable(error) from None

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the bytes as they are stored."""
        digest = hashlib.sha256()
        try:
            with self._opened() as stream:
                while chunk := stream.read(_CHUNK):
                    digest.update(chunk)
        except OSError as error:
            raise self._unreadable(error) from None
        return digest.hexdigest()

    @cached_property
    def count(self) -> int:
        """Number of records; reading them all finds every fault of the format."""
        return sum(stretch.last for stretch in self.stretches(_CHUNK))

    def records(self) -> Iterator[Record]:
        """Records in order, one at a time.

        Raises
        ------
        InputError
            The content is neither FASTA nor GenBank, or holds no record; names the line.
        """
        found = False
        with self._reading(), self._text() as text:
            for number, (header, pieces) in enumerate(self._parsed(text), start=1):
                found = True
                words = header.split()
                yield Record(words[0] if words else f"record {number}", "".join(pieces))
        if not found:
            raise InputError(f"{self.label}: no FASTA record; {_HEADER_HINT}")

    def stretches(self, size: int) -> Iterator[Stretch]:
        """Records in order, cut into stretches, so that a chromosome is never held whole.

        Parameters
        ----------
        size : int
            Letters of a stretch; the last one of a record may be shorter, an empty record has one
            of none.

        Raises
        ------
        InputError
            As :meth:`records`.
        """
        with self._reading(), self._text() as text:
            number = 0
            for header, pieces in self._parsed(text):
                number += 1
                words = header.split()
                name = words[0] if words else f"record {number}"
                offset, held = 0, ""
                for piece in pieces:
                    held += piece
                    while len(held) > size:
                        yield Stretch(number - 1, name, offset, held[:size], False)
                        offset, held = offset + size, held[size:]
                yield Stretch(number - 1, name, offset, held, True)
            if not number:
                raise InputError(f"{self.label}: no FASTA record; {_HEADER_HINT}")

    def molecules(self) -> Iterator[Molecule | InputError]:
        """Molecules in order, one at a time; a bad record comes as its error."""
        for record in self.records():
            try:
                yield record.molecule()
            except InputError as error:
                yield error

    @contextmanager
    def _reading(self) -> Iterator[None]:
        try:
            yield
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            reason = " ".join(str(error).split())
            raise InputError(f"{self.label}: damaged gzip data ({reason}); copy it again") from None
        except OSError as error:
            raise self._unreadable(error) from None

    def _opened(self) -> io.BufferedReader:
        if self._content is not None:
            return io.BufferedReader(io.BytesIO(self._content))
        return open(self.name, "rb")

    @contextmanager
    def _text(self) -> Iterator[io.TextIOWrapper]:
        """The content without its compression, as text whose lines end in LF."""
        with contextlib.ExitStack() as stack:
            stream = stack.enter_context(self._opened())
            if stream.peek(2)[:2] == _GZIP:
                unpacked = stack.enter_context(gzip.GzipFile(fileobj=stream, mode="rb"))
                stream = stack.enter_context(io.BufferedReader(unpacked))
            self._refuse_binary(stream.peek(_CHUNK)[:_CHUNK])
            yield stack.enter_context(
                io.TextIOWrapper(stream, encoding="utf-8", errors="surrogateescape", newline=None)
            )

    def _whole(self, stream: BinaryIO) -> bytes:
        """All bytes of a stream that cannot be read twice, refused as early as can be."""
        pieces: list[bytes] = []
        size = 0
        while piece := stream.read(_CHUNK):
            if not pieces and not piece.startswith(_GZIP):
                self._refuse_binary(piece)
            pieces.append(piece)
            size += len(piece)
            if size > LARGEST_STREAM:
                raise InputError(
                    f"{self.label}: more than {LARGEST_STREAM} bytes through a pipe; give a file"
                )
        return b"".join(pieces)

    def _unreadable(self, error: Exception) -> InputError:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        return InputError(f"{self.label}: {reason}; check the path")

    def _refuse_binary(self, start: bytes) -> None:
        for magic, reason in _BINARY_FORMATS:
            if start.startswith(magic):
                raise InputError(f"{self.label}: {reason}")
        if b"\0" in start:
            raise InputError(f"{self.label}: not a text file; give FASTA or GenBank")

    def _parsed(self, text: io.TextIOWrapper) -> Iterator[tuple[str, Iterable[str]]]:
        """Header and letters of each record, the letters in pieces."""
        lines = self._lines(text)
        ahead: list[tuple[int, str]] = []
        for number, line in lines:
            ahead.append((number, line))
            if line.strip():
                break
        first = ahead[-1][1] if ahead else ""
        for start, name in _TEXT_FORMATS:
            if first.startswith(start):
                raise InputError(
                    f"{self.label}, line {ahead[-1][0]}: this is {name}, which is not read; "
                    "convert it to FASTA or GenBank"
                )
        whole = _chained(ahead, lines)
        if re.match(r"LOCUS\s", first):
            yield from self._genbank(whole)
            return
        # Parsers of libraries hold a record whole; a chromosome has to pass line by line.
        header = ""
        for is_header, group in groupby(self._fasta_lines(whole), lambda line: line[0] == ">"):
            if not is_header:
                yield header, ("".join(line.split()) for line in group)
                header = ""
                continue
            for line in group:
                if header:
                    yield header, ()
                header = line[1:].rstrip() or " "
        if header:
            yield header, ()

    def _lines(self, text: io.TextIOWrapper) -> Iterator[tuple[int, str]]:
        """Lines with their numbers, without a byte-order mark and undecoded bytes."""
        for number, line in enumerate(text, start=1):
            if "\0" in line:
                raise InputError(
                    f"{self.label}, line {number}: not a text file; give FASTA or GenBank"
                )
            if not line.isascii():
                line = _decoded(line).removeprefix(_BYTE_ORDER_MARK)
            yield number, line

    def _fasta_lines(self, lines: Iterator[tuple[int, str]]) -> Iterator[str]:
        """The same lines, if no record can get lost between them."""
        begun = False
        for number, line in lines:
            if line.startswith(">"):
                begun = True
            elif line.lstrip().startswith(">"):
                raise InputError(
                    f"{self.label}, line {number}: a blank stands before '>'; remove it, "
                    "for a header starts its line"
                )
            elif not begun and line.strip():
                raise InputError(
                    f"{self.label}, line {number}: '{_shown(line.strip())}' stands before the "
                    f"first header, so this is not FASTA; {_HEADER_HINT}"
                )
            if begun:
                yield line

    def _genbank(self, lines: Iterator[tuple[int, str]]) -> Iterator[tuple[str, Iterable[str]]]:
        from Bio import SeqIO
        from Bio.Seq import UndefinedSequenceError

        text = "".join(line for _, line in lines)
        if not text.rstrip().endswith("\n//"):
            raise InputError(
                f"{self.label}: the last GenBank record has no end '//'; the file is cut short"
            )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # fields that a strict GenBank file would not have
            warnings.filterwarnings("error", message="Expected sequence length")
            try:
                records = list(SeqIO.parse(io.StringIO(text), "genbank"))
            except Exception as error:  # the parser raises what it likes at a damaged record
                reason = _shown(" ".join(str(error).split()) or type(error).__name__, 120)
                raise InputError(
                    f"{self.label}: damaged GenBank record ({reason}); export it again, or as FASTA"
                ) from None
        for record in records:
            try:
                letters = str(record.seq)
            except UndefinedSequenceError:
                letters = ""
            known = record.id not in ("", ".", None) and not record.id.startswith("<")
            yield (record.id if known else record.name), letters.split()


def read_target(target: str) -> Iterator[Molecule | InputError]:
    """Molecules that a TARGET names, in order; a bad record comes as its error.

    Parameters
    ----------
    target : str
        Name of an embedded molecule, "-" for standard input, a FASTA or GenBank file, a shape in
        3DNA's ``.par`` format, or letters.

    Raises
    ------
    InputError
        The target is none of these, or its file cannot be read.
    """
    if is_embedded(target):
        yield embedded(target)
        return
    if is_par(target):
        yield read_par(Path(target))
        return
    looks_like_path = "/" in target or "." in target or "\\" in target
    try:
        is_file = bool(target.strip()) and Path(target).exists()
    except (OSError, ValueError):
        is_file = False
    if target == STANDARD_INPUT or is_file or looks_like_path:
        yield from SequenceSource(target).molecules()
    elif not re.fullmatch(r"[A-Za-z\s]*", target):
        names = ", ".join(embedded_names())
        raise InputError(
            f"target '{_shown(target, 60)}' is neither an embedded molecule ({names}), nor a "
            "file, nor a sequence of A, C, G, T"
        )
    else:
        yield Molecule(parse_sequence(target, "sequence"))


def read_one(target: str, purpose: str) -> Molecule:
    """The only molecule of a TARGET.

    Parameters
    ----------
    purpose : str
        What takes one molecule only, such as "a diagram"; opens the message.

    Raises
    ------
    InputError
        The target holds several molecules, or its molecule is bad.
    """
    molecules = list(read_target(target))
    if len(molecules) != 1:
        raise InputError(f"{purpose} is of one molecule, '{target}' holds {len(molecules)}")
    molecule = molecules[0]
    if isinstance(molecule, InputError):
        raise molecule
    return molecule


def _standard_input() -> BinaryIO:
    if sys.stdin is None:
        raise OSError(None, "standard input is closed")
    buffer = getattr(sys.stdin, "buffer", None)
    return io.BytesIO(sys.stdin.read().encode()) if buffer is None else buffer


def _chained(
    ahead: list[tuple[int, str]], lines: Iterator[tuple[int, str]]
) -> Iterator[tuple[int, str]]:
    yield from ahead
    yield from lines


def _decoded(line: str) -> str:
    """A line read as UTF-8, or, where it is not, as Latin-1."""
    try:
        line.encode()
    except UnicodeEncodeError:
        return line.encode(errors="surrogateescape").decode("latin-1")
    return line


def _shown(text: str, most: int = _SHOWN) -> str:
    """The beginning of a text, printable, for a message."""
    cut = text if len(text) <= most else text[:most] + "..."
    return "".join(letter if letter.isprintable() else "?" for letter in cut)
