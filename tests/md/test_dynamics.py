"""Dynamics: coordinates, determinism, blow-ups, resumption, and exact averages."""

import numpy as np
import pytest
from bead_chains import ring_chain

from dnacheck.md import ensemble as ensemble_module
from dnacheck.md.bead_chain import BeadChain, BeadEnergy, BeadOptions
from dnacheck.md.coordinates import BondCoordinates
from dnacheck.md.dynamics import BondLangevin, highest_frequency
from dnacheck.md.ensemble import EnsembleOptions, sample_ensemble
from dnacheck.md.ensemble_statistics import block_stderr, estimate
from dnacheck.model.chain import Chain, uniform_stiffness
from dnacheck.numerics.outcome import InputError, SolveError, Status

SHORT = EnsembleOptions(samples=6, interval=3, burn_in=2, checkpoint_samples=2, measure="frames")


def open_chain(n_steps=10, persistence_length_A=463.0):
    ground = np.tile([0.6, 0.05, -0.1], (n_steps, 1))
    return Chain(
        "open", ground, uniform_stiffness(n_steps, 1.5), persistence_length_A=persistence_length_A
    )


@pytest.fixture
def shared_context(monkeypatch, chain, energy):
    """Let replicas share one context: building a new one takes a second each."""
    cache = {}

    def energy_of(beads, platform="Reference"):
        key = (beads.closed, beads.chain.name, beads.measure)
        if key not in cache:
            cache[key] = BeadEnergy(beads, platform)
        return cache[key]

    monkeypatch.setattr(ensemble_module, "BeadEnergy", energy_of)


@pytest.mark.parametrize("closed", [True, False])
def test_coordinates_and_beads_belong_together(closed):
    chain = ring_chain()
    coordinates = BondCoordinates(BeadChain(chain, closed))
    rng = np.random.default_rng(0)
    x = coordinates.projected(rng.standard_normal(coordinates.size))
    beads = coordinates.beads(x)
    assert coordinates.of_beads(beads) == pytest.approx(x, abs=1e-12)
    # Virtual work: f.dx is the same in beads and in coordinates, for forces that add up to zero.
    pull = rng.standard_normal(beads.shape)
    pull -= pull.mean(axis=0)
    move = coordinates.projected(rng.standard_normal(coordinates.size))
    work = float(np.sum(pull * (coordinates.beads(x + move) - beads)))
    assert float(coordinates.forces(pull) @ move) == pytest.approx(work, rel=1e-10)


def test_highest_frequency_of_springs():
    rng = np.random.default_rng(1)
    matrix = rng.standard_normal((60, 60))
    matrix = matrix @ matrix.T
    got = highest_frequency(lambda x: -matrix @ x, np.zeros(60), lambda v: v)
    assert got == pytest.approx(np.sqrt(np.linalg.eigvalsh(matrix)[-1]), rel=0.01)


def test_the_highest_frequency_of_a_ring_is_near_two(energy, minima):
    walker = BondLangevin(energy, minima[0].positions, 1.0, 1.0, 1.0, np.random.default_rng(0))
    highest = 2.0 / (walker.time_step_ps / BondCoordinates(energy.beads).unit_ps)
    assert 1.7 < highest < 3.0


def test_a_ring_stays_closed_and_results_do_not_depend_on_threads(chain, minima, shared_context):
    start = minima[0].positions
    one = sample_ensemble(chain, start, True, SHORT, threads=1)
    again = sample_ensemble(chain, start, True, SHORT, threads=1)
    assert one.status is Status.CONVERGED
    assert one.platform == "Reference"
    assert np.array_equal(one.positions, again.positions)
    assert not np.array_equal(one.replicas[0].positions, one.replicas[1].positions)
    bonds = np.linalg.norm(np.diff(one.positions[:, 0::2], axis=1), axis=2)
    closing = np.linalg.norm(one.positions[:, -2] - one.positions[:, 0], axis=1)
    assert np.abs(bonds - 3.4).max() < 1.0
    assert np.abs(closing - 3.4).max() < 1.0
    assert len(one.angles()) == 2
    assert one.elastic_RT()[0].shape == (6,)


def test_a_stopped_run_goes_on_to_the_same_configurations(tmp_path, chain, minima, shared_context):
    start = minima[0].positions
    whole = sample_ensemble(chain, start, True, SHORT, directory=tmp_path / "whole")
    sample_ensemble(chain, start, True, SHORT, directory=tmp_path / "stopped")
    # What a kill leaves: replica 0 lacks its last block, replica 1 has not begun.
    (tmp_path / "stopped" / "replica00_block00002.npz").unlink()
    for block in range(3):
        (tmp_path / "stopped" / f"replica01_block{block:05d}.npz").unlink()
    counted = []
    resumed = sample_ensemble(
        chain,
        start,
        True,
        SHORT,
        directory=tmp_path / "stopped",
        resume=True,
        progress=counted.append,
    )
    assert np.array_equal(resumed.positions, whole.positions)
    assert np.array_equal(resumed.replicas[0].kinetic_RT, whole.replicas[0].kinetic_RT)
    assert sum(counted) == 12
    for name in ("whole", "stopped"):
        blocks = sorted((tmp_path / name).iterdir())
        assert [path.name[:9] for path in blocks] == ["replica00"] * 3 + ["replica01"] * 3


def test_checkpoints_are_neither_overwritten_nor_mixed(tmp_path, chain, minima, shared_context):
    start = minima[0].positions
    sample_ensemble(chain, start, True, SHORT, directory=tmp_path)
    with pytest.raises(InputError, match="resume it, or name a new one"):
        sample_ensemble(chain, start, True, SHORT, directory=tmp_path)
    other = EnsembleOptions(**{**SHORT.__dict__, "seed": 9})
    with pytest.raises(InputError, match="other settings"):
        sample_ensemble(chain, start, True, other, directory=tmp_path, resume=True)
    (tmp_path / "replica00_block00000.npz").write_bytes(b"PK\x03\x04 cut short")
    with pytest.raises(InputError, match="cannot be read"):
        sample_ensemble(chain, start, True, SHORT, directory=tmp_path, resume=True)
    with pytest.raises(InputError, match="no checkpoint"):
        sample_ensemble(chain, start, True, SHORT, directory=tmp_path / "new", resume=True)
    with pytest.raises(InputError, match="without a directory"):
        sample_ensemble(chain, start, True, SHORT, resume=True)


def test_a_step_too_long_is_caught_and_what_was_kept_is_kept(chain, minima, shared_context):
    options = EnsembleOptions(
        samples=40, interval=5, burn_in=0, step_fraction=1.15, measure="frames", replicas=1
    )
    with pytest.raises(SolveError, match=r"replica 0, frame \d+: the dynamics blew up") as caught:
        sample_ensemble(chain, minima[0].positions, True, options)
    partial = caught.value.partial
    assert partial.status is Status.NOT_FINITE
    assert len(partial.replicas[0]) < 40
    assert np.all(np.isfinite(partial.positions))
    frame = int(str(caught.value).split("frame ")[1].split(":")[0])
    assert len(partial.replicas[0]) == frame


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"samples": 0}, "samples"),
        ({"step_fraction": float("inf")}, "step_fraction"),
        ({"seed": -1}, "seed"),
        ({"integrator": "verlet"}, "integrator"),
        ({"measure": "flat"}, "measure"),
        ({"bath_ratio": 0.0}, "bath_ratio"),
    ],
)
def test_bad_options_are_named(settings, message):
    with pytest.raises(InputError, match=message):
        EnsembleOptions(**settings)


def test_bad_starts_are_refused(chain, minima):
    with pytest.raises(InputError, match="beads were given"):
        sample_ensemble(chain, minima[0].positions[:-1])
    broken = np.array(minima[0].positions)
    broken[5] = np.inf
    with pytest.raises(InputError, match="not a finite number"):
        sample_ensemble(chain, broken)
    with pytest.raises(InputError, match="Abacus"):
        sample_ensemble(chain, minima[0].positions, options=EnsembleOptions(platform="Abacus"))


def _reduced_variances(sampled):
    """Variances of tau, theta, phi over their harmonic values, with standard errors."""
    chain = sampled.chain
    scale = chain.energy_scale_RT * np.array([1.5, 1.0, 1.0])
    squares = np.stack([(a - chain.ground) ** 2 for a in sampled.angles()]).mean(axis=2) * scale
    return squares.mean(axis=(0, 1)), block_stderr(squares)


@pytest.mark.md
@pytest.mark.parametrize("integrator", ["bond-langevin", "langevin-middle"])
def test_an_open_chain_has_half_rt_in_every_angle(integrator):
    """In the flat measure the angles of an open chain are independent Gaussians, exactly."""
    chain = open_chain(8)
    interval = 8 if integrator == "bond-langevin" else 30
    options = EnsembleOptions(
        samples=2500, interval=interval, integrator=integrator, replicas=1, seed=3
    )
    start = BeadChain(chain, False).positions(chain.ground)
    sampled = sample_ensemble(chain, start, False, options)
    energy = estimate(np.stack(sampled.elastic_RT()))
    assert energy.stderr < 0.4
    assert abs(energy.mean - 12.0) < 4.0 * energy.stderr
    mean, stderr = _reduced_variances(sampled)
    assert np.all(np.abs(mean - 1.0) < 4.0 * stderr)
    assert abs(sampled.kinetic_temperature_K - 300.0) < 6.0


@pytest.mark.md
def test_the_measure_of_frames_stiffens_theta():
    """At 10 RT per square radian cos(theta) narrows theta by a tenth; "angles" undoes it."""
    chain = open_chain(6, persistence_length_A=34.0)
    start = BeadChain(chain, False).positions(chain.ground)
    theta = np.linspace(-np.pi / 2, np.pi / 2, 20001)
    weight = np.exp(-5.0 * (theta - 0.05) ** 2)
    flat = float(np.sum(10.0 * (theta - 0.05) ** 2 * weight) / weight.sum())
    weight = weight * np.cos(theta)
    curved = float(np.sum(10.0 * (theta - 0.05) ** 2 * weight) / weight.sum())
    assert curved < 0.93 * flat
    for measure, expected in (("frames", curved), ("angles", flat)):
        options = EnsembleOptions(
            samples=4000, interval=12, measure=measure, replicas=1, seed=5, step_fraction=0.3
        )
        mean, stderr = _reduced_variances(sample_ensemble(chain, start, False, options))
        assert abs(mean[1] - expected) < 4.0 * stderr[1]
        assert stderr[1] < 0.018


@pytest.mark.md
def test_half_the_time_step_leaves_a_ring_as_it_is():
    """Mean energy and variances of a ring at the default step, at half of it, by Metropolis."""
    from dnacheck.cyclization.ensembles.metropolis import ClosedRingOptions, closed_ring_ensemble
    from dnacheck.equilibria.discrete.search import find_rings

    chain = ring_chain(24)
    ring = find_rings(chain).lowest
    start = BeadChain(chain).positions(ring.angles)
    energies, variances, errors = [], [], []
    for fraction, interval in ((0.45, 12), (0.225, 24)):
        options = EnsembleOptions(
            samples=1200, interval=interval, burn_in=30, replicas=1, step_fraction=fraction, seed=8
        )
        sampled = sample_ensemble(chain, start, True, options)
        energies.append(estimate(np.stack(sampled.elastic_RT())))
        angles = np.stack(sampled.angles())
        squares = ((angles - angles.mean(axis=(0, 1))) ** 2).mean(axis=2)
        variances.append(squares.mean(axis=(0, 1)))
        errors.append(block_stderr(squares))
    other = closed_ring_ensemble(chain, ring, ClosedRingOptions(samples=1500), 3)
    exact = (other.angle_deviation**2).mean(axis=0)
    for energy, variance, error in zip(energies, variances, errors, strict=True):
        sigma = np.hypot(energy.stderr, other.energy_RT.stderr)
        assert sigma < 0.01 * other.energy_RT.mean
        assert abs(energy.mean - other.energy_RT.mean) < 3.5 * sigma
        assert np.all(error < 0.02 * exact)
        assert np.all(np.abs(variance - exact) < 3.5 * np.hypot(error, 0.01 * exact))


@pytest.mark.md
def test_replicas_side_by_side_and_openmms_own_checkpoints(tmp_path):
    chain = ring_chain(12)
    start = BeadEnergy(BeadChain(chain)).beads.positions(chain.ground)
    from dnacheck.md.geometry import planar_ring

    start = planar_ring(chain, 4, 0.0, 10.0)
    for integrator, platform in (("bond-langevin", "Reference"), ("langevin-middle", "CPU")):
        options = EnsembleOptions(
            samples=4, interval=5, burn_in=1, checkpoint_samples=2, integrator=integrator,
            platform=platform, measure="frames", energy_limit=1e6,
        )  # fmt: skip
        one = sample_ensemble(chain, start, True, options, threads=1)
        two = sample_ensemble(
            chain, start, True, options, threads=2, directory=tmp_path / integrator
        )
        assert two.platform == platform
        assert np.array_equal(one.positions, two.positions)
        for path in (tmp_path / integrator).glob("*_block00001.npz"):
            path.unlink()
        resumed = sample_ensemble(
            chain, start, True, options, directory=tmp_path / integrator, resume=True
        )
        assert np.array_equal(one.positions, resumed.positions)


def test_spring_options_reach_the_system():
    soft = BeadChain(ring_chain(), options=BeadOptions(bond_factor=1.0))
    stiff = BeadChain(ring_chain(), options=BeadOptions(bond_factor=4.0))
    assert soft.bond_deviation == pytest.approx(2.0 * stiff.bond_deviation)
