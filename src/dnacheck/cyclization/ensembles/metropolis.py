"""Metropolis ensembles over wedge angles: the free chain, and closed rings.

The J factor by restrained chains is in :mod:`dnacheck.cyclization.umbrella.sampling`.
"""

from __future__ import annotations

import math
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.ensembles.kernels.closed_moves import ACCEPTED, TRIED, run_closed
from dnacheck.cyclization.ensembles.kernels.open_moves import (
    CRANKSHAFT,
    N_MOVES,
    crankshaft_sweep,
    local_sweep,
)
from dnacheck.cyclization.umbrella.mbar import quiet_pymbar
from dnacheck.equilibria.ring import Equilibrium
from dnacheck.model.chain import Chain, chain_frames
from dnacheck.numerics.outcome import InputError
from dnacheck.numerics.random_numbers import random_state
from dnacheck.numerics.superpose import superpose

Array = NDArray[np.float64]

_ACCEPTANCE = 0.45
_TUNING_ROUNDS = 8


@dataclass(frozen=True)
class MoveOptions:
    """Which moves a sweep makes, and how large they are.

    Attributes
    ----------
    singles, pivots : bool
        Whether each step tries its three angles, and one pivot.
    crankshafts : int
        Crankshafts in a sweep.
    reach : float
        Largest change of an angle and largest turn of a pivot or crankshaft, in radians.
    """

    singles: bool = True
    pivots: bool = True
    crankshafts: int = 50
    reach: float = 0.2

    def __post_init__(self) -> None:
        if not (self.singles or self.pivots or self.crankshafts > 0):
            raise InputError("no move is in use")
        if self.crankshafts < 0:
            raise InputError(f"crankshafts must not be negative: {self.crankshafts}")
        if not 0.0 < self.reach <= math.pi:
            raise InputError(f"reach must lie in (0, pi], not {self.reach}")


def sample_free_chain(
    chain: Chain,
    samples: int,
    thinning: int,
    rng: np.random.Generator,
    moves: MoveOptions | None = None,
    start: Array | None = None,
) -> Array:
    """Angles (samples, N, 3) of the open chain by Metropolis moves, every ``thinning`` sweeps.

    Starts from ``start`` (N, 3) or from an exact draw; their distribution is Gaussian with mean
    the ground angles and covariance the inverse stiffness in RT, which makes it a test of the
    moves.
    """
    moves = moves or MoveOptions()
    stiffness = chain.energy_scale_RT * chain.stiffness
    ground = np.ascontiguousarray(chain.ground)
    if start is None:
        roots = np.linalg.cholesky(np.linalg.inv(stiffness))
        start = ground + np.einsum("sij,sj->si", roots, rng.standard_normal(ground.shape))
    angles = np.array(start, dtype=float)
    use = np.array([moves.singles, moves.pivots, moves.crankshafts], dtype=np.int64)
    reach = np.full(N_MOVES, moves.reach)
    state, accepted, mismatch = random_state(rng), np.zeros((N_MOVES, 2)), np.empty(6)
    shapes = np.empty((samples, *ground.shape))
    form = chain.form_code
    for t in range(samples):
        for _ in range(thinning):
            crankshaft_sweep(
                angles, ground, stiffness, form, use[2], moves.reach, True, state, accepted
            )
            local_sweep(
                angles, ground, stiffness, form, 0.0, 1.0, reach, use, True, state, accepted,
                mismatch,
            )  # fmt: skip
        shapes[t] = angles
    return shapes


@dataclass(frozen=True)
class ClosedRingOptions:
    """Length of a closed-ring run.

    Attributes
    ----------
    samples : int
        Recorded shapes of each copy.
    thinning : int
        Sweeps between records.
    burn_in : int
        Records dropped at the start of each copy, while the moves are tuned.
    copies : int
        Independent chains, all from the given ring.
    crankshafts : int or None
        In a sweep; None for as many as the chain has steps.
    constrained : int
        Constrained moves in a sweep.
    threads : int
        Threads used, one a copy; the result does not depend on it.
    """

    samples: int = 250
    thinning: int = 5
    burn_in: int = 40
    copies: int = 4
    crankshafts: int | None = None
    constrained: int = 2
    threads: int = 1

    def __post_init__(self) -> None:
        if self.samples < 20 or self.copies < 2:
            raise InputError("a closed-ring run needs 20 samples and two copies or more")
        if self.thinning < 1 or self.threads < 1 or self.burn_in < _TUNING_ROUNDS:
            raise InputError(
                f"thinning and threads must be positive and burn_in at least {_TUNING_ROUNDS}"
            )
        if self.constrained < 0 or (self.crankshafts is not None and self.crankshafts < 0):
            raise InputError("numbers of moves must not be negative")
        if self.constrained == 0 and self.crankshafts == 0:
            raise InputError("no move is in use")


@dataclass(frozen=True)
class Observable:
    """Mean of a quantity over an ensemble, its standard error and its standard deviation.

    ``effective_samples`` is the number of independent samples that the standard error stands on.
    """

    mean: float
    stderr: float
    deviation: float
    effective_samples: float


@dataclass(frozen=True)
class ClosedRingEnsemble:
    """Thermal ensemble of a closed ring, sampled from exp(-E) delta(closure) dq.

    Attributes
    ----------
    ring : Equilibrium
        Where the copies started.
    energy_RT, writhe, twist, radius_of_gyration_A : Observable
        Elastic energy in RT; turns; turns; Å (about the centroid of the base-pair centres).
    links : dict of int to int
        Samples at each link: chains may pass through themselves.
    angle_mean, angle_deviation, angle_stderr : ndarray, shape (N, 3)
        Of tau, theta, phi of each step over the ensemble, radians; the error is of the mean.
    mean_centres_A : ndarray, shape (N, 3)
        Mean of the base-pair centres, each sample superposed on it.
    fluctuation_A : ndarray, shape (N,)
        Root mean square distance of each base pair from its mean place.
    energies_RT, writhes : ndarray, shape (copies, samples)
    centres_A : ndarray, shape (copies * samples, N, 3), single precision
        Superposed centres of every sample.
    samples : int
    acceptance : dict of str to float
    seconds : float
    """

    ring: Equilibrium
    energy_RT: Observable
    writhe: Observable
    twist: Observable
    radius_of_gyration_A: Observable
    links: dict[int, int]
    angle_mean: Array
    angle_deviation: Array
    angle_stderr: Array
    mean_centres_A: Array
    fluctuation_A: Array
    energies_RT: Array
    writhes: Array
    centres_A: NDArray[np.float32]
    samples: int
    acceptance: dict[str, float]
    seconds: float


def observable(series: Array) -> Observable:
    """Mean and error of series (copies, samples): autocorrelation within, scatter between copies.

    The error is the larger of that from the statistical inefficiency of the copies (pymbar) and
    that from the copies' means.
    """
    copies = len(series)
    g = 1.0
    if np.ptp(series) > 0.0:
        with quiet_pymbar() as pymbar:
            g = max(1.0, pymbar.timeseries.statistical_inefficiency_multiple(list(series)))
    deviation = float(series.std(ddof=1))
    within = deviation * math.sqrt(g / series.size)
    between = float(series.mean(axis=1).std(ddof=1)) / math.sqrt(copies)
    return Observable(float(series.mean()), max(within, between), deviation, series.size / g)


def mean_structure(centres: NDArray[np.float32]) -> tuple[Array, Array, NDArray[np.float32]]:
    """Mean (N, 3), fluctuation (N,) and superposed copies of shapes (T, N, 3), to consistency."""
    moved = centres.astype(float)
    mean = moved[0]
    for _ in range(4):
        moved = np.array([superpose(shape, mean)[0] for shape in moved])
        mean = moved.mean(axis=0)
    fluctuation = np.sqrt(np.mean(np.sum((moved - mean) ** 2, axis=2), axis=0))
    return mean, fluctuation, moved.astype(np.float32)


def closed_ring_ensemble(
    chain: Chain,
    ring: Equilibrium,
    options: ClosedRingOptions | None = None,
    rng: np.random.Generator | int = 0,
) -> ClosedRingEnsemble:
    """Thermal ensemble of the closed chain about a ring, by crankshafts and constrained moves.

    Near a minimum of energy E the mean energy is about E + (3N - 6)/2 RT; of a chain with guests,
    N counts the steps that none of them holds.

    Parameters
    ----------
    ring : Equilibrium
        A closed equilibrium of ``chain``; the copies start there.
    rng : Generator or int
        Random numbers, or the seed for them; spawns one stream for each copy.

    Raises
    ------
    InputError
        The ring is not closed or belongs to another chain.
    """
    began = time.perf_counter()
    options = options or ClosedRingOptions()
    if ring.angles.shape != chain.ground.shape or not ring.closure < 1e-6:
        raise InputError(f"the start of a closed ensemble of {chain.name} must be a closed ring")
    stiffness = chain.energy_scale_RT * chain.stiffness
    inverse_roots = np.linalg.inv(np.linalg.cholesky(stiffness))
    ground = np.ascontiguousarray(chain.ground)
    crankshafts = chain.n_steps if options.crankshafts is None else options.crankshafts

    def run(stream: np.random.Generator) -> tuple[Array, Array, Array, Array]:
        angles = np.array(ring.angles)
        state = random_state(stream)
        reach = 2.5 * math.sqrt(float(np.mean(np.linalg.inv(stiffness)[:, 1, 1])))
        size = 1.5 * (3.0 * chain.n_steps) ** (-1.0 / 6.0)
        per_round = max(options.burn_in // _TUNING_ROUNDS, 1)
        for stage in range(_TUNING_ROUNDS + 1):
            records = per_round if stage < _TUNING_ROUNDS else options.samples
            accepted, counts = np.zeros((N_MOVES, 2)), np.zeros(4)
            shapes, topology = np.empty((records, *ground.shape)), np.empty((records, 3))
            run_closed(
                angles, ground, stiffness, inverse_roots, chain.form_code, crankshafts, reach,
                options.constrained, size, options.thinning, state, accepted, counts, shapes,
                topology,
            )  # fmt: skip
            if stage < _TUNING_ROUNDS:
                rate = accepted[CRANKSHAFT, 0] / max(accepted[CRANKSHAFT, 1], 1.0)
                if crankshafts:
                    reach = min(reach * float(np.clip(rate / _ACCEPTANCE, 0.6, 1.6)), math.pi)
                rate = counts[ACCEPTED] / max(counts[TRIED], 1.0)
                if options.constrained:
                    size *= float(np.clip(rate / _ACCEPTANCE, 0.7, 1.4))
        return shapes, topology, accepted, counts

    with ThreadPoolExecutor(options.threads) as pool:
        runs = list(pool.map(run, np.random.default_rng(rng).spawn(options.copies)))
    shapes = np.array([r[0] for r in runs])
    topology = np.array([r[1] for r in runs])
    accepted = np.sum([r[2] for r in runs], axis=0)
    counts = np.sum([r[3] for r in runs], axis=0)
    strain = shapes - ground
    strain[..., chain.bound, :] = 0.0  # round-off, times a stiffness without bound
    energies = 0.5 * np.einsum("ctsi,sij,ctsj->ct", strain, stiffness, strain)
    flat = shapes.reshape(-1, *ground.shape)
    centres = np.array(
        [chain.rise_A * chain_frames(q, chain.step_form)[0][:-1] for q in flat], dtype=np.float32
    )
    radii = np.sqrt(np.mean(np.sum((centres - centres.mean(axis=1, keepdims=True)) ** 2, 2), 1))
    mean, fluctuation, moved = mean_structure(centres)
    energy = observable(energies)
    numbers, times = np.unique(np.round(topology[..., 0]).astype(int), return_counts=True)
    deviation = flat.std(axis=0, ddof=1)
    rates = {}
    if crankshafts:
        rates["crankshaft"] = float(accepted[CRANKSHAFT, 0] / accepted[CRANKSHAFT, 1])
    if options.constrained:
        rates["constrained"] = float(counts[ACCEPTED] / counts[TRIED])
    copy_means = shapes.mean(axis=1)
    angle_stderr = np.maximum(
        copy_means.std(axis=0, ddof=1) / math.sqrt(options.copies),
        deviation / math.sqrt(energy.effective_samples),
    )
    return ClosedRingEnsemble(
        ring=ring,
        energy_RT=energy,
        writhe=observable(topology[..., 2]),
        twist=observable(topology[..., 1]),
        radius_of_gyration_A=observable(radii.reshape(energies.shape).astype(float)),
        links={int(a): int(b) for a, b in zip(numbers, times, strict=True)},
        angle_mean=flat.mean(axis=0),
        angle_deviation=deviation,
        angle_stderr=angle_stderr,
        mean_centres_A=mean,
        fluctuation_A=fluctuation,
        energies_RT=energies,
        writhes=topology[..., 2],
        centres_A=moved,
        samples=flat.shape[0],
        acceptance=rates,
        seconds=time.perf_counter() - began,
    )
