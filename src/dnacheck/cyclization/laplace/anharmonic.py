"""Register-integrated Laplace with its first anharmonic term.

Laplace's approximation is the first term of an expansion in the temperature. With f(x; t) the
log-weight of the closed shape that a draw t x leads to, its energy part divided by t^2 (t^2 is then
the temperature), f = t A + t^2 B + ..., where A is odd in x and B even, and

    ln <exp f> = t^2 (<B> + <A^2> / 2) + O(t^4),

averages over the Gaussian of Laplace's approximation. In a Gaussian integral's diagrams these are
all graphs of two loops. A and B are differences of antithetic draws at small t; no derivative of
third or fourth order is written down, and no weight is exponentiated, so nothing has heavy tails.
The next term is estimated from ln <exp f> at a finite t and is the bound of what is left.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.laplace.constrained_minimum import steps_in_RT
from dnacheck.cyclization.laplace.kernels.anharmonic import scaled_log_weights
from dnacheck.cyclization.laplace.register import RegisterProfile, register_profile
from dnacheck.cyclization.result import JFactor, JStatus
from dnacheck.equilibria.ring import Equilibria
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import InputError, SolveError
from dnacheck.numerics.seeds import Randomness, seed_sequence

Array = NDArray[np.float64]

_SCALES = np.array([0.25, 0.5])
"""t of the differences; their error of order t^2 is extrapolated away."""


@dataclass(frozen=True)
class AnharmonicOptions:
    """How many draws the averages take.

    Attributes
    ----------
    tolerance : float
        Standard error of the correction at which drawing stops.
    first_pairs, most_pairs : int
        Antithetic pairs of the first round and altogether.
    """

    tolerance: float = 0.01
    first_pairs: int = 200
    most_pairs: int = 20_000

    def __post_init__(self) -> None:
        if not (math.isfinite(self.tolerance) and self.tolerance > 0.0):
            raise InputError(f"tolerance must be a positive number, not {self.tolerance}")
        if not 16 <= self.first_pairs <= self.most_pairs:
            raise InputError(
                f"pairs need 16 <= first_pairs <= most_pairs: {self.first_pairs}, {self.most_pairs}"
            )


@dataclass(frozen=True)
class AnharmonicTerm:
    """First term beyond Laplace's in ln J.

    Attributes
    ----------
    value, stderr : float
        What is added to ln J of register-integrated Laplace, and its statistical error.
    next_term, next_stderr : float
        Estimate of the term after it.
    pairs : int
        Antithetic pairs drawn.
    lost : int
        Pairs without a closed shape at one of the scales; they are left out.
    """

    value: float
    stderr: float
    next_term: float
    next_stderr: float
    pairs: int
    lost: int


class _Drawer:
    """Draws pairs about the register-constrained minima in proportion to their Laplace weights."""

    def __init__(self, profile: RegisterProfile, seed: Randomness) -> None:
        self.steps = steps_in_RT(profile.chain)
        self.slices = profile.slices()
        masses = np.array([piece.log_mass for piece in self.slices])
        weights = np.exp(masses - masses.max())
        self.shares = weights / weights.sum()
        self.sequence = seed_sequence(seed)

    def draw(self, pairs: int) -> Array:
        """Log-weights (pairs, scales, 2)."""
        first, *streams = self.sequence.spawn(1 + len(self.slices))
        counts = np.random.default_rng(first).multinomial(pairs, self.shares)
        out = np.empty((pairs, len(_SCALES), 2))
        done = 0
        for piece, stream, count in zip(self.slices, streams, counts, strict=True):
            if count:
                rng, part = np.random.default_rng(stream), out[done : done + count]
                factors = piece.minimum.factors
                scaled_log_weights(rng, _SCALES, self.steps, piece.centre, factors, part)
                done += count
        return out


def _term(log_weights: Array) -> AnharmonicTerm:
    """The averages over pairs (P, scales, 2)."""
    kept = log_weights[np.isfinite(log_weights).all(axis=(1, 2))]
    small, large = _SCALES
    even = kept.mean(axis=2) / _SCALES**2
    odd = 0.5 * (kept[..., 0] - kept[..., 1]) / _SCALES
    terms = even + 0.5 * odd**2
    ratio = (large / small) ** 2
    first = (ratio * terms[:, 0] - terms[:, 1]) / (ratio - 1.0)
    # ln <exp f> / t^2 at the larger scale; the second line is its influence function.
    weights = np.exp(kept[:, 1]).mean(axis=1)
    whole = math.log(float(weights.mean())) / large**2
    single = weights / weights.mean() / large**2
    value = float(first.mean())
    count = len(kept)
    return AnharmonicTerm(
        value=value,
        stderr=float(first.std(ddof=1) / math.sqrt(count)),
        next_term=(whole - value) / large**2,
        next_stderr=float((single - first).std(ddof=1) / math.sqrt(count)) / large**2,
        pairs=len(log_weights),
        lost=len(log_weights) - count,
    )


def anharmonic_term(
    profile: RegisterProfile,
    options: AnharmonicOptions | None = None,
    seed: Randomness = 0,
) -> AnharmonicTerm:
    """First anharmonic term of ln J, from Gaussian draws about the register-constrained minima.

    Raises
    ------
    SolveError
        Fewer than half of the draws reach a closed shape even at the small scales.
    """
    options = options or AnharmonicOptions()
    drawer = _Drawer(profile, seed)
    drawn = drawer.draw(options.first_pairs)
    while True:
        if np.isfinite(drawn).all(axis=(1, 2)).mean() < 0.5:
            raise SolveError(
                f"J factor of {profile.chain.name}: too few draws reach a closed shape for the "
                "anharmonic term; use half-chain sampling"
            )
        term = _term(drawn)
        if term.stderr <= options.tolerance or len(drawn) >= options.most_pairs:
            return term
        wanted = math.ceil(len(drawn) * (1.1 * term.stderr / options.tolerance) ** 2)
        drawn = np.concatenate(
            [drawn, drawer.draw(max(16, min(wanted, options.most_pairs) - len(drawn)))]
        )


def corrected_laplace(
    target: Chain | Equilibria | RegisterProfile,
    options: AnharmonicOptions | None = None,
    seed: Randomness = 0,
) -> JFactor:
    """J factor by register-integrated Laplace with its first anharmonic term.

    Returns
    -------
    JFactor
        ``stderr`` is that of the averages; ``bias_bound`` is the estimated next term with twice
        its error, and the trapezoid rule's.

    Raises
    ------
    SolveError
        No register-constrained minimum, or too few draws reach a closed shape.
    """
    began = time.perf_counter()
    options = options or AnharmonicOptions()
    profile = target if isinstance(target, RegisterProfile) else register_profile(target)
    term = anharmonic_term(profile, options, seed)
    warnings = [*profile.chain.warnings, *profile.warnings]
    if term.lost:
        warnings.append(
            f"{term.lost} of {term.pairs} pairs reach no closed shape and were left out"
        )
    bias = abs(term.next_term) + 2.0 * term.next_stderr + profile.bias_bound
    met = math.hypot(term.stderr, bias) <= options.tolerance
    return JFactor(
        target=profile.chain.name,
        n_bp=profile.chain.n_steps,
        method="corrected-laplace",
        minus_lnJ=-(profile.log_j + term.value),
        stderr=term.stderr,
        links=profile.shares({chart.link: chart.log_j + term.value for chart in profile.charts}),
        bias_bound=bias,
        samples=2 * term.pairs,
        seconds=time.perf_counter() - began,
        warnings=tuple(warnings),
        status=JStatus.CONVERGED if met else JStatus.TOLERANCE_NOT_MET,
    )
