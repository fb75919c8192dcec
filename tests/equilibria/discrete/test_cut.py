"""A ring has no first base pair: minima and J are the same wherever it is cut."""

import numpy as np
import pytest

from dnacheck.cyclization.laplace.isolated import laplace
from dnacheck.equilibria.discrete.kernels.cut import rotated
from dnacheck.equilibria.discrete.search import SearchOptions, find_rings, search_minima
from dnacheck.equilibria.discrete.solve import NewtonOptions, solve_ring
from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.cut_kernels import least_rotation
from dnacheck.model.parameters import load_parameters
from dnacheck.model.sequence import Sequence, parse_sequence
from dnacheck.scanning.scan import COLUMNS, scan_row

SETS = ("trifonov2", "trifonov", "desantis")

# Molecules whose second minimum was found from some cuts only, and that minimum in RT.
TWO_MINIMA = [
    (
        "TGATTTATGCATGCAGCCGAATACTAAGCTTCCATGGATTACGTTCGAGCTGTAACTGAGTGGTAGTCTATCGACCTCAGTGAC",
        {"a_tracts": "none"},
        32.2795,
    ),
    (
        "CATGGGGTTTCCAAGGTAGCGATGCTCTCTAGTTCCCTCGTACTGTTATGGACGAGTTTGCACGTGTCCACGATTACCATCAGT",
        {"angles": "trifonov"},
        32.5115,
    ),
]


def turned(letters, cut):
    return letters[cut:] + letters[:cut]


def chain_of(letters, **arguments):
    return build_chain(Sequence("ring", letters), **arguments)


def random_letters(rng, low=60, high=150):
    return "".join(rng.choice(list("ACGT"), int(rng.integers(low, high + 1))))


def check_cuts(letters, angles, cuts):
    """Energies to 1e-9, -ln J to 1e-6, links and numbers of minima, from several cuts."""
    search = find_rings(chain_of(letters, angles=angles))
    log_j = laplace(search).minus_lnJ
    for cut in cuts:
        other = find_rings(chain_of(turned(letters, cut), angles=angles))
        assert [ring.link for ring in other.equilibria] == [r.link for r in search.equilibria]
        for ring, reference in zip(other.equilibria, search.equilibria, strict=True):
            assert ring.energy == pytest.approx(reference.energy, rel=1e-9)
            assert ring.residual <= 1e-10
        assert laplace(other).minus_lnJ == pytest.approx(log_j, abs=1e-6)
    return search


def check_sample(seed, count, cuts):
    rng = np.random.default_rng(seed)
    for i in range(count):
        letters = random_letters(rng)
        check_cuts(letters, SETS[i % 3], rng.integers(1, len(letters), cuts))


def test_random_molecules_are_the_same_from_every_cut():
    check_sample(21, 60, 2)


@pytest.mark.slow
def test_two_thousand_random_molecules_are_the_same_from_every_cut():
    check_sample(22, 2000, 3)


@pytest.mark.parametrize(("letters", "arguments", "energy"), TWO_MINIMA)
def test_second_minima_are_found_from_every_cut(letters, arguments, energy):
    for cut in range(0, len(letters), 7):
        found = find_rings(chain_of(turned(letters, cut), **arguments))
        assert min(abs(ring.energy_RT - energy) for ring in found.equilibria) < 1e-4


def test_what_is_rolled_back_is_a_ring_of_the_molecule_as_it_is_written():
    """Solved again from where it is, it stays; and its multipliers balance it."""
    rng = np.random.default_rng(23)
    for form in ("wedge", "midstep"):
        letters = random_letters(rng)
        chain = chain_of(letters, step_form=form)
        assert least_rotation(chain.arrays) != 0
        for ring in find_rings(chain).equilibria:
            again = solve_ring(chain, ring.angles)
            assert again.iterations <= 1
            assert np.abs(again.angles - ring.angles).max() < 1e-6
            assert np.abs(again.multipliers - ring.multipliers).max() < 1e-6
            assert again.log_abs_det_kkt == pytest.approx(ring.log_abs_det_kkt, abs=1e-6)


def test_the_canonical_cut_is_one_for_all_cuts():
    rng = np.random.default_rng(24)
    for unit in (random_letters(rng), "ACGT" * 20, "A" * 40, "AAC" * 21):
        first = None
        for cut in rng.integers(0, len(unit), 6):
            steps = chain_of(turned(unit, int(cut))).arrays
            ring = rotated(steps, least_rotation(steps))
            first = ring if first is None else first
            assert np.array_equal(ring.ground, first.ground)
            assert np.array_equal(ring.stiffness, first.stiffness)


def test_a_tracts_across_the_written_ends_do_not_move_the_energy():
    rng = np.random.default_rng(25)
    for _ in range(6):
        body = list(random_letters(rng, 90, 110))
        body[3:9] = "AAAAAA"
        letters = "".join(body)
        energies = [find_rings(chain_of(turned(letters, k))).lowest.energy for k in range(12)]
        assert max(energies) == pytest.approx(min(energies), rel=1e-9)
        # Negative control: the rule of an open chain does.
        cut = [find_rings(chain_of(turned(letters, k), closed=False)) for k in range(12)]
        assert np.ptp([found.lowest.energy_RT for found in cut]) > 0.01


def test_another_molecule_of_the_same_letters_is_another_ring():
    """Negative control: what is compared is not blind to the order of the steps."""
    rng = np.random.default_rng(26)
    letters = random_letters(rng)
    other = "".join(rng.permutation(list(letters)))
    gap = find_rings(chain_of(letters)).lowest.energy_RT
    assert abs(gap - find_rings(chain_of(other)).lowest.energy_RT) > 0.01


def test_scan_gives_a_ring_one_row():
    rng = np.random.default_rng(27)
    for angles in SETS:
        arguments = {"angles": load_parameters(angles)}
        letters = random_letters(rng)
        rows = {tuple(scan_row("x", turned(letters, k), arguments)) for k in (0, 11, 40)}
        assert len(rows) == 1
        assert rows.pop()[COLUMNS.index("status")] == "ok"


def brute_force(chain):
    """Minima from 64 registers of three links, with the ring as it is written."""
    nearest = round(chain.relaxed_turns)
    turns = np.arange(64) * (2.0 * np.pi / 64)
    return search_minima(chain, (nearest - 1, nearest, nearest + 1), turns, 1.0, NewtonOptions())


def check_brute_force(seed, count):
    """How many of the molecules lack a minimum less than 3 RT above the lowest."""
    rng = np.random.default_rng(seed)
    missed = 0
    for i in range(count):
        chain = chain_of(random_letters(rng), angles=SETS[i % 3])
        found = [ring.energy_RT for ring in find_rings(chain).equilibria]
        every = [ring.energy_RT for ring in brute_force(chain).equilibria]
        assert min(every) >= min(found) - 1e-6
        near = [energy for energy in every if energy < min(every) + 3.0]
        missed += any(np.abs(np.subtract(found, energy)).min() > 1e-4 for energy in near)
    return missed


def test_brute_force_finds_no_other_minimum():
    assert check_brute_force(28, 15) == 0


@pytest.mark.slow
def test_brute_force_finds_no_other_minimum_in_a_thousand():
    assert check_brute_force(29, 1000) == 0


def test_a_chain_made_of_arrays_is_the_same_from_every_cut():
    rng = np.random.default_rng(30)
    n = 90
    ground = np.array([2.0 * np.pi / 10.5, 0.0, 0.0]) + rng.normal(0.0, 0.08, (n, 3))
    stiffness = np.empty((n, 3, 3))
    for s in range(n):
        root = np.eye(3) + 0.2 * rng.normal(size=(3, 3))
        stiffness[s] = root @ root.T
    reference = find_rings(Chain("arrays", ground, stiffness))
    for cut in (1, 37, 89):
        there = Chain("arrays", np.roll(ground, -cut, 0), np.roll(stiffness, -cut, 0))
        found = find_rings(there)
        assert [r.energy for r in found.equilibria] == [r.energy for r in reference.equilibria]


def test_a_molecule_bent_by_a_turn_misleads_no_search():
    """Second-order prediction is no guide there: every link in reach is started from."""
    letters = "AAAAAACGGGCAAAAAACGGC" * 14
    chain = build_chain(parse_sequence(letters, "phased A-tracts"), "trifonov")
    auto = find_rings(chain).lowest
    every = find_rings(chain, SearchOptions(links="all")).lowest
    assert auto.energy_RT == pytest.approx(every.energy_RT, rel=1e-9)
