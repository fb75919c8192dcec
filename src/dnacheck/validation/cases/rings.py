"""Molecules on which discrete solvers break."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from dnacheck.equilibria.discrete.search import SearchOptions, find_rings, search_minima
from dnacheck.equilibria.discrete.solve import NewtonOptions
from dnacheck.equilibria.ring import Equilibria
from dnacheck.model.chain import Chain, build_chain, uniform_stiffness
from dnacheck.model.molecules import embedded
from dnacheck.model.sequence import Sequence, parse_sequence
from dnacheck.validation.cases.case import HardCase, hard_case
from dnacheck.validation.cases.geometry import long_double_end
from dnacheck.validation.engine.verdict import Rule

GROUP = "rings"
_TIGHT = 1e-9


def _random(rng: np.random.Generator, n: int) -> Sequence:
    return parse_sequence("".join(rng.choice(list("ACGT"), n)), f"random{n}")


def _brute(chain: Chain, registers: int = 8) -> Equilibria:
    middle = round(chain.relaxed_turns)
    rolls = np.linspace(0.0, 2.0 * np.pi, registers, endpoint=False, dtype=np.float64)
    links = tuple(range(middle - 2, middle + 3))
    return search_minima(chain, links, rolls, math.inf, NewtonOptions())


def _energy(search: Equilibria) -> float:
    return search.lowest.energy_RT if search.equilibria else math.inf


def homopolymer(rng: np.random.Generator) -> HardCase:
    """A straight molecule: the register is free."""
    del rng
    energies = {}
    for n in (100, 150, 200, 300, 500):
        chain = build_chain(parse_sequence("A" * n, f"A{n}"), a_tracts="none")
        found, full = find_rings(chain), _brute(chain)
        energies[n] = abs(_energy(found) / _energy(full) - 1.0)
    worst = max(energies.values())
    missed = [n for n, error in energies.items() if not error < _TIGHT]
    return hard_case(
        GROUP,
        "straight homopolymer",
        "poly(A) of 100 to 500 bp: the lowest ring is found although its register is free",
        f"missed or not found at {missed} bp" if missed else "the lowest of a brute-force search",
        worst,
        _TIGHT,
        Rule.AT_MOST,
        "both searches converge to 1e-10",
    )


def bent_beyond_a_turn(rng: np.random.Generator) -> HardCase:
    """A-tracts in phase with the helix bend the molecule by more than 360°."""
    del rng
    unit = "AAAAAACGGGCAAAAAACGGC"
    chain = build_chain(parse_sequence(unit * 14, "phased A-tracts"), "trifonov")
    from dnacheck.model.chain import chain_frames

    tangents = chain_frames(chain.ground)[1][::21, :, 2]
    bend = math.degrees(
        float(np.sum(np.arccos(np.clip(np.sum(tangents[1:] * tangents[:-1], axis=1), -1, 1))))
    )
    found, full = find_rings(chain), _brute(chain)
    ok = bend > 360.0 and bool(found.equilibria) and bool(found.lowest.stable)
    return hard_case(
        GROUP,
        "bent by more than 360°",
        "a molecule whose A-tracts bend it by more than a full turn closes to a stable minimum, "
        "the lowest of a brute-force search",
        f"intrinsic bend {bend:.0f}°, ring energy {_energy(found):.4f} RT",
        _energy(found) / _energy(full) if ok else math.inf,
        1.0,
        Rule.ABSOLUTE,
        "both searches converge to 1e-10",
        _TIGHT,
    )


def near_degenerate_links(rng: np.random.Generator) -> HardCase:
    """A molecule whose relaxed twist is half-way between two integers."""
    sequence = _random(rng, 200)
    chain = build_chain(sequence)
    shift = (math.floor(chain.relaxed_turns) + 0.5 - chain.relaxed_turns) * 2.0 * math.pi / 200
    chain = Chain("twist n + 1/2", chain.ground + np.array([shift, 0.0, 0.0]), chain.stiffness)
    found, full = find_rings(chain), _brute(chain)
    links = sorted({ring.link for ring in found.equilibria})
    gap = abs(found.equilibria[1].energy_RT - found.equilibria[0].energy_RT)
    both = _energy(found) / _energy(full) if len(links) >= 2 else math.inf
    return hard_case(
        GROUP,
        "two nearly degenerate links",
        "with the relaxed twist at n + ½ both links are reported, the lower one first",
        f"links {', '.join(map(str, links))}, {gap:.3f} RT apart",
        both,
        1.0,
        Rule.ABSOLUTE,
        "the brute-force search gives the same lowest ring",
        _TIGHT,
    )


def palindrome(rng: np.random.Generator) -> HardCase:
    """A self-complementary molecule reads the same on both strands."""
    half = _random(rng, 80)
    whole = parse_sequence(half.letters + half.reverse_complement().letters, "palindrome")
    one = build_chain(whole, step_form="midstep")
    other = build_chain(whole.reverse_complement(), step_form="midstep")
    same = np.array_equal(one.ground, other.ground)
    search = find_rings(one)
    full = _brute(one)
    return hard_case(
        GROUP,
        "palindrome",
        "a self-complementary molecule has one and the same ring on either strand, found among "
        "mirror-related pairs of minima",
        f"both strands {'equal' if same else 'differ'}; {len(search.equilibria)} minima, lowest "
        f"{_energy(search):.4f} RT",
        _energy(search) / _energy(full) if same else math.inf,
        1.0,
        Rule.ABSOLUTE,
        "the brute-force search gives the same lowest ring",
        _TIGHT,
    )


def both_strands(rng: np.random.Generator) -> HardCase:
    """The symmetrised step gives both strands the same ring."""
    sequence = _random(rng, 150)
    energies = [
        find_rings(build_chain(strand, a_tracts="none", step_form="midstep")).lowest.energy
        for strand in (sequence, sequence.reverse_complement())
    ]
    return hard_case(
        GROUP,
        "the other strand",
        "with the symmetrised step both strands have the same ring energy",
        f"relative difference {abs(energies[1] / energies[0] - 1.0):.1e}",
        energies[1],
        energies[0],
        Rule.RELATIVE,
        "an exact symmetry; both are converged to 1e-10",
        _TIGHT,
    )


def shortest(rng: np.random.Generator) -> HardCase:
    """Twenty base pairs."""
    chain = build_chain(_random(rng, 20))
    found, full = find_rings(chain), _brute(chain, 16)
    return hard_case(
        GROUP,
        "N = 20",
        "the shortest rings converge to the lowest of a brute-force search",
        f"{_energy(found):.3f} RT, brute force {_energy(full):.3f} RT",
        _energy(found),
        _energy(full),
        Rule.RELATIVE,
        "both searches converge to 1e-10",
        _TIGHT,
    )


def longest(rng: np.random.Generator) -> HardCase:
    """Ten thousand base pairs."""
    chain = build_chain(_random(rng, 10_000))
    found = find_rings(chain, SearchOptions(links=round(chain.relaxed_turns)))
    gap, stable = math.inf, False
    if found.equilibria:
        end, _ = long_double_end(found.lowest.angles)
        gap, stable = float(np.linalg.norm(end)), found.lowest.stable is True
    return hard_case(
        GROUP,
        "N = 10 000",
        "the ring is stable, and its end meets its start in extended precision (steps)",
        f"{'stable' if stable else 'no stable ring'}, end {gap:.1e} from the start",
        gap if stable else math.inf,
        1e-7,
        Rule.AT_MOST,
        "round-off of 10,000 rotations, each of 1e-16, on a ring 3,000 steps across",
    )


def extreme_ratios(rng: np.random.Generator) -> HardCase:
    """K3/K1 from 0.05 to 20."""
    base = build_chain(_random(rng, 160))
    worst, energies = 0.0, []
    for ratio in (0.05, 0.2, 1.0, 5.0, 20.0):
        chain = base.with_twist_ratio(ratio)
        found, full = find_rings(chain), _brute(chain)
        energies.append(_energy(found))
        worst = max(worst, abs(_energy(found) / _energy(full) - 1.0))
    rising = all(b >= a for a, b in itertools.pairwise(energies))
    return hard_case(
        GROUP,
        "K3/K1 from 0.05 to 20",
        "every ratio gives the lowest ring, and a stiffer twist never lowers the energy",
        f"{energies[0]:.2f} to {energies[-1]:.2f} RT, {'rising' if rising else 'not rising'}",
        worst if rising else math.inf,
        _TIGHT,
        Rule.AT_MOST,
        "both searches converge to 1e-10",
    )


def steep_wedge(rng: np.random.Generator) -> HardCase:
    """A step bent by nearly 90° in its ground state."""
    chain = build_chain(_random(rng, 150))
    ground = chain.ground.copy()
    ground[70, 1] = math.radians(89.9)
    steep = Chain("steep", ground, chain.stiffness)
    found, full = find_rings(steep), _brute(steep)
    return hard_case(
        GROUP,
        "a kink of nearly 90°",
        "one step with a roll of 89.9° does not stop the solver",
        f"{_energy(found):.4f} RT, residual {found.lowest.residual:.0e}",
        _energy(found),
        _energy(full),
        Rule.RELATIVE,
        "both searches converge to 1e-10",
        _TIGHT,
    )


def first_base_pair(rng: np.random.Generator) -> HardCase:
    """Which base pair of the ring is called first must not matter."""
    molecule = embedded("11T15")
    chain = build_chain(molecule)
    reference = find_rings(chain).lowest.energy
    worst = 0.0
    for shift in sorted(int(x) for x in rng.integers(1, chain.n_steps, 8)):
        rolled = Chain(
            "relabelled",
            np.roll(chain.ground, -shift, axis=0),
            np.roll(chain.stiffness, -shift, axis=0),
        )
        worst = max(worst, abs(find_rings(rolled).lowest.energy / reference - 1.0))
    return hard_case(
        GROUP,
        "another first base pair",
        "the ring energy of 11T15 is the same whichever base pair is called first",
        f"largest relative difference over 8 choices {worst:.1e}",
        worst,
        _TIGHT,
        Rule.AT_MOST,
        "an exact symmetry",
    )


def full_stiffness(rng: np.random.Generator) -> HardCase:
    """A full 3 x 3 stiffness that is the uniform one in other clothes."""
    chain = build_chain(_random(rng, 150))
    plain = find_rings(chain).lowest.energy
    noise = rng.standard_normal((chain.n_steps, 3, 3))
    coupled = uniform_stiffness(chain.n_steps, 1.5)
    tiny = 1e-9 * (noise + np.swapaxes(noise, 1, 2))
    other = find_rings(Chain("coupled", chain.ground, coupled + tiny)).lowest.energy
    return hard_case(
        GROUP,
        "coupled stiffness, limit",
        "full 3×3 stiffnesses 1e-9 away from the uniform one change the energy by as little",
        f"relative change {abs(other / plain - 1.0):.1e}",
        other,
        plain,
        Rule.RELATIVE,
        "first-order perturbation",
        1e-7,
    )


def condition_numbers(rng: np.random.Generator) -> list[dict[str, Any]]:
    """Condition of the closure problem against length.

    Returns
    -------
    list of dict
        n; hessian: ratio of largest to smallest stiffness of the projected Hessian, estimated from
        its smallest eigenvalue; closure: condition of G K^-1 G^T with lengths in units of the
        ring's radius.
    """
    from dnacheck.equilibria.discrete.kernels.closure import closure_jacobian, linearise

    rows = []
    for n in (50, 150, 500, 2000):
        chain = build_chain(_random(rng, n))
        ring = find_rings(chain).lowest
        centres, frames = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
        axes, jacobian = np.empty((n, 3, 3)), np.empty((6, 3 * n))
        linearise(ring.angles, 0, centres, frames, axes, np.empty((0, 5, 3)))
        closure_jacobian(centres, axes, jacobian)
        jacobian[:3] *= 2.0 * np.pi / n
        largest = float(np.max(chain.stiffness))
        rows.append(
            {
                "n": n,
                "smallest": ring.softest,
                "hessian": largest / ring.softest,
                "closure": float(np.linalg.cond(jacobian @ jacobian.T)),
            }
        )
    return rows


CASES = (
    homopolymer,
    bent_beyond_a_turn,
    near_degenerate_links,
    palindrome,
    both_strands,
    shortest,
    longest,
    extreme_ratios,
    steep_wedge,
    first_base_pair,
    full_stiffness,
)
