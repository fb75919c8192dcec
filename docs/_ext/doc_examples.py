"""Runs the examples of a Markdown page and compares their output with what the page shows.

What counts as an example:

* a fence ``pycon``: Python prompts with their output; all of a page share their names;
* a fence ``console``: every line ``$ dnacheck ...`` is run, in a folder of the page's own, and the
  lines below it, up to the next ``$``, are its output; other commands are left alone;
* a ``{code-block}`` with a ``:caption:``: a file of that name in the page's folder.

``...`` in the output stands for anything, and a number below 1e-6 in powers of ten, such as a
residual, for any other such number. An HTML comment ``<!-- slow -->`` on the line before a fence
keeps it out of the fast tests. Run as a program it lists the examples of the given pages whose
output differs; with ``--write`` it puts the new output into the pages.
"""

from __future__ import annotations

import contextlib
import doctest
import io
import re
import shlex
import sys
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
_ROUNDING = re.compile(r"\b\d(?:\.\d+)?e-(?:0[6-9]|[1-9]\d)\b")
_FENCE = re.compile(r"^(?P<ticks>`{3,})(?P<info>.*)$")


@dataclass(frozen=True)
class Fence:
    """One fenced block of a page: its information line, text, first line and whether it is slow."""

    info: str
    text: str
    line: int
    slow: bool


@dataclass(frozen=True)
class Difference:
    """An example whose output is not what the page shows."""

    page: str
    line: int
    """Line of the page, from 1, on which the expected output begins."""
    source: str
    expected: str
    got: str

    def __str__(self) -> str:
        return (
            f"{self.page}, line {self.line}: {self.source}\n"
            f"expected:\n{self.expected}\ngot:\n{self.got}"
        )


class Checker(doctest.OutputChecker):
    """Compares outputs; numbers that are rounding are all alike."""

    def check_output(self, want: str, got: str, optionflags: int) -> bool:
        """Whether the output is what the page shows."""
        want, got = _ROUNDING.sub("1e-99", want), _ROUNDING.sub("1e-99", got)
        return super().check_output(want, got, optionflags)


def fences(text: str) -> Iterator[Fence]:
    """Fenced blocks of a page in order."""
    lines = text.splitlines()
    number = 0
    while number < len(lines):
        opening = _FENCE.match(lines[number])
        if opening is None:
            number += 1
            continue
        first = number + 1
        end = first
        while end < len(lines) and lines[end].rstrip() != opening["ticks"]:
            end += 1
        slow = number > 0 and lines[number - 1].strip() == "<!-- slow -->"
        yield Fence(opening["info"].strip(), "\n".join(lines[first:end]) + "\n", first + 1, slow)
        number = end + 1


def run_page(page: Path, folder: Path, slow: bool = False) -> list[Difference]:
    """Run the examples of a page in an empty folder; what differs."""
    differences: list[Difference] = []
    names: dict[str, object] = {}
    with contextlib.chdir(folder):
        for fence in fences(page.read_text(encoding="utf-8")):
            if fence.info.startswith("{code-block}"):
                _write_file(fence)
            elif fence.slow and not slow:
                continue
            elif fence.info == "pycon":
                differences += _run_prompts(fence, names, page.name)
            elif fence.info == "console":
                differences += _run_commands(fence, page.name)
    return differences


def _write_file(fence: Fence) -> None:
    caption = re.match(r":caption:\s*(\S+)\n", fence.text)
    if caption is not None:
        body = re.sub(r"\A(:\w+:.*\n)+\n?", "", fence.text)
        Path(caption[1]).write_text(body, encoding="utf-8")


def _run_prompts(fence: Fence, names: dict[str, object], page: str) -> list[Difference]:
    differences: list[Difference] = []

    class Runner(doctest.DocTestRunner):
        def report_failure(self, out, test, example, got):  # type: ignore[no-untyped-def]
            self.differ(test, example, got)

        def report_unexpected_exception(self, out, test, example, exc_info):  # type: ignore[no-untyped-def]
            last = "".join(traceback.format_exception_only(*exc_info[:2]))
            self.differ(test, example, f"Traceback (most recent call last):\n  ...\n{last}")

        def differ(self, test, example, got):  # type: ignore[no-untyped-def]
            line = fence.line + example.lineno + example.source.count("\n")
            got = re.sub(r"^$(?=\n)", "<BLANKLINE>", got, flags=re.MULTILINE)
            differences.append(Difference(page, line, example.source.strip(), example.want, got))

    parsed = doctest.DocTestParser().get_doctest(fence.text, names, page, page, fence.line)
    parsed.globs = names
    Runner(Checker(), optionflags=FLAGS, verbose=False).run(
        parsed, out=lambda text: None, clear_globs=False
    )
    return differences


def _run_commands(fence: Fence, page: str) -> list[Difference]:
    differences = []
    checker = Checker()
    line = fence.line
    for part in re.split(r"^(?=\$ )", fence.text, flags=re.MULTILINE):
        prompt = re.match(r"\$ ((?:.*\\\n)*.*\n)", part)
        begin, line = line, line + part.count("\n")
        words = shlex.split(prompt[1].replace("\\\n", " "), comments=True) if prompt else []
        if prompt is None or not words or words[0] != "dnacheck":
            continue
        expected, got = part[prompt.end() :], run_command(words[1:])
        if not checker.check_output(expected, got, FLAGS):
            first = begin + prompt[0].count("\n")
            differences.append(Difference(page, first, prompt[0].strip(), expected, got))
    return differences


def run_command(arguments: list[str]) -> str:
    """Standard output, then standard error, then the exit code if it is not 0."""
    from dnacheck.cli import main

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(arguments)
    tail = f"exit code {code}\n" if code else ""
    return out.getvalue() + err.getvalue() + tail


def write_output(page: Path, differences: list[Difference]) -> None:
    """Put the real output of the differing examples into the page."""
    lines = page.read_text(encoding="utf-8").splitlines(keepends=True)
    for difference in sorted(differences, key=lambda d: -d.line):
        first = difference.line - 1
        lines[first : first + difference.expected.count("\n")] = [difference.got]
    page.write_text("".join(lines), encoding="utf-8")


if __name__ == "__main__":
    import tempfile

    write = "--write" in sys.argv
    for name in sys.argv[1:]:
        if name == "--write":
            continue
        path = Path(name).resolve()
        with tempfile.TemporaryDirectory() as temporary:
            found = run_page(path, Path(temporary), slow=True)
        if write:
            write_output(path, found)
        for difference in found:
            print(difference, end="\n\n")
