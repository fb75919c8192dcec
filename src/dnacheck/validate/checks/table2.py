"""Table II: discrete and continuum rings of the eleven molecules against the paper."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from dnacheck.validate.context import Context
from dnacheck.validate.published import ENERGY_ROUNDING, PAPER, PublishedRing, table2
from dnacheck.validate.registry import Check, Findings, Group, Level
from dnacheck.validate.scene import Scene
from dnacheck.validate.sections import Column, Figure, Rings, Table
from dnacheck.validate.verdict import CheckResult, Rule, judge, must_fail

if TYPE_CHECKING:
    from dnacheck.model.chain import Chain
    from dnacheck.ring.continuum import ContinuumRing
    from dnacheck.ring.discrete import DiscreteRing
    from dnacheck.ring.reconstruct import Reconstruction

DISCRETE_TOLERANCE = 5e-4
CONTINUUM_TOLERANCE = 1.5e-3
LARGEST_GAP = 5e-3
RMS_TOLERANCE_A = 0.1

RMS_FILTER_WIDTH = 20
"""Filter width at which the rms column of Table II is met; the text gives 15 for the energies."""

_HELIX_2, _HELIX_1 = 2.521, -0.769
"""Sugar-phosphate helices r ± 2.521 d2 - 0.769 d1 in steps (caption of Figure 11)."""


class Case:
    """A molecule of Table II with its rings, ours and the paper's."""

    def __init__(self, context: Context, name: str) -> None:
        from dnacheck.ring.reconstruct import reconstruct, rms_difference
        from dnacheck.validate import rings

        self.name = name
        molecule = next(item for item in context.molecules if item.name == name)
        self.published: PublishedRing = table2()[name]
        self.chain: Chain = rings.scene_chain(context.scene, molecule, "trifonov2", 1.5)
        self.discrete: DiscreteRing = rings.lowest_ring(self.chain)
        self.options = rings.rod_options(context.scene)
        self.continuum: ContinuumRing = rings.lowest_continuum(self.chain, self.options)
        self.base_pairs: Reconstruction = reconstruct(self.continuum, self.chain.step_form)
        self.gap = self.continuum.energy / self.discrete.energy - 1.0
        rise = self.chain.rise_A
        self.rms_A = rms_difference(self.base_pairs.centres, self.discrete.centres, rise)
        wide = rings.lowest_continuum(
            self.chain, replace(self.options, filter_width=RMS_FILTER_WIDTH)
        )
        wide_pairs = reconstruct(wide, self.chain.step_form)
        self.wide_rms_A = rms_difference(wide_pairs.centres, self.discrete.centres, rise)


def cases(context: Context) -> list[Case]:
    """The scene's molecules that Table II lists."""
    names = [item.name for item in context.molecules if item.name in table2()]
    return [Case(context, name) for name in names]


def judge_discrete(name: str, energy: float, published: float) -> CheckResult:
    """The discrete energy against Table II."""
    return judge(
        f"table2.discrete[{name}]",
        "energy of the lowest discrete ring",
        energy,
        published,
        Rule.RELATIVE,
        f"Table II of {PAPER}, E_disc",
        "the recovered sequences reach 0.02 %, and the next best reading of the paper is off by "
        "0.5 % or more, so 0.05 % tells them apart",
        DISCRETE_TOLERANCE,
        "K_θ",
        expected_sigma=ENERGY_ROUNDING,
    )


def judge_continuum(name: str, energy: float, published: float) -> CheckResult:
    """The continuum energy against Table II."""
    return judge(
        f"table2.continuum[{name}]",
        "energy of the lowest continuum ring",
        energy,
        published,
        Rule.RELATIVE,
        f"Table II of {PAPER}, E_cont",
        "the paper leaves end alignment and the exact filter open; readings of them differ by up "
        "to 0.15 %",
        CONTINUUM_TOLERANCE,
        "K_θ",
        expected_sigma=ENERGY_ROUNDING,
    )


def judge_gap(name: str, gap: float) -> CheckResult:
    """Continuum against discrete."""
    return judge(
        f"table2.gap[{name}]",
        "relative difference of continuum and discrete energy",
        abs(gap),
        LARGEST_GAP,
        Rule.AT_MOST,
        f"Section IX of {PAPER}: within 0.5 %",
        "the paper's own claim for the continuum model",
    )


def judge_centres(name: str, rms_A: float, published: float) -> CheckResult:
    """Rms distance of base-pair centres: superposed at best, it can't exceed the published one."""
    return judge(
        f"table2.centres[{name}]",
        "rms distance of base-pair centres, continuum against discrete",
        rms_A,
        published + 0.005,
        Rule.AT_MOST,
        f"Table II of {PAPER}, last column",
        "the paper does not say how it superposed the rings, and no way of superposing is better "
        "than the best, which is ours",
        unit="Å",
    )


def judge_shape(name: str, rms_A: float, published: float) -> CheckResult:
    """Rms distance of the two shapes against Table II."""
    return judge(
        f"table2.shape[{name}]",
        "rms distance of base-pair centres, continuum of filter width 20 against discrete",
        rms_A,
        published,
        Rule.ABSOLUTE,
        f"Table II of {PAPER}, last column",
        "two decimals are printed, and 0.1 Å is a sixth of the value; at the text's filter width "
        "of 15 the centres are 0.15 to 0.19 Å closer than printed, at 20 all agree to 0.03 Å and "
        "the energies no worse, so the column belongs to a wider filter",
        RMS_TOLERANCE_A,
        "Å",
        expected_sigma=0.005 / 3.0**0.5,
    )


def discrete(context: Context) -> Findings:
    """Discrete energies."""
    return Findings(
        [
            judge_discrete(case.name, case.discrete.energy, case.published.discrete)
            for case in cases(context)
        ]
    )


def continuum(context: Context) -> Findings:
    """Continuum energies."""
    return Findings(
        [
            judge_continuum(case.name, case.continuum.energy, case.published.continuum)
            for case in cases(context)
        ]
    )


def gap(context: Context) -> Findings:
    """Both models beside each other: the table itself."""
    found = cases(context)
    rows = [_row(case) for case in found]
    columns = [
        Column("number", "No."),
        Column("name", "Molecule"),
        Column("n_bp", "bp"),
        Column("discrete_paper", "paper", "", ".5f", "", "Discrete energy"),
        Column("discrete", "ours", "", ".5f", "discrete_verdict", "Discrete energy"),
        Column("discrete_off", "off by", "%", "+.3f", "", "Discrete energy"),
        Column("continuum_paper", "paper", "", ".5f", "", "Continuum energy"),
        Column("continuum", "ours", "", ".5f", "continuum_verdict", "Continuum energy"),
        Column("continuum_off", "off by", "%", "+.3f", "", "Continuum energy"),
        Column("gap_paper", "paper", "%", ".2f", "", "Continuum − discrete"),
        Column("gap", "ours", "%", "+.2f", "gap_verdict", "Continuum − discrete"),
        Column("rms_paper", "paper", "Å", ".2f", "", "rms distance"),
        Column("rms", "w = 20", "Å", ".2f", "shape_verdict", "rms distance"),
        Column("rms_centres", "w = 15", "Å", ".2f", "centres_verdict", "rms distance"),
    ]
    table = Table(
        "table2",
        "Table II: lowest rings of the paper's molecules",
        columns,
        rows,
        "Reduced energies (K_θ = K_φ = 1, K_τ = 1.5), Trifonov II angles. The paper prints the "
        "absolute value of the difference; ours keeps its sign. Rms distances of base-pair centres "
        "after optimal superposition: with the text's filter width w = 15 they are 0.15 to 0.19 Å "
        "smaller than printed; with w = 20 they agree, and the energies still do.",
        "Table II",
        summary=True,
    )
    results = [judge_gap(case.name, case.gap) for case in found]
    return Findings(results, [table, _details(found, context)])


def _row(case: Case) -> dict[str, Any]:
    ring, rod, paper = case.discrete, case.continuum, case.published
    return {
        "number": paper.number,
        "name": case.name,
        "n_bp": case.chain.n_steps,
        "discrete_paper": paper.discrete,
        "discrete": ring.energy,
        "discrete_off": 100.0 * (ring.energy / paper.discrete - 1.0),
        "discrete_verdict": judge_discrete(case.name, ring.energy, paper.discrete).verdict.value,
        "continuum_paper": paper.continuum,
        "continuum": rod.energy,
        "continuum_off": 100.0 * (rod.energy / paper.continuum - 1.0),
        "continuum_verdict": judge_continuum(case.name, rod.energy, paper.continuum).verdict.value,
        "gap_paper": paper.gap_percent,
        "gap": 100.0 * case.gap,
        "gap_verdict": judge_gap(case.name, case.gap).verdict.value,
        "rms_paper": paper.rms_A,
        "rms": case.wide_rms_A,
        "shape_verdict": judge_shape(case.name, case.wide_rms_A, paper.rms_A).verdict.value,
        "rms_centres": case.rms_A,
        "centres_verdict": judge_centres(case.name, case.rms_A, paper.rms_A).verdict.value,
    }


def _details(found: list[Case], context: Context) -> Table:
    from dnacheck.ring.continuum import lowest_continuum_ring
    from dnacheck.ring.search import find_rings
    from dnacheck.validate import rings

    rows = []
    for case in found:
        began = time.perf_counter()
        search = find_rings(case.chain)
        discrete_s = time.perf_counter() - began
        began = time.perf_counter()
        rod = rings.rod_of(case.chain, case.options)
        lowest_continuum_ring(rod)
        rows.append(
            {
                "name": case.name,
                "energy_RT": case.discrete.energy_RT,
                "bend_RT": case.discrete.bend_RT,
                "twist_RT": case.discrete.twist_RT,
                "link": case.discrete.link,
                "writhe": case.discrete.writhe,
                "softest": case.discrete.smallest_eigenvalue * case.chain.energy_scale_RT,
                "minima": len(search.equilibria),
                "iterations": case.discrete.iterations,
                "residual": case.discrete.residual,
                "continuum_RT": case.continuum.energy_RT,
                "continuum_error": case.continuum.energy_error,
                "continuum_residual": case.continuum.residual,
                "discrete_ms": 1e3 * discrete_s,
                "continuum_ms": 1e3 * (time.perf_counter() - began),
            }
        )
    columns = [
        Column("name", "Molecule"),
        Column("energy_RT", "energy", "RT", ".3f", "", "Discrete ring"),
        Column("bend_RT", "bending", "RT", ".3f", "", "Discrete ring"),
        Column("twist_RT", "twisting", "RT", ".3f", "", "Discrete ring"),
        Column("link", "link", "", "d", "", "Discrete ring"),
        Column("writhe", "writhe", "", "+.4f", "", "Discrete ring"),
        Column("softest", "softest mode", "RT/rad²", ".2f", "", "Discrete ring"),
        Column("minima", "minima found", "", "d", "", "Discrete ring"),
        Column("iterations", "iterations", "", "d", "", "Discrete ring"),
        Column("residual", "residual", "", ".0e", "", "Discrete ring"),
        Column("discrete_ms", "search", "ms", ".1f", "", "Discrete ring"),
        Column("continuum_RT", "energy", "RT", ".3f", "", "Continuum ring"),
        Column("continuum_error", "mesh error", "K_θ", ".0e", "", "Continuum ring"),
        Column("continuum_residual", "residual", "", ".0e", "", "Continuum ring"),
        Column("continuum_ms", "search", "ms", ".1f", "", "Continuum ring"),
    ]
    return Table(
        "rings",
        "The rings in detail",
        columns,
        rows,
        "Every ring is the lowest of a search over links and registers; times are for the whole "
        "search on one core, compiled code warm.",
        collapsed=True,
    )


def shape(context: Context) -> Findings:
    """Shapes superimposed, as in Figure 11."""
    found = cases(context)
    results = [
        judged
        for case in found
        for judged in (
            judge_shape(case.name, case.wide_rms_A, case.published.rms_A),
            judge_centres(case.name, case.rms_A, case.published.rms_A),
        )
    ]
    first = next((case for case in found if case.name == "12A09"), found[0])
    figure = Figure(
        "figure11",
        f"{first.name}: discrete and continuum ring superimposed",
        "superimposed_rings",
        {"name": first.name, "rms_A": first.rms_A, **_overlay(first, decimals=3)},
        "Sugar–phosphate helices r ± 2.521 d2 − 0.769 d1 (in steps): discrete as beads, continuum "
        "as lines, after optimal superposition; seen along the smallest and the largest principal "
        "axis.",
        "Figure 11",
        width=4.6,
        height=4.4,
        summary=True,
    )
    shown = [{"name": case.name, "curves": _curves(case)} for case in found]
    turn = Rings(
        "rings3d",
        "Rings to turn",
        shown,
        "Discrete (beads) and continuum (lines) equilibria superimposed; lengths in Å.",
        "Figure 11",
    )
    return Findings(results, [figure, turn])


def _overlay(case: Case, decimals: int) -> dict[str, Any]:
    """Centres and helices of both rings in Å in the discrete ring's principal axes."""
    rise = case.chain.rise_A
    n = case.chain.n_steps
    fixed = case.discrete.centres[:n]
    centre = fixed.mean(axis=0)
    axes = np.linalg.svd(fixed - centre)[2]
    axes *= np.sign(np.linalg.det(axes))
    moving = case.base_pairs.centres[:n]
    u, _, vt = np.linalg.svd((moving - moving.mean(axis=0)).T @ (fixed - centre))
    turn = (u * np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])) @ vt
    onto = turn @ axes.T
    rings = {
        "discrete": _helices(case.discrete.centres - centre, case.discrete.frames, axes.T),
        "continuum": _helices(
            case.base_pairs.centres - moving.mean(axis=0), case.base_pairs.frames, onto
        ),
    }
    return {
        model: {part: np.round(rise * points, decimals).tolist() for part, points in parts.items()}
        for model, parts in rings.items()
    }


def _helices(centres: Any, frames: Any, rotation: Any) -> dict[str, Any]:
    d1, d2 = frames[..., 0], frames[..., 1]
    return {
        "axis": centres @ rotation,
        "strand1": (centres + _HELIX_2 * d2 + _HELIX_1 * d1) @ rotation,
        "strand2": (centres - _HELIX_2 * d2 + _HELIX_1 * d1) @ rotation,
    }


def _curves(case: Case) -> list[dict[str, Any]]:
    overlay = _overlay(case, decimals=1)
    return [
        {
            "label": f"{model}, {part}",
            "model": model,
            "style": {"discrete": "beads", "continuum": "line"}[model],
            "part": part,
            "points": overlay[model][part],
        }
        for model in ("discrete", "continuum")
        for part in ("axis", "strand1", "strand2")
    ]


def controls(context: Context) -> Findings:
    """Table II must refuse what is wrong."""
    from dnacheck.model.chain import Chain
    from dnacheck.model.molecules import Molecule
    from dnacheck.ring.search import find_rings
    from dnacheck.validate import rings

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


def _applies(scene: Scene) -> str | None:
    if not scene.checks.against_paper:
        return "the scene does not ask for the paper's values"
    return None


_BOTH = ("energy", "continuum_energy")

GROUP = Group(
    "table2",
    "Rings against the paper",
    "The eleven molecules of Kahn and Crothers: letters to discrete and continuum rings.",
    (
        Check("table2.discrete", "discrete energies of Table II", discrete, 1.0, ("energy",),
              Level.QUICK, _applies),
        Check("table2.continuum", "continuum energies of Table II", continuum, 1.0,
              ("continuum_energy",), Level.QUICK, _applies),
        Check("table2.gap", "continuum against discrete, side by side", gap, 1.5, _BOTH,
              Level.QUICK, _applies),
        Check("table2.shape", "shapes superimposed (Figure 11)", shape, 1.0,
              (*_BOTH, "shape_A"), Level.QUICK, _applies),
        Check("table2.controls", "wrong models must be refused", controls, 1.0, ("energy",),
              Level.QUICK, _applies),
    ),
)  # fmt: skip
