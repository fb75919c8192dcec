"""Exact-closure importance sampling: J factors without a closure window.

Shapes near every register-constrained minimum (:mod:`dnacheck.cyclization.laplace.register`) are
drawn from the Gaussian of Laplace's approximation, moved onto exact closure and weighted exactly;
the mean weight multiplies the register-integrated Laplace J. What remains systematic is small and
measured: the trapezoid rule over the register, links and registers left out, and shapes above a
draw beyond the one counted (:mod:`dnacheck.cyclization.closure.kernels.draws`), which probes count
without bias.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.closure.kernels.draws import (
    COUNTED,
    NO_CROSSING,
    DrawRecord,
    Probes,
    draw_pairs,
)
from dnacheck.cyclization.laplace.constrained_minimum import steps_in_RT
from dnacheck.cyclization.laplace.register import RegisterProfile, register_profile
from dnacheck.cyclization.result import JFactor, JStatus
from dnacheck.equilibria.ring import Equilibria
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import InputError, SolveError
from dnacheck.numerics.seeds import Randomness, seed_sequence
from dnacheck.numerics.statistics import batch_error, summarise_weights

Array = NDArray[np.float64]

_PILOT_PAIRS = 16
_FOLDED = 0.05
"""Part of the draws that fold above which the Gaussian is no picture of the closed shapes. At 700
base pairs a tenth folds and errors are as stated; at 1,000 a seventh, and means from a few hundred
draws miss by up to five of their standard errors."""
_SAFETY = 1.15
"""Draws asked for beyond those that the first round's spread calls for."""


@dataclass(frozen=True)
class ClosureOptions:
    """How long and how densely to sample.

    Attributes
    ----------
    tolerance : float
        Standard error of ln J at which sampling stops.
    max_seconds : float
        Wall time after which it stops with what it has.
    first_batches, pairs_per_batch : int
        Independent batches of the first round and antithetic pairs in each. A batch spreads its
        pairs evenly over links and registers by their Laplace weights (systematic sampling).
    most_draws : int
        Bound on the number of draws.
    probe_rate : float
        Fraction of draws that are searched for further closed shapes.
    threads : int
        Threads to use; no result depends on it.
    """

    tolerance: float = 0.01
    max_seconds: float = math.inf
    first_batches: int = 20
    pairs_per_batch: int = 8
    most_draws: int = 400_000
    probe_rate: float = 0.1
    threads: int = 1

    def __post_init__(self) -> None:
        if not (math.isfinite(self.tolerance) and self.tolerance > 0.0):
            raise InputError(f"tolerance must be a positive number, not {self.tolerance}")
        if not self.max_seconds > 0.0:
            raise InputError(f"max_seconds must be positive, not {self.max_seconds}")
        if self.first_batches < 2 or self.pairs_per_batch < 1 or self.threads < 1:
            raise InputError("sampling needs two batches, a pair in each and a thread, at least")
        if not 0.0 <= self.probe_rate <= 1.0:
            raise InputError(f"probe_rate must lie between 0 and 1, not {self.probe_rate}")


@dataclass
class Draws:
    """Draws so far; one row per pair.

    Attributes
    ----------
    record : DrawRecord
        Its strains are empty unless they are asked for.
    batch : ndarray, shape (pairs,)
    unfinished : int
        Probes that ended before they found a shape again.
    """

    record: DrawRecord
    batch: NDArray[np.int64]
    unfinished: int

    @property
    def weights(self) -> Array:
        """Weights (pairs, 2) relative to the Laplace value."""
        weights: Array = np.exp(self.record.log_weights)
        return weights

    def joined(self, more: Draws) -> Draws:
        """These and ``more``, whose batches are numbered on."""
        offset = int(self.batch.max()) + 1 if self.batch.size else 0
        pairs = zip(self.record, more.record, strict=True)
        return Draws(
            DrawRecord(*(np.concatenate(arrays) for arrays in pairs)),
            np.concatenate([self.batch, more.batch + offset]),
            self.unfinished + more.unfinished,
        )


class ClosureSampler:
    """Draws exactly closed shapes of one molecule.

    Parameters
    ----------
    profile : RegisterProfile
        Register-constrained minima of the molecule.
    seed : int or numpy.random.SeedSequence
        One stream is spawned from it for every round and minimum.
    """

    def __init__(
        self,
        profile: RegisterProfile,
        options: ClosureOptions,
        seed: Randomness = 0,
    ) -> None:
        self.profile, self.options = profile, options
        self.steps = steps_in_RT(profile.chain)
        self.slices = profile.slices()
        masses = np.array([piece.log_mass for piece in self.slices])
        self.log_laplace = float(np.logaddexp.reduce(masses))
        self.cumulative = np.cumsum(np.exp(masses - self.log_laplace))
        self.sequence = seed_sequence(seed)
        self.probes = Probes(0.0, np.zeros(6), np.zeros((6, 6)))
        self.probes = self._probes()

    def _probes(self) -> Probes:
        """Centre and spread of the probes' random starts, from the corrections of a pilot."""
        rate = float(self.options.probe_rate)
        y = self._round(1, _PILOT_PAIRS).record.corrections.reshape(-1, 6)
        y = y[np.isfinite(y).all(axis=1)]
        if len(y) < 2:
            root = np.diag([float(self.profile.chain.n_steps)] * 3 + [1.0] * 3)
            return Probes(rate, np.zeros(6), root)
        spread = y.std(axis=0)
        covariance = np.cov(y.T) if len(y) > 12 else np.diag(spread**2)
        # Wider than the corrections, because other crossings lie further out.
        root = 1.5 * np.linalg.cholesky(covariance + np.diag((0.1 * spread) ** 2 + 1e-12))
        return Probes(rate, y.mean(axis=0), root)

    def _round(self, batches: int, pairs: int, strains: bool = False) -> Draws:
        """One round of independent batches, each spread systematically over the slices."""
        root = self.sequence.spawn(1)[0]
        offsets, *streams = root.spawn(1 + len(self.slices))
        start = np.random.default_rng(offsets).random(batches)
        places = (np.arange(pairs)[None, :] + start[:, None]) / pairs
        chosen = np.searchsorted(self.cumulative, places.ravel() * self.cumulative[-1])
        chosen = np.minimum(chosen, len(self.slices) - 1)
        batch = np.repeat(np.arange(batches), pairs)
        order = np.argsort(chosen, kind="stable")
        counts = np.bincount(chosen, minlength=len(self.slices))
        total = batches * pairs
        record = DrawRecord(
            log_weights=np.empty((total, 2)),
            codes=np.empty((total, 2), dtype=np.int64),
            links=np.empty((total, 2), dtype=np.int64),
            others=np.empty((total, 2)),
            corrections=np.empty((total, 2, 6)),
            strains=np.empty((total if strains else 0, 2, *self.steps.ground.shape)),
        )
        bounds = np.concatenate([[0], np.cumsum(counts)])

        def work(index: int) -> int:
            part = slice(bounds[index], bounds[index + 1])
            piece = self.slices[index]
            return int(
                draw_pairs(
                    np.random.default_rng(streams[index]),
                    self.steps,
                    piece.centre,
                    piece.minimum.factors,
                    self.probes,
                    DrawRecord(*(array[part] for array in record)),
                )
            )

        busy = [i for i in range(len(self.slices)) if counts[i]]
        if self.options.threads > 1 and len(busy) > 1:
            with ThreadPoolExecutor(self.options.threads) as pool:
                unfinished = sum(pool.map(work, busy))
        else:
            unfinished = sum(map(work, busy))
        return Draws(record, batch[order], unfinished)

    def sample(
        self,
        progress: Callable[[int], None] | None = None,
        watch: Callable[[Draws], None] | None = None,
    ) -> JFactor:
        """Sample until the tolerance, the time or the number of draws is reached.

        Parameters
        ----------
        watch : callable, optional
            See :meth:`draw`.

        Returns
        -------
        JFactor
            ``stderr`` from the spread of the batches; ``bias_bound`` from the trapezoid rule,
            what was left out, the weight that probes found uncounted (with twice its error), and
            what heavy tails may hold beyond the largest weight.

        Raises
        ------
        SolveError
            No draw could be closed.
        """
        began = time.perf_counter()
        return self.result(self.draw(progress, watch), began)

    def draw(
        self,
        progress: Callable[[int], None] | None = None,
        watch: Callable[[Draws], None] | None = None,
    ) -> Draws:
        """Draw until the tolerance, the time or the number of draws is reached.

        Parameters
        ----------
        watch : callable, optional
            Called with every round of draws and their strains, which are not kept.
        """
        options = self.options
        began = time.perf_counter()

        def round_of(batches: int) -> Draws:
            new = self._round(batches, options.pairs_per_batch, watch is not None)
            if watch is not None:
                watch(new)
                new.record = new.record._replace(strains=new.record.strains[:0])
            return new

        draws = round_of(options.first_batches)
        while True:
            if progress is not None:
                progress(draws.record.log_weights.size)
            summary = _batch_summary(draws)
            error = summary[1]
            elapsed = time.perf_counter() - began
            done = draws.record.log_weights.size
            if error <= options.tolerance or done >= options.most_draws:
                break
            if elapsed >= options.max_seconds:
                break
            batches = int(draws.batch.max()) + 1
            wanted = batches * ((_SAFETY * error / options.tolerance) ** 2 - 1.0)
            wanted = min(wanted, (options.most_draws - done) / (2 * options.pairs_per_batch))
            if math.isfinite(options.max_seconds):
                wanted = min(wanted, batches * (options.max_seconds - elapsed) / elapsed)
            # No more than fivefold at a time: the error that sets the number is itself uncertain.
            count = max(2, math.ceil(min(wanted, 4.0 * batches)))
            draws = draws.joined(round_of(count))
        return draws

    def result(self, draws: Draws, began: float) -> JFactor:
        """J from draws; ``began`` is when the clock started.

        Raises
        ------
        SolveError
            No draw could be closed.
        """
        profile, options, chain = self.profile, self.options, self.profile.chain
        record = draws.record
        mean, error = _batch_summary(draws)
        if not mean > 0.0:
            raise SolveError(
                f"J factor of {chain.name}: none of {record.codes.size} draws could be closed; "
                "use half-chain sampling",
            )
        weights = draws.weights
        pair = 0.5 * weights.sum(axis=1)
        with np.errstate(divide="ignore"):
            tails = summarise_weights(np.log(pair))
        folded = float(np.mean(record.codes == NO_CROSSING))
        others = record.others.mean() / mean
        others_error = record.others.std() / math.sqrt(record.others.size) / mean
        bias = profile.bias_bound + others + 2.0 * others_error + tails.unseen
        if folded > 0.01 and others == 0.0:
            # No probe of so many found anything: at most three in as many do, at 95 %.
            often = (
                options.probe_rate * (1.0 - folded) + min(1.0, 8.0 * options.probe_rate) * folded
            )
            bias += min(1.0, 3.0 / (often * record.codes.size)) if often > 0.0 else folded
        log_parts: dict[int, float] = {}
        errors: dict[int, float] = {}
        counted = record.codes == COUNTED
        for link in np.unique(record.links[counted]):
            part = np.where(counted & (record.links == link), weights, 0.0).mean(axis=1)
            values = _batch_means(part, draws.batch)
            if not values.mean() > 0.0:  # so far out that its weight underflows
                continue
            log_parts[int(link)] = self.log_laplace + math.log(values.mean())
            errors[int(link)] = batch_error(values) / float(values.mean())
        warnings = [*chain.warnings, *profile.warnings]
        if folded > 0.01:
            warnings.append(
                f"{100 * folded:.2g} % of the draws have no closed shape on their branch; probes "
                f"put what all uncounted shapes hold at {100 * others:.2g} ± "
                f"{100 * others_error:.1g} % of J"
            )
        if draws.unfinished:
            warnings.append(f"{draws.unfinished} probes ended before they found a shape again")
        status = JStatus.CONVERGED
        if error > options.tolerance:
            status = JStatus.TOLERANCE_NOT_MET
        if folded > _FOLDED:
            status = JStatus.FOLDED
        if tails.heavy or tails.largest_share > 0.1:
            status = JStatus.HEAVY_TAILS
            warnings.append(
                f"heavy tails: Pareto shape {tails.pareto_shape or math.nan:.2f}, largest weight "
                f"{100 * tails.largest_share:.2g} % of the sum"
            )
        # Of single draws: pairs share their numbers and would look better than they are.
        single = weights.ravel()
        return JFactor(
            target=chain.name,
            n_bp=chain.n_steps,
            method="closure",
            minus_lnJ=-(self.log_laplace + math.log(mean)),
            stderr=error,
            links=profile.shares(log_parts, errors),
            bias_bound=bias,
            samples=int(single.size),
            effective_samples=float(single.sum() ** 2 / np.square(single).sum()),
            pareto_shape=tails.pareto_shape,
            seconds=profile.seconds + time.perf_counter() - began,
            warnings=tuple(warnings),
            status=status,
        )


def _batch_means(pair_values: Array, batch: NDArray[np.int64]) -> Array:
    """Mean of pair values (P,) in each batch."""
    counts = np.bincount(batch)
    means: Array = np.bincount(batch, weights=pair_values) / counts
    return means


def _batch_summary(draws: Draws) -> tuple[float, float]:
    """Mean weight and its relative standard error from batches; the error is inf for no weight."""
    values = _batch_means(draws.weights.mean(axis=1), draws.batch)
    mean = float(values.mean())
    if not mean > 0.0:
        return 0.0, math.inf
    return mean, batch_error(values) / mean


def sample_closure(
    target: Chain | Equilibria | RegisterProfile,
    options: ClosureOptions | None = None,
    seed: Randomness = 0,
) -> JFactor:
    """J factor by exact-closure importance sampling.

    Raises
    ------
    SolveError
        No register-constrained minimum, or no draw could be closed.
    """
    profile = target if isinstance(target, RegisterProfile) else register_profile(target)
    return ClosureSampler(profile, options or ClosureOptions(), seed).sample()
