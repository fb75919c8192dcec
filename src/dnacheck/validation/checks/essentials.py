"""One end-to-end number of every chain of reasoning, and the constants of the physics.

What is expected stands here as a number, or follows from a formula or a count that shares no code
and no constant with what it checks: 8 pi^2, the mole, the rise and RT per reduced unit are written
out once more on purpose.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Check, Findings, Group, Level
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge, must_fail
from dnacheck.validation.reference.published import PAPER, table2

if TYPE_CHECKING:
    from dnacheck.equilibria.ring import Equilibria

# Written out, not imported.
_RISE_A = 3.4
_PERSISTENCE_A = 463.0
_PARTICLES_PER_MOLE = 6.02214076e23
_CUBIC_ANGSTROMS_PER_LITRE = 1e27
_BOLTZMANN_J_PER_K = 1.380649e-23
_TEMPERATURE_K = 300.0

_SECTION = f"{PAPER}, Section II"
_STRAIGHT_BP = 150
_BASE_PAIRS_PER_TURN = 10.5
_TWIST_RATIO = 1.5
_J_TOLERANCE = 0.2
"""RT. The formula is good to a few per cent in J; a factor of two is 0.69."""
_HALVES = 20_000


def constants(context: Context) -> Findings:
    """Defaults and constants against their values, written out."""
    from dnacheck.cyclization.result import PER_CUBIC_ANGSTROM_IN_MOLAR
    from dnacheck.md.bead_chain import GAS_CONSTANT_KJ
    from dnacheck.model.chain import build_chain
    from dnacheck.model.molecules import embedded
    from dnacheck.model.units import TEMPERATURE_K, thermal_energy_pN_nm

    chain = build_chain(embedded("12A09"))
    exact = (
        ("rise", "default rise of a step", chain.rise_A, _RISE_A, "Å", _SECTION),
        ("persistence length", "default persistence length", chain.persistence_length_A,
         _PERSISTENCE_A, "Å", _SECTION),
        ("RT", "RT per reduced unit of energy", chain.energy_scale_RT, _PERSISTENCE_A / _RISE_A,
         "RT", _SECTION),
        ("temperature", "temperature of forces and of the bead chain", TEMPERATURE_K,
         _TEMPERATURE_K, "K", "the documentation"),
        ("kT", "thermal energy", thermal_energy_pN_nm(),
         _BOLTZMANN_J_PER_K * _TEMPERATURE_K / 1e-21, "pN nm", "SI: k_B = 1.380649e-23 J/K"),
        ("gas constant", "gas constant of the bead chain", GAS_CONSTANT_KJ,
         _BOLTZMANN_J_PER_K * _PARTICLES_PER_MOLE / 1e3, "kJ/mol/K", "SI: k_B times N_A"),
        ("mole", "mol/L that are one molecule per Å³", PER_CUBIC_ANGSTROM_IN_MOLAR,
         _CUBIC_ANGSTROMS_PER_LITRE / _PARTICLES_PER_MOLE, "mol/L", "SI: N_A = 6.02214076e23"),
    )  # fmt: skip
    results = [
        judge(
            f"essentials.constants[{item}]", quantity, got, expected, Rule.RELATIVE, source,
            "as many digits as the constant is given with", 1e-6, unit,
        )
        for item, quantity, got, expected, unit, source in exact
    ]  # fmt: skip
    return Findings(results)


def energy(context: Context) -> Findings:
    """The ring of one molecule in RT against Table II, by way of no default of the package."""
    from dnacheck.equilibria.discrete.search import find_rings
    from dnacheck.model.chain import build_chain
    from dnacheck.model.molecules import embedded

    def judged(item: str, got: float) -> CheckResult:
        return judge(
            f"essentials.energy[{item}]",
            "energy of the lowest discrete ring",
            got,
            table2()["12A09"].discrete * _PERSISTENCE_A / _RISE_A,
            Rule.RELATIVE,
            f"Table II of {PAPER}, times 463/3.4",
            "the table's rounding and its angles, as in table2.discrete",
            1e-3,
            "RT",
        )

    own = find_rings(build_chain(embedded("12A09"))).lowest.energy_RT
    wrong = find_rings(build_chain(embedded("12A09"), rise_A=3.32)).lowest.energy_RT
    control = judged("control: 12A09", wrong)
    return Findings([judged("12A09", own), must_fail(control, "a rise of 3.32 Å for 3.4 Å")])


def _straight() -> Equilibria:
    from dnacheck.equilibria.discrete.search import find_rings
    from dnacheck.model.chain import Chain, uniform_stiffness

    n = _STRAIGHT_BP
    ground = np.tile([2.0 * math.pi / _BASE_PAIRS_PER_TURN, 0.0, 0.0], (n, 1))
    return find_rings(
        Chain(
            f"straight {n}",
            ground,
            uniform_stiffness(n, _TWIST_RATIO),
            persistence_length_A=_PERSISTENCE_A,
            rise_A=_RISE_A,
            twist_ratio=_TWIST_RATIO,
        )
    )


def _rod_minus_ln_j() -> float:
    """Shimada and Yamakawa's −ln J of the straight molecule, the writhe's variance in its twist.

    In a uniform distribution of directions 4 pi of the tangent and 2 pi of the twist are 8 pi^2.
    """
    length, kuhn = _STRAIGHT_BP * _RISE_A, 2.0 * _PERSISTENCE_A
    density = 4.0 * math.pi**3 * kuhn**3 / length**6
    density *= math.exp(-(math.pi**2) * kuhn / length + 0.514 * length / kuhn)
    variance = length / (_TWIST_RATIO * _PERSISTENCE_A)
    variance += 3.0 * length**2 / (8.0 * math.pi**2 * _PERSISTENCE_A**2)
    excess = [
        2.0 * math.pi * (link - _STRAIGHT_BP / _BASE_PAIRS_PER_TURN) for link in range(10, 20)
    ]
    twist = sum(math.exp(-0.5 * x * x / variance) for x in excess)
    twist *= math.sqrt(2.0 * math.pi / variance)
    per_mole = _CUBIC_ANGSTROMS_PER_LITRE / _PARTICLES_PER_MOLE
    return -math.log(per_mole * density * twist)


def ln_j(context: Context) -> Findings:
    """J of a straight molecule by half chains and by Laplace against the rod in closed form."""
    from dnacheck.cyclization.half_chain.sampling import HalfChainOptions, half_chain
    from dnacheck.cyclization.laplace.register import register_profile

    search = _straight()
    halves = half_chain(search, HalfChainOptions(halves=_HALVES), context.rng())
    # The register integral lacks the first anharmonic term, which is in the formula.
    laplace = -register_profile(search).log_j
    laplace -= 0.514 * _STRAIGHT_BP * _RISE_A / (2.0 * _PERSISTENCE_A)

    def judged(item: str, got: float, sigma: float | None = None) -> CheckResult:
        return judge(
            f"essentials.ln_J[{item}]",
            f"−ln J of a straight molecule of {_STRAIGHT_BP} base pairs",
            got,
            _rod_minus_ln_j(),
            Rule.ABSOLUTE,
            "Shimada & Yamakawa, Macromolecules 17, 689 (1984), and the writhe's variance",
            "the formula is good to a few per cent in J; half of 8π² is 0.69",
            _J_TOLERANCE,
            "RT",
            got_sigma=sigma,
        )

    control = judged("control: half chains", halves.minus_lnJ + math.log(2.0), halves.stderr)
    return Findings(
        [
            judged("half chains", halves.minus_lnJ, halves.stderr),
            judged("Laplace", laplace),
            must_fail(control, "half of 8π²"),
        ]
    )


def link(context: Context) -> Findings:
    """Link of coiled ribbons with a writhe beyond one half, against a count of their crossings."""
    from dnacheck.numerics.curve_topology import link_of_ring
    from dnacheck.validation.reference.closed_curves import coiled_frames, crossing_link

    rng = context.rng()
    mirror = np.diag([1.0, 1.0, -1.0])
    right = coiled_frames(200, _COIL, _COIL_TURNS)
    # A mirrored frame is left-handed; d2 the other way makes it right-handed again.
    left = mirror @ right @ np.diag([1.0, -1.0, 1.0])
    results = []
    writhes = []
    for item, frames in (("right-handed", right), ("left-handed", left)):
        tangents = frames[:-1, :, 2]
        centres = np.concatenate([np.zeros((1, 3)), np.cumsum(tangents, axis=0)])
        counts = {
            crossing_link(centres[:-1], frames[:-1, :, 0], rng.standard_normal(3)) for _ in range(3)
        }
        got, twist, writhe = link_of_ring(centres, np.ascontiguousarray(frames))
        writhes.append(abs(writhe))
        expected = counts.pop() if len(counts) == 1 else None
        results.append(_link(item, got, expected))
    control = _link("control", round(twist - writhe), expected)
    results += [
        judge(
            "essentials.link[writhe]",
            "smaller writhe of the two, turns",
            min(writhes),
            0.5,
            Rule.AT_LEAST,
            "the check's own need",
            "below one half the writhe's sign does not change the integer",
        ),
        must_fail(control, "the writhe has the wrong sign"),
    ]
    return Findings(results)


_COIL = 0.5
_COIL_TURNS = 3


def _link(item: str, got: int, expected: int | None) -> CheckResult:
    return judge(
        f"essentials.link[{item}]",
        "link of a ribbon that coils twice about a circle",
        got,
        expected,
        Rule.EQUAL,
        "half the signed crossings seen from three sides",
        "an integer",
    )


def a_tracts(context: Context) -> Findings:
    """The A-tract rule on the letters of the eleven against the regions that come with them."""
    from dnacheck.model.a_tracts import automatic_regions
    from dnacheck.model.molecules import embedded, embedded_names

    molecules = [embedded(name) for name in embedded_names()]

    def judged(item: str, moved: int) -> CheckResult:
        wrong = [
            m.name
            for m in molecules
            if tuple((a + moved, b + moved) for a, b in automatic_regions(m.sequence.letters))
            != m.a_tract_regions
        ]
        return judge(
            f"essentials.a_tracts[{item}]",
            "molecules of Table II whose A-tract region the rule misses",
            len(wrong),
            0,
            Rule.EQUAL,
            "data/molecules/kahn_crothers.fasta, from the published energies",
            "all eleven" + (f"; not {', '.join(wrong)}" if wrong else ""),
        )

    control = must_fail(judged("control", 1), "the region is moved by one step")
    return Findings([judged("eleven", 0), control])


GROUP = Group(
    "essentials",
    "One number of every chain of reasoning",
    "Constants, an energy in RT, a J, a link and the A-tract rule, each against a number or a "
    "formula that shares nothing with it.",
    (
        Check("essentials.constants", "constants of the physics, written out", constants, 0.1,
              level=Level.QUICK),
        Check("essentials.energy", "an energy in RT against Table II", energy, 0.2,
              level=Level.QUICK),
        Check("essentials.ln_J", "J of a straight molecule in closed form", ln_j, 2.0,
              level=Level.QUICK),
        Check("essentials.link", "link of coiled ribbons by counting crossings", link, 0.2,
              level=Level.QUICK),
        Check("essentials.a_tracts", "the A-tract rule against the eleven's regions", a_tracts,
              0.1, level=Level.QUICK),
    ),
)  # fmt: skip
