"""The continuum: from chain to rod, and whether its boundary-value problem is solved."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Check, Findings, Group, Level
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge, must_fail
from dnacheck.validation.reference.oracles import load_oracle, oracle_exists
from dnacheck.validation.reference.published import PAPER
from dnacheck.validation.report.record import Column, Figure, Table
from dnacheck.validation.scene.scene import Scene

EQUATIONS_TOLERANCE = 1e-12
ORACLE_TOLERANCE = 1e-7
MESH_TOLERANCE = 1e-3
FRAME_TOLERANCE = 1e-10

_BENT = 80
"""Base pairs shown of Figure 5: those up to the end of the A-tracts."""
_MESHES = tuple((k, m) for k in (15, 20, 30, 45, 60) for m in (4, 5, 6))


def equations(context: Context) -> Findings:
    """The closed-form twisted circle in the equations that are solved."""
    del context
    right = _departure(printed=False)
    wrong = _departure(printed=True)

    def judged(name: str, departure: float) -> CheckResult:
        return judge(
            f"continuum.equations[{name}]",
            "largest departure of the twisted circle (4.12) from (4.9), relative",
            departure,
            EQUATIONS_TOLERANCE,
            Rule.AT_MOST,
            f"closed-form solution (4.12) of {PAPER}, misprints corrected",
            "a closed form in double precision; derivatives by complex steps are exact",
        )

    as_printed = must_fail(judged("control", wrong), "mu(s) was taken as printed")
    return Findings([judged("circle", right), as_printed])


def _departure(printed: bool) -> float:
    """Largest |y' - rates(y)| over the largest rate, for alpha = 2.3 and K3/K1 = 1.5."""
    from dnacheck.equilibria.continuum.equations import rates

    alpha, bend, twist = 2.3, 1.0 / 158.0, 1.5 / 158.0
    s = np.linspace(0.0, 1.0, 101)
    step = 1e-30
    derivative = _circle(s + 1j * step, alpha, bend, twist, printed).imag / step
    state = _circle(s, alpha, bend, twist, printed)
    stiffness = np.broadcast_to([bend, bend, twist], (s.size, 3))
    right = rates(state, np.zeros((s.size, 3)), stiffness)
    return float(np.max(np.abs(derivative - right)) / np.max(np.abs(right)))


def _circle(s: Any, alpha: float, k1: float, k3: float, printed: bool) -> Any:
    """(4.12) for real or complex s, shape (m, 14): corrected, or mu as printed."""
    sp, cp = np.sin(np.pi * s), np.cos(np.pi * s)
    sa, ca = np.sin(alpha * s / 2), np.cos(alpha * s / 2)
    by_twist = (np.sin(alpha * s), np.cos(alpha * s)) if printed else (sp, cp)
    bend, twist = 4 * np.pi * k1, 2 * alpha * k3
    fourth = sa if printed else ca
    zero = 0 * s
    return np.stack(
        [
            zero,
            (np.cos(2 * np.pi * s) - 1) / (2 * np.pi),
            np.sin(2 * np.pi * s) / (2 * np.pi),
            sp * ca,
            -sp * sa,
            cp * sa,
            cp * ca,
            2 * np.pi * k3 * alpha + zero,
            zero,
            zero,
            bend * cp * ca - twist * by_twist[0] * sa,
            -bend * cp * sa - twist * by_twist[0] * ca,
            -bend * sp * sa + twist * by_twist[1] * ca,
            -bend * sp * fourth - twist * by_twist[1] * sa,
        ],
        axis=-1,
    )


def other_solver(context: Context) -> Findings:
    """The same rod by an independent solver.

    Both start from one register, and where the register is nearly free one may end in the minimum
    and the other in the saddle; ours is therefore the equilibrium of that link nearest to theirs.
    """
    from dnacheck.equilibria.continuum import (
        ContinuumOptions,
        lowest_continuum_ring,
        solve_continuum_ring,
    )
    from dnacheck.validation.engine import rings

    solve = load_oracle("scipy_bvp").solve
    options = rings.rod_options(context.scene)
    chosen = context.molecules if context.level is Level.FULL else context.molecules[:1]

    def judged(name: str, got: float, expected: float) -> CheckResult:
        return judge(
            f"continuum.other_solver[{name}]",
            "continuum energy against scipy.integrate.solve_bvp",
            got,
            expected,
            Rule.RELATIVE,
            "solve_bvp at tol 1e-8 in the paper's fourteen variables",
            "ten times the oracle's own residual",
            ORACLE_TOLERANCE,
            "K_θ",
        )

    results, rows = [], []
    for molecule in chosen:
        rod = rings.rod_of(rings.scene_chain(context.scene, molecule), options)
        chain = rings.scene_chain(context.scene, molecule)
        link = rings.lowest_continuum(chain, options).link
        fine = ContinuumOptions(energy_tolerance=1e-10, degree=6)
        began = time.perf_counter()
        solve_continuum_ring(rod, link, options=fine)
        ours_s = time.perf_counter() - began
        began = time.perf_counter()
        theirs = solve(rod, link, tol=1e-8)
        theirs_s = time.perf_counter() - began
        target = theirs.energy
        found = lowest_continuum_ring(rod, link, fine, registers=2).equilibria
        ours = min(found, key=lambda ring: abs(ring.energy - target))
        rows.append(
            {
                "name": molecule.name,
                "ours": ours.energy,
                "theirs": theirs.energy,
                "difference": ours.energy / theirs.energy - 1.0,
                "nodes": theirs.nodes,
                "ours_ms": 1e3 * ours_s,
                "theirs_ms": 1e3 * theirs_s,
            }
        )
        results.append(judged(molecule.name, ours.energy, theirs.energy))
    softer = lowest_continuum_ring(_softer(rod), link, fine, registers=2).equilibria
    wrong = min(softer, key=lambda ring: abs(ring.energy - theirs.energy))
    results.append(
        must_fail(judged(molecule.name, wrong.energy, theirs.energy), "K_3 is 1e-4 too small")
    )
    table = Table(
        "other-solver",
        "The same rod by two solvers",
        [
            Column("name", "Molecule"),
            Column("ours", "collocation", "K_θ", ".9f"),
            Column("theirs", "solve_bvp", "K_θ", ".9f"),
            Column("difference", "difference", "", "+.1e"),
            Column("nodes", "its nodes", "", "d"),
            Column("ours_ms", "our time", "ms", ".1f"),
            Column("theirs_ms", "its time", "ms", ".0f"),
        ],
        rows,
        "Both at an energy error near 1e-8 or below; ours includes the refined second mesh that "
        "its error estimate needs.",
    )
    return Findings(results, [table])


def _softer(rod: Any) -> Any:
    from dataclasses import replace

    return replace(rod, twist_stiffness=rod.twist_stiffness * (1.0 - 1e-4))


def mesh(context: Context) -> Findings:
    """Energies over the meshes of Section VIII."""
    from dnacheck.equilibria.continuum import ContinuumOptions, lowest_continuum_ring
    from dnacheck.validation.engine import rings

    options = rings.rod_options(context.scene)
    results, rows = [], []
    for molecule in context.molecules:
        chain = rings.scene_chain(context.scene, molecule)
        rod = rings.rod_of(chain, options)
        reference = rings.lowest_continuum(chain, options)
        errors = {}
        for k, m in _MESHES:
            choice = ContinuumOptions(intervals=k, degree=m, adapt=False)
            ring = lowest_continuum_ring(rod, reference.link, choice, registers=2).lowest
            errors[k, m] = abs(ring.energy / reference.energy - 1.0)
        worst = max(errors.values())
        rows.append(
            {
                "name": molecule.name,
                **{f"k{k}m{m}": error for (k, m), error in errors.items() if m in (4, 6)},
                "worst": worst,
            }
        )
        results.append(
            judge(
                f"continuum.mesh[{molecule.name}]",
                "largest relative change of the energy over 15 to 60 intervals, degrees 4 to 6",
                worst,
                MESH_TOLERANCE,
                Rule.AT_MOST,
                f"Section VIII of {PAPER}: at most 0.1 %",
                "the paper's own figure",
            )
        )
    columns = [Column(f"k{k}m{m}", f"{k} × {m}", "", ".0e") for k, m in _MESHES if m in (4, 6)]
    table = Table(
        "mesh",
        "Energy against the mesh",
        [Column("name", "Molecule"), *columns, Column("worst", "worst of all", "", ".0e")],
        rows,
        "Relative departure of the energy from the converged one; intervals × degree.",
        "Section VIII",
        collapsed=True,
    )
    return Findings(results, [table])


def rods(context: Context) -> Findings:
    """How good the rods are."""
    from dnacheck.validation.engine import rings

    options = rings.rod_options(context.scene)
    rows, results = [], []
    for molecule in context.molecules:
        rod = rings.rod_of(rings.scene_chain(context.scene, molecule), options)
        rows.append(
            {
                "name": molecule.name,
                "length": rod.length_steps / rod.n_steps,
                "fit": rod.fit_rms * rod.rise_A,
                "condition": rod.fit_condition,
                "orthogonality": rod.frame_orthogonality,
                "residual": rod.frame_residual,
                "projection": np.degrees(rod.projection),
                "turns": rod.relaxed_turns,
            }
        )
        results.append(
            judge(
                f"continuum.rods[{molecule.name}]",
                "departure of the natural frame from orthonormality",
                rod.frame_orthogonality,
                FRAME_TOLERANCE,
                Rule.AT_MOST,
                f"Section VI D of {PAPER}: normalisation and perpendicularity of D_1 are monitored",
                "thousands of times below the energy's error",
            )
        )
    table = Table(
        "rods",
        "The fitted rods",
        [
            Column("name", "Molecule"),
            Column("length", "length over N", "", ".5f"),
            Column("fit", "rms of fit", "Å", ".4f"),
            Column("condition", "condition of fit", "", ".1e"),
            Column("orthogonality", "frame, orthogonality", "", ".0e"),
            Column("residual", "frame, equation", "", ".0e"),
            Column("projection", "largest projection", "degrees", ".2f"),
            Column("turns", "relaxed turns", "", ".3f"),
        ],
        rows,
        collapsed=True,
    )
    return Findings(results, [table, *_figures(context)])


def _figures(context: Context) -> list[Figure]:
    """Figures 4 and 5: the centreline, and what the filter does to it."""
    from dnacheck.model.chain import chain_frames
    from dnacheck.model.rod.filtering import double_filter, padded_steps, smooth
    from dnacheck.validation.engine import rings

    def centreline(name: str) -> Any:
        known = {item.name: item for item in context.molecules}
        chain = rings.scene_chain(context.scene, known.get(name, context.molecules[0]))
        return chain, chain_frames(chain.ground, chain.step_form)[0]

    chain, points = centreline("08A17")
    centred = points - points.mean(axis=0)
    along = np.linalg.svd(centred)[2]
    part = points[:48] - points[:48].mean(axis=0)
    end_on = part @ np.linalg.svd(part)[2].T
    figure4 = Figure(
        "figure4",
        f"{chain.name}: the centreline of the wedge chain, far and near",
        "centreline_scales",
        {"side": (chain.rise_A * centred @ along.T)[:, :2], "end": chain.rise_A * end_on[:, 1:]},
        "Left: the unstressed molecule from the side, the first 47 base pairs heavy. Right: these "
        "47 seen along their axis. The short-scale structure is irregular, the long-scale one is "
        "not.",
        "Figure 4",
        width=4.6,
        height=3.4,
    )
    chain, _ = centreline("08T15")
    options = rings.rod_options(context.scene)
    steps = padded_steps(chain.n_steps, options.padding)
    padded = chain_frames(chain.ground[steps], chain.step_form)[0]
    inner = slice(options.padding, options.padding + chain.n_steps + 1)
    raw = padded[inner]
    axes = np.linalg.svd(raw - raw.mean(axis=0))[2]

    def seen(curve: Any) -> Any:
        return chain.rise_A * ((curve[inner] - raw.mean(axis=0)) @ axes.T)[: _BENT + 1, :2]

    figure5 = Figure(
        "figure5",
        f"{chain.name}: filtering once straightens, filtering twice does not",
        "filters",
        {
            "raw": seen(padded),
            "once": seen(smooth(padded, options.filter_width)),
            "twice": seen(double_filter(padded, options.filter_width)),
            "width": options.filter_width,
        },
        "Dots: base-pair centres of the unstressed chain; lines: after the filter. The vertical "
        "scale is stretched. Shown is the first half, which holds the A-tract bend.",
        "Figure 5",
        width=4.8,
        height=3.2,
    )
    return [figure4, figure5]


def _no_oracle(scene: Scene) -> str | None:
    del scene
    if not oracle_exists("scipy_bvp"):
        return "validation/oracles is not at hand: this is not a checkout"
    return None


_NEEDS = ("continuum_energy",)

GROUP = Group(
    "continuum",
    "Continuum rod",
    "From wedge chain to rod (Sections V to VII), and whether (4.9) with (4.11) is solved.",
    (
        Check("continuum.equations", "closed-form solution (4.12)", equations, 0.1, _NEEDS,
              Level.QUICK),
        Check("continuum.rods", "quality of the fitted rods (Figures 4 and 5)", rods, 1.0, _NEEDS),
        Check("continuum.mesh", "energies over meshes (Section VIII)", mesh, 4.0, _NEEDS),
        Check("continuum.other_solver", "same rod by solve_bvp", other_solver, 6.0, _NEEDS,
              applies=_no_oracle),
    ),
)  # fmt: skip
