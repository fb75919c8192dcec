"""J of bound molecules by independent methods, and the ratio of binding constants."""

import math
from dataclasses import replace

import numpy as np
import pytest

from dnacheck.cyclization.binding import binding, facing_deg
from dnacheck.cyclization.closure.method import ClosureSampling
from dnacheck.cyclization.ensembles.metropolis import ClosedRingOptions, closed_ring_ensemble
from dnacheck.cyclization.half_chain.method import HalfChain
from dnacheck.cyclization.laplace.isolated import laplace
from dnacheck.cyclization.laplace.method import Laplace
from dnacheck.cyclization.method import Run
from dnacheck.equilibria.boundary import HingedRing, NickedRing
from dnacheck.equilibria.discrete.boundary_search import find_equilibria
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.equilibria.discrete.solve import solve_ring
from dnacheck.model.chain import build_chain
from dnacheck.model.guests import bind
from dnacheck.model.molecules import embedded
from dnacheck.numerics.outcome import InputError
from tests.dense_closure import block_diagonal, closure_hessian, jacobian, null_space
from tests.short_chains import closed_ground_chain


@pytest.fixture(scope="module")
def bound():
    return bind(build_chain(embedded("11T15")), 125, "cap")


def test_laplace_agrees_with_dense_algebra_over_the_free_steps():
    chain = bind(closed_ground_chain(), 5, "roll=20@0,1,2")
    ring = find_rings(chain).lowest
    scale = chain.energy_scale_RT
    free = np.repeat(~chain.bound, 3)
    rows = jacobian(ring.angles, "wedge")[:, free]
    hessian = scale * (
        block_diagonal(chain.elastic().stiffness)
        + closure_hessian(ring.angles, ring.multipliers, "wedge")
    )
    basis = null_space(rows)
    log_det = np.linalg.slogdet(basis.T @ hessian[np.ix_(free, free)] @ basis)[1]
    log_det += np.linalg.slogdet(rows @ rows.T)[1]
    log_det_k = np.linalg.slogdet(scale * chain.stiffness[~chain.bound])[1].sum()
    expected = (
        math.log(8.0 * math.pi**2 * 1660.539 / chain.rise_A**3)
        - ring.energy_RT
        + 0.5 * log_det_k
        - 3.0 * math.log(2.0 * math.pi)
        - 0.5 * log_det
    )
    search = find_rings(chain)
    assert laplace(replace(search, equilibria=(ring,))).minus_lnJ == pytest.approx(
        -expected, abs=1e-5
    )


def test_laplace_of_a_guest_is_the_limit_of_stiff_steps(bound):
    value = Laplace(register=True).compute(bound).minus_lnJ
    elastic = bound.elastic()
    stiffness = elastic.stiffness.copy()
    stiffness[bound.bound] *= 1e6
    stiff = replace(elastic, stiffness=stiffness)
    search = find_rings(elastic)
    ring = solve_ring(stiff, find_rings(bound).lowest.angles)
    limit = Laplace(register=True).compute(replace(search, source=stiff, equilibria=(ring,)))
    assert limit.minus_lnJ == pytest.approx(value, abs=1e-4)


def test_closure_sampling_and_half_chains_agree_on_a_bound_ring(bound):
    closure = ClosureSampling().compute(bound, rng=1, tolerance=0.01)
    halves = HalfChain().compute(bound, rng=2, tolerance=0.05)
    error = math.hypot(closure.stderr, halves.stderr)
    assert abs(closure.minus_lnJ - halves.minus_lnJ) < 4.0 * error + (halves.bias_bound or 0.0)


def test_ratio_of_binding_constants(bound):
    linkage = binding(bound, ClosureSampling(), Run(rng=3, tolerance=0.03))
    assert linkage.free.minus_lnJ == pytest.approx(16.16, abs=4 * 0.03)
    assert linkage.ratio == pytest.approx(math.exp(linkage.ln_ratio))
    assert linkage.stderr == pytest.approx(math.hypot(linkage.free.stderr, linkage.bound.stderr))
    # CAP's site lies in the outer half of this C-shaped molecule's ring: binding favours closure.
    assert linkage.ln_ratio > 4.0
    assert linkage.to_dict()["guests"] == [{"name": "CAP", "site": 125}]


def test_a_kink_in_the_wrong_direction_opens_the_ring(bound):
    wrong = bind(bound.elastic(0.0), 125, "roll=-40@-5,5")
    right, wrong = (laplace(chain).minus_lnJ for chain in (bound, wrong))
    assert wrong > right + 4.0


def test_positive_kinks_turn_the_major_groove_of_their_steps_inwards(bound):
    site = bound.guests[0].site
    ring = find_rings(bound).lowest
    # Half a turn of the helix away, at the dyad, the minor groove faces inwards.
    assert abs(facing_deg(ring, site - 5)) < 60.0
    assert abs(facing_deg(ring, site)) > 120.0


def test_nothing_bound_is_refused(bound):
    with pytest.raises(InputError, match="holds no guest"):
        binding(bound.elastic(0.0), Laplace())


def test_thermal_motion_of_a_bound_ring_by_two_kinds_of_moves():
    chain = bind(closed_ground_chain(20, 2, 60.0), 5, "roll=25@0,1,2")
    ring = find_rings(chain).lowest
    runs = [
        closed_ring_ensemble(chain, ring, options, rng)
        for options, rng in (
            (ClosedRingOptions(samples=300, constrained=0, copies=4), 1),
            (ClosedRingOptions(samples=300, crankshafts=0, copies=4), 2),
        )
    ]
    for run in runs:
        assert run.angle_deviation[chain.bound].max() < 1e-12
        assert run.angle_deviation[~chain.bound].min() > 1e-3
    first, second = (run.energy_RT for run in runs)
    assert abs(first.mean - second.mean) < 4.0 * math.hypot(first.stderr, second.stderr)
    # Stiff steps move harmonically: half RT for each free angle, less the six of closure.
    harmonic = ring.energy_RT + 0.5 * (3 * chain.n_free - 6)
    assert abs(second.mean - harmonic) < 4.0 * second.stderr + 0.03 * harmonic
    # Negative control: the held steps' angles do not count.
    assert abs(second.mean - harmonic - 4.5) > 4.0 * second.stderr


@pytest.mark.parametrize("ends", [NickedRing(), HingedRing()])
def test_j_of_open_ends_with_a_guest_is_the_limit_of_stiff_steps(bound, ends):
    elastic = bound.elastic()
    stiffness = elastic.stiffness.copy()
    stiffness[bound.bound] *= 1e5
    held = find_equilibria(bound, ends)
    stiff = find_equilibria(replace(elastic, stiffness=stiffness), ends)
    assert held.boundary == ends
    for method in (Laplace(), Laplace(register=True)):
        limit = method.compute(stiff).minus_lnJ
        assert method.compute(held).minus_lnJ == pytest.approx(limit, abs=1e-4)
    # Negative control: it is not the closed ring's.
    closed = Laplace(register=True).compute(bound).minus_lnJ
    assert abs(Laplace(register=True).compute(held).minus_lnJ - closed) > 0.05


def test_linkage_of_open_ends_compares_open_ends(bound):
    linkage = binding(bound, Laplace(), boundary=NickedRing())
    free = laplace(find_equilibria(bound.elastic(0.0), NickedRing())).minus_lnJ
    assert linkage.free.minus_lnJ == pytest.approx(free)
