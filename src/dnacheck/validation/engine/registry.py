"""The checks that the harness knows: one module of :mod:`dnacheck.validation.checks` per group."""

from __future__ import annotations

import enum
import fnmatch
import importlib
import importlib.util
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from dnacheck.numerics.outcome import InputError
from dnacheck.validation.engine.verdict import CheckResult
from dnacheck.validation.report.record import Block

if TYPE_CHECKING:
    from dnacheck.validation.engine.context import Context
    from dnacheck.validation.scene.scene import Scene

GROUP_MODULES = (
    "table2",
    "essentials",
    "requested",
    "discrete",
    "continuum",
    "sweeps",
    "jfactors",
    "rigid",
    "bound",
    "bead_chain",
    "speed",
    "hard",
)
"""Modules of ``dnacheck.validation.checks``, in the order of the report. Each defines ``GROUP``."""


class Level(enum.IntEnum):
    """How much time a run may take."""

    QUICK = 0
    DEFAULT = 1
    FULL = 2


@dataclass(frozen=True)
class Findings:
    """What a check found: judged numbers, and what the report shows of them."""

    results: Sequence[CheckResult]
    blocks: Sequence[Block] = ()


@dataclass(frozen=True)
class Check:
    """A unit of work that runs in one process and is never repeated once it is finished.

    Attributes
    ----------
    name : str
        ``group.name``; its results are called ``group.name[item]``.
    title : str
        What is checked, in one line.
    run : callable
        Context -> Findings; must use no random number but those of ``context.rng()``.
    seconds : float
        What it costs on the default scene, warm, one core; decides the order of work.
    needs : tuple of str
        Quantities that the scene must want; otherwise it is left out.
    level : Level
        Lowest level at which it runs.
    applies : callable, optional
        Scene -> reason why it can't run, or None.
    requires : tuple of str
        Modules that must exist; otherwise it is skipped.
    """

    name: str
    title: str
    run: Callable[[Context], Findings]
    seconds: float
    needs: tuple[str, ...] = ()
    level: Level = Level.DEFAULT
    applies: Callable[[Scene], str | None] | None = None
    requires: tuple[str, ...] = ()

    @property
    def group(self) -> str:
        """Name of its group."""
        return self.name.partition(".")[0]

    def missing(self) -> str | None:
        """Why it can't run in this installation, if so."""
        for module in self.requires:
            if not _exists(module):
                return f"the module {module} is not installed"
        return None


@dataclass(frozen=True)
class Group:
    """A chapter of the report and its checks.

    ``assemble`` may make the chapter's blocks from the findings of its checks, by name; by default
    they follow one another.
    """

    name: str
    title: str
    intro: str
    checks: tuple[Check, ...]
    assemble: Callable[[Mapping[str, Findings]], Sequence[Block]] | None = None


def _exists(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except ModuleNotFoundError:
        return False


@cache
def groups() -> tuple[Group, ...]:
    """All groups in the order of the report."""
    package = "dnacheck.validation.checks"
    return tuple(importlib.import_module(f"{package}.{module}").GROUP for module in GROUP_MODULES)


def all_checks() -> tuple[Check, ...]:
    """Every check, in the order of the report."""
    return tuple(check for group in groups() for check in group.checks)


def find_check(name: str) -> Check:
    """The check of that name."""
    return next(check for check in all_checks() if check.name == name)


def select(patterns: Sequence[str]) -> tuple[Check, ...]:
    """Checks whose name or group one of the patterns names; ``*`` and ``?`` are wild.

    Raises
    ------
    InputError
        A pattern names nothing.
    """
    chosen: set[str] = set()
    for pattern in patterns:
        found = {
            check.name
            for check in all_checks()
            if fnmatch.fnmatchcase(check.name, pattern) or check.group == pattern
        }
        if not found:
            import difflib

            names = [group.name for group in groups()] + [check.name for check in all_checks()]
            close = difflib.get_close_matches(pattern, names, n=1)
            hint = f"; did you mean '{close[0]}'?" if close else "; see dnacheck validate --list"
            raise InputError(f"no check is called '{pattern}'{hint}")
        chosen |= found
    return tuple(check for check in all_checks() if check.name in chosen)
