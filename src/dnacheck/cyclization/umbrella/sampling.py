"""J factors by Metropolis sampling under closure restraints of growing strength, joined by MBAR.

Chains at restraint strengths from none to tight move by the moves of
:mod:`dnacheck.cyclization.ensembles.kernels.open_moves` and exchange with their neighbours, which
carries them between links. MBAR (Shirts & Chodera 2008, pymbar) joins the strengths: the weight of
each recorded shape under the free chain, averaged with a narrow Gaussian of the mismatch c about
closure, is the free chain's density of closure, smoothed by that Gaussian. The Gaussian is
multiplied with exp(-m.c + c.S.c / 2) of the nearest tilt as for half chains, and two widths
extrapolate what bias is left, which is linear in the width's square.
"""

from __future__ import annotations

import itertools
import math
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.ensembles.kernels.open_moves import N_MOVES
from dnacheck.cyclization.half_chain.proposals import Tilt, linearised_closure, ring_tilts
from dnacheck.cyclization.result import PER_CUBIC_ANGSTROM_IN_MOLAR, JFactor, JStatus, LinkShare
from dnacheck.cyclization.umbrella.kernels.ladder import run_ladder
from dnacheck.cyclization.umbrella.mbar import (
    JoinedSeries,
    RestrainedSeries,
    decorrelate,
    join_series,
)
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.equilibria.ring import Equilibria
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import InputError
from dnacheck.numerics.random_numbers import random_state
from dnacheck.numerics.seeds import Randomness, generator

Array = NDArray[np.float64]

_LEAST_OVERLAP = 0.03
"""Overlap between neighbouring states below which MBAR's error is not to be trusted (Klimovich,
Shirts & Mobley, J. Comput.-Aided Mol. Des. 29, 397 (2015))."""
_ACCEPTANCE = 0.45
_TUNING_ROUNDS = 8
_WIDEST = 25.0
"""Exponent of the Gaussian of closure beyond which it counts as zero; its correction, a series
in the mismatch, means nothing there."""


def _ladder(tightest: float, first: float, ratio: float) -> tuple[float, ...]:
    steps = math.ceil(math.log(tightest / first) / math.log(ratio))
    return (0.0, *(tightest * ratio ** (k - steps) for k in range(steps + 1)))


@dataclass(frozen=True)
class UmbrellaOptions:
    """Length of the run and strengths of the restraints.

    Attributes
    ----------
    strengths : tuple of float
        Restraint U = strength/2 (|r|^2 / l^2 + |w|^2) in RT, rising from 0; l is the radius of
        the circle of the chain's length.
    samples : int
        Recorded shapes for each strength and copy.
    thinning : int
        Sweeps from one record to the next.
    burn_in : int
        Records at the start of each copy that tune the moves and are dropped.
    copies : int
        Independent ladders.
    singles, pivots, crankshafts : bool
        Moves in use; a sweep tries each angle once, one pivot a step, as many crankshafts as
        there are steps.
    threads : int
        Threads used, one a ladder; the result does not depend on it.
    """

    strengths: tuple[float, ...] = field(default_factory=lambda: _ladder(50.0, 0.1, 2.0))
    samples: int = 500
    thinning: int = 4
    burn_in: int = 100
    copies: int = 4
    singles: bool = True
    pivots: bool = True
    crankshafts: bool = True
    threads: int = 1

    def __post_init__(self) -> None:
        s = self.strengths
        if len(s) < 3 or s[0] != 0.0 or not all(a < b for a, b in itertools.pairwise(s)):
            raise InputError("restraint strengths must rise from 0 and be at least three")
        if min(self.samples, self.thinning, self.copies, self.threads) < 1 or self.samples < 20:
            raise InputError("umbrella sampling needs 20 samples or more and positive counts")
        if self.copies < 2:
            raise InputError("umbrella sampling needs two copies or more to compare")
        if self.burn_in < _TUNING_ROUNDS:
            raise InputError(f"burn_in must be at least {_TUNING_ROUNDS}")
        if not (self.singles or self.pivots):
            raise InputError("single-angle moves or pivots are needed to move the chain's end")


@dataclass(frozen=True)
class UmbrellaEstimate:
    """ln J (mol/L) by MBAR with its diagnostics.

    Attributes
    ----------
    log_j, stderr : float
        Extrapolated to zero width; the error is the larger of the next two.
    mbar_error : float
        MBAR's asymptotic error from the decorrelated samples.
    copies_error : float
        Error from the scatter of the copies' own estimates.
    bias : float
        What extrapolating the Gaussian's width to zero changed.
    copies : tuple of float
        ln J of each copy by itself.
    overlap : ndarray, shape (R, R)
        Overlap matrix of the restraint strengths.
    least_overlap : float
        Its smallest entry between neighbours.
    inefficiencies : ndarray, shape (copies, R)
        Statistical inefficiency of the recorded series, in records.
    decorrelated : int
        Samples that MBAR used.
    acceptance : ndarray, shape (R, 3)
        Of single-angle moves, pivots and crankshafts (NaN where not in use).
    exchange : ndarray, shape (R - 1,)
        Accepted exchanges between neighbouring strengths.
    links : tuple of LinkShare
    """

    log_j: float
    stderr: float
    mbar_error: float
    copies_error: float
    bias: float
    copies: tuple[float, ...]
    overlap: Array
    least_overlap: float
    inefficiencies: Array
    decorrelated: int
    acceptance: Array
    exchange: Array
    links: tuple[LinkShare, ...]


@dataclass(frozen=True)
class _Record:
    mismatches: Array  # (R, T, 6)
    tilts: NDArray[np.int64]  # (R, T)
    accepted: Array  # (R, 3, 2)
    swapped: Array  # (R - 1, 2)


class _Ladders:
    """Everything that the copies of a ladder share."""

    def __init__(self, chain: Chain, tilts: tuple[Tilt, ...], options: UmbrellaOptions) -> None:
        chain.require_free("umbrella sampling")
        self.chain, self.tilts, self.options = chain, tilts, options
        self.length = chain.n_steps / (2.0 * math.pi)
        self.ground = np.ascontiguousarray(chain.ground)
        self.stiffness = chain.energy_scale_RT * chain.stiffness
        self.pulls = np.array([tilt.pull for tilt in tilts])
        self.offsets = np.array([math.log(tilt.share) - tilt.energy_RT for tilt in tilts])
        closures = [linearised_closure(chain, tilt.angles) for tilt in tilts]
        self.multipliers = np.array([closure.multipliers for closure in closures])
        self.curvatures = np.array([closure.curvature for closure in closures])
        self.strengths = np.array(options.strengths)
        crankshafts = chain.n_steps if options.crankshafts else 0
        self.use = np.array([options.singles, options.pivots, crankshafts], dtype=np.int64)

    def run(self, rng: np.random.Generator) -> _Record:
        """One copy: chains start from tilts, are tuned and burnt in, and then recorded."""
        options, count = self.options, len(self.strengths)
        shares = np.array([tilt.share for tilt in self.tilts])
        starts = rng.choice(len(self.tilts), size=count, p=shares)
        angles = np.array([self.tilts[k].angles for k in starts])
        angles[0] = self.ground
        spread = math.sqrt(float(np.mean(np.linalg.inv(self.stiffness)[:, 1, 1])))
        reach = np.full((count, N_MOVES), 2.5 * spread)
        state = random_state(rng)
        for _ in range(_TUNING_ROUNDS):
            record = self._advance(angles, reach, state, max(options.burn_in // _TUNING_ROUNDS, 1))
            rate = _rate(record.accepted)
            factor = np.clip(np.nan_to_num(rate, nan=_ACCEPTANCE) / _ACCEPTANCE, 0.6, 1.6)
            reach = np.minimum(reach * factor, 1.0)
        return self._advance(angles, reach, state, options.samples)

    def _advance(
        self, angles: Array, reach: Array, state: NDArray[np.uint64], records: int
    ) -> _Record:
        count = len(self.strengths)
        record = _Record(
            mismatches=np.empty((count, records, 6)),
            tilts=np.empty((count, records), np.int64),
            accepted=np.zeros((count, N_MOVES, 2)),
            swapped=np.zeros((count - 1, 2)),
        )
        run_ladder(
            angles,
            self.ground,
            self.stiffness,
            self.chain.form_code,
            self.strengths,
            self.length,
            reach,
            self.use,
            self.pulls,
            self.offsets,
            state,
            self.options.thinning,
            record.accepted,
            record.swapped,
            record.mismatches,
            record.tilts,
        )
        return record

    def squares(self, mismatches: Array) -> Array:
        """|r|^2 / l^2 + |w|^2 of mismatches (..., 6)."""
        scale = np.array([self.length] * 3 + [1.0] * 3)
        total: Array = np.sum((mismatches / scale) ** 2, axis=-1)
        return total

    def log_kernel(self, mismatches: Array, tilts: NDArray[np.int64], width: float) -> Array:
        """ln of the corrected Gaussian about closure, in normalised rotations, for (..., 6)."""
        turn = np.sum(mismatches[..., 3:] ** 2, axis=-1)
        volume = np.where(
            turn < 1e-6, 1.0 - turn / 12.0, 2.0 * (1.0 - np.cos(np.sqrt(turn))) / (turn + 1e-300)
        )
        m, s = self.multipliers[tilts], self.curvatures[tilts]
        exponent = 0.5 * np.einsum("...i,...ij,...j->...", mismatches, s, mismatches)
        exponent -= np.einsum("...i,...i->...", m, mismatches)
        gaussian = -0.5 * self.squares(mismatches) / width**2
        norm = 3.0 * math.log(2.0 * math.pi * width**2) + 3.0 * math.log(self.length)
        value = gaussian + exponent - norm + np.log(8.0 * math.pi**2 / volume)
        return np.where(gaussian > -_WIDEST, value, -np.inf)

    def series(self, record: _Record) -> RestrainedSeries:
        """What MBAR needs of a record, with Gaussians of two widths."""
        width = math.sqrt(2.0 / float(self.strengths[-1]))
        return RestrainedSeries(
            squares=self.squares(record.mismatches),
            log_kernels=tuple(
                self.log_kernel(record.mismatches, record.tilts, w)
                for w in (width, width / math.sqrt(2.0))
            ),
            places=record.tilts,
            links=np.array([tilt.link for tilt in self.tilts])[record.tilts],
        )


def _rate(accepted: Array) -> Array:
    with np.errstate(invalid="ignore"):
        rate: Array = accepted[..., 0] / np.where(accepted[..., 1] > 0, accepted[..., 1], np.nan)
    return rate


def _extrapolated(joined: JoinedSeries) -> tuple[float, float]:
    """ln of the density at width zero, a straight line in the width's square, and its error.

    Twice the narrow mean minus the wide one. With a = 2/(2 - wide/narrow) and b = a - 1, the
    logarithm's error is a d ln narrow - b d ln wide, and the covariance of the two follows from
    the errors of both and of their ratio.
    """
    wide, narrow = joined.log_means[:2]
    left = max(2.0 - math.exp(wide - narrow), 0.1)
    a = 2.0 / left
    b = a - 1.0
    wide_variance, narrow_variance = joined.errors[:2] ** 2
    twice_covariance = wide_variance + narrow_variance - joined.ratio_error**2
    variance = a * a * narrow_variance + b * b * wide_variance - a * b * twice_covariance
    return float(narrow) + math.log(left), math.sqrt(max(float(variance), 0.0))


def umbrella_estimate(
    search: Equilibria, options: UmbrellaOptions, rng: np.random.Generator
) -> UmbrellaEstimate:
    """ln J by restrained Metropolis chains joined with MBAR.

    Parameters
    ----------
    search : Equilibria
        Minima of the molecule: chains start there, and the smoothing is corrected from them.
    rng : numpy.random.Generator
        Spawns one stream for each copy.

    Raises
    ------
    SolveError
        No stable ring at any link searched.
    """
    chain = search.chain
    tilts = ring_tilts(search, 0)
    ladders = _Ladders(chain, tilts, options)
    with ThreadPoolExecutor(options.threads) as pool:
        records = list(pool.map(ladders.run, rng.spawn(options.copies)))
    series = [ladders.series(record) for record in records]
    thinned = [decorrelate(one) for one in series]
    kept = [one[0] for one in thinned]
    links = tuple(sorted({tilt.link for tilt in tilts}))
    whole = join_series(ladders.strengths, series, kept, links)
    unit = math.log(PER_CUBIC_ANGSTROM_IN_MOLAR) - 3.0 * math.log(chain.rise_A)
    log_j, mbar_error = _extrapolated(whole)
    copies = tuple(
        _extrapolated(join_series(ladders.strengths, [one], [picks]))[0] + unit
        for one, picks in zip(series, kept, strict=True)
    )
    copies_error = float(np.std(copies, ddof=1) / math.sqrt(len(copies)))
    neighbours = np.minimum(np.diag(whole.overlap, 1), np.diag(whole.overlap, -1))
    return UmbrellaEstimate(
        log_j=log_j + unit,
        stderr=max(mbar_error, copies_error),
        mbar_error=mbar_error,
        copies_error=copies_error,
        bias=log_j - float(whole.log_means[0]),
        copies=copies,
        overlap=whole.overlap,
        least_overlap=float(neighbours.min()),
        inefficiencies=np.array([one[1] for one in thinned]),
        decorrelated=whole.samples,
        acceptance=_rate(np.sum([record.accepted for record in records], axis=0)),
        exchange=_rate(np.sum([record.swapped for record in records], axis=0)),
        links=tuple(
            LinkShare(link, -(value + unit), error)
            for link, (value, error) in sorted(whole.links.items(), key=lambda x: -x[1][0])
        ),
    )


def metropolis(
    target: Chain | Equilibria,
    options: UmbrellaOptions | None = None,
    rng: Randomness = 0,
) -> JFactor:
    """J factor by Metropolis sampling under closure restraints, joined by MBAR.

    Parameters
    ----------
    target : Chain or Equilibria
        A molecule, or the minima already found for it.
    rng : int, SeedSequence or Generator

    Returns
    -------
    JFactor
        ``bias_bound`` is what extrapolating the smoothing of closure changed.

    Raises
    ------
    SolveError
        No stable ring at any link searched.
    """
    began = time.perf_counter()
    options = options or UmbrellaOptions()
    search = find_rings(target) if isinstance(target, Chain) else target
    estimate = umbrella_estimate(search, options, generator(rng))
    chain = search.chain
    notes = list(chain.warnings)
    poor = estimate.least_overlap < _LEAST_OVERLAP
    if poor:
        notes.append(
            f"restraints overlap by {estimate.least_overlap:.3f} only, less than "
            f"{_LEAST_OVERLAP:g}; put more strengths between them"
        )
    return JFactor(
        target=chain.name,
        n_bp=chain.n_steps,
        method="metropolis",
        minus_lnJ=-estimate.log_j,
        stderr=estimate.stderr,
        bias_bound=abs(estimate.bias),
        links=estimate.links,
        samples=options.copies * options.samples * len(options.strengths),
        effective_samples=float(estimate.decorrelated),
        seconds=time.perf_counter() - began,
        warnings=tuple(notes),
        status=JStatus.TOLERANCE_NOT_MET if poor else JStatus.CONVERGED,
    )
