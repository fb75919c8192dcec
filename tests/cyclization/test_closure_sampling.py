"""Exact-closure sampling against brute force, values of a separate prototype, and itself."""

import math
from dataclasses import replace

import numpy as np
import pytest
from dense_closure import brute_force_log_j
from short_chains import closed_ground_chain, end_poses, exact_free_angles

from dnacheck.cyclization.closure.kernels.draws import COUNTED, NO_CROSSING, chart_of_link
from dnacheck.cyclization.closure.kernels.projection import solve_six
from dnacheck.cyclization.closure.sampling import ClosureOptions, ClosureSampler, sample_closure
from dnacheck.cyclization.laplace.constrained_minimum import RegisterOptions
from dnacheck.cyclization.laplace.register import register_profile
from dnacheck.cyclization.result import JStatus
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.chain import Chain, build_chain, uniform_stiffness
from dnacheck.model.molecules import embedded
from dnacheck.model.sequence import parse_sequence
from dnacheck.numerics.outcome import InputError


def rough_ring(n, link, stiffness_RT, seed, form="wedge"):
    """A chain that rests nearly closed, with a full random stiffness on every step."""
    rng = np.random.default_rng(seed)
    root = np.eye(3) + 0.2 * rng.standard_normal((n, 3, 3))
    return Chain(
        "rough",
        closed_ground_chain(n, link, stiffness_RT).ground + rng.normal(0.0, 0.15, (n, 3)),
        root @ root.transpose(0, 2, 1),
        persistence_length_A=3.4 * stiffness_RT,
        step_form=form,
    )


def brute_force(chain, halves=8_000, batches=5):
    """-ln J at vanishing window and its standard error, by counting pairs of free half chains."""
    windows = [(0.6, 0.6), (0.45, 0.45), (0.3, 0.3)]
    squares = np.square([w[0] for w in windows])
    values = []
    n = chain.n_steps
    for batch in range(batches):
        rng = np.random.default_rng(batch)
        first = end_poses(exact_free_angles(chain, halves, rng)[:, : n // 2])
        second = end_poses(exact_free_angles(chain, halves, rng)[:, n // 2 :])
        counts = -brute_force_log_j(chain, first, second, windows)
        values.append(np.polyfit(squares, counts, 1)[-1])
    return float(np.mean(values)), float(np.std(values, ddof=1) / math.sqrt(batches))


@pytest.mark.parametrize(
    "chain", [rough_ring(12, 2, 10.0, 2), closed_ground_chain(14, 1, 10.0)], ids=["rough", "even"]
)
def test_meets_brute_force_on_soft_short_chains(chain):
    expected, error = brute_force(chain)
    result = sample_closure(chain, ClosureOptions(tolerance=0.008), seed=1)
    assert abs(result.minus_lnJ - expected) < 3.5 * math.hypot(error, result.stderr)
    assert error < 0.05
    # Laplace's value lies outside these errors, so the agreement says something.
    laplace = -register_profile(chain).log_j
    assert abs(laplace - expected) > 3.0 * error


def test_a_wrong_width_of_the_draws_is_caught():
    """Negative control: draws 5 % wider than the weights believe miss by many errors."""
    chain = rough_ring(12, 2, 10.0, 2)
    profile = register_profile(chain)
    good = sample_closure(profile, ClosureOptions(tolerance=0.008), seed=1)
    charts = tuple(
        replace(
            chart,
            rings=tuple(
                replace(r, factors=r.factors._replace(root=1.05 * r.factors.root))
                for r in chart.rings
            ),
        )
        for chart in profile.charts
    )
    wrong = sample_closure(replace(profile, charts=charts), ClosureOptions(tolerance=0.008), seed=1)
    assert abs(wrong.minus_lnJ - good.minus_lnJ) > 10 * math.hypot(good.stderr, wrong.stderr)


@pytest.mark.parametrize(
    ("name", "value", "sigma"), [("08T15", 15.762, 0.011), ("09T15", 15.531, 0.010)]
)
def test_meets_the_prototype_of_the_notes(name, value, sigma):
    result = sample_closure(build_chain(embedded(name)), ClosureOptions(tolerance=0.008), seed=2)
    assert abs(result.minus_lnJ - value) < 3 * math.hypot(sigma, result.stderr)
    assert result.stderr <= 0.008
    assert result.effective_samples > 0.85 * result.samples
    assert result.status is JStatus.CONVERGED


def test_does_not_depend_on_the_registers_chosen():
    """Other slices, other Gaussians, the same J: the weights are exact, not only nearly so."""
    chain = build_chain(parse_sequence("ACGTTGCATGCCGATA" * 8, "soft"), twist_ratio=0.7)
    search = find_rings(chain)
    options = ClosureOptions(tolerance=0.006)
    one = sample_closure(register_profile(search), options, seed=3)
    other = sample_closure(
        register_profile(search, RegisterOptions(spacing=0.5, fewest=26)), options, seed=4
    )
    assert abs(one.minus_lnJ - other.minus_lnJ) < 3 * math.hypot(one.stderr, other.stderr)


def test_midstep_form():
    chain = rough_ring(10, 1, 12.0, 5, "midstep")
    profile = register_profile(chain)
    fine = register_profile(chain, RegisterOptions(spacing=0.5, fewest=28))
    one = sample_closure(profile, ClosureOptions(tolerance=0.008), seed=5)
    other = sample_closure(fine, ClosureOptions(tolerance=0.008), seed=6)
    assert abs(one.minus_lnJ - other.minus_lnJ) < 3.5 * math.hypot(one.stderr, other.stderr)


def test_straight_molecule_is_sampled_as_sharply_as_a_bent_one():
    ground = np.zeros((105, 3))
    ground[:, 0] = 2 * math.pi / 10.5
    chain = Chain("straight", ground, uniform_stiffness(105, 1.5), twist_ratio=1.5)
    profile = register_profile(chain)
    result = sample_closure(profile, ClosureOptions(tolerance=0.01), seed=7)
    assert result.effective_samples > 0.85 * result.samples
    # First anharmonic correction of Shimada & Yamakawa: 0.514 L / b, b = 2 P.
    expected = 0.514 * 105 * 3.4 / (2 * 463.0)
    assert -profile.log_j - result.minus_lnJ == pytest.approx(expected, abs=0.05)


def test_result_is_reproducible_and_independent_of_threads():
    profile = register_profile(build_chain(embedded("15A09")))
    options = ClosureOptions(tolerance=0.02)
    one = sample_closure(profile, options, seed=8)
    two = sample_closure(profile, replace(options, threads=2), seed=8)
    assert (one.minus_lnJ, one.stderr) == (two.minus_lnJ, two.stderr)
    assert sample_closure(profile, options, seed=9).minus_lnJ != one.minus_lnJ


def test_links_add_up_to_j():
    chain = build_chain(parse_sequence("ACGTTGCATGCCGATA" * 16, "two links"), twist_ratio=0.6)
    result = sample_closure(chain, ClosureOptions(tolerance=0.03), seed=10)
    total = sum(math.exp(-share.minus_lnJ) for share in result.links)
    assert result.molar == pytest.approx(total, rel=1e-9)
    assert len(result.links) >= 2


def test_a_link_whose_weight_underflows_has_no_share():
    profile = register_profile(closed_ground_chain())
    sampler = ClosureSampler(profile, ClosureOptions(first_batches=4, most_draws=1), 1)
    draws = sampler.draw()
    record = draws.record
    record.log_weights[0, 0], record.links[0, 0], record.codes[0, 0] = -900.0, 99, COUNTED
    result = sampler.result(draws, 0.0)
    assert math.isfinite(result.minus_lnJ)
    assert 99 not in [share.link for share in result.links]


def test_unreachable_tolerance_is_said():
    profile = register_profile(build_chain(embedded("12A09")))
    options = ClosureOptions(tolerance=1e-4, most_draws=320)
    result = sample_closure(profile, options, seed=11)
    assert result.status is JStatus.TOLERANCE_NOT_MET
    assert result.stderr > 1e-4
    timed = sample_closure(profile, ClosureOptions(tolerance=1e-5, max_seconds=0.2), seed=11)
    assert timed.status is JStatus.TOLERANCE_NOT_MET


def test_probes_count_what_hard_draws_leave_out():
    """A floppy chain: some branches fold, and the probes find shapes that were not counted."""
    chain = rough_ring(20, 2, 2.5, 12)
    result = sample_closure(chain, ClosureOptions(tolerance=1.0, probe_rate=0.3), seed=12)
    assert result.bias_bound > 1e-3
    assert any("no closed shape on their branch" in w for w in result.warnings)


def test_draws_without_a_shape_count_as_zero():
    chain = rough_ring(20, 2, 2.5, 12)
    sampler = ClosureSampler(register_profile(chain), ClosureOptions(), 13)
    draws = sampler.draw().record
    folded = draws.codes == NO_CROSSING
    assert folded.any()
    assert np.all(draws.log_weights[folded] == -math.inf)
    assert np.isnan(draws.corrections[folded]).all()
    assert np.isfinite(draws.corrections[~folded]).all()


@pytest.mark.parametrize(
    "bad",
    [
        {"tolerance": 0.0},
        {"tolerance": math.nan},
        {"tolerance": -1.0},
        {"max_seconds": 0.0},
        {"max_seconds": math.nan},
        {"first_batches": 1},
        {"pairs_per_batch": 0},
        {"threads": 0},
        {"probe_rate": 1.5},
    ],
)
def test_bad_options_are_refused(bad):
    with pytest.raises(InputError):
        ClosureOptions(**bad)


def test_a_link_is_counted_by_the_nearest_chart_of_its_parity():
    covered = np.array([14, 15, 18])
    assert [chart_of_link(k, covered) for k in (12, 13, 14, 16, 17, 19, 20)] == [
        14, 15, 14, 14, 15, 15, 18,
    ]  # fmt: skip
    assert chart_of_link(13, np.array([14])) == 13


def test_six_by_six_solver():
    rng = np.random.default_rng(0)
    matrix, rhs, out = rng.standard_normal((6, 6)), rng.standard_normal(6), np.empty(6)
    det = solve_six(matrix, rhs, out)
    np.testing.assert_allclose(matrix @ out, rhs, atol=1e-10)
    assert det == pytest.approx(np.linalg.det(matrix))


@pytest.mark.slow
def test_one_sigma_interval_holds_the_long_run_value_two_times_in_three():
    profile = register_profile(build_chain(parse_sequence("ACGTTGCATGCCGATAAC" * 5, "90mer")))
    truth = sample_closure(profile, ClosureOptions(tolerance=0.0015), seed=14)
    options = ClosureOptions(tolerance=1.0)
    inside = 0
    for seed in range(200):
        run = sample_closure(profile, options, seed=1000 + seed)
        inside += abs(run.minus_lnJ - truth.minus_lnJ) < run.stderr
    assert 120 <= inside <= 152
