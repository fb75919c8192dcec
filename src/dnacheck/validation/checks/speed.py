"""Speed against error: what a ring's energy costs, to which accuracy, by which solver."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Check, Findings, Group, Level
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge, must_fail
from dnacheck.validation.reference.oracles import load_oracle, oracle_exists
from dnacheck.validation.report.record import Column, Figure, Note, Table

if TYPE_CHECKING:
    from dnacheck.equilibria.ring import Equilibrium
    from dnacheck.model.chain import Chain
    from dnacheck.model.rod import Rod

FINER = 10.0
"""A reference is at least so many times finer than what it judges."""
ROUNDING = 1e-15
_PREFERRED = "11T15"
_REPEATS = 5
_SLOW_S = 0.1
"""Work slower than this is timed once, after it has run."""
_DEGREES = (3, 4, 6)
_INTERVALS = (10, 15, 20, 30, 45, 60, 90)
_ADAPTED = (1e-4, 1e-6, 1e-8, 1e-10)
_BVP = {Level.DEFAULT: (1e-2, 1e-4, 1e-6), Level.FULL: (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)}
_NEWTON = (1e-2, 1e-4, 1e-8)
_AUTO_INTERVALS = {Level.DEFAULT: (20, 50), Level.FULL: (10, 20, 50, 100)}
_AUTO_BEFORE = 0.1
"""AUTO follows the ring through so many radians of end twist up to the ring itself."""
_AUTO_DIGITS = 1e-10
"""AUTO prints its table to so many digits."""


@dataclass
class Line:
    """A solver: its settings, the error of each and its time."""

    label: str
    points: list[str] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    def add(self, point: str, error: float, seconds: float, floor: float) -> None:
        """Keep a point whose error the reference can tell."""
        if error >= floor:
            self.points.append(point)
            self.errors.append(error)
            self.seconds.append(seconds)


def timed(compute: Callable[[], float]) -> tuple[float, float]:
    """A value and the processor time of getting it: warm, best of a few."""
    value = compute()
    best = float("inf")
    for _ in range(_REPEATS):
        began = time.process_time()
        value = compute()
        best = min(best, time.process_time() - began)
        if best > _SLOW_S:
            break
    return value, best


def departure(energy: float, reference: float) -> float:
    """Relative error of an energy."""
    return abs(energy / reference - 1.0)


def ring_energy(context: Context) -> Findings:
    """Continuum and discrete energies against references ten times finer."""
    from dnacheck.validation.engine import rings

    known = {molecule.name: molecule for molecule in context.molecules}
    molecule = known.get(_PREFERRED, context.molecules[0])
    chain = rings.scene_chain(context.scene, molecule)
    level = context.level if context.level in _BVP else Level.DEFAULT
    rod = rings.rod_of(chain, rings.rod_options(context.scene))
    continuum, doubt = continuum_reference(rod)
    floor = FINER * max(doubt, ROUNDING)
    lines = [*collocation_lines(rod, continuum, floor)]
    adapted = adapted_line(rod, continuum, floor)
    lines.append(adapted)
    notes = []
    if oracle_exists("scipy_bvp"):
        lines.append(bvp_line(rod, continuum, floor, _BVP[level]))
    else:
        notes.append("solve_bvp: the checkout's validation/oracles is not at hand.")
    auto = auto_line(rod, continuum, floor, _AUTO_INTERVALS[level])
    if isinstance(auto, str):
        notes.append(auto)
    else:
        lines.append(auto)
    newton, newton_doubt = newton_line(chain)
    lines.append(newton)
    smallest = min(error for line in lines[:-1] for error in line.errors)
    results = [
        _finer("continuum", doubt, smallest),
        _finer("discrete", newton_doubt, min(newton.errors)),
        must_fail(
            _finer("control", _coarse_doubt(rod, continuum), smallest),
            "a mesh of 20 intervals of degree 4 was the reference",
        ),
        *_promises(rod, continuum),
    ]
    return Findings(results, _blocks(chain, lines, notes))


def continuum_reference(rod: Rod) -> tuple[Equilibrium, float]:
    """The finest continuum ring, and how far another fine mesh of another degree is from it."""
    from dnacheck.equilibria.continuum import (
        ContinuumOptions,
        lowest_continuum_ring,
        solve_continuum_ring,
    )

    link = lowest_continuum_ring(rod).lowest.link
    finest = ContinuumOptions(energy_tolerance=1e-14, degree=8, tolerance=1e-12)
    other = ContinuumOptions(intervals=200, degree=7, adapt=False, tolerance=1e-12)
    ring = solve_continuum_ring(rod, link, options=finest)
    doubt = departure(solve_continuum_ring(rod, link, options=other).energy, ring.energy)
    return ring, max(doubt, ROUNDING)


def _coarse_doubt(rod: Rod, reference: Equilibrium) -> float:
    from dnacheck.equilibria.continuum import ContinuumOptions, solve_continuum_ring

    coarse = ContinuumOptions(intervals=20, degree=4, adapt=False)
    ring = solve_continuum_ring(rod, reference.link, options=coarse)
    return departure(ring.energy, reference.energy)


def collocation_lines(rod: Rod, reference: Equilibrium, floor: float) -> list[Line]:
    """Our collocation on uniform meshes, one line per degree."""
    from dnacheck.equilibria.continuum import ContinuumOptions, solve_continuum_ring

    lines = []
    for degree in _DEGREES:
        line = Line(f"collocation, degree {degree}")
        for intervals in _INTERVALS:
            mesh = ContinuumOptions(
                intervals=intervals, degree=degree, adapt=False, tolerance=1e-12
            )

            def compute(mesh: ContinuumOptions = mesh) -> float:
                return solve_continuum_ring(rod, reference.link, options=mesh).energy

            energy, seconds = timed(compute)
            line.add(str(intervals), departure(energy, reference.energy), seconds, floor)
        lines.append(line)
    return lines


def adapted_line(rod: Rod, reference: Equilibrium, floor: float) -> Line:
    """Our collocation with adapted mesh and error estimate."""
    from dnacheck.equilibria.continuum import ContinuumOptions, solve_continuum_ring

    line = Line("collocation, adapted")
    for tolerance in _ADAPTED:
        options = ContinuumOptions(energy_tolerance=tolerance)

        def compute(options: ContinuumOptions = options) -> float:
            return solve_continuum_ring(rod, reference.link, options=options).energy

        energy, seconds = timed(compute)
        line.add(f"{tolerance:.0e}", departure(energy, reference.energy), seconds, floor)
    return line


def bvp_line(rod: Rod, reference: Equilibrium, floor: float, tolerances: Sequence[float]) -> Line:
    """scipy.integrate.solve_bvp on the paper's fourteen variables."""
    solve = load_oracle("scipy_bvp").solve
    line = Line("solve_bvp (scipy)")
    for tolerance in tolerances:

        def compute(tolerance: float = tolerance) -> float:
            return float(solve(rod, reference.link, tol=tolerance).energy)

        energy, seconds = timed(compute)
        line.add(f"{tolerance:.0e}", departure(energy, reference.energy), seconds, floor)
    return line


def auto_line(
    rod: Rod, reference: Equilibrium, floor: float, intervals: Sequence[int]
) -> Line | str:
    """AUTO-07p, time per solution of its branch; or why there is none."""
    if not oracle_exists("auto07p"):
        return "AUTO-07p: the checkout's validation/oracles is not at hand."
    auto = load_oracle("auto07p")
    if not auto.installed():
        return "AUTO-07p: not installed."
    from dnacheck.equilibria.continuation.branch import ring_from
    from dnacheck.equilibria.continuation.parameters import end_twist
    from dnacheck.equilibria.continuum.collocation import discretise

    before = reference.curve.alpha - _AUTO_BEFORE
    disc = discretise(rod, reference.curve.mesh, reference.curve.degree)
    start = ring_from(disc, end_twist(), before, reference.curve.loads, reference.curve.slopes)
    line = Line("AUTO-07p, degree 4")
    for count in intervals:
        grid = np.linspace(0.0, 1.0, 4 * count + 1)
        branch = auto.follow_twist(
            rod, before, start.curve.solution(grid), points=20, intervals=count, energy=True,
            first_step=_AUTO_BEFORE / 4.0, longest_step=_AUTO_BEFORE / 4.0, tolerance=1e-10,
            most=reference.curve.alpha,
        )  # fmt: skip
        if abs(branch.alpha[-1] - reference.curve.alpha) > 1e-7:
            return f"AUTO-07p: its branch ended at {branch.alpha[-1]:.6f}."
        error = departure(float(branch.energy[-1]), reference.energy)
        line.add(str(count), error, branch.seconds_per_point, max(floor, FINER * _AUTO_DIGITS))
    return line


def newton_line(chain: Chain) -> tuple[Line, float]:
    """The whole discrete search over Newton's tolerance, and its reference's own error."""
    from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
    from dnacheck.equilibria.discrete.solve import NewtonOptions
    from dnacheck.model.chain import Chain as AnyChain

    def energy(of: Chain, tolerance: float) -> float:
        options = SearchOptions(newton=NewtonOptions(tolerance=tolerance))
        return find_rings(of, options).lowest.energy

    shift = chain.n_steps // 4
    rolled = AnyChain(
        "cut elsewhere",
        np.roll(chain.ground, -shift, axis=0),
        np.roll(chain.stiffness, -shift, axis=0),
        step_form=chain.step_form,
    )
    reference = energy(chain, 1e-13)
    doubt = max(departure(energy(rolled, 1e-13), reference), ROUNDING)
    line = Line("discrete chain, Newton")
    for tolerance in _NEWTON:
        value, seconds = timed(lambda tolerance=tolerance: energy(chain, tolerance))  # type: ignore[misc]
        line.add(f"{tolerance:.0e}", departure(value, reference), seconds, FINER * doubt)
    return line, doubt


def _finer(item: str, doubt: float, smallest: float) -> CheckResult:
    return judge(
        f"speed.ring_energy[{item} reference]",
        f"{FINER:g} times the reference's own relative error",
        FINER * doubt,
        smallest,
        Rule.AT_MOST,
        "the smallest error that the reference is used to judge",
        "a reference must be at least ten times finer; errors it can't tell are not shown",
    )


def _promises(rod: Rod, reference: Equilibrium) -> list[CheckResult]:
    """Adapted meshes keep the tolerance that they were given."""
    from dnacheck.equilibria.continuum import ContinuumOptions, solve_continuum_ring

    results = []
    for tolerance in _ADAPTED:
        options = ContinuumOptions(energy_tolerance=tolerance)
        ring = solve_continuum_ring(rod, reference.link, options=options)
        results.append(
            judge(
                f"speed.ring_energy[adapted to {tolerance:.0e}]",
                "relative error of the continuum energy on an adapted mesh",
                departure(ring.energy, reference.energy),
                tolerance,
                Rule.AT_MOST,
                "the tolerance that was asked for",
                "the error estimate must not promise too much",
            )
        )
    return results


def _blocks(chain: Chain, lines: Sequence[Line], notes: Sequence[str]) -> list[Any]:
    title = f"{chain.name}: time against error of the ring energy"
    figure = Figure(
        "speed-energy",
        title,
        "work_precision",
        {
            "up": "relative error of the energy",
            "lines": [
                {
                    "label": line.label,
                    "seconds": line.seconds,
                    "errors": line.errors,
                    "points": line.points,
                }
                for line in lines
            ],
        },
        "Processor time of one energy, compiled code warm. Numbers: mesh intervals, or the "
        "tolerance asked for. Collocation, solve_bvp and AUTO-07p solve the same continuum rod "
        "(AUTO: time per solution of a branch, on uniform meshes; the others' meshes hold the "
        "knots of the rod's spline); the discrete chain has its own reference and "
        "its time is that of the search over links and registers.",
        width=6.6,
        height=4.6,
    )
    rows = [
        {"solver": line.label, "setting": point, "error": error, "ms": 1e3 * seconds}
        for line in lines
        for point, error, seconds in zip(line.points, line.errors, line.seconds, strict=True)
    ]
    table = Table(
        "speed-energy-table",
        title,
        [
            Column("solver", "Solver"),
            Column("setting", "intervals or tolerance"),
            Column("error", "relative error", "", ".1e"),
            Column("ms", "time", "ms", ".2f"),
        ],
        rows,
        collapsed=True,
    )
    said = [Note("speed-energy-note", "Not shown: " + " ".join(notes))] if notes else []
    return [figure, table, *said]


GROUP = Group(
    "speed",
    "Speed against error",
    "What an accuracy costs, each error measured against a reference at least ten times finer.",
    (
        Check("speed.ring_energy", "ring energy by every solver", ring_energy, 9.0,
              ("energy", "continuum_energy"),
              applies=lambda scene: None
              if scene.checks.compare_methods or scene.checks.against_paper
              else "the scene does not ask to compare methods ([checks])"),
    ),
)  # fmt: skip
