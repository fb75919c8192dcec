"""J factors: Table III, Figures 17 to 19, and independent methods that must agree."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from dnacheck.validate.checks.jfactors.acceptance import acceptance
from dnacheck.validate.checks.jfactors.methods import half_chain, laplace, metropolis
from dnacheck.validate.checks.jfactors.table3 import shifts, table3
from dnacheck.validate.registry import Check, Findings, Group
from dnacheck.validate.scene import Scene
from dnacheck.validate.sections import Block, Column, Table


def assemble(findings: Mapping[str, Findings]) -> Sequence[Block]:
    """One table of all methods, then what each check has to show."""
    methods = {
        block.id: {row["name"]: row for row in block.rows}
        for found in findings.values()
        for block in found.blocks
        if isinstance(block, Table) and block.id in ("closure", "half-chain", "metropolis")
    }
    others = [
        block
        for found in findings.values()
        for block in found.blocks
        if not (isinstance(block, Table) and block.id in methods)
    ]
    if "closure" not in methods:
        return others
    rows = []
    for name, best in methods["closure"].items():
        row = {"name": name, **best}
        row["laplace_bias"] = None if best["laplace"] is None else best["register_bias"]
        for method in ("half-chain", "metropolis"):
            found = methods.get(method, {}).get(name)
            if found:
                row[method] = found["minus_lnJ"]
                row[f"{method}-error"] = math.hypot(found["stderr"], found["bias"] or 0.0)
        rows.append(row)
    columns = [
        Column("name", "Molecule"),
        Column("J", "J", "mol/L", ".2e"),
        Column("minus_lnJ", "−ln J", "", ".3f", "", "Exact closure"),
        Column("stderr", "±", "", ".3f", "", "Exact closure"),
        Column("half-chain", "−ln J", "", ".3f", "", "Half chains"),
        Column("half-chain-error", "±", "", ".3f", "", "Half chains"),
        Column("metropolis", "−ln J", "", ".2f", "", "Metropolis, MBAR"),
        Column("metropolis-error", "±", "", ".2f", "", "Metropolis, MBAR"),
        Column("laplace", "plain", "", ".3f", "", "Laplace"),
        Column("register", "register", "", ".3f", "", "Laplace"),
        Column("register_bias", "its bias", "", "+.2f", "", "Laplace"),
    ]
    table = Table(
        "methods",
        "J factors by five methods",
        columns,
        rows,
        "−ln J, J in mol/L, nothing fitted. ± are standard errors with bias bounds added in "
        "quadrature; Laplace has none of its own, its bias is measured against exact closure.",
        summary=len(rows) <= 30,
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
              requires=("dnacheck.jfactor.closure_sampling",)),
        Check("jfactor.half_chain", "tilted half chains", half_chain, 16.0, _NEEDS,
              requires=("dnacheck.jfactor.half_chain",)),
        Check("jfactor.metropolis", "Metropolis with MBAR, best cyclizers", metropolis, 40.0,
              _NEEDS, requires=("dnacheck.jfactor.umbrella",)),
        Check("jfactor.acceptance", "Metropolis moves keep their distribution", acceptance, 6.0,
              _NEEDS, requires=("dnacheck.jfactor.metropolis_kernels",)),
        Check("jfactor.table3", "Table III", table3, 6.0, _NEEDS, applies=_paper,
              requires=("dnacheck.jfactor.table3",)),
        Check("jfactor.shifts", "entropy shifts (Figures 17 to 19)", shifts, 5.0, _NEEDS,
              applies=_paper, requires=("dnacheck.jfactor.table3",)),
    ),
    assemble,
)  # fmt: skip
