"""The independent witness: the same molecule as an OpenMM bead chain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dnacheck.validation.checks.bead_ensemble import LONGEST, ensemble, profile
from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Check, Findings, Group, Level
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge, must_fail
from dnacheck.validation.report.record import Column, Figure, Table
from dnacheck.validation.scene.scene import Scene

if TYPE_CHECKING:
    from dnacheck.equilibria.ring import Equilibrium
    from dnacheck.md.check import MdCheck
    from dnacheck.model.chain import Chain

ENERGY_TOLERANCE = 1e-10
MINIMUM_TOLERANCE = 1e-5
RMS_TOLERANCE_A = 0.02


def _chains(context: Context) -> list[Chain]:
    from dnacheck.validation.engine.rings import scene_chain

    return [scene_chain(context.scene, molecule) for molecule in context.molecules]


def _judge_energy(item: str, difference: float) -> CheckResult:
    return judge(
        f"bead_chain.energy[{item}]",
        "relative difference of OpenMM's energy of the discrete ring from the solver's",
        abs(difference),
        ENERGY_TOLERANCE,
        Rule.AT_MOST,
        "the discrete solver, which shares no code with the bead chain",
        "the same function of the same positions, in double precision",
    )


def energy(context: Context) -> Findings:
    """OpenMM's energy of every discrete ring, and of faulty bead chains."""
    from dnacheck.md.bead_chain import sabotaged
    from dnacheck.md.check import MdOptions, run_md_check
    from dnacheck.validation.engine.rings import lowest_ring

    options = MdOptions(minimise=None, ensemble=None, seed=context.seed % 2**31)
    results, rows = [], []
    for chain in _chains(context):
        ring = lowest_ring(chain)
        found = run_md_check(chain, ring.angles, options)
        worst = max((abs(finding.difference) for finding in found.findings), default=1.0)
        results.append(_judge_energy(chain.name, worst))
        rows.append(
            {
                "name": chain.name,
                "solver": ring.energy_RT,
                "openmm": found.energy_RT,
                "difference": found.rings[0].openmm_difference,
                "worst": worst,
                "seconds": found.energy_seconds,
            }
        )
    for kind, fault in (("sign", "one ground roll has the wrong sign"),
                        ("stiffness", "one bending stiffness is 5 % too large")):  # fmt: skip
        wrong = sabotaged(chain, "sign" if kind == "sign" else "stiffness", chain.n_steps // 3)
        found = run_md_check(chain, ring.angles, options, built_from=wrong)
        control = _judge_energy(f"control: {kind}", found.rings[0].openmm_difference)
        results.append(must_fail(control, fault))
    table = Table(
        "bead-chain",
        "The rings as OpenMM bead chains",
        [
            Column("name", "Molecule"),
            Column("solver", "discrete solver", "RT", ".6f"),
            Column("openmm", "OpenMM", "RT", ".6f"),
            Column("difference", "difference", "", "+.0e"),
            Column("worst", "worst, perturbed rings included", "", ".0e"),
            Column("seconds", "time", "s", ".2f"),
        ],
        rows,
        "Energy of the discrete ring, evaluated by OpenMM on beads (Reference platform, double "
        "precision), and of the ring with its beads moved by 0.1 Å at random.",
        summary=len(rows) <= 30,
    )
    return Findings(results, [table])


def minimum(context: Context) -> Findings:
    """The bead chain finds the ring by itself."""
    from dnacheck.md.check import MdOptions, run_md_check
    from dnacheck.validation.engine.rings import lowest_ring

    options = MdOptions(ensemble=None, seed=context.seed % 2**31)
    chains = _chains(context)
    results, rows = [], []
    for chain in chains if context.level is Level.FULL else chains[-1:]:
        ring = lowest_ring(chain)
        found = run_md_check(chain, ring.angles, options)
        match = found.rings[0]
        row: dict[str, Any] = {"name": chain.name, "energy": match.energy_RT}
        for start, difference, rms in (
            ("perturbed ring", match.perturbed_difference, match.perturbed_rms_A),
            ("planar circles", match.own_difference, match.own_rms_A),
        ):
            row[f"{start} energy"], row[f"{start} rms"] = difference, rms
            results += [
                judge(
                    f"bead_chain.minimum[{chain.name}, {start}, energy]",
                    f"relative difference of the minimised bead chain's energy, from {start}",
                    abs(difference),
                    MINIMUM_TOLERANCE,
                    Rule.AT_MOST,
                    "the discrete solver's lowest ring",
                    "what the stiff springs of the bead chain leave",
                ),
                judge(
                    f"bead_chain.minimum[{chain.name}, {start}, shape]",
                    f"rms distance of base-pair centres, from {start}",
                    rms,
                    RMS_TOLERANCE_A,
                    Rule.AT_MOST,
                    "the discrete solver's lowest ring",
                    "a hundredth of a bond length",
                    unit="Å",
                ),
            ]
        rows.append(row)
    columns = [Column("name", "Molecule"), Column("energy", "discrete ring", "RT", ".4f")]
    for start in ("perturbed ring", "planar circles"):
        group = f"From {start}"
        columns.append(Column(f"{start} energy", "energy, relative", "", "+.0e", "", group))
        columns.append(Column(f"{start} rms", "rms", "Å", ".0e", "", group))
    table = Table("bead-minimum", "Minimised bead chains", columns, rows)
    return Findings(results, [table, *_shape(found, ring)])


def _shape(found: MdCheck, ring: Equilibrium) -> list[Figure]:
    """The nearest minimum from planar circles over the discrete ring, on principal axes."""
    import numpy as np

    from dnacheck.numerics.superpose import superpose

    if not found.minima:
        return []
    centres = found.chain.rise_A * ring.centres[:-1]
    centres = centres - centres.mean(axis=0)
    axes = np.linalg.svd(centres, full_matrices=False)[2].T
    axes[:, 2] *= np.linalg.det(axes)
    centres = centres @ axes
    moved, rms = min(
        (superpose(minimum.centres_A, centres)[:2] for minimum in found.minima),
        key=lambda pair: float(pair[1]),
    )
    return [
        Figure(
            "bead-shape",
            f"{found.chain.name}: the bead chain's own minimum over the discrete ring",
            "bead_ring",
            {"discrete": centres.tolist(), "beads": np.asarray(moved).tolist()},
            "Base-pair centres. The bead chain was relaxed from planar circles made of nothing "
            f"but the sequence; rms distance {rms:.1e} Å.",
            width=3.6,
            height=3.4,
        )
    ]


def _applies(scene: Scene) -> str | None:
    if max(len(letters) for _, letters, _ in scene.resolved) > 1000:
        return "a molecule has more than 1000 base pairs"
    return None


def _shaken(scene: Scene) -> str | None:
    if min(len(letters) for _, letters, _ in scene.resolved) > LONGEST:
        return f"every molecule has more than {LONGEST} base pairs"
    return None


GROUP = Group(
    "bead_chain",
    "OpenMM bead chain",
    "The same molecules as beads and forces in OpenMM, built without the ring solvers.",
    (
        Check("bead_chain.energy", "OpenMM's energies of the rings", energy, 10.0,
              ("thermal_energy",), applies=_applies, requires=("dnacheck.md.check", "openmm")),
        Check("bead_chain.minimum", "rings found by the bead chain", minimum, 10.0,
              ("thermal_energy",), applies=_applies, requires=("dnacheck.md.check", "openmm")),
        Check("bead_chain.ensemble", "rings in thermal motion", ensemble, 70.0,
              ("thermal_energy",), applies=_shaken, requires=("dnacheck.md.check", "openmm")),
        Check("bead_chain.profile", "fluctuation along a molecule with one soft half", profile,
              45.0, ("thermal_energy",), Level.FULL, _shaken,
              requires=("dnacheck.md.check", "openmm")),
    ),
)  # fmt: skip
