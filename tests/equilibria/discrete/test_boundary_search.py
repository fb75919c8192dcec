"""Search for the equilibria of chains held otherwise than a ring, from starts of its own."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import ellipe, ellipj, ellipk

from dnacheck.equilibria.boundary import HingedRing, Loop, NickedRing, Pull, Ring
from dnacheck.equilibria.discrete.boundary_search import find_equilibria
from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
from dnacheck.equilibria.discrete.solve import solve_ring
from dnacheck.model.chain import Chain, build_chain, chain_frames
from dnacheck.model.molecules import embedded
from dnacheck.numerics.outcome import InputError

FORMS = ["wedge", "midstep", "rigid"]


def molecule(name="09T15", form="wedge"):
    if form == "rigid":
        return build_chain(embedded(name), "olson1998")
    return build_chain(embedded(name), step_form=form)


def straight(n=150, ratio=1.5):
    ground = np.tile([2.0 * np.pi / 10.45, 0.0, 0.0], (n, 1))
    stiffness = np.tile(np.diag([ratio, 1.0, 1.0]), (n, 1, 1))
    return Chain("straight", ground, stiffness, step_form="midstep")


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("boundary", [NickedRing(), HingedRing()])
def test_nothing_lies_below_what_the_search_finds(boundary, form):
    """Against starts that the search does not use: open shapes bent at random towards a ring."""
    chain = molecule(form=form)
    search = find_equilibria(chain, boundary)
    assert search.equilibria
    assert search.lowest.stable
    rng = np.random.default_rng(11)
    reached = []
    for _ in range(12):
        phase, turns = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-1.0, 1.0)
        along = phase + np.cumsum(chain.ground[:, 0])
        start = chain.ground.copy()
        start[:, 0] += 2.0 * np.pi * turns / chain.n_steps
        start[:, 1] += 2.0 * np.pi / chain.n_steps * np.cos(along)
        start[:, 2] += 2.0 * np.pi / chain.n_steps * np.sin(along)
        found = solve_ring(chain, start, boundary=boundary, throw=False)
        if found.status.ok and found.stable:
            reached.append(found.energy)
    assert len(reached) >= 3
    assert min(reached) == pytest.approx(search.lowest.energy, rel=1e-8)


def as_a_rod(boundary):
    """Energy of the straight molecule's minimum times its length, for steps without length.

    Hinges of N steps differ from a rod in even powers of 1/N; the first is extrapolated away.
    """
    values = [n * find_equilibria(straight(n), boundary).lowest.energy for n in (150, 300)]
    return (4.0 * values[1] - values[0]) / 3.0


def test_a_nicked_straight_molecule_is_a_circle_without_twist():
    assert as_a_rod(NickedRing()) == pytest.approx(2.0 * np.pi**2, rel=1e-7)
    nicked = find_equilibria(straight(), NickedRing()).lowest
    assert nicked.twist_RT == pytest.approx(0.0, abs=1e-4 * nicked.energy_RT)
    # Negative control: with the end turned to a whole number of turns the twist costs energy.
    assert find_rings(straight()).lowest.energy > 1.05 * nicked.energy


def test_a_hinged_straight_molecule_is_the_elastica_whose_ends_meet():
    """No moment at either end: curvature 4 K k cn(2 K s - K) over 0 < s < 1, with 2 E(k) = K(k)."""
    m = brentq(lambda m: 2.0 * ellipe(m) - ellipk(m), 0.5, 0.99)
    quarter = ellipk(m)
    energy = quad(
        lambda s: 8.0 * m * (quarter * ellipj(2.0 * quarter * s - quarter, m)[1]) ** 2, 0.0, 1.0
    )[0]
    assert as_a_rod(HingedRing()) == pytest.approx(energy, rel=1e-7)
    # Negative control: the circle of the nicked ring costs more.
    assert energy < 0.75 * 2.0 * np.pi**2


@pytest.mark.parametrize("form", FORMS)
def test_a_loop_onto_the_start_finds_the_rings(form):
    chain = molecule("11T15", form)
    loops = find_equilibria(chain, Loop())
    ring = find_rings(chain).lowest
    assert loops.lowest.energy_RT == pytest.approx(ring.energy_RT, rel=1e-9)


@pytest.mark.parametrize("form", FORMS)
def test_a_loop_to_where_the_chain_ends_by_itself_costs_nothing(form):
    chain = molecule(form=form)
    centres, frames = chain_frames(chain.ground, chain.step_form)
    pose = Loop(chain.rise_A * centres[-1], frames[-1])
    assert find_equilibria(chain, pose).lowest.energy == pytest.approx(0.0, abs=1e-15)
    turned = frames[-1] @ Rotation.from_rotvec([0.0, 0.0, 0.5]).as_matrix()
    away = Loop(chain.rise_A * centres[-1], turned)
    assert find_equilibria(chain, away).lowest.energy > 1e-4


@pytest.mark.parametrize("form", FORMS)
def test_a_pulled_chain_is_stretched(form):
    chain = molecule(form=form)
    weak, strong = (find_equilibria(chain, Pull(f)).lowest for f in (0.1, 10.0))
    assert weak.stable
    assert strong.stable
    assert strong.centres[-1, 2] > weak.centres[-1, 2] > 0.0


def test_free_ends_have_no_link():
    with pytest.raises(InputError, match="has no link"):
        find_equilibria(straight(), NickedRing(), SearchOptions(links=15))
    assert find_equilibria(straight(), Ring(), SearchOptions(links=14)).lowest.link == 14
