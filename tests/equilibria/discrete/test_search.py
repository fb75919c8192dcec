"""The search for the lowest ring: links, registers, lengths, stiffness ratios, hard cases."""

import numpy as np
import pytest

from dnacheck.equilibria.discrete.search import SearchOptions, find_rings, search_minima
from dnacheck.equilibria.discrete.solve import NewtonOptions
from dnacheck.model.chain import Chain, build_chain, uniform_stiffness
from dnacheck.model.molecules import embedded
from dnacheck.model.sequence import Sequence
from dnacheck.numerics.outcome import InputError

SETS = ("trifonov2", "trifonov", "desantis")


def random_chain(rng, low, high, ratio=1.5, angles="trifonov2"):
    n = int(rng.integers(low, high + 1))
    return build_chain(Sequence("random", "".join(rng.choice(list("ACGT"), n))), angles, ratio)


def brute_force(chain, links=5, registers=32):
    nearest = round(chain.relaxed_turns)
    around = tuple(range(nearest - links // 2, nearest + links // 2 + 1))
    turns = np.arange(registers) * (2.0 * np.pi / registers)
    return search_minima(chain, around, turns, np.inf, NewtonOptions())


def check_stable(chain):
    found = find_rings(chain)
    assert found.failed_starts == 0
    assert found.lowest.stable
    assert found.lowest.residual < 1e-10
    energies = [ring.energy for ring in found.equilibria]
    assert energies == sorted(energies)
    return found


def test_random_sequences_end_in_stable_minima():
    rng = np.random.default_rng(11)
    for _ in range(20):
        for angles in SETS:
            check_stable(random_chain(rng, 60, 400, angles=angles))


def test_brute_force_finds_nothing_lower():
    rng = np.random.default_rng(12)
    for angles in SETS:
        chain = random_chain(rng, 60, 250, angles=angles)
        lowest = find_rings(chain).lowest.energy
        assert brute_force(chain, registers=8).lowest.energy >= lowest * (1.0 - 1e-9)


@pytest.mark.parametrize("unit", ["A", "AT", "AAC"])
def test_repeats_whose_register_is_all_but_free(unit):
    """The energy of a short repeat hardly knows its register; some registers are still worse."""
    for n in range(10, 73, 4 if len(unit) > 1 else 1):
        letters = (unit * n)[:n]
        found = find_rings(build_chain(Sequence(f"{unit}{n}", letters), a_tracts="none"))
        assert found.failed_starts == 0
        assert found.lowest.residual < 1e-10
        around = brute_force(found.chain, 1, 6)
        assert around.lowest.energy >= found.lowest.energy * (1.0 - 1e-9)


@pytest.mark.slow
def test_a_thousand_random_sequences_end_in_stable_minima():
    rng = np.random.default_rng(13)
    for _ in range(1000):
        letters = "".join(rng.choice(list("ACGT"), int(rng.integers(60, 401))))
        for angles in SETS:
            check_stable(build_chain(Sequence("random", letters), angles))


@pytest.mark.slow
def test_brute_force_finds_nothing_lower_on_fifty():
    rng = np.random.default_rng(14)
    for i in range(50):
        chain = random_chain(rng, 60, 400, angles=SETS[i % 3])
        lowest = find_rings(chain).lowest.energy
        assert brute_force(chain).lowest.energy >= lowest * (1.0 - 1e-9)


def test_a_search_of_the_wrong_link_is_higher():
    """Negative control of the comparison with brute force."""
    chain = build_chain(embedded("09T15"))
    far = find_rings(chain, SearchOptions(links=14)).lowest
    assert far.energy > 2.0 * find_rings(chain).lowest.energy


@pytest.mark.parametrize("ratio", [0.05, 0.5, 5.0, 20.0])
def test_extreme_twist_ratios(ratio):
    rng = np.random.default_rng(15)
    for angles in SETS:
        check_stable(random_chain(rng, 80, 200, ratio, angles))


@pytest.mark.parametrize("n", [10, 13, 20])
def test_very_short_molecules(n):
    chain = build_chain(Sequence("short", ("ACGTTGCAAC" * 2)[:n]))
    assert check_stable(chain).lowest.energy > 0.5


def test_ten_thousand_base_pairs():
    rng = np.random.default_rng(16)
    chain = random_chain(rng, 10_000, 10_000)
    found = find_rings(chain, SearchOptions(links=round(chain.relaxed_turns)))
    assert found.lowest.stable
    assert found.lowest.residual < 1e-10


def test_straight_isotropic_chain_is_the_flat_ring():
    """Its energy is that of an N-gon: bending 2 pi / N a step, with twist spread evenly."""
    n, turns = 105, 10.0
    ground = np.tile([2.0 * np.pi * turns / n, 0.0, 0.0], (n, 1))
    lowest = find_rings(Chain("straight", ground, uniform_stiffness(n, 1.5))).lowest
    # The wedge form splits one bend into theta and phi, which costs a fourth-order excess.
    assert lowest.energy == pytest.approx(0.5 * n * (2.0 * np.pi / n) ** 2, rel=2e-3)
    assert lowest.link == 10
    assert lowest.writhe == pytest.approx(0.0, abs=1e-6)
    # The register is free, up to the wedge form's own small preference.
    assert abs(lowest.smallest_eigenvalue) < 1e-3


def test_half_a_turn_of_excess_has_two_nearly_equal_links():
    n = 150
    ground = np.tile([2.0 * np.pi * 14.5 / n, 0.0, 0.0], (n, 1))
    found = find_rings(Chain("half", ground, uniform_stiffness(n, 1.5)))
    # A straight chain's register is free: a family of rings of one energy, not one ring.
    assert all(ring.status.ok and ring.stable is not False for ring in found.equilibria)
    by_link = {ring.link: ring.energy for ring in reversed(found.equilibria)}
    assert set(by_link) >= {14, 15}
    assert by_link[14] == pytest.approx(by_link[15], rel=5e-3)
    # Half a turn of twist on top of a flat ring.
    twist = 0.5 * 1.5 * np.pi**2 / n
    assert by_link[14] == pytest.approx(0.5 * (2.0 * np.pi) ** 2 / n + twist, rel=1e-2)


@pytest.mark.parametrize("links", ["some", 1.5, True, None])
def test_bad_links_are_refused(links):
    with pytest.raises(InputError, match="link must be"):
        SearchOptions(links=links)


def test_a_bound_on_the_links_is_said():
    rng = np.random.default_rng(17)
    soft = random_chain(rng, 400, 400, 0.01)
    found = find_rings(Chain("soft", soft.ground, soft.stiffness, persistence_length_A=30.0))
    assert len(found.links_searched) <= 64
    assert any("only the 64 links nearest" in note for note in found.notes)
