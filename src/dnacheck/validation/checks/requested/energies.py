"""Ring energies of the chain and of the rod, by the cheapest model that is accurate enough."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.pilots import (
    USED,
    VARIANT_COLUMNS,
    Candidate,
    choose,
    first_pilots,
    judge_accuracy,
    mesh_candidates,
    pilot_table,
    variants_of,
)
from dnacheck.validation.engine.registry import Findings
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge, must_fail
from dnacheck.validation.report.record import Column, Table

if TYPE_CHECKING:
    from dnacheck.equilibria.continuum import ContinuumOptions
    from dnacheck.model.chain import Chain

SHOWN_ROWS = 500
LARGEST_RESIDUAL = 1e-9


def energy(context: Context) -> Findings:
    """Ring energies of the wedge chain."""
    from dnacheck.equilibria.continuum import lowest_continuum_ring
    from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
    from dnacheck.equilibria.discrete.solve import NewtonOptions
    from dnacheck.model.rod import build_rod
    from dnacheck.validation.engine import rings

    accuracy = context.scene.wanted.energy
    assert accuracy is not None
    variants = variants_of(context)
    options = rings.rod_options(context.scene)
    fine = SearchOptions(newton=NewtonOptions(tolerance=1e-12))

    def by_rod(chain: Chain) -> float:
        return lowest_continuum_ring(build_rod(chain, options)).lowest.energy

    chosen = choose(
        [
            Candidate("discrete chain", lambda chain: find_rings(chain).lowest.energy),
            Candidate("continuum rod", by_rod),
        ],
        lambda chain: find_rings(chain, fine).lowest.energy,
        first_pilots(variants),
        accuracy,
    )
    rows, unsolved = [], []
    worst = 0.0
    for angles, twist_ratio, chain in variants:
        row: dict[str, Any] = {
            "name": chain.name,
            "n_bp": chain.n_steps,
            "angles": angles,
            "ratio": twist_ratio,
        }
        search = rings.rings(chain)
        if search.equilibria:
            ring = search.lowest
            worst = max(worst, ring.residual)
            row |= {
                "energy": ring.energy_RT,
                "bend": ring.bend_RT,
                "twist": ring.twist_RT,
                "link": ring.link,
                "writhe": ring.writhe,
                "minima": len(search.equilibria),
                "status": ring.status.name.lower(),
            }
        else:
            unsolved.append(chain.name)
            row["status"] = search.status.value
        rows.append(row)
    results = [
        judge(
            "wanted.energy[solved]",
            "molecules without a stable ring",
            len(unsolved),
            0,
            Rule.EQUAL,
            "a closed elastic chain has a minimum at every link",
            "every minimum sought must be found",
        ),
        judge(
            "wanted.energy[residual]",
            "largest residual of an equilibrium",
            worst,
            LARGEST_RESIDUAL,
            Rule.AT_MOST,
            "equations (4.6), closure included",
            "the energy's error is of the order of its square",
        ),
        judge_accuracy("wanted.energy[accuracy]", "ring energy", chosen.error, accuracy),
        _control(variants[0][2], accuracy),
    ]
    several = len(context.scene.model.angles) * len(context.scene.model.twist_ratios) > 1
    columns = [
        Column("name", "Molecule"),
        Column("n_bp", "bp"),
        *([Column("angles", "Angles"), Column("ratio", "K_3/K_1", "", "g")] if several else []),
        Column("energy", "Energy", "RT", ".4f"),
        Column("bend", "bending", "RT", ".4f"),
        Column("twist", "twisting", "RT", ".4f"),
        Column("link", "Link", "", "d"),
        Column("writhe", "Writhe", "", "+.4f"),
        Column("minima", "Minima found", "", "d"),
        Column("status", "Status"),
    ]
    cut = f" The first {SHOWN_ROWS} of {len(rows)}." if len(rows) > SHOWN_ROWS else ""
    table = Table(
        "energies",
        "Ring energies",
        columns,
        rows[:SHOWN_ROWS],
        f"Lowest ring of each molecule by the {chosen.chosen.name}.{cut}",
        summary=not context.scene.checks.against_paper and len(rows) <= 30,
        collapsed=len(rows) > 30,
    )
    return Findings(
        results,
        [table, pilot_table("energy", "Which model gives the energies", chosen, accuracy, USED)],
    )


def _control(chain: Chain, accuracy: float) -> CheckResult:
    """A chain whose bending stiffness is wrong by four times the accuracy wanted."""
    from dataclasses import replace

    from dnacheck.validation.engine.rings import lowest_ring

    truth = lowest_ring(chain).energy
    factor = 1.0 + 4.0 * accuracy
    wrong = lowest_ring(replace(chain, stiffness=factor * chain.stiffness)).energy
    return must_fail(
        judge_accuracy("wanted.energy[control]", "ring energy", abs(wrong / truth - 1.0), accuracy),
        f"all stiffnesses are {100.0 * 4.0 * accuracy:.2g} % too large",
    )


def continuum_energy(context: Context) -> Findings:
    """Ring energies of the continuum rod, on the coarsest mesh that suffices."""
    from dnacheck.equilibria.continuum import ContinuumOptions, lowest_continuum_ring
    from dnacheck.validation.engine import rings

    accuracy = context.scene.wanted.continuum_energy
    assert accuracy is not None
    variants = variants_of(context)
    options = rings.rod_options(context.scene)

    def compute(mesh: ContinuumOptions) -> Callable[[Chain], float]:
        def lowest(chain: Chain) -> float:
            return lowest_continuum_ring(rings.rod_of(chain, options), options=mesh).lowest.energy

        return lowest

    chosen = choose(
        mesh_candidates(compute, ((15, 3), (20, 4), (30, 4), (30, 6))),
        compute(ContinuumOptions(energy_tolerance=0.01 * accuracy, degree=6)),
        first_pilots(variants),
        accuracy,
    )
    results = [
        judge_accuracy(
            "wanted.continuum_energy[accuracy]", "continuum energy", chosen.error, accuracy
        )
    ]
    rows = [
        {
            "name": chain.name,
            "angles": angles,
            "ratio": ratio,
            "energy": chosen.chosen.compute(chain) * chain.energy_scale_RT,
        }
        for angles, ratio, chain in variants
    ]
    table = Table(
        "continuum-energies",
        "Continuum ring energies",
        [
            *VARIANT_COLUMNS,
            Column("energy", "Energy", "RT", ".4f"),
        ],
        rows[:SHOWN_ROWS],
        f"Lowest ring of each molecule, {chosen.chosen.name}.",
        collapsed=True,
    )
    title = "Which mesh gives the continuum energies"
    used = f"{USED}, against a reference mesh of degree 6"
    return Findings(results, [table, pilot_table("continuum", title, chosen, accuracy, used)])
