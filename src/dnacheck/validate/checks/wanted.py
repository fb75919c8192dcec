"""What the scene asked for, by the cheapest model that a pilot shows to be accurate enough."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dnacheck.validate.context import Context
from dnacheck.validate.registry import Check, Findings, Group, Level
from dnacheck.validate.sections import Column, Table
from dnacheck.validate.verdict import CheckResult, Rule, judge, must_fail

if TYPE_CHECKING:
    from dnacheck.model.chain import Chain
    from dnacheck.ring.continuum import ContinuumOptions

SHOWN_ROWS = 500
LARGEST_RESIDUAL = 1e-9
_PILOTS = 3


@dataclass(frozen=True)
class Candidate:
    """A way to a quantity; candidates are listed from the cheapest to the dearest."""

    name: str
    compute: Callable[[Chain], float]


@dataclass(frozen=True)
class Choice:
    """The candidate that a pilot selected, with what the pilot measured."""

    chosen: Candidate
    error: float
    rows: Sequence[dict[str, Any]]


def pilots(chains: Sequence[Chain]) -> list[Chain]:
    """The shortest, the median and the longest molecule."""
    ordered = sorted(chains, key=lambda chain: (chain.n_steps, chain.name))
    picks = {0, len(ordered) // 2, len(ordered) - 1}
    return [ordered[index] for index in sorted(picks)][:_PILOTS]


def choose(
    candidates: Sequence[Candidate],
    reference: Callable[[Chain], float],
    chains: Sequence[Chain],
    accuracy: float,
    relative: bool = True,
) -> Choice:
    """The first candidate whose largest error on the pilots is within the accuracy.

    Every candidate up to it is measured, and the next one, so that the report can show what the
    dearer model would have cost. Where none suffices the last is taken. The decision rests on
    errors and on the fixed order, not on measured times, so it is the same on every machine.
    """
    exact = [reference(chain) for chain in chains]
    rows: list[dict[str, Any]] = []
    chosen: Candidate | None = None
    error = float("inf")
    after = False
    for index, candidate in enumerate(candidates):
        if after:
            rows.append({"model": candidate.name, "decision": "left out: dearer, not needed"})
            continue
        candidate.compute(chains[0])  # compiles, so that the time is that of warm code
        began = time.perf_counter()
        values = [candidate.compute(chain) for chain in chains]
        seconds = (time.perf_counter() - began) / len(chains)
        errors = [
            abs(value - truth) / (abs(truth) if relative else 1.0)
            for value, truth in zip(values, exact, strict=True)
        ]
        worst = max(errors)
        row = {"model": candidate.name, "error": worst, "ms": 1e3 * seconds}
        if chosen is not None:
            row["decision"] = "left out: dearer, not needed"
            after = True
        elif worst <= accuracy or index == len(candidates) - 1:
            chosen, error = candidate, worst
            row["decision"] = "chosen"
        else:
            row["decision"] = "left out: not accurate enough"
        rows.append(row)
    assert chosen is not None
    return Choice(chosen, error, rows)


def _pilot_table(name: str, title: str, choice: Choice, accuracy: float, used: str) -> Table:
    return Table(
        f"pilot-{name}",
        title,
        [
            Column("model", "Model"),
            Column("error", "largest error measured", "", ".1e"),
            Column("ms", "time per molecule", "ms", ".1f"),
            Column("decision", "Decision"),
        ],
        choice.rows,
        f"Wanted: {accuracy:g}. Measured on {used}; candidates from the cheapest to the dearest.",
    )


def _accuracy(name: str, quantity: str, error: float, accuracy: float) -> CheckResult:
    return judge(
        f"{name}[accuracy]",
        f"error of the {quantity} measured on the pilot molecules",
        error,
        accuracy,
        Rule.AT_MOST,
        "the scene's wish; the reference is at least ten times finer",
        "asked for by the scene",
    )


def _variants(context: Context) -> list[tuple[str, float, Chain]]:
    """Every molecule with every angle set and twist ratio of the scene."""
    from dnacheck.validate.rings import scene_chain

    model = context.scene.model
    return [
        (angles, ratio, scene_chain(context.scene, molecule, angles, ratio))
        for angles in model.angles
        for ratio in model.twist_ratios
        for molecule in context.molecules
    ]


def energy(context: Context) -> Findings:
    """Ring energies of the wedge chain."""
    from dnacheck.ring.discrete import NewtonOptions
    from dnacheck.ring.search import SearchOptions, find_rings
    from dnacheck.validate import rings

    accuracy = context.scene.wanted.energy
    assert accuracy is not None
    variants = _variants(context)
    options = rings.rod_options(context.scene)
    fine = SearchOptions(newton=NewtonOptions(tolerance=1e-12))
    ratio = variants[0][1]
    chosen = choose(
        [
            Candidate("discrete chain", lambda chain: find_rings(chain).lowest.energy),
            Candidate("continuum rod", lambda chain: rings.lowest_continuum(chain, options).energy),
        ],
        lambda chain: find_rings(chain, fine).lowest.energy,
        pilots([chain for _, at, chain in variants if at == ratio]),
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
        _accuracy("wanted.energy", "ring energy", chosen.error, accuracy),
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
    used = "the shortest, median and longest molecule"
    return Findings(
        results,
        [table, _pilot_table("energy", "Which model gives the energies", chosen, accuracy, used)],
    )


def _control(chain: Chain, accuracy: float) -> CheckResult:
    """A chain whose bending stiffness is wrong by four times the accuracy wanted."""
    from dataclasses import replace

    from dnacheck.validate.rings import lowest_ring

    truth = lowest_ring(chain).energy
    factor = 1.0 + 4.0 * accuracy
    wrong = lowest_ring(replace(chain, stiffness=factor * chain.stiffness)).energy
    return must_fail(
        _accuracy("wanted.energy[control]", "ring energy", abs(wrong / truth - 1.0), accuracy),
        f"all stiffnesses are {100.0 * 4.0 * accuracy:.2g} % too large",
    )


def _mesh(intervals: int, degree: int) -> ContinuumOptions:
    from dnacheck.ring.continuum import ContinuumOptions

    return ContinuumOptions(intervals=intervals, degree=degree, adapt=False)


def continuum_energy(context: Context) -> Findings:
    """Ring energies of the continuum rod, on the coarsest mesh that suffices."""
    from dnacheck.ring.continuum import ContinuumOptions, lowest_continuum_ring
    from dnacheck.validate import rings

    accuracy = context.scene.wanted.continuum_energy
    assert accuracy is not None
    variants = _variants(context)
    options = rings.rod_options(context.scene)

    def compute(mesh: ContinuumOptions) -> Callable[[Chain], float]:
        def lowest(chain: Chain) -> float:
            return lowest_continuum_ring(rings.rod_of(chain, options), options=mesh).lowest.energy

        return lowest

    candidates = [
        Candidate(f"{k} intervals of degree {m}", compute(_mesh(k, m)))
        for k, m in ((15, 3), (20, 4), (30, 4), (30, 6))
    ]
    candidates.append(
        Candidate("mesh adapted to 1e-8", compute(ContinuumOptions(energy_tolerance=1e-8)))
    )
    chosen = choose(
        candidates,
        compute(ContinuumOptions(energy_tolerance=0.01 * accuracy, degree=6)),
        pilots([chain for _, at, chain in variants if at == variants[0][1]]),
        accuracy,
    )
    results = [_accuracy("wanted.continuum_energy", "continuum energy", chosen.error, accuracy)]
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
            Column("name", "Molecule"),
            Column("angles", "Angles"),
            Column("ratio", "K_3/K_1", "", "g"),
            Column("energy", "Energy", "RT", ".4f"),
        ],
        rows[:SHOWN_ROWS],
        f"Lowest ring of each molecule, {chosen.chosen.name}.",
        collapsed=True,
    )
    title = "Which mesh gives the continuum energies"
    used = "the shortest, median and longest molecule against a reference mesh of degree 6"
    return Findings(results, [table, _pilot_table("continuum", title, chosen, accuracy, used)])


GROUP = Group(
    "wanted",
    "What the scene asked for",
    "Each quantity by the cheapest model that a pilot run shows to be accurate enough.",
    (
        Check("wanted.energy", "ring energies by the cheapest model", energy, 2.0, ("energy",),
              Level.QUICK),
        Check("wanted.continuum_energy", "continuum energies on the coarsest mesh that suffices",
              continuum_energy, 3.0, ("continuum_energy",), Level.QUICK),
    ),
)  # fmt: skip
