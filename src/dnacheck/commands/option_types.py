"""What the options of all commands may be: numbers and counts in a range, links, steps.

Every value that is refused gets the largest or the range that makes sense, never an overflow or
an allocation that fails later.
"""

from __future__ import annotations

import re
from typing import Any

import click

from dnacheck.numerics.ranges import Range

TOLERANCE = Range(1e-6, 100.0)
"""Standard error on ln J: a millionth would take 10¹¹ draws, a hundred says nothing."""
SECONDS = Range(1e-3, 1e6)
"""Up to twelve days, which every operating system's timed wait takes."""
SEED = Range(0, 2**63 - 1)
THREADS = Range(1, 1024)
LINK = Range(-(10**6), 10**6)
"""No molecule that can be computed has more turns; each has its own limit besides."""
BASE_PAIRS = Range(4, 10**6)
FILTER_WIDTH = Range(1, 10_001)
INTERVALS = Range(1, 10_000)
DEGREE = Range(1, 12)
WINDOW = Range(10, 100_000)
STEP = Range(1, 10**9)
PIECE = Range(1, 10**9)
POSITION = Range(0, 10**9)
POINTS = Range(1, 10**6)
TURNS = Range(-1000.0, 1000.0)
SAMPLES = Range(20, 10**6)
ITERATIONS = Range(1, 100_000)
REPLICAS = Range(1, 1000)
FRAMES = Range(-(2**31), 2**31 - 1)
FORCE_PN = Range(-1000.0, 1000.0, "pN")
TORQUE_PN_NM = Range(-1000.0, 1000.0, "pN nm")
"""Single molecules break below 1000 pN."""
STEP_FRACTION = Range(1e-3, 10.0)
COMPUTED = Range(0, 100_000)

_LONGEST_SHOWN = 30


def shown(value: Any) -> str:
    """A value as typed, its middle left out if it is long."""
    text = str(value)
    if len(text) > _LONGEST_SHOWN:
        text = f"{text[: _LONGEST_SHOWN // 2]}...{text[-5:]} ({len(text)} characters)"
    return f"'{text}'"


class Number(click.ParamType):
    """A finite number in a range."""

    name = "number"

    def __init__(self, allowed: Range) -> None:
        self.allowed = allowed

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        try:
            number = float(value)
        except (TypeError, ValueError):
            self.fail(f"{shown(value)} is not a number", param, ctx)
        if number not in self.allowed:
            self.fail(f"{shown(value)}: give a number {self.allowed}", param, ctx)
        return number


class Count(click.ParamType):
    """An integer in a range."""

    name = "integer"

    def __init__(self, allowed: Range) -> None:
        self.allowed = allowed

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        number = integer(value)
        if number is None:
            self.fail(f"{shown(value)} is not an integer {self.allowed}", param, ctx)
        if number not in self.allowed:
            self.fail(f"{shown(value)}: give an integer {self.allowed}", param, ctx)
        return number


def integer(text: Any) -> int | None:
    """The integer that a text writes in decimal digits, None if it writes none."""
    if isinstance(text, int):
        return text
    if not isinstance(text, str) or re.fullmatch(r"[+-]?[0-9]{1,4000}", text) is None:
        return None
    return int(text)


class LinkChoice(click.ParamType):
    """``auto``, ``all`` or an integer."""

    name = "auto|all|integer"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> str | int:
        if value in ("auto", "all"):
            return str(value)
        number = integer(value)
        if number is None:
            self.fail(f"{shown(value)} is not 'auto', 'all' or an integer", param, ctx)
        if number not in LINK:
            self.fail(f"{shown(value)}: give an integer {LINK}", param, ctx)
        return number


class StepRange(click.ParamType):
    """``auto``, ``tracts-only``, ``none`` or ``A..B``, 0-based steps, both included."""

    name = "auto|tracts-only|none|A..B"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> str | tuple[int, int]:
        if isinstance(value, tuple) or value in ("auto", "tracts-only", "none"):
            return value
        match = re.fullmatch(r"([0-9]{1,9})\.\.([0-9]{1,9})", value)
        if match is None:
            self.fail(f"{shown(value)} is not 'auto', 'none' or A..B, such as 30..92", param, ctx)
        first, last = int(match[1]), int(match[2])
        if first > last:
            self.fail(f"the first step {first} lies after the last step {last}", param, ctx)
        return first, last
