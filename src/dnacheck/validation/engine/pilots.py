"""Pilot runs: which of several models is accurate enough, measured on a few molecules."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge
from dnacheck.validation.report.record import Column, Table

if TYPE_CHECKING:
    from dnacheck.equilibria.continuum import ContinuumOptions
    from dnacheck.model.chain import Chain

USED = "the shortest, median and longest molecule"
VARIANT_COLUMNS = (
    Column("name", "Molecule"),
    Column("angles", "Angles"),
    Column("ratio", "K_3/K_1", "", "g"),
)
_REPEATS = 3
_SLOW_S = 0.5
"""Work slower than this is not repeated."""


@dataclass(frozen=True)
class Candidate:
    """A way to a quantity; candidates are listed from the cheapest to the dearest."""

    name: str
    compute: Callable[[Chain], float]


@dataclass(frozen=True)
class Choice:
    """The candidate that a pilot selected, with what the pilot measured."""

    chosen: Candidate
    error: float
    rows: Sequence[dict[str, Any]]


def pilots(chains: Sequence[Chain]) -> list[Chain]:
    """The shortest, the median and the longest molecule."""
    ordered = sorted(chains, key=lambda chain: (chain.n_steps, chain.name))
    picks = {0, len(ordered) // 2, len(ordered) - 1}
    return [ordered[index] for index in sorted(picks)]


def first_pilots(variants: Sequence[tuple[str, float, Chain]]) -> list[Chain]:
    """The pilots among the molecules at the scene's first twist ratio; see :func:`variants_of`."""
    return pilots([chain for _, ratio, chain in variants if ratio == variants[0][1]])


def mesh_candidates(
    compute: Callable[[ContinuumOptions], Callable[[Chain], float]],
    meshes: Sequence[tuple[int, int]],
) -> list[Candidate]:
    """A quantity on fixed meshes (intervals, degree), coarse ones first, and on an adapted one."""
    from dnacheck.equilibria.continuum import ContinuumOptions

    fixed = [
        Candidate(
            f"{intervals} intervals of degree {degree}",
            compute(ContinuumOptions(intervals=intervals, degree=degree, adapt=False)),
        )
        for intervals, degree in meshes
    ]
    adapted = compute(ContinuumOptions(energy_tolerance=1e-8))
    return [*fixed, Candidate("mesh adapted to 1e-8", adapted)]


def choose(
    candidates: Sequence[Candidate],
    reference: Callable[[Chain], float],
    chains: Sequence[Chain],
    accuracy: float,
    relative: bool = True,
) -> Choice:
    """The first candidate whose largest error on the pilots is within the accuracy.

    Every candidate up to it is measured, and the next one, so that the report can show what the
    dearer model would have cost. Where none suffices the last is taken. The decision rests on
    errors and on the fixed order, not on measured times, so it is the same on every machine.
    """
    exact = [reference(chain) for chain in chains]
    rows: list[dict[str, Any]] = []
    chosen: Candidate | None = None
    error = float("inf")
    after = False
    for index, candidate in enumerate(candidates):
        if after:
            rows.append({"model": candidate.name, "decision": "left out: dearer, not needed"})
            continue
        values = [candidate.compute(chain) for chain in chains]
        errors = [
            abs(value - truth) / (abs(truth) if relative else 1.0)
            for value, truth in zip(values, exact, strict=True)
        ]
        worst = max(errors)
        seconds = warm_seconds(candidate.compute, chains)
        row = {"model": candidate.name, "error": worst, "ms": 1e3 * seconds}
        if chosen is not None:
            row["decision"] = "left out: dearer, not needed"
            after = True
        elif worst <= accuracy or index == len(candidates) - 1:
            chosen, error = candidate, worst
            row["decision"] = "chosen"
        else:
            row["decision"] = "left out: not accurate enough"
        rows.append(row)
    assert chosen is not None
    return Choice(chosen, error, rows)


def warm_seconds(compute: Callable[[Chain], Any], chains: Sequence[Chain]) -> float:
    """Seconds per molecule of work that has run on each before; the best of three, unless slow."""
    best = float("inf")
    for _ in range(_REPEATS):
        began = time.perf_counter()
        for chain in chains:
            compute(chain)
        best = min(best, time.perf_counter() - began)
        if best > _SLOW_S:
            break
    return best / len(chains)


def pilot_table(name: str, title: str, choice: Choice, accuracy: float, used: str) -> Table:
    """What the pilot measured and decided."""
    return Table(
        f"pilot-{name}",
        title,
        [
            Column("model", "Model"),
            Column("error", "largest error measured", "", ".1e"),
            Column("ms", "time per molecule", "ms", ".1f"),
            Column("decision", "Decision"),
        ],
        choice.rows,
        f"Wanted: {accuracy:g}. Measured on {used}; candidates from the cheapest to the dearest. "
        "Times: one core, compiled code warm, best of three.",
    )


def judge_accuracy(
    name: str, quantity: str, error: float, accuracy: float, unit: str = ""
) -> CheckResult:
    """The measured error against the scene's wish."""
    return judge(
        name,
        f"error of the {quantity} measured on the pilot molecules",
        error,
        accuracy,
        Rule.AT_MOST,
        "the scene's wish; the reference is at least ten times finer",
        "asked for by the scene",
        unit=unit,
    )


def variants_of(context: Context) -> list[tuple[str, float, Chain]]:
    """Every molecule with every angle set and twist ratio of the scene."""
    from dnacheck.validation.engine.rings import scene_chain

    model = context.scene.model
    return [
        (angles, ratio, scene_chain(context.scene, molecule, angles, ratio))
        for angles in model.angles
        for ratio in model.twist_ratios
        for molecule in context.molecules
    ]
