"""Mean elastic energy of the ring at temperature.

Let ln J(c) be that of the chain with all stiffnesses times c. Both partition functions in J are
integrals of exp(-cE), so that the closed chain's mean energy is that of the open one less
d ln J / dc at c = 1. The open chain's is 3N/2 RT: its energy is quadratic in 3N independent angles.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.pilots import (
    USED,
    VARIANT_COLUMNS,
    Candidate,
    choose,
    first_pilots,
    judge_accuracy,
    pilot_table,
    variants_of,
)
from dnacheck.validation.engine.registry import Findings
from dnacheck.validation.engine.verdict import Rule, judge, must_fail
from dnacheck.validation.report.record import Column, Table

if TYPE_CHECKING:
    from dnacheck.model.chain import Chain

STIFFENING = 0.05
"""Half the difference in c; the differences' own error is about its square, in RT."""
SHOWN_ROWS = 500
_LN_J_TOLERANCE = 0.01
_FINEST_LN_J = 0.003


def equipartition(chain: Chain) -> float:
    """Lowest ring's energy and half an RT for each of its 3N - 6 ways to move, in RT."""
    from dnacheck.equilibria.discrete.search import find_rings

    return find_rings(chain).lowest.energy_RT + 0.5 * (3 * chain.n_steps - 6)


def sampled(chain: Chain, tolerance: float, seed: int) -> tuple[float, float]:
    """Mean energy from J factors at two stiffnesses, and its error, in RT.

    Parameters
    ----------
    tolerance : float
        Error of each ln J.
    """
    from dnacheck.cyclization.closure.sampling import ClosureOptions, sample_closure

    options = ClosureOptions(tolerance=tolerance)
    stiff, soft = (
        sample_closure(
            replace(chain, stiffness=c * chain.stiffness, twist_ratio=None), options, seed=seed
        )
        for c in (1.0 + STIFFENING, 1.0 - STIFFENING)
    )
    slope = (soft.minus_lnJ - stiff.minus_lnJ) / (2.0 * STIFFENING)
    error = math.hypot(stiff.total_error, soft.total_error) / (2.0 * STIFFENING)
    return 1.5 * chain.n_steps - slope, error


def thermal_energy(context: Context) -> Findings:
    """Equipartition where it is enough, else the derivative of ln J."""
    accuracy = context.scene.wanted.thermal_energy
    assert accuracy is not None
    variants = variants_of(context)
    used = first_pilots(variants)
    tolerance = max(0.1 * accuracy * used[0].n_steps * STIFFENING, _FINEST_LN_J)
    reference = {
        id(chain): sampled(chain, min(tolerance, _LN_J_TOLERANCE), context.seed + index)
        for index, chain in enumerate(used)
    }
    chosen = choose(
        [
            Candidate("equipartition", equipartition),
            Candidate(
                "derivative of ln J",
                lambda chain: sampled(chain, _LN_J_TOLERANCE, context.seed + 7)[0],
            ),
        ],
        lambda chain: reference[id(chain)][0],
        used,
        accuracy,
    )
    widest = max(error / mean for mean, error in reference.values())
    first = used[0]
    mean, error = reference[id(first)]
    results = [
        judge_accuracy("wanted.thermal_energy[accuracy]", "mean energy", chosen.error, accuracy),
        judge(
            "wanted.thermal_energy[reference]",
            "largest relative error of the reference",
            widest,
            0.25 * accuracy,
            Rule.AT_MOST,
            "errors of ln J at the two stiffnesses",
            "small against the scene's wish",
        ),
        must_fail(
            judge(
                f"wanted.thermal_energy[control: {first.name}]",
                "mean elastic energy of the closed chain",
                lowest_energy(first),
                mean,
                Rule.RELATIVE,
                "derivative of ln J by the stiffness",
                "asked for by the scene",
                accuracy,
                "RT",
                expected_sigma=error,
            ),
            "the thermal motion was left out",
        ),
    ]
    rows = []
    for angles, ratio, chain in variants:
        value = chosen.chosen.compute(chain)
        rows.append(
            {
                "name": chain.name,
                "angles": angles,
                "ratio": ratio,
                "lowest": lowest_energy(chain),
                "mean": value,
                "sampled": reference[id(chain)][0] if id(chain) in reference else None,
                "error": reference[id(chain)][1] if id(chain) in reference else None,
            }
        )
    table = Table(
        "thermal",
        "Mean elastic energies of the rings at temperature",
        [
            *VARIANT_COLUMNS,
            Column("lowest", "at rest", "RT", ".2f"),
            Column("mean", "mean", "RT", ".2f"),
            Column("sampled", "pilot", "RT", ".2f", "", "From the derivative of ln J"),
            Column("error", "±", "RT", ".2f", "", "From the derivative of ln J"),
        ],
        rows[:SHOWN_ROWS],
        f"By {chosen.chosen.name}.",
        collapsed=True,
    )
    title = "Which model gives the mean energies"
    words = f"{USED}, against the derivative of ln J by the stiffness"
    return Findings(results, [table, pilot_table("thermal", title, chosen, accuracy, words)])


def lowest_energy(chain: Chain) -> float:
    """Energy of the lowest ring in RT."""
    from dnacheck.validation.engine.rings import lowest_ring

    return lowest_ring(chain).energy_RT
