"""Which checks a scene needs, and why the others are left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dnacheck.validation.engine.registry import Check, Level, all_checks
from dnacheck.validation.scene.scene import Scene

COMPARING_GROUPS = ("essentials", "jfactor", "bead_chain")
"""Groups that compute a quantity again by independent methods, or another one to try the program;
the quantity itself, no dearer than its accuracy asks, comes from the group ``wanted``."""


@dataclass(frozen=True)
class Step:
    """A check and the decision about it; ``reason`` says why, in either case."""

    check: Check
    run: bool
    reason: str
    unavailable: bool = False
    """Wanted, but something it needs is not installed: reported as skipped."""


@dataclass(frozen=True)
class Plan:
    """Every check of the registry with its decision, in the order of the report."""

    steps: tuple[Step, ...]

    @property
    def chosen(self) -> tuple[Check, ...]:
        """Checks that run."""
        return tuple(step.check for step in self.steps if step.run)

    @property
    def skipped(self) -> tuple[Step, ...]:
        """Checks that the scene wants and this installation can't do."""
        return tuple(step for step in self.steps if step.unavailable)


def make_plan(scene: Scene, level: Level, only: Sequence[Check] | None = None) -> Plan:
    """Decide for every check whether the scene needs it.

    A check runs if the scene wants every quantity that it needs, its group is not excluded, its
    level is reached, it applies to the scene's molecules and its modules are installed.

    Parameters
    ----------
    only : sequence of Check, optional
        Consider only these; naming a check lifts the limit of the level.
    """
    return Plan(tuple(_decide(check, scene, level, only) for check in all_checks()))


def _decide(check: Check, scene: Scene, level: Level, only: Sequence[Check] | None) -> Step:
    if only is not None and check not in only:
        return Step(check, False, "not named by --only")
    groups = scene.checks.groups
    if groups != "all" and check.group not in groups:
        return Step(check, False, "its group is not listed in [checks] groups")
    absent = [name for name in check.needs if name not in scene.wants]
    if absent:
        return Step(check, False, f"the scene does not want {' and '.join(absent)}")
    compared = scene.checks.compare_methods or scene.checks.against_paper
    if check.group in COMPARING_GROUPS and not compared:
        return Step(check, False, "the scene does not ask to compare methods ([checks])")
    reason = check.applies(scene) if check.applies else None
    if reason:
        return Step(check, False, reason)
    if only is None and check.level > level:
        option = "--full" if check.level is Level.FULL else "a run without --quick"
        return Step(check, False, f"takes about {check.seconds:.0f} s; part of {option}")
    missing = check.missing()
    if missing:
        return Step(check, False, missing, unavailable=True)
    if check.needs:
        return Step(check, True, f"the scene wants {' and '.join(check.needs)}")
    return Step(check, True, "the scene asks for its group")
