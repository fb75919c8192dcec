"""How well fitted mechanics are known: profile likelihoods, posterior, and what to measure next.

All work on the fit's own quadratic model of every molecule's -ln J (value, gradient and Hessian
from its closed draws), so they cost no further sampling; the misfit itself is not quadratic.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.gradient import closed_draws
from dnacheck.mechanics.fit import MechanicsFit, plausible_range
from dnacheck.mechanics.local_model import local_model
from dnacheck.model.chain import Chain
from dnacheck.model.named_parameters import modified_chain
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

_GRID = 41
_REFITS = 30
_DROP = {0.68: 0.9889, 0.95: 3.8415}
"""Rise of chi-square at the ends of an interval of one parameter (chi-square, one degree)."""
_LENGTHS = 50.0
"""Autocorrelation times that a chain must hold for its averages to count (emcee's advice)."""


class _Quadratic:
    """Misfit of a fit's molecules as its local models give it, priors included."""

    def __init__(self, fit: MechanicsFit) -> None:
        self.fit = fit
        self.best = np.array([item.value for item in fit.parameters])
        self.residual = fit.measured - fit.computed
        self.weight = 1.0 / (fit.errors**2 + fit.computed_errors**2)
        self.priors = [
            (i, item.prior) for i, item in enumerate(fit.parameters) if item.prior is not None
        ]
        self.ranges = np.array([plausible_range(item.name) for item in fit.parameters])

    def residuals(self, change: Array) -> Array:
        """Measured less computed -ln J (m,) after a change (p,) of the parameters."""
        fit = self.fit
        second = 0.5 * np.einsum("p,ipq,q->i", change, fit.curvature, change)
        return np.asarray(self.residual - fit.jacobian @ change - second)

    def chi_square(self, change: Array) -> float:
        """Misfit, priors included."""
        total = float(np.sum(self.weight * self.residuals(change) ** 2))
        for i, prior in self.priors:
            total += ((self.best[i] + change[i] - prior.mean) / prior.stderr) ** 2
        return total

    def minimise(self, fixed: int, value: float, start: Array) -> tuple[float, Array]:
        """Least misfit with one parameter's change held at ``value``."""
        fit = self.fit
        free = [i for i in range(len(self.best)) if i != fixed]
        change = start.copy()
        change[fixed] = value
        best = self.chi_square(change)
        for _ in range(_REFITS):
            slope = fit.jacobian + np.einsum("ipq,q->ip", fit.curvature, change)
            slope = slope[:, free]
            normal = slope.T @ (self.weight[:, None] * slope)
            pull = slope.T @ (self.weight * self.residuals(change))
            for i, prior in self.priors:
                if i != fixed:
                    k = free.index(i)
                    normal[k, k] += 1.0 / prior.stderr**2
                    pull[k] += (prior.mean - self.best[i] - change[i]) / prior.stderr**2
            normal += np.diag(1e-6 / self.ranges[free] ** 2)
            move = np.linalg.solve(normal, pull) if free else np.empty(0)
            fraction = 1.0
            while fraction > 1e-3:
                trial = change.copy()
                trial[free] += fraction * move
                cost = self.chi_square(trial)
                if cost <= best:
                    break
                fraction *= 0.5
            else:
                break
            gain, change, best = best - cost, trial, cost
            if gain < 1e-6:
                break
        return best, change


@dataclass(frozen=True)
class ProfileLikelihood:
    """Least misfit against one parameter, all others refitted at every point.

    Attributes
    ----------
    name : str
    values, chi_square : ndarray, shape (k,)
        ``chi_square`` counts from its minimum.
    intervals : dict of float to (float, float)
        Ends of the 68 and 95 % intervals; infinite where the misfit stays below the limit.
    """

    name: str
    values: Array
    chi_square: Array
    intervals: dict[float, tuple[float, float]]


def profile_likelihood(fit: MechanicsFit, name: str, reach: float = 4.0) -> ProfileLikelihood:
    """Profile likelihood of one parameter.

    Parameters
    ----------
    reach : float
        Standard errors (or plausible ranges, where they are smaller) to each side.

    Raises
    ------
    InputError
        No such parameter.
    """
    names = [item.name for item in fit.parameters]
    if name not in names:
        raise InputError(f"parameter '{name}' was not fitted; fitted are {', '.join(names)}")
    which = names.index(name)
    model = _Quadratic(fit)
    error = fit.parameters[which].stderr
    width = reach * min(error if error else math.inf, 4.0 * plausible_range(name))
    offsets = np.linspace(-width, width, _GRID)
    chi = np.empty(_GRID)
    middle = _GRID // 2
    for order in (range(middle, _GRID), range(middle, -1, -1)):
        change = np.zeros(len(names))
        for k in order:
            chi[k], change = model.minimise(which, float(offsets[k]), change)
    chi -= chi.min()
    values = fit.parameters[which].value + offsets
    return ProfileLikelihood(
        name, values, chi, {level: _crossings(values, chi, drop) for level, drop in _DROP.items()}
    )


def _crossings(values: Array, chi: Array, limit: float) -> tuple[float, float]:
    """Where a profile first rises above a limit on both sides of its minimum."""
    lowest = int(np.argmin(chi))
    low, high = -math.inf, math.inf
    for k in range(lowest, 0, -1):
        if chi[k - 1] > limit:
            t = (limit - chi[k]) / (chi[k - 1] - chi[k])
            low = float(values[k] + t * (values[k - 1] - values[k]))
            break
    for k in range(lowest, len(chi) - 1):
        if chi[k + 1] > limit:
            t = (limit - chi[k]) / (chi[k + 1] - chi[k])
            high = float(values[k] + t * (values[k + 1] - values[k]))
            break
    return low, high


@dataclass(frozen=True)
class Posterior:
    """Draws from the posterior of a fit's parameters, by emcee.

    Attributes
    ----------
    names : tuple of str
    samples : ndarray, shape (n, p)
        Burn-in dropped, thinned by half the autocorrelation time.
    autocorrelation : ndarray, shape (p,)
        Integrated autocorrelation times in steps.
    acceptance : float
    converged : bool
        Whether the chain holds 50 autocorrelation times of every parameter.
    """

    names: tuple[str, ...]
    samples: Array
    autocorrelation: Array
    acceptance: float
    converged: bool

    def interval(self, name: str, level: float = 0.68) -> tuple[float, float]:
        """Central credible interval of a parameter."""
        column = self.samples[:, self.names.index(name)]
        low, high = np.quantile(column, [0.5 - 0.5 * level, 0.5 + 0.5 * level])
        return float(low), float(high)


def posterior(
    fit: MechanicsFit,
    steps: int = 4000,
    rng: int | np.random.SeedSequence | np.random.Generator = 0,
) -> Posterior:
    """Posterior of a fit by emcee, on its quadratic models, with flat priors where none are given.

    Flat priors end six standard errors, or four plausible ranges, from the fit.
    """
    import emcee

    model = _Quadratic(fit)
    p = len(model.best)
    errors = np.sqrt(np.diag(fit.covariance))
    wall = np.maximum(6.0 * np.minimum(errors, 4.0 * model.ranges), 4.0 * model.ranges)

    def log_probability(changes: Array) -> Array:
        second = 0.5 * np.einsum("kp,ipq,kq->ki", changes, fit.curvature, changes)
        residual = model.residual - changes @ fit.jacobian.T - second
        chi = (model.weight * residual**2).sum(axis=1)
        for i, prior in model.priors:
            chi += ((model.best[i] + changes[:, i] - prior.mean) / prior.stderr) ** 2
        return np.where((np.abs(changes) < wall).all(axis=1), -0.5 * chi, -np.inf)

    generator = np.random.default_rng(rng)
    walkers = max(4 * p, 16)
    start = 0.1 * np.minimum(errors, model.ranges) * generator.standard_normal((walkers, p))
    sampler = emcee.EnsembleSampler(walkers, p, log_probability, vectorize=True)
    # emcee draws from the old-style generator that it holds
    state = np.random.RandomState(int(generator.integers(2**32))).get_state()
    sampler.random_state = state
    sampler.run_mcmc(start, steps, skip_initial_state_check=True)
    times = np.asarray(sampler.get_autocorr_time(tol=0))
    longest = float(times.max()) if np.isfinite(times).all() else math.inf
    converged = longest * _LENGTHS < steps
    drop = min(int(3 * longest), steps // 2) if math.isfinite(longest) else steps // 2
    thin = max(1, int(0.5 * longest)) if math.isfinite(longest) else 1
    chain = sampler.get_chain(discard=drop, thin=thin, flat=True)
    return Posterior(
        names=tuple(item.name for item in fit.parameters),
        samples=np.asarray(chain) + model.best,
        autocorrelation=times,
        acceptance=float(np.mean(sampler.acceptance_fraction)),
        converged=bool(converged),
    )


@dataclass(frozen=True)
class Proposal:
    """What measuring one more molecule would do.

    Attributes
    ----------
    name : str
    minus_lnJ : float
        Predicted, without offsets.
    errors : dict of str to float
        Standard error of each parameter after the measurement.
    shrinks : str
        The parameter whose error shrinks most.
    factor : float
        Its error after over before.
    gain : float
        Half the logarithm of the fall of the covariance's determinant (nats of information).
    """

    name: str
    minus_lnJ: float
    errors: dict[str, float]
    shrinks: str
    factor: float
    gain: float


def design(
    fit: MechanicsFit,
    candidates: Sequence[Chain],
    stderr: float = 0.3,
    tolerance: float = 0.05,
    rng: int = 0,
) -> tuple[Proposal, ...]:
    """Which further molecule would tell most, best first.

    Parameters
    ----------
    candidates : sequence of Chain
        Chains with their own parameters, as for the fit.
    stderr : float
        Error of -ln J that the measurement would have.

    Raises
    ------
    InputError
        An error that is not positive.
    """
    if not stderr > 0.0:
        raise InputError(f"stderr must be positive, not {stderr}")
    names = [item.name for item in fit.parameters]
    before = np.sqrt(np.diag(fit.covariance))
    found = []
    for chain in candidates:
        draws = closed_draws(modified_chain(chain, fit.values), tolerance=tolerance, rng=rng)
        model = local_model(chain, draws, names, fit.values)
        slope = -model.gradient
        for i, name in enumerate(names):
            if name == "offset":
                slope[i] = 1.0
        spread = fit.covariance @ slope
        variance = stderr**2 + float(slope @ spread)
        after = np.sqrt(np.diag(fit.covariance - np.outer(spread, spread) / variance))
        ratio = after / before
        most = int(np.argmin(ratio))
        found.append(
            Proposal(
                name=chain.name,
                minus_lnJ=-model.log_j,
                errors={n: float(e) for n, e in zip(names, after, strict=True)},
                shrinks=names[most],
                factor=float(ratio[most]),
                gain=0.5 * math.log(variance / stderr**2),
            )
        )
    return tuple(sorted(found, key=lambda item: -item.gain))
