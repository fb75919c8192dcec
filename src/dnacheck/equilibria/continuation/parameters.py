"""What a family of rings is followed in: end twist, curvature, twist ratio, or a user's own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.continuum.collocation import Discretisation
from dnacheck.model.rod.rod import Rod
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Conditions:
    """The problem at one value of the parameter, with its derivative.

    Attributes
    ----------
    coefficients, rates : ndarray, shape (K, k, 4)
        w1hat, w2hat, bending and twisting compliance at the collocation points, per unit s, and
        their derivatives with respect to the parameter.
    alpha, alpha_rate : float
        End twist of (4.11) in radians, and its derivative.
    """

    coefficients: Array
    rates: Array
    alpha: float
    alpha_rate: float


@dataclass(frozen=True)
class Parameter:
    """A one-parameter family of problems.

    Attributes
    ----------
    name : str
    scale : float
        Change of the parameter that counts as much, in the arclength of the branch, as a change
        of the moment by 2 pi K1 or of the force by 4 pi**2 K1, those of a circle.
    conditions : callable (Discretisation, value) -> Conditions
    rod : callable (Rod, value) -> Rod
        The rod whose ring a point of the branch is.
    period : float or None
        Problems that differ by this are the same problem: 2 pi for the end twist.
    least : float
        Values up to this one have no meaning.
    """

    name: str
    scale: float
    conditions: Callable[[Discretisation, float], Conditions]
    rod: Callable[[Rod, float], Rod]
    period: float | None = None
    least: float = -np.inf


def end_twist(fraction: float = 1.0) -> Parameter:
    """The angle alpha of (4.11) from D1(0) to D1(1), radians, at fixed curvature.

    ``fraction`` is gamma of Section VII: 1 the rod itself, 0 the perfect problem.
    """
    cache: list[tuple[Discretisation, Array, Array]] = []

    def conditions(disc: Discretisation, value: float) -> Conditions:
        if not cache or cache[0][0] is not disc:
            coefficients = disc.coefficients(fraction)
            cache[:] = [(disc, coefficients, np.zeros_like(coefficients))]
        return Conditions(cache[0][1], cache[0][2], value, 1.0)

    return Parameter(
        name="end_twist",
        scale=2.0 * np.pi,
        conditions=conditions,
        rod=lambda rod, value: _straightened(rod, fraction),
        period=2.0 * np.pi,
    )


def curvature_fraction(alpha: float) -> Parameter:
    """gamma of Section VII, the fraction of the intrinsic curvature, at fixed end twist."""

    def conditions(disc: Discretisation, value: float) -> Conditions:
        coefficients = disc.coefficients(value)
        rates = np.zeros_like(coefficients)
        rates[..., :2] = disc.strains.reshape(*rates.shape[:2], 2)
        return Conditions(coefficients, rates, alpha, 0.0)

    return Parameter("curvature_fraction", 1.0, conditions, _straightened)


def twist_ratio(alpha: float) -> Parameter:
    """K3/K1 at fixed K1 and fixed end twist."""

    def conditions(disc: Discretisation, value: float) -> Conditions:
        factor = value * disc.rod.bend_stiffness / disc.rod.twist_stiffness
        coefficients = disc.coefficients(1.0, factor)
        rates = np.zeros_like(coefficients)
        rates[..., 3] = -coefficients[..., 3] / value
        return Conditions(coefficients, rates, alpha, 0.0)

    return Parameter(
        "twist_ratio",
        1.0,
        conditions,
        lambda rod, value: replace(rod, twist_stiffness=value * rod.bend_stiffness),
        least=0.0,
    )


def custom(
    name: str,
    conditions: Callable[[Discretisation, float], Conditions],
    rod: Callable[[Rod, float], Rod],
    scale: float = 1.0,
    period: float | None = None,
) -> Parameter:
    """A parameter of the caller's own.

    Raises
    ------
    InputError
        ``scale`` is not positive.
    """
    if not 0.0 < scale < np.inf:
        raise InputError(f"parameter '{name}': scale = {scale}, give a positive number")
    return Parameter(name, scale, conditions, rod, period)


def _straightened(rod: Rod, fraction: float) -> Rod:
    if fraction == 1.0:
        return rod
    return replace(rod, strain_series=fraction * rod.strain_series)


def perfect_rod(
    n_steps: int = 158,
    twist_ratio: float = 1.5,
    persistence_length_A: float = 463.0,
    rise_A: float = 3.4,
) -> Rod:
    """Intrinsically straight, untwisted, isotropic rod: the perfect problem of Section IV B.

    Parameters
    ----------
    n_steps : int
        N in K1 = K_theta/N (5.3); Figure 6 has 158.
    twist_ratio : float
        K3/K1.

    Raises
    ------
    InputError
        A number that is not positive.
    """
    from dnacheck.model.rod.options import RodOptions

    for name, value in (
        ("number of steps", n_steps),
        ("twist ratio", twist_ratio),
        ("persistence length", persistence_length_A),
        ("rise", rise_A),
    ):
        if not 0.0 < value < np.inf:
            raise InputError(f"perfect rod: {name} = {value}, give a positive number")
    base_pairs = np.arange(n_steps + 1) / n_steps
    arrays = [np.array([0.0, 1.0]), np.zeros((1, 2, 2)), base_pairs, np.zeros(n_steps + 1)]
    for array in arrays:
        array.setflags(write=False)
    return Rod(
        name="perfect",
        n_steps=n_steps,
        breaks=arrays[0],
        strain_series=arrays[1],
        compliance_series=None,
        bend_stiffness=1.0 / n_steps,
        twist_stiffness=twist_ratio / n_steps,
        s_frames=arrays[2],
        omega=arrays[3],
        length_steps=float(n_steps),
        energy_scale_RT=persistence_length_A / rise_A,
        rise_A=rise_A,
        options=RodOptions(),
    )
