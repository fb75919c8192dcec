"""Rings of rigid base-pair steps: another program's energies, and the molecules by Olson's set."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from dnacheck.numerics.outcome import SolveError
from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Check, Findings, Group, Level
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge, must_fail
from dnacheck.validation.reference.published import RIGID_RINGS_SOURCE, rigid_rings, table3
from dnacheck.validation.report.record import Block, Column, Figure, Table

if TYPE_CHECKING:
    from dnacheck.cyclization.result import JFactor
    from dnacheck.equilibria.ring import Equilibria, Equilibrium
    from dnacheck.model.chain import Chain
    from dnacheck.model.parameters import ParameterSet
    from dnacheck.validation.reference.published import PublishedRigidRing

SET = "olson1998"
_OUTSIDE_kT = 5e-5
_UNREVERSED = ("CT", "GT", "TC", "TG")
"""The steps that a widely used file of the set has from their complements, not reversed."""
_STRANDS = 1e-9
_WITNESSED = 2
_EVERY_STEP = "AACAGATCCGCTGGTT"
"""Read as a ring it has each of the 16 steps once."""
_SHAPES = 5
_SPREAD = np.array([0.15, 0.1, 0.1, 0.2, 0.2, 0.2])
"""Standard deviations of random shapes about the ground shape: radians, multiples of the rise."""
_BEADS = 1e-10
_SIGMAS = 3.0
_EXPERIMENT_RT = 0.7
"""Error of the experimental free energies (Section X)."""
_SETS = {"olson": "Olson 1998, rigid steps", "trifonov": "Trifonov II, wedges"}


def outside(context: Context) -> Findings:
    """Every minimum that an independent program printed, with its energy."""
    published = rigid_rings()
    rows: list[dict[str, Any]] = []
    results: list[CheckResult] = []
    lowest_excess = -math.inf
    for number, ring in enumerate(published, start=1):
        found = _search(ring.letters, SET)
        result = _against(f"ring {number}, {len(ring.letters)} bp", found, ring)
        results.append(result)
        lowest_excess = max(lowest_excess, found.lowest.energy_RT - ring.energy_kT)
        nearest = _nearest(found, ring)
        rows.append(
            {
                "number": number,
                "n_bp": len(ring.letters),
                "link": ring.link,
                "outside": ring.energy_kT,
                "ours": nearest.energy_RT if nearest else None,
                "difference": nearest.energy_RT - ring.energy_kT if nearest else None,
                "residual": nearest.residual if nearest else None,
                "lowest": found.lowest.energy_RT,
                "verdict": result.verdict.value,
            }
        )
    results.append(
        judge(
            "rigid.outside[lowest]",
            "lowest minimum found less the printed one, the largest of all rings",
            lowest_excess,
            _OUTSIDE_kT,
            Rule.AT_MOST,
            RIGID_RINGS_SOURCE,
            "the lowest ring cannot lie above a minimum that another program has",
            unit="kT",
        )
    )
    return Findings([*results, *_controls(published)], [_outside_table(rows)])


def _search(letters: str, parameters: str | ParameterSet) -> Equilibria:
    from dnacheck.equilibria.discrete.search import find_rings
    from dnacheck.model.chain import build_chain
    from dnacheck.model.sequence import Sequence as Letters

    return find_rings(build_chain(Letters("ring", letters), parameters))


def _nearest(found: Equilibria, ring: PublishedRigidRing) -> Equilibrium | None:
    """The stable minimum of that link whose energy is nearest."""
    same = [e for e in found.equilibria if e.link == ring.link and e.stable]
    return min(same, key=lambda e: abs(e.energy_RT - ring.energy_kT), default=None)


def _against(item: str, found: Equilibria, ring: PublishedRigidRing) -> CheckResult:
    nearest = _nearest(found, ring)
    return judge(
        f"rigid.outside[{item}]",
        f"energy of the stable minimum of link {ring.link} that is nearest",
        nearest.energy_RT if nearest else math.nan,
        ring.energy_kT,
        Rule.ABSOLUTE,
        RIGID_RINGS_SOURCE,
        "its gradient norm was about 1e-4, and its energies are printed to 1e-6",
        _OUTSIDE_kT,
        "kT",
    )


def _controls(published: Sequence[PublishedRigidRing]) -> list[CheckResult]:
    """The printed rings must not be those of a set with a mistake in it."""
    from dnacheck.model.parameters import load_parameters

    wrong = unreversed_set()
    said = judge(
        "rigid.outside[strand relation]",
        "steps that the reader says were complemented without being reversed",
        ", ".join(wrong.unreversed_steps),
        ", ".join(_UNREVERSED),
        Rule.EQUAL,
        "the set was made so",
        "both strands of a molecule are one molecule",
    )
    right = load_parameters(SET)
    assert right.stiffness is not None
    stiffness = right.stiffness.copy()
    stiffness[0, 2, 2] *= 1.01
    stiffer = replace(right, name="stiffer", stiffness=stiffness)
    ring, longest = published[0], published[-1]
    return [
        said,
        must_fail(
            _against("control: complements", _search(longest.letters, wrong), longest),
            "four steps have the values of their complements unreversed",
        ),
        must_fail(
            _against("control: stiffness", _search(ring.letters, stiffer), ring),
            "the roll stiffness of AA is 1 % larger",
        ),
    ]


@cache
def unreversed_set() -> ParameterSet:
    """Olson's set as a widely used file has it: four steps complemented and not reversed."""
    from dnacheck.model.parameters import load_parameters, other_strand, strand_report
    from dnacheck.model.sequence import STEP_NAMES, complement

    right = load_parameters(SET)
    assert right.stiffness is not None
    image, turned = other_strand(right.kind, right.ground, right.stiffness, read=complement)
    assert turned is not None
    rows = [STEP_NAMES.index(name) for name in _UNREVERSED]
    ground, stiffness = right.ground.copy(), right.stiffness.copy()
    ground[rows], stiffness[rows] = image[rows], turned[rows]
    departure, broken, unreversed = strand_report(right.kind, ground, stiffness)
    return replace(
        right,
        name="unreversed",
        ground=ground,
        stiffness=stiffness,
        strand_asymmetry=departure,
        asymmetric_steps=broken,
        unreversed_steps=unreversed,
    )


def molecules(context: Context) -> Findings:
    """Energy and -ln J of every molecule by Olson's set beside Trifonov II, nothing fitted."""
    from dnacheck.equilibria.discrete.search import find_rings
    from dnacheck.model.chain import build_chain
    from dnacheck.validation.engine.rings import rings, scene_chain

    accuracy = context.scene.wanted.rigid_ln_J
    assert accuracy is not None
    rows: list[dict[str, Any]] = []
    unsolved: list[str] = []
    errors: list[float] = []
    witnesses: list[CheckResult] = []
    strands = 0.0
    for index, molecule in enumerate(context.molecules):
        row: dict[str, Any] = {"name": molecule.name, "n_bp": len(molecule.sequence.letters)}
        if molecule.name in table3():
            row["experiment"] = table3()[molecule.name].experiment
        chain = build_chain(molecule, SET)
        wedges = scene_chain(context.scene, molecule, "trifonov2")
        try:
            for key, one, search in (
                ("olson", chain, find_rings(chain)),
                ("trifonov", wedges, rings(wedges)),
            ):
                factor = _sampled(one, context.seed + index, accuracy)
                row |= _values(key, search, factor)
                errors.append(factor.total_error)
                if key == "olson" and index < _WITNESSED:
                    witnesses += _witnesses(molecule.name, one, factor, context.seed + index)
            other = find_rings(
                build_chain(molecule.sequence.reverse_complement(), SET)
            ).lowest.energy_RT
            strands = max(strands, abs(other / row["olson_energy"] - 1.0))
        except SolveError as error:
            unsolved.append(molecule.name)
            row["note"] = str(error)
        rows.append(row)
    results = [
        judge(
            "rigid.molecules[solved]",
            "molecules without an energy or a J factor",
            len(unsolved),
            0,
            Rule.EQUAL,
            "every chain closes with some probability",
            "none may be missed",
        ),
        judge(
            "rigid.molecules[accuracy]",
            "largest error of −ln J, as its method measures it",
            max(errors, default=math.inf),
            accuracy,
            Rule.AT_MOST,
            "the scene's wish",
            "asked for by the scene",
        ),
        _both_strands("rigid.molecules[strands]", strands),
        _strand_control(context),
        *witnesses,
    ]
    return Findings(results, _molecule_blocks(rows))


def _sampled(chain: Chain, seed: int, accuracy: float) -> JFactor:
    """-ln J by exactly closed shapes; by whatever method is sure of it where that one is not."""
    from dnacheck.cyclization.methods import Auto, ClosureSampling
    from dnacheck.cyclization.result import JStatus

    try:
        factor = ClosureSampling().compute(chain, rng=seed, tolerance=accuracy)
    except SolveError:
        factor = None
    if factor and factor.status is JStatus.CONVERGED and factor.total_error <= accuracy:
        return factor
    return Auto().compute(chain, rng=seed, tolerance=accuracy)


def _values(key: str, search: Equilibria, factor: JFactor) -> dict[str, Any]:
    return {
        f"{key}_energy": search.lowest.energy_RT,
        f"{key}_link": search.lowest.link,
        f"{key}_minus_lnJ": factor.minus_lnJ,
        f"{key}_error": factor.total_error,
        f"{key}_method": factor.method,
    }


def _witnesses(name: str, chain: Chain, factor: JFactor, seed: int) -> list[CheckResult]:
    """-ln J by Laplace with its first term, and the control without that term."""
    from dnacheck.cyclization.methods import Laplace

    corrected = Laplace(register=True, order=1).compute(chain, rng=seed)
    plain = Laplace(register=True).compute(chain)

    def compared(item: str, value: float) -> CheckResult:
        return judge(
            f"rigid.molecules[{item}]",
            "−ln J by rigid steps",
            value,
            factor.minus_lnJ,
            Rule.SIGMAS,
            f"{factor.method}, a method that shares no integral with it",
            "what is left out after the first term is smaller than the sampling error",
            _SIGMAS,
            "",
            corrected.total_error,
            factor.total_error,
            widest_sigma=0.1,
        )

    return [
        compared(f"{name}, Laplace", corrected.minus_lnJ),
        must_fail(
            compared(f"{name}, control", plain.minus_lnJ),
            "the first anharmonic term was left out",
        ),
    ]


def _both_strands(item: str, difference: float) -> CheckResult:
    return judge(
        item,
        "relative difference of the two strands' energies, the largest",
        difference,
        _STRANDS,
        Rule.AT_MOST,
        "both strands of a molecule are one molecule",
        "residuals of 1e-10 leave less",
    )


def _strand_control(context: Context) -> CheckResult:
    from dnacheck.equilibria.discrete.search import find_rings
    from dnacheck.model.chain import build_chain

    molecule = context.molecules[0]
    here, there = (
        find_rings(build_chain(one, unreversed_set())).lowest.energy_RT
        for one in (molecule.sequence, molecule.sequence.reverse_complement())
    )
    result = _both_strands("rigid.molecules[strands, control]", abs(there / here - 1.0))
    return must_fail(result, "four steps have the values of their complements unreversed")


def beads(context: Context) -> Findings:
    """Energies of random open chains by OpenMM, from where the beads of their pairs lie."""
    from dnacheck.md.rigid_beads import RigidBeads
    from dnacheck.model.chain import build_chain, elastic_energy
    from dnacheck.model.sequence import Sequence as Letters

    chain = build_chain(Letters("every step", _EVERY_STEP), SET)
    witness = RigidBeads(chain, closed=False)
    rng = context.rng()

    def compared(item: str, wrong: Chain | None = None) -> CheckResult:
        shape = chain.ground + _SPREAD * rng.standard_normal(chain.ground.shape)
        return judge(
            f"rigid.beads[{item}]",
            "energy of a random shape from its coordinates",
            elastic_energy(wrong or chain, shape),
            witness.energy_RT(witness.positions(shape)),
            Rule.RELATIVE,
            "OpenMM, from positions of four beads a base pair",
            "both are sums of 16 terms in double precision",
            _BEADS,
            "RT",
        )

    ground, lengths = chain.ground.copy(), chain.ground.copy()
    tilted = int(np.argmax(np.abs(ground[:, 1])))
    ground[tilted, 1] *= -1.0
    lengths[:, 3:] *= chain.rise_A
    controls = [
        must_fail(
            compared("control: sign", replace(chain, ground=ground)),
            "one step's tilt has the other sign",
        ),
        must_fail(
            compared("control: unit", replace(chain, ground=lengths)),
            "translations in Å are read as multiples of the rise",
        ),
    ]
    return Findings([*(compared(f"shape {i + 1}") for i in range(_SHAPES)), *controls])


def _outside_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    return Table(
        "rigid-outside",
        "Rings of another program",
        [
            Column("number", "Ring", "", "d"),
            Column("n_bp", "Length", "bp", "d"),
            Column("link", "Link", "", "d"),
            Column("outside", "printed", "kT", ".6f", "", "Energy"),
            Column("ours", "ours", "kT", ".6f", "verdict", "Energy"),
            Column("difference", "difference", "kT", "+.1e", "", "Energy"),
            Column("residual", "our residual", "", ".0e"),
            Column("lowest", "lowest ring found", "kT", ".6f"),
        ],
        rows,
        f"Random sequences by {SET}, last pair held on the first. Printed: {RIGID_RINGS_SOURCE}. "
        "That program stopped at a gradient norm of about 1e-4.",
    )


def _molecule_blocks(rows: Sequence[Mapping[str, Any]]) -> list[Block]:
    columns = [
        Column("name", "Molecule"),
        Column("n_bp", "Length", "bp", "d"),
        Column("experiment", "ΔG exp.", "RT", ".1f"),
    ]
    for key, label in _SETS.items():
        columns += [
            Column(f"{key}_energy", "energy", "RT", ".4f", "", label),
            Column(f"{key}_link", "link", "", "d", "", label),
            Column(f"{key}_minus_lnJ", "−ln J", "", ".3f", "", label),
            Column(f"{key}_error", "±", "", ".3f", "", label),
        ]
    columns.append(Column("note", "Note"))
    blocks: list[Block] = [
        Table(
            "rigid-molecules",
            "Rigid steps beside wedges",
            columns,
            rows,
            f"Lowest ring and −ln J, nothing fitted. {_citation()}",
        )
    ]
    solved = [row for row in rows if "olson_minus_lnJ" in row and "trifonov_minus_lnJ" in row]
    measured = [row for row in solved if "experiment" in row]
    if len(measured) > 1:
        blocks.append(_experiment_table(measured))
    if solved:
        blocks.append(_figure(solved))
    return blocks


def _citation() -> str:
    from dnacheck.model.parameters import load_parameters

    return load_parameters(SET).citation


def against_experiment(rows: Sequence[Mapping[str, Any]], key: str) -> dict[str, float]:
    """Mean and rms of -ln J less experiment, and what a constant leaves of it; RT."""
    apart = np.array([row[f"{key}_minus_lnJ"] - row["experiment"] for row in rows])
    return {
        "mean": float(apart.mean()),
        "rms": float(np.sqrt(np.mean(apart**2))),
        "spread": float(apart.std()),
        "largest": float(np.abs(apart).max()),
    }


def _experiment_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    group = "−ln J less experiment"
    return Table(
        "rigid-experiment",
        "Against experiment, nothing fitted",
        [
            Column("set", "Parameters"),
            Column("rms", "rms", "RT", ".2f", "", group),
            Column("mean", "mean", "RT", "+.2f", "", group),
            Column("spread", "about the mean", "RT", ".2f", "", group),
            Column("largest", "largest", "RT", ".2f", "", group),
        ],
        [{"set": label, **against_experiment(rows, key)} for key, label in _SETS.items()],
        f"Experiment: Table III, error about ±{_EXPERIMENT_RT} RT. This is the error of the "
        "parameter sets: their −ln J are computed to the errors of the table above. Olson's set "
        "comes from crystals of proteins on DNA and knows AA steps but no A-tracts.",
        "Table III",
    )


def _figure(rows: Sequence[Mapping[str, Any]]) -> Figure:
    return Figure(
        "rigid-lnJ",
        "−ln J by two parameter sets and by experiment",
        "rigid_ln_J",
        {
            "labels": {"olson": _SETS["olson"], "trifonov": _SETS["trifonov"]},
            "rows": [
                {
                    "name": row["name"],
                    "olson": row["olson_minus_lnJ"],
                    "trifonov": row["trifonov_minus_lnJ"],
                    "experiment": row.get("experiment"),
                }
                for row in rows
            ],
            "experiment_error": _EXPERIMENT_RT,
        },
        "Nothing is fitted to these molecules.",
        height=1.1 + 0.3 * len(rows),
    )


GROUP = Group(
    "rigid",
    "Rigid base-pair rings",
    "Steps with six parameters and a full 6×6 stiffness: minima of another program found again, "
    "and every molecule by Olson's protein–DNA set beside Trifonov II.",
    (
        Check("rigid.outside", "energies of another program's rings", outside, 0.3,
              ("rigid_ln_J",), Level.QUICK),
        Check("rigid.molecules", "Olson's set beside Trifonov II and experiment", molecules, 2.5,
              ("rigid_ln_J",), Level.QUICK),
        Check("rigid.beads", "energies of rigid steps by OpenMM", beads, 4.0, ("rigid_ln_J",),
              Level.FULL, requires=("dnacheck.md.rigid_beads", "openmm")),
    ),
)  # fmt: skip
