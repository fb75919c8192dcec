"""Derivatives of ln J from the draws that gave it."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from dnacheck.cyclization.closure import method as closure_method
from dnacheck.cyclization.gradient import closed_draws
from dnacheck.cyclization.laplace.isolated import laplace
from dnacheck.cyclization.laplace.register import register_profile
from dnacheck.cyclization.methods import ClosureSampling
from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.molecules import embedded
from dnacheck.model.named_parameters import modified_chain, own_value
from dnacheck.numerics.outcome import InputError

SEEDS = range(6)
FIXED = ClosureSampling(first_batches=40, most_draws=1)
WITH_GRADIENT = replace(FIXED, gradient=True)


@pytest.fixture(scope="module")
def chain():
    return build_chain(embedded("09T15"))


def changed(chain, ground=0.0, stiffness=0.0):
    """The chain with ground values and stiffness (RT) moved."""
    return replace(
        chain,
        ground=chain.ground + ground,
        stiffness=chain.stiffness + stiffness / chain.energy_scale_RT,
        twist_ratio=None,
    )


def minus_lnJ(chain, seed):
    return FIXED.compute(chain, rng=seed, tolerance=10.0).minus_lnJ


def directions(chain):
    """Names of parameters and how they move the ground values and the stiffness."""
    n = chain.n_steps
    wave = np.zeros((n, 3))
    wave[:, 2] = np.cos(np.arange(n) * 0.6)
    one = np.zeros((n, 3))
    one[40, 1] = 1.0
    twist = np.zeros((n, 3))
    twist[:, 0] = 1.0
    scale = chain.energy_scale_RT * chain.stiffness
    softer = np.zeros((n, 3, 3))
    softer[60, 1, 1] = 1.0
    coupled = np.zeros((n, 3, 3))
    coupled[:, 0, 2] = coupled[:, 2, 0] = 1.0
    return {
        "twist offset": (twist, None, 2e-4),
        "phased roll": (wave, None, 1e-3),
        "one tilt": (one, None, 1e-2),
        "persistence length": (None, scale, 1e-2),
        "one stiffness": (None, softer, 20.0),
        "bend-twist coupling": (None, coupled, 2.0),
    }


@pytest.mark.parametrize(
    "name",
    [
        "twist offset",
        "phased roll",
        "one tilt",
        "persistence length",
        "one stiffness",
        "bend-twist coupling",
    ],
)
def test_central_differences_with_common_random_numbers(chain, name):
    ground, stiffness, h = directions(chain)[name]
    moved = {}
    if ground is not None:
        moved["ground"] = h * ground
    if stiffness is not None:
        moved["stiffness"] = h * stiffness
    back = {key: -value for key, value in moved.items()}
    differences = [
        (minus_lnJ(changed(chain, **back), s) - minus_lnJ(changed(chain, **moved), s)) / (2.0 * h)
        for s in SEEDS
    ]
    spread = np.std(differences, ddof=1) / math.sqrt(len(differences))
    gradient = WITH_GRADIENT.compute(chain, rng=99, tolerance=10.0).derivatives
    value, stderr = gradient.along(ground, stiffness)
    assert stderr > 0.0
    # 3.5: six parameters are compared, and six seeds give the spread.
    assert abs(value - np.mean(differences)) < 3.5 * math.hypot(stderr, spread)


def stiff_ring(factor):
    """Twelve steps of a bent ring, ``factor`` times as stiff as the usual."""
    rng = np.random.default_rng(5)
    n = 12
    ground = 0.1 * rng.standard_normal((n, 3)) + np.array([2.0 * math.pi / n, 0.0, 0.0])
    phase = np.cumsum(ground[:, 0])
    ground[:, 1] -= 0.4 * np.cos(phase)
    ground[:, 2] -= 0.4 * np.sin(phase)
    stiffness = factor * np.tile(np.diag([1.5, 1.0, 1.2]), (n, 1, 1))
    return Chain("stiff", ground, stiffness)


def test_the_limit_of_a_stiff_chain_of_twelve_steps():
    """There Laplace is exact, and so are its central differences."""
    chain = stiff_ring(1000.0)
    gradient = ClosureSampling(gradient=True).compute(chain, rng=1, tolerance=1e-3).derivatives
    pulls, per_stiffness = np.empty((12, 3)), np.empty((12, 3))
    for s in range(12):
        for i in range(3):
            move = np.zeros((12, 3))
            move[s, i] = 1e-4
            pulls[s, i] = (
                -np.diff(
                    [laplace(changed(chain, ground=sign * move)).minus_lnJ for sign in (-1, 1)]
                )[0]
                / 2e-4
            )
            change = np.zeros((12, 3, 3))
            change[s, i, i] = 1e-3 * chain.energy_scale_RT * chain.stiffness[s, i, i]
            per_stiffness[s, i] = -np.diff(
                [laplace(changed(chain, stiffness=sign * change)).minus_lnJ for sign in (-1, 1)]
            )[0] / (2.0 * change[s, i, i])
    size = np.abs(pulls).max()
    np.testing.assert_allclose(gradient.ground, pulls, atol=5e-4 * size)
    found = np.einsum("sii->si", gradient.stiffness)
    np.testing.assert_allclose(found, per_stiffness, atol=5e-4 * np.abs(per_stiffness).max())


def test_a_wrong_sign_would_be_seen(chain):
    """Negative control: the derivative along the ring's own strain is far from zero."""
    gradient = WITH_GRADIENT.compute(chain, rng=2, tolerance=10.0).derivatives
    strain = gradient.ground / chain.energy_scale_RT
    value, stderr = gradient.along(strain)
    assert value > 30.0 * stderr


def test_the_same_draws_give_j_with_and_without_its_gradient(chain):
    plain = ClosureSampling().compute(chain, rng=3, tolerance=0.05)
    with_gradient = ClosureSampling(gradient=True).compute(chain, rng=3, tolerance=0.05)
    draws = closed_draws(chain, rng=3, tolerance=0.05)
    assert plain.derivatives is None
    assert with_gradient.minus_lnJ == plain.minus_lnJ == draws.result.minus_lnJ
    assert draws.weights.sum() == pytest.approx(1.0, abs=1e-12)
    stiffness = chain.energy_scale_RT * chain.stiffness
    mean, errors = draws.average(np.einsum("sij,dsj->dsi", stiffness, draws.strains))
    scale = np.abs(mean).max()
    np.testing.assert_allclose(mean, with_gradient.derivatives.ground, atol=1e-9 * scale)
    np.testing.assert_allclose(errors, with_gradient.derivatives.ground_stderr, rtol=0.4)
    square = np.einsum("dsi,dsj->dsij", draws.strains, draws.strains)
    by_draws = 0.5 * (np.linalg.inv(stiffness) - draws.average(square)[0])
    found = with_gradient.derivatives.stiffness
    np.testing.assert_allclose(found, by_draws, atol=1e-9 * np.abs(found).max())


@pytest.mark.parametrize("gradient", [False, True])
def test_the_time_of_finding_the_minima_counts_once(chain, gradient, monkeypatch):
    profile = replace(register_profile(chain), seconds=0.3)

    def slowly(_):
        time.sleep(profile.seconds)
        return profile

    monkeypatch.setattr(closure_method, "register_profile_of", slowly)
    method = ClosureSampling(gradient=gradient)
    for compute in (method.compute, lambda *a, **k: closed_draws(*a, **k).result):
        began = time.perf_counter()
        result = compute(chain, tolerance=10.0)
        assert profile.seconds < result.seconds < time.perf_counter() - began


def test_errors_cover_the_spread_over_seeds(chain):
    """Chained to the persistence length, where steps are correlated."""
    scale = chain.energy_scale_RT * chain.stiffness
    values, errors = zip(
        *(
            WITH_GRADIENT.compute(chain, rng=s, tolerance=10.0).derivatives.along(stiffness=scale)
            for s in range(40)
        ),
        strict=True,
    )
    # the spread of forty values is known to 11 %
    assert np.std(values, ddof=1) == pytest.approx(np.mean(errors), rel=0.35)


def test_every_shape_that_is_drawn_closes(chain):
    from dnacheck.model.chain_kernels import fill_frames

    draws = closed_draws(chain, FIXED, rng=4, tolerance=10.0)
    n = chain.n_steps
    centres, frames = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    for strain in draws.strains[:20]:
        fill_frames(chain.ground + strain, chain.form_code, centres, frames)
        np.testing.assert_allclose(centres[n], 0.0, atol=1e-8 * n)
        np.testing.assert_allclose(frames[n], np.eye(3), atol=1e-8)


def test_a_derivative_of_another_shape_is_refused(chain):
    gradient = WITH_GRADIENT.compute(chain, tolerance=10.0).derivatives
    with pytest.raises(InputError, match="ground must have the shape"):
        gradient.along(np.ones(3))


def test_gradient_by_name_is_the_slope_of_j():
    """Common random numbers: the same draws, at the ends of a difference."""
    chain = build_chain(embedded("09T15"))
    method = ClosureSampling(gradient=True)
    found = method.compute(chain, rng=5, tolerance=0.01).gradient(["bend_scale", "twist_ratio"])
    for name, width in (("bend_scale", 0.02), ("twist_ratio", 0.05)):
        own = own_value(chain, name)
        ends = [
            ClosureSampling().compute(
                modified_chain(chain, {name: own + s * width}), rng=5, tolerance=0.01
            )
            for s in (1.0, -1.0)
        ]
        slope = (ends[1].minus_lnJ - ends[0].minus_lnJ) / (2.0 * width)
        value, error = found[name]
        assert abs(value - slope) < 3.0 * np.hypot(error, 0.5 * 0.01 / width)
    with pytest.raises(InputError, match="gradient=True"):
        ends[0].gradient("bend_scale")
    with pytest.raises(InputError, match="is unknown"):
        method.compute(chain, rng=5, tolerance=0.1).gradient("stiffnes")
