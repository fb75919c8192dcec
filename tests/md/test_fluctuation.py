"""Profiles of fluctuation: errors, attenuation, and dynamics against Metropolis sampling."""

from dataclasses import replace

import numpy as np
import pytest
from bead_chains import coupled_stiffness, ring_chain

from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.md.bead_chain import BeadChain, BeadEnergy
from dnacheck.md.ensemble import EnsembleOptions, sample_ensemble
from dnacheck.md.ensemble_statistics import estimate
from dnacheck.md.fluctuation import compare_profiles, fluctuation_profile
from dnacheck.md.geometry import per_base_pair_fluctuation
from dnacheck.md.harmonic import harmonic_fluctuation
from dnacheck.md.minimise import minimise
from dnacheck.numerics.outcome import InputError

CIRCLE = np.stack(
    [np.cos(np.arange(24) * np.pi / 12), np.sin(np.arange(24) * np.pi / 12), np.zeros(24)], axis=1
)


def smooth_draws(rng, frames, width):
    """Displacements of a few waves, the amplitude of which varies along the ring."""
    turns = np.arange(24) * np.pi / 12
    waves = np.stack([wave(k * turns) for k in (2, 3, 5) for wave in (np.cos, np.sin)])
    size = 1.0 + width * np.sin(np.arange(24) * np.pi / 12)
    move = np.einsum("fkc,kn->fnc", rng.standard_normal((frames, 6, 3)), waves)
    return 90.0 * CIRCLE + 2.0 * move * size[:, None]


def test_a_profile_is_that_of_the_geometry_module_and_its_error_is_the_scatter():
    rng = np.random.default_rng(0)
    runs = [smooth_draws(rng, 400, 0.3) for _ in range(40)]
    profiles = [fluctuation_profile(run.reshape(2, 200, 24, 3), 90.0 * CIRCLE) for run in runs]
    got = np.stack([p.fluctuation_A for p in profiles])
    assert got[0] == pytest.approx(per_base_pair_fluctuation(runs[0], 90.0 * CIRCLE), rel=1e-12)
    assert profiles[0].frames == 400
    claimed = np.stack([p.stderr_A for p in profiles]).mean()
    assert claimed == pytest.approx(got.std(axis=0, ddof=1).mean(), rel=0.15)


def test_correlation_expected_of_noisy_profiles_is_the_one_found():
    rng = np.random.default_rng(1)
    found = []
    for _ in range(40):
        pair = [
            fluctuation_profile(smooth_draws(rng, 200, 0.08)[None], 90.0 * CIRCLE) for _ in range(2)
        ]
        found.append(compare_profiles(*pair))
    correlation = np.mean([f.correlation for f in found])
    expected = np.mean([f.expected_correlation for f in found])
    assert 0.5 < correlation < 0.97
    assert expected == pytest.approx(correlation, abs=0.03)
    ratios = np.array([f.mean_ratio for f in found])
    assert ratios.std(ddof=1) == pytest.approx(
        np.mean([f.mean_ratio_stderr for f in found]), rel=0.35
    )


def test_bad_profiles_are_refused():
    draws = smooth_draws(np.random.default_rng(2), 40, 0.1)
    with pytest.raises(InputError, match="centres have shape"):
        fluctuation_profile(draws, 90.0 * CIRCLE)
    with pytest.raises(InputError, match="too few"):
        fluctuation_profile(draws[None, :5], 90.0 * CIRCLE)
    with pytest.raises(InputError, match="two blocks"):
        fluctuation_profile(draws[None], 90.0 * CIRCLE, blocks=1)
    short = fluctuation_profile(draws[None, :, :20], 90.0 * CIRCLE[:20])
    with pytest.raises(InputError, match="24 and 20"):
        compare_profiles(fluctuation_profile(draws[None], 90.0 * CIRCLE), short)


def softened(chain, factor):
    """Half of the steps softer, all of them with couplings that differ from step to step."""
    stiffness = coupled_stiffness(chain.n_steps)
    stiffness[: chain.n_steps // 2] *= factor
    return replace(chain, stiffness=stiffness, twist_ratio=None)


@pytest.mark.md
@pytest.mark.parametrize("form", ["wedge", "midstep"])
def test_dynamics_and_metropolis_fluctuate_alike_where_one_half_is_soft(form):
    """A strong profile under a full stiffness; the uniform chain's profile must not pass."""
    from dnacheck.cyclization.ensembles.metropolis import ClosedRingOptions, closed_ring_ensemble

    chain = replace(softened(ring_chain(60), 0.15), step_form=form)
    ring = find_rings(chain).lowest
    energy = BeadEnergy(BeadChain(chain))
    minimum = minimise(energy, energy.beads.positions(ring.angles))
    assert minimum.energy_RT == pytest.approx(ring.energy_RT, rel=1e-8)
    options = EnsembleOptions(samples=1200, interval=15, burn_in=60, seed=4)
    sampled = sample_ensemble(chain, minimum.positions, True, options)
    ours = fluctuation_profile(sampled.positions[:, 0::2].reshape(2, -1, 60, 3), minimum.centres_A)
    other = closed_ring_ensemble(chain, ring, ClosedRingOptions(samples=1500), 2)
    theirs = fluctuation_profile(
        other.centres_A.astype(float).reshape(4, 1500, 60, 3), minimum.centres_A
    )
    found = compare_profiles(ours, theirs)
    assert found.variation > 0.1
    assert found.correlation >= 0.99
    # Some hundred independent shapes: 3 % to within two standard errors.
    assert found.mean_ratio_stderr < 0.025
    assert abs(found.mean_ratio - 1.0) < 0.03 + 2.0 * found.mean_ratio_stderr
    mean = estimate(np.stack(sampled.elastic_RT()))
    gap = mean.mean - other.energy_RT.mean
    assert abs(gap) < 4.0 * np.hypot(mean.stderr, other.energy_RT.stderr)
    uniform = BeadEnergy(BeadChain(replace(chain, stiffness=coupled_stiffness(60))))
    flat = harmonic_fluctuation(uniform, minimise(uniform, minimum.positions))
    assert np.corrcoef(flat, theirs.fluctuation_A)[0, 1] < 0.9
