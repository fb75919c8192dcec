"""Wrong models that Table II must refuse."""

from __future__ import annotations

from typing import Any

import numpy as np

from dnacheck.validation.checks.table2.case import (
    cases,
    judge_discrete,
    judge_shape,
)
from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Findings
from dnacheck.validation.engine.verdict import must_fail


def controls(context: Context) -> Findings:
    """Table II must refuse what is wrong."""
    from dnacheck.equilibria.discrete.search import find_rings
    from dnacheck.model.chain import Chain
    from dnacheck.model.molecules import Molecule
    from dnacheck.validation.engine import rings

    case = cases(context)[0]
    chain, published = case.chain, case.published
    molecule = next(item for item in context.molecules if item.name == case.name)

    def energy(ground: Any, stiffness: Any) -> float:
        wrong = Chain(f"wrong {case.name}", ground, stiffness)
        return find_rings(wrong).lowest.energy

    mirrored = chain.ground * np.array([1.0, -1.0, 1.0])
    softer = chain.stiffness * np.array([1.0, 0.99, 0.99])[:, None]
    uniform = chain.ground.copy()
    uniform[:, 0] = 2.0 * np.pi / 10.45
    other = Molecule(molecule.sequence.reverse_complement())
    results = [
        (energy(mirrored, chain.stiffness), "the sign of the roll θ was turned"),
        (energy(chain.ground, softer), "bending is 1 % too soft"),
        (energy(uniform, chain.stiffness), "the A-tract twist was left out"),
        (rings.lowest_ring(rings.scene_chain(context.scene, other, "trifonov2", 1.5)).energy,
         "the other strand was read"),
    ]  # fmt: skip
    judged = [
        must_fail(
            judge_discrete(f"control {number}: {case.name}", value, published.discrete), fault
        )
        for number, (value, fault) in enumerate(results, start=1)
    ]
    swapped = [item for item in cases(context) if item.name != case.name]
    if swapped:
        judged.append(
            must_fail(
                judge_discrete(
                    f"control 5: {case.name}",
                    case.discrete.energy,
                    swapped[0].published.discrete,
                ),
                f"it was compared with the row of {swapped[0].name}",
            )
        )
    judged.append(
        must_fail(
            judge_shape(f"control: {case.name}", 0.0, published.rms_A),
            "a shape was compared with itself",
        )
    )
    judged.append(
        must_fail(
            judge_shape(f"control 2: {case.name}", case.rms_A, published.rms_A),
            "the continuum was filtered with width 15",
        )
    )
    return Findings(judged)
