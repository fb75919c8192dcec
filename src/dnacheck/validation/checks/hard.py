"""Hard cases as checks, and one table of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from dnacheck.validation.cases import HardCase
from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Check, Findings, Group, Level
from dnacheck.validation.engine.verdict import CheckResult, failed
from dnacheck.validation.report.record import Block, Column, Figure, Table
from dnacheck.validation.scene.scene import Scene

_COLUMNS = (
    Column("title", "Case"),
    Column("must", "What must happen"),
    Column("did", "What did"),
    Column("verdict", "Verdict"),
)


def _run(
    context: Context, name: str, makers: Iterable[Callable[[np.random.Generator], HardCase]]
) -> Findings:
    """Every case with its own random stream; a crash is that case's failure."""
    results: list[CheckResult] = []
    rows: list[dict[str, Any]] = []
    for number, make in enumerate(makers):
        words = (make.__doc__ or make.__name__).splitlines()[0]
        try:
            case = make(context.rng(number))
        except Exception as error:
            did = " ".join(f"{type(error).__name__}: {error}".split())
            result = failed(f"{name}[{make.__name__}]", words, did)
            case = HardCase(make.__name__.replace("_", " "), words, did, result)
        results.append(case.result)
        rows.append(
            {
                "title": case.title,
                "must": case.must,
                "did": case.did,
                "verdict": case.result.verdict.value,
            }
        )
    return Findings(results, [Table(name, name, _COLUMNS, rows)])


def geometry(context: Context) -> Findings:
    """Rotations, and drift along long chains."""
    from dnacheck.validation.cases import geometry as cases

    found = _run(context, "hard.geometry", cases.CASES)
    rows = cases.drift_against_length(context.rng(1000))
    figure = Figure(
        "drift",
        "Drift against length",
        "drift",
        {"rows": rows},
        "A random chain of N steps. Orthonormality of the last frame, with and without "
        "renormalisation; error of the end's position against long double precision; error of the "
        "energy of the angles recovered from the frames.",
        width=5.6,
        height=3.8,
    )
    return Findings(found.results, [*found.blocks, figure])


def rings(context: Context) -> Findings:
    """Hard molecules for the discrete solver, and condition numbers."""
    from dnacheck.validation.cases import rings as cases

    found = _run(context, "hard.rings", cases.CASES)
    table = Table(
        "condition",
        "Condition numbers",
        [
            Column("n", "bp", "", "d"),
            Column("smallest", "softest mode", "K_θ", ".2e"),
            Column("hessian", "stiffest over softest mode", "", ".1e"),
            Column("closure", "closure (G Gᵀ, lengths over radius)", "", ".1f"),
        ],
        cases.condition_numbers(context.rng(1000)),
        "Lowest rings of random sequences: the Hessian under closure, and the closure constraints.",
        collapsed=True,
    )
    return Findings(found.results, [*found.blocks, table])


def continua(context: Context) -> Findings:
    """Hard choices for the continuum."""
    from dnacheck.validation.cases import continua as cases

    return _run(context, "hard.continuum", cases.CASES)


def assemble(findings: Mapping[str, Findings]) -> Sequence[Block]:
    """One table of all cases; the other blocks follow."""
    rows: list[Mapping[str, Any]] = []
    others: list[Block] = []
    for name, found in findings.items():
        for block in found.blocks:
            if isinstance(block, Table) and block.id == name:
                rows.extend(block.rows)
            else:
                others.append(block)
    title = "Every case in which naive code breaks"
    return [Table("hard-cases", title, _COLUMNS, rows), *others]


def _applies(scene: Scene) -> str | None:
    return None if scene.checks.hard_cases else "the scene does not ask for hard cases"


GROUP = Group(
    "hard",
    "Hard cases",
    "What must happen, and what did, where naive code breaks.",
    (
        Check("hard.geometry", "rotations and long products", geometry, 2.0, (), Level.QUICK,
              _applies),
        Check("hard.rings", "molecules on which solvers break", rings, 6.0, ("energy",),
              applies=_applies),
        Check("hard.continuum", "degenerate starts, bad fits", continua, 3.0,
              ("continuum_energy",), applies=_applies),
    ),
    assemble,
)  # fmt: skip
