"""Laplace's J factor against dense algebra and what was measured for the eleven molecules."""

import math
from dataclasses import replace

import numpy as np
import pytest
from dense_closure import block_diagonal, closure_hessian, end_pose, jacobian, null_space
from short_chains import closed_ground_chain, soft_chain

from dnacheck.cyclization.laplace.isolated import (
    SOFT_REGISTER,
    laplace,
    laplace_log_j,
    register_spread,
)
from dnacheck.cyclization.result import JFactor, JStatus, link_shares
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.equilibria.ring import Equilibria
from dnacheck.model.chain import Chain, build_chain, elastic_energy, uniform_stiffness
from dnacheck.model.molecules import embedded, embedded_names
from dnacheck.numerics.outcome import InputError, SolveError


def dense_log_j(ring):
    """ln J (mol/L) of one minimum, with every matrix formed and in RT and Å."""
    chain, q = ring.chain, ring.angles
    scale, rise = chain.energy_scale_RT, chain.rise_A
    n = q.size
    stiffness = scale * block_diagonal(chain.stiffness)
    unit = np.array([rise] * 3 + [1.0] * 3)
    g = unit[:, None] * jacobian(q, chain.step_form)
    force = scale * ring.multipliers
    hessian = stiffness + closure_hessian(q, force, chain.step_form)
    z = null_space(g)
    log_projected = np.linalg.slogdet(z.T @ hessian @ z)[1]
    log_gram = np.linalg.slogdet(g @ g.T)[1]
    return (
        math.log(8 * math.pi**2)
        - scale * elastic_energy(chain, q)
        + 0.5 * np.linalg.slogdet(stiffness / (2 * math.pi))[1]
        + 0.5 * (n - 6) * math.log(2 * math.pi)
        - 0.5 * (log_projected + log_gram)
        + math.log(1660.539)
    )


@pytest.mark.parametrize("form", ["wedge", "midstep"])
def test_equals_dense_algebra(form):
    chain = replace(soft_chain(14, 100.0), step_form=form)
    ring = find_rings(chain).lowest
    assert np.abs(end_pose(ring.angles, form)).max() < 1e-8
    assert laplace_log_j(ring) == pytest.approx(dense_log_j(ring), abs=2e-5)


def test_a_wrong_unit_of_length_would_be_seen():
    """Negative control of the comparison above: steps taken for ångström change ln J by 3 ln l."""
    ring = find_rings(soft_chain(14, 100.0)).lowest
    other = replace(ring, source=replace(ring.chain, rise_A=1.0, persistence_length_A=100.0))
    assert laplace_log_j(other) - dense_log_j(ring) == pytest.approx(3 * math.log(3.4), abs=1e-4)


@pytest.mark.parametrize("name", embedded_names())
def test_entropy_of_the_eleven_lies_where_it_was_measured(name):
    """-ln J - E was 5.2 to 5.9 with a separate prototype; the paper fitted 5.2."""
    search = find_rings(build_chain(embedded(name)))
    result = laplace(search)
    lowest = result.links[0]
    assert 5.2 <= lowest.minus_lnJ - search.lowest.energy_RT <= 5.95
    assert result.method == "laplace"
    assert result.status is JStatus.NO_ERROR_ESTIMATE
    assert math.isinf(result.total_error)


def test_links_add_up():
    result = laplace(build_chain(embedded("09T09")))
    total = sum(math.exp(-share.minus_lnJ) for share in result.links)
    assert result.molar == pytest.approx(total, rel=1e-12)
    assert len(result.links) == 2


def test_a_free_register_is_said():
    ground = np.zeros((150, 3))
    ground[:, 0] = 2 * math.pi / 10.45
    straight = Chain("straight", ground, uniform_stiffness(150, 1.5), twist_ratio=1.5)
    with pytest.raises(SolveError, match="register is free"):
        laplace(straight)


def test_a_soft_register_is_said():
    """A hundredth of the wedge bends leaves a register that the Gaussian does not describe."""
    ground = build_chain(embedded("08T15")).ground * [1.0, 0.01, 0.01]
    chain = Chain("nearly straight", ground, uniform_stiffness(155, 1.5), twist_ratio=1.5)
    ring = find_rings(chain).lowest
    assert register_spread(chain, ring.link, ring.angles, ring.multipliers) > SOFT_REGISTER
    assert laplace(chain).status is JStatus.SOFT_REGISTER


def test_no_ring_is_said():
    chain = closed_ground_chain()
    search = find_rings(chain)
    none = Equilibria(chain, (), search.links_searched, 4, 4, 0.0, search.status)
    with pytest.raises(SolveError, match="no stable ring at links"):
        laplace(none)


def test_a_result_that_is_no_number_is_refused():
    with pytest.raises(InputError, match="is no number"):
        JFactor("x", 10, "laplace", math.nan, 0.0)
    with pytest.raises(InputError, match="is no number"):
        JFactor("x", 10, "closure", 1.0, math.nan)


def test_json_has_the_promised_members():
    record = laplace(build_chain(embedded("08T15"))).to_dict()
    assert {"target", "n_bp", "method", "minus_lnJ", "stderr", "J_molar", "links"} <= set(record)
    assert {"effective_samples", "seconds", "warnings", "bias_bound"} <= set(record)


def test_link_shares_are_sorted_and_leave_out_nothing_but_zero():
    shares = link_shares({3: -5.0, 4: -2.0, 5: -math.inf})
    assert [share.link for share in shares] == [4, 3]


def test_the_stiffness_itself_counts_not_the_ratio_it_was_made_from():
    """Stiffening by c shifts ln J by the known powers of c; the label of the ratio is idle."""
    chain = build_chain(embedded("09T15"))
    stiffer = replace(chain, stiffness=1.05 * chain.stiffness)
    unlabelled = replace(stiffer, twist_ratio=None)
    assert laplace(stiffer).minus_lnJ == pytest.approx(laplace(unlabelled).minus_lnJ, abs=1e-9)
    # E and 3 ln c of the six closure conditions are all that changes in Laplace's formula.
    rise = 0.05 * find_rings(chain).lowest.energy_RT - 3.0 * math.log(1.05)
    single = laplace_log_j(find_rings(chain).lowest) - laplace_log_j(find_rings(stiffer).lowest)
    assert single == pytest.approx(rise, abs=1e-6)
