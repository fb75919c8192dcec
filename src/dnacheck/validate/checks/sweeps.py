"""Following rings: bifurcation diagrams, sweeps of the twist ratio, robustness."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dnacheck.validate.context import Context
from dnacheck.validate.published import PAPER
from dnacheck.validate.registry import Check, Findings, Group
from dnacheck.validate.scene import Scene
from dnacheck.validate.sections import Column, Figure, Table
from dnacheck.validate.verdict import CheckResult, Rule, judge, must_fail

if TYPE_CHECKING:
    from dnacheck.model.chain import Chain

_MODULE = "dnacheck.ring.continuation.figures"
ANGLE_SETS = ("trifonov", "desantis", "trifonov2")
_FIGURE_OF = {"trifonov": "Figure 12", "desantis": "Figure 13", "trifonov2": "Figure 14"}
_TITLES = {"trifonov": "Trifonov", "desantis": "De Santis", "trifonov2": "Trifonov II"}
_SHOWN_POINTS = 400
"""Points kept of a branch for its drawing."""


def _chain(context: Context, name: str, angles: str | None = None) -> Chain:
    from dnacheck.validate.rings import scene_chain

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
    from dnacheck.ring.continuation.figures import figure_6

    n, ratio = 158, 1.5
    component = figure_6(n, ratio)
    circle = component["branches"][0]
    scale = _chain(context, "11T15").energy_scale_RT
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
    from dnacheck.ring.continuation.diagram import lowest_component
    from dnacheck.ring.continuation.figures import component_data, marked_rings, ring_shape
    from dnacheck.ring.discrete import NewtonOptions, solve_ring
    from dnacheck.ring.reconstruct import reconstruct
    from dnacheck.validate import rings

    chain = _chain(context, "11T15")
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
                "moment": ring.end_moment * chain.energy_scale_RT,
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


def ratios(context: Context) -> Findings:
    """Energies over the twist ratio for three angle sets."""
    from dnacheck.ring.continuation.figures import sweeps
    from dnacheck.validate import rings
    from dnacheck.validate.rings import scene_chain

    options = rings.rod_options(context.scene)
    results: list[CheckResult] = []
    figures: list[Figure] = []
    rows = []
    for angles in ANGLE_SETS:
        chains = [scene_chain(context.scene, m, angles) for m in context.molecules]
        data = sweeps(chains, rod_options=options)
        worst_residual, worst_gap, missing = 0.0, 0.0, 0
        for chain, pair in zip(chains, data, strict=True):
            continuum, discrete = pair["continuum"], pair["discrete"]
            for sweep in (continuum, discrete):
                finite = np.isfinite(sweep["energy"])
                missing += int(np.count_nonzero(~finite))
                worst_residual = max(worst_residual, float(np.max(sweep["residual"][finite])))
            gap = np.max(np.abs(continuum["energy"] / discrete["energy"] - 1.0))
            worst_gap = max(worst_gap, float(gap))
            alone = rings.lowest_ring(chain).energy_RT
            at = int(np.argmin(np.abs(discrete["ratios"] - (chain.twist_ratio or 1.5))))
            rows.append(
                {
                    "angles": _TITLES[angles],
                    "name": chain.name,
                    "low": continuum["energy"][0],
                    "high": continuum["energy"][-1],
                    "twist_low": continuum["twist"][0],
                    "twist_high": continuum["twist"][-1],
                    "gap": 100.0 * float(gap),
                    "crossings": len(discrete["crossings"]),
                    "links": ", ".join(map(str, sorted({int(x) for x in discrete["link"]}))),
                    "search": abs(float(discrete["energy"][at]) / alone - 1.0),
                }
            )
        results += _sweep_results(angles, missing, worst_residual, worst_gap)
        lines = [
            {key: line[key] for key in ("name", "model", "ratios", "energy", "bend", "twist")}
            | {"crossings": line["crossings"]}
            for pair in data
            for line in (pair["continuum"], pair["discrete"])
        ]
        figures.append(
            Figure(
                f"sweep-{angles}",
                f"{_TITLES[angles]} angles: ring energy against K_3/K_1",
                "sweep_energy",
                {"lines": lines},
                "Lines: continuum; dots: discrete; crosses: where another minimum becomes the "
                "lowest.",
                _FIGURE_OF[angles],
                width=6.6,
                height=4.4,
            )
        )
        if angles == "trifonov2":
            figures.append(
                Figure(
                    "sweep-parts",
                    "Trifonov II angles: bending and twisting energy against K_3/K_1",
                    "sweep_parts",
                    {"lines": lines},
                    "Lines: continuum; dots: discrete.",
                    "Figures 15 and 16",
                    width=5.0,
                    height=4.0,
                )
            )
    worst_search = max(row["search"] for row in rows)
    results.append(
        judge(
            "sweeps.ratios[search]",
            "largest relative difference between a swept energy and the full search there",
            worst_search,
            1e-9,
            Rule.AT_MOST,
            "the search over links and registers at the scene's ratio",
            "both are converged to 1e-10",
        )
    )
    table = Table(
        "sweeps",
        "Sweeps of the twist ratio",
        [
            Column("angles", "Angles"),
            Column("name", "Molecule"),
            Column("low", "0.5", "RT", ".3f", "", "Energy at K_3/K_1 ="),
            Column("high", "1.5", "RT", ".3f", "", "Energy at K_3/K_1 ="),
            Column("twist_low", "0.5", "RT", ".3f", "", "Twisting energy at K_3/K_1 ="),
            Column("twist_high", "1.5", "RT", ".3f", "", "Twisting energy at K_3/K_1 ="),
            Column("gap", "largest gap to discrete", "%", ".2f"),
            Column("crossings", "crossings", "", "d"),
            Column("links", "links"),
        ],
        rows,
        collapsed=True,
    )
    return Findings(results, [*figures, table])


def _sweep_results(
    angles: str, missing: int, worst_residual: float, worst_gap: float
) -> list[CheckResult]:
    return [
        judge(
            f"sweeps.ratios[{angles} complete]",
            "points without a ring, both models",
            missing,
            0,
            Rule.EQUAL,
            "every ratio has a lowest ring",
            "a count",
        ),
        judge(
            f"sweeps.ratios[{angles} residual]",
            "largest residual of any point",
            worst_residual,
            1e-9,
            Rule.AT_MOST,
            "equations (4.6) and (4.9)",
            "ten times the solvers' tolerance",
        ),
        judge(
            f"sweeps.ratios[{angles} gap]",
            "largest relative difference of continuum and discrete energy at any ratio",
            worst_gap,
            0.01,
            Rule.AT_MOST,
            f"Section IX of {PAPER} finds 0.5 % for Trifonov II at 1.5",
            "twice the paper's figure, for angle sets whose bends are up to 1.64 times as large",
        ),
    ]


def robustness(context: Context) -> Findings:
    """Energies over the choices of filter and fit."""
    from dnacheck.ring.continuation.figures import robustness as figure_10

    chain = _chain(context, "08T15")
    data = figure_10(chain)
    bounds = (
        ("spread_fit", "spread over (k, m) from (12, 5) up at w = 15", 0.05),
        ("spread_width", "spread over w from 10 to 25 at (k, m) = (20, 6)", 0.05),
        ("farthest", "largest distance of any choice from (w, k, m) = (15, 20, 6)", 0.15),
    )
    results = [
        judge(
            f"sweeps.robustness[{key}]",
            f"{chain.name}: {words}",
            data[key],
            bound,
            Rule.AT_MOST,
            f"Figure 10 of {PAPER}",
            "what the paper reads off its figure"
            if bound < 0.1
            else "0.1 RT in the text, (10, 4) and w = 5 beyond it",
            unit="RT",
        )
        for key, words, bound in bounds
    ]
    figure = Figure(
        "figure10",
        f"{chain.name}: energy for different filters and fits",
        "robustness",
        {
            "ratios": data["ratios"],
            "by_fit": {f"{k}, {m}": curve for (k, m), curve in data["by_fit"].items()},
            "by_width": {str(w): curve for w, curve in data["by_width"].items()},
        },
        "Left: w = 15 and (k, m) varied; right: (k, m) = (20, 6) and w varied."
        + "".join(f" Refused: {label} ({why})." for label, why in data["refused"].items()),
        "Figure 10",
        width=4.8,
        height=3.8,
    )
    return Findings(results, [figure])


def _applies(scene: Scene) -> str | None:
    if not scene.checks.against_paper:
        return "the scene does not ask for the paper's figures"
    return None


_BOTH = ("energy", "continuum_energy")

GROUP = Group(
    "sweeps",
    "Diagrams and sweeps",
    "Solutions followed in the end twist and in the twist ratio (Sections VII, VIII and X).",
    (
        Check("sweeps.perfect", "perfect diagram (Figure 6)", perfect, 8.0, _BOTH,
              applies=_applies, requires=(_MODULE,)),
        Check("sweeps.imperfect", "imperfect diagram (Figures 7, 8 and 9)", imperfect, 1.0, _BOTH,
              applies=_applies, requires=(_MODULE,)),
        Check("sweeps.ratios", "sweeps of K3/K1 (Figures 12 to 16)", ratios, 5.0, _BOTH,
              applies=_applies, requires=(_MODULE,)),
        Check("sweeps.robustness", "filters and fits (Figure 10)", robustness, 2.0, _BOTH,
              applies=_applies, requires=(_MODULE,)),
    ),
)  # fmt: skip
