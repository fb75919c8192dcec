"""Rings with bound guests, against stiffened steps, an open chain's loop and dense algebra."""

from dataclasses import replace

import numpy as np
import pytest

from dnacheck.equilibria.boundary import Loop, NickedRing
from dnacheck.equilibria.discrete.bound_search import follow_binding
from dnacheck.equilibria.discrete.boundary_search import find_equilibria
from dnacheck.equilibria.discrete.kernels.search import fill_start
from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
from dnacheck.equilibria.discrete.solve import NewtonOptions, solve_ring
from dnacheck.model.chain import Chain, build_chain, chain_frames, uniform_stiffness
from dnacheck.model.guests import bind, superhelix
from dnacheck.model.molecules import embedded
from dnacheck.numerics.outcome import InputError

GUEST = np.array(
    [[0.60, 0.03, 0.5, 0.2, -0.3, 3.3], [0.62, -0.05, 0.1, 0.0, 0.4, 3.4], [0.5, 0.1, 0.6, 0, 0, 3]]
)


def chain_of(kind):
    if kind == "rigid":
        return build_chain(embedded("11T15"), "olson1998")
    return build_chain(embedded("11T15"), step_form=kind)


def stiffened(chain, factor):
    elastic = chain.elastic()
    stiffness = elastic.stiffness.copy()
    stiffness[chain.bound] *= factor
    return replace(elastic, stiffness=stiffness)


@pytest.mark.parametrize("kind", ["wedge", "midstep", "rigid"])
def test_a_guest_is_the_limit_of_stiff_steps(kind):
    chain = bind(bind(chain_of(kind), 157, GUEST), 60, "roll=35@-5,5")
    ring = find_rings(chain).lowest
    # The gradient of stiff steps rounds off at about stiffness times 1e-16.
    rounded = NewtonOptions(tolerance=1e-7)
    stiff = solve_ring(stiffened(chain, 1e6), ring.angles, rounded)
    assert abs(stiff.energy_RT - ring.energy_RT) < 1e-5
    assert np.abs(stiff.angles - ring.angles).max() < 1e-5
    # Negative control: steps that are merely stiff are told from held ones.
    soft = solve_ring(stiffened(chain, 1e2), ring.angles)
    assert abs(soft.energy_RT - ring.energy_RT) > 1e-4
    np.testing.assert_array_equal(ring.angles[chain.bound], chain.ground[chain.bound])
    assert ring.residual < 1e-10
    assert ring.stable


@pytest.mark.parametrize("kind", ["wedge", "rigid"])
def test_a_ring_with_one_guest_is_a_loop_of_the_rest(kind):
    site = 100
    chain = bind(chain_of(kind), site, GUEST)
    ring = find_rings(chain).lowest
    n, held = chain.n_steps, len(GUEST)
    rest = (np.arange(n - held) + site + held) % n
    if kind == "rigid":
        unit = {"rise_A": chain.rise_A, "persistence_length_A": chain.persistence_length_A}
    else:
        unit = {}
    free = Chain("rest", chain.ground[rest], chain.stiffness[rest], step_form=kind, **unit)
    centres, frames = chain_frames(chain.ground[site : site + held], kind)
    rotation = frames[-1].T
    position = -chain.rise_A * rotation @ centres[-1]
    pose = Loop(tuple(position), tuple(map(tuple, rotation)))
    loop = solve_ring(free, ring.angles[rest], boundary=pose)
    assert loop.energy_RT == pytest.approx(ring.energy_RT, rel=1e-10)
    np.testing.assert_allclose(loop.angles, ring.angles[rest], atol=1e-8)


def test_coordinates_hold_every_base_pair():
    chain = bind(chain_of("wedge"), 40, GUEST)
    ring = find_rings(chain).lowest
    assert ring.centres.shape == (159, 3)
    assert np.abs(ring.centres[-1]).max() < 1e-9
    turned = ring.frames[40].T @ ring.frames[43]
    expected = chain_frames(chain.ground[40:43])[1][-1]
    np.testing.assert_allclose(turned, expected, atol=1e-12)


def test_the_cut_does_not_matter():
    chain = bind(chain_of("wedge"), 20, GUEST)
    other = bind(
        Chain("cut", *(np.roll(a, -21, axis=0) for a in (chain.elastic(0.0).ground,
                                                         chain.elastic(0.0).stiffness))),
        157,
        GUEST,
    )  # fmt: skip
    here, there = find_rings(chain).lowest, find_rings(other).lowest
    assert there.energy == pytest.approx(here.energy, rel=1e-12)
    assert there.link == here.link


def test_a_guest_with_the_rings_own_shape_takes_nothing_away():
    free = find_rings(chain_of("wedge")).lowest
    n = len(free.angles)
    ground = free.chain.ground.copy()
    steps = np.arange(70, 90)
    ground[steps] = free.angles[steps]
    shaped = replace(free.chain, ground=ground)
    held = bind(shaped, 0, "twist=0@70")  # any guest: the record of what is held
    stiffness = held.stiffness.copy()
    stiffness[steps] = 1e30 * np.eye(3)
    guest = replace(held.guests[0], steps=tuple(steps), ground=ground[steps],
                    stiffness=free.chain.stiffness[steps])  # fmt: skip
    chain = replace(held, ground=ground, stiffness=stiffness, guests=(guest,))
    ring = find_rings(chain).lowest
    strain = free.angles[steps] - free.chain.ground[steps]
    stored = 0.5 * np.einsum("si,sij,sj->", strain, free.chain.stiffness[steps], strain)
    assert ring.energy == pytest.approx(free.energy - stored, rel=1e-9)
    np.testing.assert_allclose(ring.angles, free.angles, atol=1e-7)
    assert n == 158


def test_every_link_of_a_bound_ring_is_kept_apart():
    chain = bind(chain_of("wedge"), 125, "cap")
    for link in (15, 16):
        found = find_rings(chain, SearchOptions(links=link))
        assert {ring.link for ring in found.equilibria} == {link}


def test_a_nicked_ring_takes_a_guest():
    chain = bind(chain_of("wedge"), 125, "cap")
    ring = find_rings(chain).lowest
    nicked = find_equilibria(chain, NickedRing()).lowest
    assert nicked.energy < ring.energy
    np.testing.assert_array_equal(nicked.angles[chain.bound], chain.ground[chain.bound])


def test_the_rod_refuses_a_guest():
    from dnacheck.model.rod import build_rod

    with pytest.raises(InputError, match="leave out what is bound"):
        build_rod(bind(chain_of("wedge"), 125, "cap"))


def straight_chain(n=300, repeat=10.5):
    ground = np.zeros((n, 3))
    ground[:, 0] = 2.0 * np.pi / repeat
    return Chain("straight", ground, uniform_stiffness(n, 1.5))


def test_a_nucleosome_takes_one_turn_of_link_from_a_ring():
    free = straight_chain()
    chain = bind(free, 70, "nucleosome")
    found = find_rings(chain)
    # Fuller: a left-handed superhelix of 1.65 turns whose axis climbs at the angle a has the writhe
    # -1.65 (1 - sin a); its 146 steps of 10.2 base pairs a turn have more twist than free ones. The
    # loop that closes the ring writhes too, by less than a tenth of a turn.
    climb = np.arctan(25.9 / (2.0 * np.pi * 41.9))
    shift = -1.65 * (1.0 - np.sin(climb)) + 146.0 / 10.2 - 146.0 / 10.5
    best = free.relaxed_turns + shift
    assert found.lowest.link == 28
    assert {27, 28} <= {ring.link for ring in found}
    # With a nick the rest of the ring has no excess twist, so twist + writhe is the best link.
    nicked = find_equilibria(chain, NickedRing()).lowest
    assert nicked.twist_turns + nicked.writhe == pytest.approx(best, abs=0.1)
    # Negative control: a right-handed superhelix adds link instead.
    values = superhelix(147, 1.65, 41.9, 25.9, 3.4, 10.2)
    # Its mirror image: twist and tilt change sign. The twist is made positive by whole turns.
    values[:, 0] = 2.0 * np.pi - values[:, 0]
    values[:, 1] *= -1.0
    right = find_equilibria(bind(free, 70, values), NickedRing()).lowest
    assert right.writhe > 0.5


def test_a_guest_across_open_ends_is_refused():
    chain = bind(straight_chain(), 200, "nucleosome")
    with pytest.raises(InputError, match="not joined") as caught:
        find_equilibria(chain, NickedRing())
    assert len(str(caught.value).splitlines()) == 1


def test_minima_are_those_of_many_starts():
    chain = bind(chain_of("wedge"), 125, "cap")
    known = find_rings(chain)
    elastic = chain.elastic()
    start = np.empty(chain.ground.shape)
    for link in (14, 15, 16):
        for register in np.arange(8) * np.pi / 4.0:
            fill_start(elastic.arrays, link, register, start)
            ring = solve_ring(chain, start, throw=False)
            if ring.status.ok and ring.stable:
                assert ring.energy > known.lowest.energy - 1e-9


def test_the_bound_ring_is_followed_from_the_free_one():
    chain = bind(chain_of("wedge"), 125, "cap")
    path = follow_binding(chain, points=9)
    shares = [share for share, _ in path]
    assert shares[0] == 0.0
    assert shares[-1] == 1.0
    free = find_rings(chain.elastic(0.0)).lowest
    # Steps held unstressed give up the energy that they stored, and cost the rest a little more.
    assert abs(path[0][1].energy_RT - free.energy_RT) < 1.0
    assert path[-1][1].energy_RT == pytest.approx(find_rings(chain).lowest.energy_RT, rel=1e-9)
    finer = dict(follow_binding(chain, points=17))
    for share, ring in path:
        assert finer[share].energy_RT == pytest.approx(ring.energy_RT, rel=1e-8)
