"""How far the discrete and the continuum ring are apart, on the coarsest mesh that suffices."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

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
)
from dnacheck.validation.engine.registry import Findings
from dnacheck.validation.report.record import Column, Table

if TYPE_CHECKING:
    from dnacheck.equilibria.continuum import ContinuumOptions
    from dnacheck.model.chain import Chain

SHOWN_ROWS = 500


def shape(context: Context) -> Findings:
    """Rms distance of base-pair centres of the two models, superposed at best."""
    from dnacheck.equilibria.bridge.reconstruct import reconstruct, rms_difference
    from dnacheck.equilibria.continuum import ContinuumOptions, lowest_continuum_ring
    from dnacheck.validation.engine import rings

    accuracy = context.scene.wanted.shape_A
    assert accuracy is not None
    variants = variants_of(context)
    options = rings.rod_options(context.scene)

    def compute(mesh: ContinuumOptions) -> Callable[[Chain], float]:
        def distance(chain: Chain) -> float:
            ring = lowest_continuum_ring(rings.rod_of(chain, options), options=mesh).lowest
            pairs = reconstruct(ring, chain.step_form)
            return rms_difference(pairs.centres, rings.lowest_ring(chain).centres, chain.rise_A)

        return distance

    chosen = choose(
        mesh_candidates(compute, ((15, 3), (20, 4), (30, 6))),
        compute(ContinuumOptions(energy_tolerance=1e-10, degree=6)),
        first_pilots(variants),
        accuracy,
        relative=False,
    )
    rows = [
        {
            "name": chain.name,
            "angles": angles,
            "ratio": ratio,
            "rms": chosen.chosen.compute(chain),
        }
        for angles, ratio, chain in variants
    ]
    table = Table(
        "shapes",
        "Distance between the discrete and the continuum ring",
        [
            *VARIANT_COLUMNS,
            Column("rms", "rms distance", "Å", ".2f"),
        ],
        rows[:SHOWN_ROWS],
        f"Base-pair centres after optimal superposition; {chosen.chosen.name}.",
        collapsed=True,
    )
    title = "Which mesh gives the shapes"
    used = f"{USED}, against a mesh adapted to 1e-10"
    return Findings(
        [judge_accuracy("wanted.shape_A[accuracy]", "distance", chosen.error, accuracy, "Å")],
        [table, pilot_table("shapes", title, chosen, accuracy, used)],
    )
