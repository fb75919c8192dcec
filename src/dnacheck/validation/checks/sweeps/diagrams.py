"""Bifurcation diagrams in the end twist (Figures 6 to 9)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Findings
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge, must_fail
from dnacheck.validation.reference.published import PAPER
from dnacheck.validation.report.record import Column, Figure, Table

if TYPE_CHECKING:
    from dnacheck.model.chain import Chain

_SHOWN_POINTS = 400
"""Points kept of a branch for its drawing."""


def chain_of(context: Context, name: str, angles: str | None = None) -> Chain:
    from dnacheck.validation.engine.rings import scene_chain

    known = {molecule.name: molecule for molecule in context.molecules}
    return scene_chain(context.scene, known.get(name, context.molecules[0]), angles)


def _thinned(component: Mapping[str, Any]) -> dict[str, Any]:
    """A component with what its drawing needs."""
    branches = []
    for branch in component["branches"]:
        stride = max(1, len(branch["energy"]) // _SHOWN_POINTS)
        branches.append(
            {
                **{
                    key: np.asarray(branch[key])[::stride]
                    for key in ("alpha", "energy", "end_moment", "negative_directions")
                },
                "special": branch["special"],
            }
        )
    return {"branches": branches}


def perfect(context: Context) -> Findings:
    """The perfect diagram against closed forms."""
    from dnacheck.equilibria.continuation.figures import figure_6

    n, ratio = 158, 1.5
    component = figure_6(n, ratio)
    circle = component["branches"][0]
    scale = chain_of(context, "11T15").energy_scale_RT
    bend, twist = scale / n, ratio * scale / n

    def energy_check(name: str, k3: float) -> CheckResult:
        exact = 0.5 * bend * (2.0 * np.pi) ** 2 + 0.5 * k3 * np.asarray(circle["value"]) ** 2
        worst = float(np.max(np.abs(np.asarray(circle["energy"]) / exact - 1.0)))
        return judge(
            f"sweeps.perfect[{name}]",
            "largest relative error of the twisted circle's energy along the branch",
            worst,
            1e-10,
            Rule.AT_MOST,
            "½K_1(2π)² + ½K_3α²",
            "exact; the branch is solved to a residual of 1e-10",
        )

    results = [
        energy_check("energy", twist),
        must_fail(energy_check("control", 1.0001 * twist), "K_3 is 1e-4 too large in the formula"),
    ]
    found = [abs(point["value"]) for point in circle["special"] if point["kind"] == "branch point"]
    for mode in (2, 3, 4):
        exact = 2.0 * math.pi * math.sqrt(mode**2 - 1) / ratio
        nearest = min(found, key=lambda value: abs(value - exact), default=math.inf)
        results.append(
            judge(
                f"sweeps.perfect[branch point {mode}]",
                f"end twist at which mode {mode} branches off",
                nearest,
                exact,
                Rule.ABSOLUTE,
                "α = 2π√(n²−1) K_1/K_3",
                "exact; branch points are located to this",
                1e-6,
                "rad",
            )
        )
    figure = Figure(
        "figure6",
        "Perfect diagram: rings of a straight uniform rod with the stiffnesses of 11T15",
        "diagram",
        _thinned(component),
        "Energy against end moment and against end twist. Squares: branch points. The register of "
        "the ring is free and held fixed.",
        "Figure 6",
        width=4.8,
        height=3.8,
    )
    return Findings(results, [figure])


def imperfect(context: Context) -> Findings:
    """The diagram of 11T15 and its two cyclized solutions."""
    from dnacheck.equilibria.bridge.reconstruct import reconstruct
    from dnacheck.equilibria.continuation.diagram import lowest_component
    from dnacheck.equilibria.continuation.figures import component_data, marked_rings, ring_shape
    from dnacheck.equilibria.discrete.solve import NewtonOptions, solve_ring
    from dnacheck.validation.engine import rings

    chain = chain_of(context, "11T15")
    options = rings.rod_options(context.scene)
    component = lowest_component(rings.rod_of(chain, options))
    marks = marked_rings(component)
    lowest = rings.lowest_continuum(chain, options)
    results = [
        judge(
            f"sweeps.imperfect[{chain.name} count]",
            "solutions on the component whose d_1 closes",
            len(marks),
            2,
            Rule.EQUAL,
            f"Figure 7 of {PAPER}: two circles",
            "a count",
        ),
        judge(
            f"sweeps.imperfect[{chain.name} lowest]",
            "lowest marked solution against the search over links and registers",
            marks[0].energy,
            lowest.energy,
            Rule.RELATIVE,
            "the search, another way to the same ring",
            "both meshes are converged to 1e-6",
            1e-5,
            "K_θ",
        ),
    ]
    rows = []
    figures = []
    for number, ring in enumerate(marks, start=1):
        start = reconstruct(ring, chain.step_form)
        discrete = solve_ring(chain, start.angles, NewtonOptions(minima_only=False))
        gap = ring.energy / discrete.energy - 1.0
        rows.append(
            {
                "number": number,
                "energy": ring.energy_RT,
                "link": ring.link,
                "writhe": ring.writhe,
                "moment": ring.curve.end_moment * chain.energy_scale_RT,
                "discrete": discrete.energy_RT,
                "gap": 100.0 * gap,
                "continuum_stable": ring.stable,
                "discrete_stable": discrete.stable,
            }
        )
        results += [
            judge(
                f"sweeps.imperfect[{chain.name} ring {number}]",
                "marked continuum ring against the discrete equilibrium it reconstructs to",
                ring.energy,
                discrete.energy,
                Rule.RELATIVE,
                "discrete chain, Newton from the reconstructed shape",
                f"Section IX of {PAPER}: within 0.5 %",
                5e-3,
                "K_θ",
            ),
            judge(
                f"sweeps.imperfect[{chain.name} ring {number} inertia]",
                "stability of the marked ring",
                ring.stable,
                discrete.stable,
                Rule.EQUAL,
                "inertia of the discrete projected Hessian",
                "both models must agree on what is a minimum",
            ),
        ]
        figures.append(
            Figure(
                f"figure{7 + number}" if number < 3 else f"marked{number}",
                f"{chain.name}: marked ring {number}, link {ring.link}",
                "ribbons",
                {
                    key: value
                    for key, value in ring_shape(ring, points=240).items()
                    if key in ("centreline", "true_ribbon", "natural_ribbon")
                },
                "Tube: centreline; ribbon: d_1, which tracks the strands (left), and the natural "
                "frame's D1, which need not close (right).",
                f"Figure {7 + number}" if number < 3 else "",
                width=3.6,
                height=2.6,
            )
        )
    diagram = Figure(
        "figure7",
        f"{chain.name}: the component that descends from the lowest circle",
        "diagram",
        _thinned(component_data(component)),
        "Heavy: stable. Circles: solutions whose base-pair frames close, the cyclized molecules.",
        "Figure 7",
        width=4.8,
        height=3.8,
    )
    table = Table(
        "marked",
        f"{chain.name}: the marked rings",
        [
            Column("number", "No.", "", "d"),
            Column("energy", "continuum", "RT", ".4f"),
            Column("discrete", "discrete", "RT", ".4f"),
            Column("gap", "difference", "%", "+.2f"),
            Column("link", "link", "", "d"),
            Column("writhe", "writhe", "", "+.3f"),
            Column("moment", "end moment", "RT", "+.3f"),
            Column("continuum_stable", "continuum stable"),
            Column("discrete_stable", "discrete stable"),
        ],
        rows,
    )
    return Findings(results, [diagram, table, *figures])
