"""J factors: Table III, Figures 17 to 19, and independent methods that must agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from dnacheck.validation.checks.jfactors.acceptance import acceptance, measure
from dnacheck.validation.checks.jfactors.fitted import fitted
from dnacheck.validation.checks.jfactors.methods import laplace, pairwise
from dnacheck.validation.checks.jfactors.straight import only_homopolymers, straight
from dnacheck.validation.checks.jfactors.table3 import shifts, table3
from dnacheck.validation.checks.jfactors.timing import speed
from dnacheck.validation.engine.registry import Check, Findings, Group, Level
from dnacheck.validation.report.record import Block, Column, Table
from dnacheck.validation.scene.scene import Scene


def assemble(findings: Mapping[str, Findings]) -> Sequence[Block]:
    """One table of all methods, then what each check has to show."""
    merged: dict[str, dict[str, Any]] = {}
    others: list[Block] = []
    for found in findings.values():
        for block in found.blocks:
            if isinstance(block, Table) and block.id in ("closure", "methods"):
                for row in block.rows:
                    cells = dict(row)
                    if block.id == "methods":
                        # The same method ran in both checks; the sharper run is shown.
                        for shared in ("laplace", "register-laplace", "closure"):
                            cells.pop(shared, None)
                    merged.setdefault(row["name"], {}).update(cells)
            else:
                others.append(block)
    if not merged:
        return others
    columns = [
        Column("name", "Molecule"),
        Column("J", "J", "mol/L", ".2e"),
        Column("minus_lnJ", "−ln J", "", ".3f", "", "Exact closure"),
        Column("stderr", "±", "", ".3f", "", "Exact closure"),
        Column("corrected", "−ln J", "", ".3f", "", "Laplace + first term"),
        Column("corrected_error", "±", "", ".3f", "", "Laplace + first term"),
        Column("half-chain", "−ln J", "", ".2f", "", "Half chains"),
        Column("half-chain-error", "±", "", ".2f", "", "Half chains"),
        Column("metropolis", "−ln J", "", ".2f", "", "Metropolis, MBAR"),
        Column("metropolis-error", "±", "", ".2f", "", "Metropolis, MBAR"),
        Column("sigmas", "any two differ by", "s.e.", ".1f"),
        Column("laplace", "plain", "", ".3f", "", "Laplace"),
        Column("register", "register", "", ".3f", "", "Laplace"),
        Column("register_bias", "its bias", "", "+.2f", "", "Laplace"),
    ]
    if any("half-chain-plain" in row for row in merged.values()):
        columns[8:8] = [
            Column("half-chain-plain", "plain", "", ".2f", "", "Half chains"),
            Column("half-chain-plain-error", "±", "", ".2f", "", "Half chains"),
        ]
    table = Table(
        "methods",
        "J factors by all methods",
        columns,
        list(merged.values()),
        "−ln J, J in mol/L, nothing fitted. ± are standard errors, and for Laplace with its first "
        "anharmonic term the estimated next term too. Laplace has no error of its own; its bias "
        "is measured against exact closure. Any two of the methods with errors differ by at most "
        "so many combined standard errors.",
        summary=len(merged) <= 30,
    )
    return [table, *others]


def _paper(scene: Scene) -> str | None:
    if not scene.checks.against_paper or len(scene.resolved) < 11:
        return "Table III needs all eleven molecules of the paper"
    return None


_NEEDS = ("ln_J",)

GROUP = Group(
    "jfactor",
    "J factors",
    "Cyclization free energies −ln J with the entropy computed, by independent methods.",
    (
        Check("jfactor.laplace", "exact-closure sampling and Laplace", laplace, 4.0, _NEEDS,
              requires=("dnacheck.cyclization.closure.sampling",)),
        Check("jfactor.pairwise", "every two methods, half chains and Metropolis too", pairwise,
              45.0, _NEEDS, requires=("dnacheck.validation.reference.agreement",)),
        Check("jfactor.measure", "pivot moves hold the measure of rotations", measure, 0.5,
              level=Level.QUICK,
              requires=("dnacheck.cyclization.ensembles.kernels.open_moves",)),
        Check("jfactor.acceptance", "Metropolis moves keep their distribution", acceptance, 12.0,
              _NEEDS, requires=("dnacheck.cyclization.ensembles.kernels.open_moves",)),
        Check("jfactor.table3", "Table III", table3, 6.0, _NEEDS, applies=_paper,
              requires=("dnacheck.validation.reference.table3",)),
        Check("jfactor.shifts", "entropy shifts (Figures 17 to 19)", shifts, 5.0, _NEEDS,
              applies=_paper, requires=("dnacheck.validation.reference.table3",)),
        Check("jfactor.fitted", "Table III with fitted mechanics", fitted, 12.0, _NEEDS,
              applies=_paper, requires=("dnacheck.mechanics.fit",)),
        Check("jfactor.straight", "straight molecules beside the rod", straight, 110.0, _NEEDS,
              applies=only_homopolymers, requires=("dnacheck.cyclization.laplace.anharmonic",)),
        Check("jfactor.speed", "error against time", speed, 25.0, _NEEDS, applies=_paper,
              requires=("dnacheck.validation.reference.work_precision",)),
    ),
    assemble,
)  # fmt: skip
