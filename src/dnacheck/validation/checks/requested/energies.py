"""Ring energies of the chain, and of the rod on the coarsest mesh that is accurate enough."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.pilots import (
    USED,
    VARIANT_COLUMNS,
    choose,
    first_pilots,
    judge_accuracy,
    mesh_candidates,
    pilot_table,
    variants_of,
    warm_seconds,
)
from dnacheck.validation.engine.registry import Findings
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge, must_fail
from dnacheck.validation.report.record import Column, Table

if TYPE_CHECKING:
    from dnacheck.equilibria.continuum import ContinuumOptions
    from dnacheck.equilibria.ring import Equilibrium
    from dnacheck.model.chain import Chain

SHOWN_ROWS = 500
LARGEST_RESIDUAL = 1e-9
_FORM = {
    "wedge": "Steps are the paper's wedges: read from its other strand a molecule of one's own may "
    "differ by a few per cent.",
    "midstep": "Steps are in the midstep form, the same from either strand but for the ends of "
    "A-tract regions.",
    "rigid": "Steps have six parameters, the same from either strand.",
}
"""What the form of the steps means for a molecule of one's own."""


def energy(context: Context) -> Findings:
    """Ring energies of the wedge chain."""
    from dnacheck.validation.engine import rings

    accuracy = context.scene.wanted.energy
    assert accuracy is not None
    variants = variants_of(context)
    rows, unsolved = [], []
    worst, uncertainty = 0.0, 0.0
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
            uncertainty = max(uncertainty, _energy_uncertainty(ring))
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
        _accuracy("wanted.energy[accuracy]", uncertainty, accuracy),
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
    form = _FORM[variants[0][2].step_form]
    table = Table(
        "energies",
        "Ring energies",
        columns,
        rows[:SHOWN_ROWS],
        f"Lowest ring of each molecule, of the discrete chain. {form}{cut}",
        summary=not context.scene.checks.against_paper and len(rows) <= 30,
        collapsed=len(rows) > 30,
    )
    return Findings(results, [table, _two_models(context, variants, accuracy)])


def _energy_uncertainty(ring: Equilibrium) -> float:
    """By how much a ring's energy may be off, relative, from what its equations leave.

    To first order an open end of d costs multipliers . d; a slope left costs less than itself
    times a step of one radian.
    """
    forces = float(np.abs(ring.steps.multipliers).sum())
    return (forces * ring.steps.closure + ring.residual) / abs(ring.energy)


def _accuracy(name: str, error: float, accuracy: float) -> CheckResult:
    return judge(
        name,
        "largest relative error of a ring energy that its equations' residuals leave room for",
        error,
        accuracy,
        Rule.AT_MOST,
        "the multipliers times the gap that is left, and the slope that is left",
        "asked for by the scene",
    )


def _two_models(
    context: Context, variants: Sequence[tuple[str, float, Chain]], accuracy: float
) -> Table:
    """What the continuum rod would give for the chain's energies, and in what time."""
    from dnacheck.equilibria.continuum import lowest_continuum_ring
    from dnacheck.equilibria.discrete.search import find_rings
    from dnacheck.model.rod import build_rod
    from dnacheck.validation.engine import rings

    options = rings.rod_options(context.scene)

    def by_chain(chain: Chain) -> float:
        return find_rings(chain).lowest.energy

    def by_rod(chain: Chain) -> float:
        return lowest_continuum_ring(build_rod(chain, options)).lowest.energy

    used = first_pilots(variants)
    gap = max(abs(by_rod(chain) / by_chain(chain) - 1.0) for chain in used)
    return Table(
        "pilot-energy",
        "The chain beside the rod",
        [
            Column("model", "Model"),
            Column("error", "largest difference from the chain", "", ".1e"),
            Column("ms", "time per molecule", "ms", ".1f"),
            Column("decision", "Role"),
        ],
        [
            {"model": "discrete chain", "ms": 1e3 * warm_seconds(by_chain, used),
             "decision": "what is asked for; always used"},
            {"model": "continuum rod", "error": gap, "ms": 1e3 * warm_seconds(by_rod, used),
             "decision": "would do" if gap <= accuracy else "not near enough"},
        ],
        f"Wanted: {accuracy:g}. Measured on {USED}. Times: one core, compiled code warm, best of "
        "three.",
    )  # fmt: skip


def _control(chain: Chain, accuracy: float) -> CheckResult:
    """A chain whose bending stiffness is wrong by four times the accuracy wanted."""
    from dataclasses import replace

    from dnacheck.validation.engine.rings import lowest_ring

    truth = lowest_ring(chain).energy
    factor = 1.0 + 4.0 * accuracy
    wrong = lowest_ring(replace(chain, stiffness=factor * chain.stiffness)).energy
    return must_fail(
        _accuracy("wanted.energy[control]", abs(wrong / truth - 1.0), accuracy),
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
