"""Mechanics from measured J factors: Gauss-Newton with the derivatives that the draws give.

The residual of molecule i is r_i = (y_i - f_i(p) - offset) / sigma_i, f = -ln J computed; priors
are residuals too. Every iteration samples each molecule's closed shapes at the current parameters
with the same seed (common random numbers), so that f changes smoothly and only with p.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.gradient import closed_draws
from dnacheck.mechanics.local_model import LocalModel, local_model
from dnacheck.mechanics.measurements import Measurement
from dnacheck.model.chain import Chain
from dnacheck.model.named_parameters import (
    checked_name,
    is_offset,
    modified_chain,
    offset_group,
    own_value,
    unit,
)
from dnacheck.numerics.outcome import InputError, SolveError

Array = NDArray[np.float64]

_MOST_ITERATIONS = 12
_SETTLED = 0.05
"""Change of every parameter, in its own standard errors, at which the iteration stops."""
_HUBER = 1.345
"""Residual in standard errors from which the robust loss grows linearly (95 % efficiency)."""
_LONGEST_MOVE = {
    "persistence_length_A": 0.25,
    "twist_ratio": 0.4,
    "stiffness_scale": 0.25,
    "bend_scale": 0.3,
    "a_tract_bend_scale": 0.5,
}
"""Largest move in one iteration: relative for these, else :data:`_LONGEST_DEGREES`."""
_LONGEST_DEGREES = 0.5
_SCALE = {
    "persistence_length_A": 50.0,
    "twist_ratio": 0.5,
    "stiffness_scale": 0.1,
    "bend_scale": 0.3,
    "a_tract_bend_scale": 0.5,
}
"""A plausible range of each parameter, in which directions are compared; 0.2 degree for twists,
1 degree for table entries, 1 for offsets."""
BLIND = 0.01
"""Information along a direction, in plausible ranges, below which the data are blind to it: they
would leave it an error of more than ten ranges."""


@dataclass(frozen=True)
class Prior:
    """A normal prior of a parameter."""

    mean: float
    stderr: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.mean) and math.isfinite(self.stderr) and self.stderr > 0.0):
            raise InputError(f"a prior needs a finite mean and a positive error, not {self}")


@dataclass(frozen=True)
class FitOptions:
    """How a fit is made.

    Attributes
    ----------
    tolerance : float
        Standard error of ln J of each molecule in each iteration.
    robust : bool
        Huber's loss instead of squares.
    seed, threads : int
        One seed for all iterations; no result depends on the number of threads.
    """

    tolerance: float = 0.02
    robust: bool = False
    seed: int = 0
    threads: int = 1

    def __post_init__(self) -> None:
        if not (math.isfinite(self.tolerance) and self.tolerance > 0.0):
            raise InputError(f"tolerance must be a positive number, not {self.tolerance}")
        if self.threads < 1:
            raise InputError(f"threads must be at least 1, not {self.threads}")


@dataclass(frozen=True)
class FittedParameter:
    """One parameter of a fit.

    Attributes
    ----------
    name, unit : str
    value : float
    stderr : float or None
        From the curvature of the misfit; None where the data cannot see the parameter.
    start : float
        Where the fit began: the prior's mean, or the chain's own value.
    prior : Prior or None
    """

    name: str
    unit: str
    value: float
    stderr: float | None
    start: float
    prior: Prior | None


@dataclass(frozen=True)
class Direction:
    """A direction in parameter space, with what the data say of it.

    ``stderr`` is the standard error along it in plausible ranges of the parameters (infinite
    where no datum changes); ``parts`` are its components by parameter; ``seen`` tells whether the
    data say anything of it (:data:`BLIND`).
    """

    eigenvalue: float
    stderr: float
    parts: Mapping[str, float]
    seen: bool


@dataclass(frozen=True)
class MechanicsFit:
    """Parameters that meet measured J factors best, with what can and cannot be known.

    Attributes
    ----------
    parameters : tuple of FittedParameter
    names : tuple of str
        Of the molecules, in the order of the arrays.
    measured, errors, computed, computed_errors : ndarray, shape (m,)
        -ln J (mol/L) and standard errors; ``computed`` has the fitted offset added.
    covariance, correlation : ndarray, shape (p, p)
    information : ndarray, shape (p, p)
        Fisher information of the data alone, without priors.
    directions : tuple of Direction
        Eigenvectors of the information, least seen first.
    jacobian : ndarray, shape (m, p)
        Derivatives of the computed -ln J.
    curvature : ndarray, shape (m, p, p)
        Second derivatives of the computed -ln J.
    chi_square : float
        Sum of squared residuals over squared errors, priors left out.
    degrees_of_freedom : int
    p_value : float or None
        Chance of a larger chi-square if the model is right; None without degrees of freedom.
    rms : float
        Root mean square residual of -ln J.
    leave_one_out : ndarray, shape (m,)
        Residual of each molecule predicted by a fit to the others, to second order.
    iterations : int
    converged : bool
    warnings : tuple of str
    """

    parameters: tuple[FittedParameter, ...]
    names: tuple[str, ...]
    measured: Array
    errors: Array
    computed: Array
    computed_errors: Array
    covariance: Array
    correlation: Array
    information: Array
    directions: tuple[Direction, ...]
    jacobian: Array
    curvature: Array
    chi_square: float
    degrees_of_freedom: int
    p_value: float | None
    rms: float
    leave_one_out: Array
    iterations: int
    converged: bool
    warnings: tuple[str, ...] = field(default=())

    @property
    def values(self) -> dict[str, float]:
        """Fitted values by name."""
        return {item.name: item.value for item in self.parameters}

    @property
    def leave_one_out_rms(self) -> float:
        """Root mean square of the residuals left out."""
        return float(np.sqrt(np.mean(self.leave_one_out**2)))

    def to_frame(self) -> Any:
        """Parameters as a pandas table."""
        import pandas as pd

        return pd.DataFrame(
            [
                {
                    "parameter": item.name,
                    "unit": item.unit,
                    "value": item.value,
                    "stderr": item.stderr,
                    "start": item.start,
                }
                for item in self.parameters
            ]
        )

    def to_dict(self) -> dict[str, Any]:
        """The JSON of ``dnacheck fit``."""
        return {
            "parameters": [
                {
                    "name": item.name,
                    "unit": item.unit,
                    "value": item.value,
                    "stderr": item.stderr,
                    "start": item.start,
                    "prior": None
                    if item.prior is None
                    else {"mean": item.prior.mean, "stderr": item.prior.stderr},
                }
                for item in self.parameters
            ],
            "molecules": [
                {
                    "name": name,
                    "measured": float(self.measured[i]),
                    "stderr": float(self.errors[i]),
                    "computed": float(self.computed[i]),
                    "computed_stderr": float(self.computed_errors[i]),
                    "residual": float(self.measured[i] - self.computed[i]),
                    "leave_one_out_residual": float(self.leave_one_out[i]),
                }
                for i, name in enumerate(self.names)
            ],
            "covariance": self.covariance.tolist(),
            "correlation": self.correlation.tolist(),
            "directions": [
                {
                    "eigenvalue": item.eigenvalue,
                    "stderr": item.stderr if math.isfinite(item.stderr) else None,
                    "parts": dict(item.parts),
                    "seen": item.seen,
                }
                for item in self.directions
            ],
            "chi_square": self.chi_square,
            "degrees_of_freedom": self.degrees_of_freedom,
            "p_value": self.p_value,
            "rms": self.rms,
            "leave_one_out_rms": self.leave_one_out_rms,
            "iterations": self.iterations,
            "converged": self.converged,
            "warnings": list(self.warnings),
        }


def plausible_range(name: str) -> float:
    """The range of a parameter against which what the data say of it is measured."""
    if name in _SCALE:
        return _SCALE[name]
    if is_offset(name):
        return 1.0
    return 0.2 if name.endswith("twist_deg") or name == "twist_offset_deg" else 1.0


def _bounded(name: str, value: float, move: float) -> float:
    """The new value of a parameter after a move, no longer than allowed and of the right sign."""
    if is_offset(name):
        return value + move
    longest = abs(value) * _LONGEST_MOVE[name] if name in _LONGEST_MOVE else _LONGEST_DEGREES
    return value + min(max(move, -longest), longest)


class _Data:
    """Chains and measured values of a fit, with ln J and its derivatives at given parameters."""

    def __init__(
        self,
        measurements: Sequence[Measurement],
        chains: Sequence[Chain],
        names: Sequence[str],
        options: FitOptions,
    ) -> None:
        self.measurements, self.chains = tuple(measurements), tuple(chains)
        self.names, self.options = tuple(names), options
        self.y = np.array([item.minus_lnJ for item in measurements])
        self.sigma = np.array([item.stderr for item in measurements])
        self.offsets = np.array(
            [
                [
                    1.0 if is_offset(n) and offset_group(n) in (None, item.group) else 0.0
                    for n in names
                ]
                for item in measurements
            ]
        )
        for j, name in enumerate(names):
            if is_offset(name) and not self.offsets[:, j].any():
                raise InputError(f"parameter '{name}': no molecule has that group")

    def models(self, values: Mapping[str, float]) -> list[LocalModel]:
        """Local models of ln J at ``values``, one per molecule."""

        def one(chain: Chain) -> LocalModel:
            here = modified_chain(chain, values)
            draws = closed_draws(
                here, tolerance=self.options.tolerance, rng=self.options.seed, threads=1
            )
            return local_model(chain, draws, self.names, values)

        if self.options.threads > 1:
            with ThreadPoolExecutor(self.options.threads) as pool:
                return list(pool.map(one, self.chains))
        return [one(chain) for chain in self.chains]

    def predicted(self, models: Sequence[LocalModel], values: Mapping[str, float]) -> Array:
        """Computed -ln J, offsets added."""
        vector = np.array([values[name] for name in self.names])
        return np.array([-m.log_j for m in models]) + self.offsets @ vector

    def jacobian(self, models: Sequence[LocalModel]) -> Array:
        """Derivatives (m, p) of the computed -ln J."""
        return np.array([-m.gradient for m in models]) + self.offsets


def fit_mechanics(
    measurements: Sequence[Measurement],
    chains: Sequence[Chain],
    free: Sequence[str],
    priors: Mapping[str, Prior] | None = None,
    options: FitOptions | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> MechanicsFit:
    """Fit named parameters to measured -ln J.

    Parameters
    ----------
    measurements : sequence of Measurement
    chains : sequence of Chain
        The molecules' own chains, in the same order.
    free : sequence of str
        Parameters to fit, see :mod:`dnacheck.model.named_parameters`.
    priors : mapping of str to Prior, optional
    progress : callable, optional
        Called after each iteration with its number and the rms residual.

    Raises
    ------
    InputError
        No parameter, an unknown or doubled one, a prior of one that is not free, more free
        parameters than data and priors.
    SolveError
        A molecule has no ring at the parameters reached.
    """
    options = options or FitOptions()
    priors = dict(priors or {})
    names = tuple(checked_name(name) for name in free)
    if not names:
        raise InputError("fit: name at least one free parameter")
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"parameter '{name}' is given twice")
    for name in priors:
        if name not in names:
            raise InputError(f"prior of '{name}': it is not a free parameter")
    if len(names) > len(measurements) + len(priors):
        raise InputError(
            f"{len(names)} free parameters for {len(measurements)} molecules and {len(priors)} "
            "priors; free fewer or give priors"
        )
    start = {name: _start(name, chains, priors) for name in names}
    data = _Data(measurements, chains, names, options)
    values = dict(start)
    models = data.models(values)
    converged = False
    iteration = 0
    cost = _cost(data, models, values, priors, options)
    damping = 0.0
    for iteration in range(1, _MOST_ITERATIONS + 1):
        move, errors = _move(data, models, values, priors, options, damping)
        new = {n: _bounded(n, values[n], float(move[i])) for i, n in enumerate(names)}
        try:
            new_models = data.models(new)
        except SolveError:
            damping = max(4.0 * damping, 1.0)
            continue
        new_cost = _cost(data, new_models, new, priors, options)
        if new_cost > cost + 0.1:  # beyond what the errors of J explain
            damping = max(4.0 * damping, 1.0)
            if damping > 1e4:
                break
            continue
        change = max(
            abs(new[n] - values[n]) / min(errors[i], plausible_range(n))
            for i, n in enumerate(names)
        )
        values, models, cost = new, new_models, new_cost
        damping = 0.25 * damping if damping > 0.05 else 0.0
        if progress is not None:
            residual = data.y - data.predicted(models, values)
            progress(iteration, float(np.sqrt(np.mean(residual**2))))
        if change < _SETTLED:
            converged = True
            break
    return _result(data, models, values, start, priors, iteration, converged)


def _start(name: str, chains: Sequence[Chain], priors: Mapping[str, Prior]) -> float:
    if name in priors:
        return priors[name].mean
    own = [own_value(chain, name) for chain in chains]
    finite = [value for value in own if math.isfinite(value)]
    if not finite:
        raise InputError(f"parameter '{name}': no molecule has it; leave it out")
    return finite[0]


def _weights(data: _Data, models: Sequence[LocalModel], residual: Array, robust: bool) -> Array:
    """Inverse variances of the residuals, lowered for outliers by Huber's loss where asked."""
    variance = data.sigma**2 + np.array([m.stderr for m in models]) ** 2
    weight = 1.0 / variance
    if robust:
        size = np.abs(residual) / np.sqrt(variance)
        weight = weight * np.where(size > _HUBER, _HUBER / np.maximum(size, 1e-12), 1.0)
    return np.asarray(weight)


def _cost(
    data: _Data,
    models: Sequence[LocalModel],
    values: Mapping[str, float],
    priors: Mapping[str, Prior],
    options: FitOptions,
) -> float:
    residual = data.y - data.predicted(models, values)
    z = np.abs(residual) / np.sqrt(data.sigma**2)
    loss = z**2
    if options.robust:
        loss = np.where(z > _HUBER, 2.0 * _HUBER * z - _HUBER**2, loss)
    prior = sum(((values[n] - p.mean) / p.stderr) ** 2 for n, p in priors.items())
    return float(loss.sum() + prior)


def _normal_equations(
    data: _Data, jacobian: Array, weight: Array, priors: Mapping[str, Prior]
) -> tuple[Array, Array]:
    """Fisher information of the data, and the same with the priors'."""
    information = jacobian.T @ (weight[:, None] * jacobian)
    precision = np.array([1.0 / priors[n].stderr ** 2 if n in priors else 0.0 for n in data.names])
    return information, information + np.diag(precision)


def _move(
    data: _Data,
    models: Sequence[LocalModel],
    values: Mapping[str, float],
    priors: Mapping[str, Prior],
    options: FitOptions,
    damping: float,
) -> tuple[Array, Array]:
    residual = data.y - data.predicted(models, values)
    jacobian = data.jacobian(models)
    weight = _weights(data, models, residual, options.robust)
    _, whole = _normal_equations(data, jacobian, weight, priors)
    slope = jacobian.T @ (weight * residual)
    for i, name in enumerate(data.names):
        if name in priors:
            slope[i] += (priors[name].mean - values[name]) / priors[name].stderr ** 2
    ranges = np.array([plausible_range(n) for n in data.names])
    # A whisper of a prior of ten plausible ranges keeps unseen directions where they began.
    damped = whole + np.diag((damping + BLIND) / ranges**2)
    errors = np.sqrt(np.diag(np.linalg.inv(damped))).astype(float)
    move = np.linalg.solve(damped, slope).astype(float)
    return move, errors


def _leave_one_out(
    data: _Data, jacobian: Array, weight: Array, whole: Array, residual: Array
) -> Array:
    """Residuals of molecules left out, by one Gauss-Newton step from the fit to all of them.

    For a model linear in its parameters this is exact: r_i / (1 - h_i), h the leverage.
    """
    ranges = np.array([plausible_range(n) for n in data.names])
    inverse = np.linalg.inv(whole + np.diag(1e-6 / ranges**2))
    leverage = np.einsum("ip,pq,iq->i", jacobian, inverse, jacobian) * weight
    return np.asarray(residual / np.maximum(1.0 - leverage, 1e-6))


def _result(
    data: _Data,
    models: Sequence[LocalModel],
    values: Mapping[str, float],
    start: Mapping[str, float],
    priors: Mapping[str, Prior],
    iterations: int,
    converged: bool,
) -> MechanicsFit:
    from scipy.stats import chi2

    residual = data.y - data.predicted(models, values)
    jacobian = data.jacobian(models)
    weight = _weights(data, models, residual, data.options.robust)
    information, whole = _normal_equations(data, jacobian, weight, priors)
    ranges = np.array([plausible_range(n) for n in data.names])
    directions, unseen = _directions(data.names, information, ranges)
    tiny = np.diag(1e-9 / ranges**2)
    covariance = np.linalg.inv(whole + tiny).astype(float)
    error = np.sqrt(np.diag(covariance))
    freedom = len(data.y) - len(data.names)
    plain = 1.0 / (data.sigma**2 + np.array([m.stderr for m in models]) ** 2)
    chi = float(np.sum(plain * residual**2))
    p_value = float(chi2.sf(chi, freedom)) if freedom > 0 else None
    warnings = []
    if p_value is not None and p_value < 0.01:
        warnings.append(
            f"chi-square {chi:.1f} for {freedom} degrees of freedom (p = {p_value:.1g}): the model "
            "with these free parameters does not explain the data within their errors"
        )
    for name in unseen:
        if name not in priors:
            warnings.append(f"the data cannot see {name}; it stays near where it began")
    for item in directions:
        if item.seen and item.stderr > 1.0:
            parts = ", ".join(
                f"{value:+.2f} {name}" for name, value in item.parts.items() if abs(value) > 0.2
            )
            warnings.append(
                f"the data hardly see the direction {parts}: error {item.stderr:.1f} plausible "
                "ranges"
            )
    if not converged:
        warnings.append("the fit did not settle within its errors; its values may still move")
    blind = {name for name in unseen if name not in priors}
    return MechanicsFit(
        parameters=tuple(
            FittedParameter(
                name,
                unit(name),
                values[name],
                None if name in blind else float(error[i]),
                start[name],
                priors.get(name),
            )
            for i, name in enumerate(data.names)
        ),
        names=tuple(item.name for item in data.measurements),
        measured=data.y,
        errors=data.sigma,
        computed=data.predicted(models, values),
        computed_errors=np.array([m.stderr for m in models]),
        covariance=covariance,
        correlation=covariance / np.outer(error, error),
        information=information,
        directions=directions,
        jacobian=jacobian,
        curvature=np.array([-m.hessian for m in models]),
        chi_square=chi,
        degrees_of_freedom=freedom,
        p_value=p_value,
        rms=float(np.sqrt(np.mean(residual**2))),
        leave_one_out=_leave_one_out(data, jacobian, weight, whole, residual),
        iterations=iterations,
        converged=converged,
        warnings=tuple(warnings),
    )


def _directions(
    names: Sequence[str], information: Array, ranges: Array
) -> tuple[tuple[Direction, ...], set[str]]:
    """Eigenvectors of the information in plausible ranges, and the parameters no datum sees."""
    scaled = information * np.outer(ranges, ranges)
    eigenvalues, vectors = np.linalg.eigh(scaled)
    found = []
    blind = np.zeros(len(names))
    for value, vector in zip(eigenvalues, vectors.T, strict=True):
        seen = bool(value > BLIND)
        top = vector[int(np.argmax(np.abs(vector)))]
        vector = vector * np.sign(top)
        if not seen:
            blind += vector**2
        found.append(
            Direction(
                eigenvalue=float(value),
                stderr=float(1.0 / math.sqrt(value)) if value > 1e-12 else math.inf,
                parts={n: float(v) for n, v in zip(names, vector, strict=True)},
                seen=seen,
            )
        )
    return tuple(found), {n for n, b in zip(names, blind, strict=True) if b > 0.5}
