"""JSON, notes and progress of the commands."""

import enum
import io
import json
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnacheck.commands.output import json_text, note, plain, print_json, progress


class Colour(enum.Enum):
    RED = "red light"


@dataclass(frozen=True)
class Pair:
    left: float
    right: object


def test_every_kind_of_value():
    value = {
        "none": None,
        "flag": np.True_,
        "integer": np.int64(3),
        "number": np.float64(0.25),
        "array": np.array([[1.0, np.nan], [np.inf, -np.inf]]),
        "zero_dimensional": np.array(2),
        "path": Path("a/b"),
        "status": Colour.RED,
        "pair": Pair(float("nan"), (1, 2)),
        1: [],
        Colour.RED: {},
    }
    assert json.loads(json_text(value)) == {
        "none": None,
        "flag": True,
        "integer": 3,
        "number": 0.25,
        "array": [[1.0, None], [None, None]],
        "zero_dimensional": 2,
        "path": "a/b",
        "status": "red light",
        "pair": {"left": None, "right": [1, 2]},
        "1": [],
        "red light": {},
    }


@pytest.mark.parametrize("value", [object(), {1.5: 0}, {True: 0}, {"a": {2}}, b"x", 1j, Pair])
def test_what_json_lacks_is_refused(value):
    with pytest.raises(TypeError):
        plain(value)


nested = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@given(nested)
def test_text_is_strict_json_in_ascii(value):
    text = json_text(value)
    assert text.isascii()

    def refuse(name):
        raise AssertionError(name)

    assert json.loads(text, parse_constant=refuse) == plain(value)


def test_numbers_survive_exactly():
    number = 0.1 + 0.2
    assert json.loads(json_text({"x": number}))["x"] == number


def test_print_json_writes_one_object(capsys):
    print_json({"a": 1})
    captured = capsys.readouterr()
    assert json.loads(captured.out) == {"a": 1}
    assert captured.err == ""


def test_notes_go_to_standard_error_unless_quiet(capsys):
    note("seen\nhere")
    note("unseen", quiet=True)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == "dnacheck: seen here\n"


def test_no_progress_bar_without_a_terminal(capsys):
    with progress("work", 3) as advance:
        advance(3)
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "")


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize("quiet", [False, True])
def test_progress_bar_on_a_terminal(quiet, monkeypatch, capsys):
    monkeypatch.setenv("TERM", "xterm")
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with progress("folding", 3, quiet=quiet) as advance:
        advance(2)
    assert ("folding" in terminal.getvalue()) is not quiet
    assert capsys.readouterr().out == ""
