"""J factors of ideal rods, to compare with: the wormlike chain, with and without twist.

A straight, isotropic rod of length L, persistence length P and torsional rigidity C (in kT times
a length) has, with kappa = P/L,

* ends that meet in any direction: J L^3 = 112.04 kappa^2 exp(0.246/kappa - 14.054 kappa);
* ends that meet with their tangents aligned, twist averaged over:
  J = (4 pi^3 b^3 / L^6) exp(-pi^2 b / L + 0.514 L / b), b = 2P

(Shimada & Yamakawa, Macromolecules 17, 689 (1984); good to a few per cent up to about L = 4 P).
Directions count against a uniform distribution.

Twist enters as a sum over links of a Gaussian in the excess twist 2 pi (link - relaxed turns),
whose variance L/C ignores that bending and twist are coupled through the writhe. To lowest order
in L/P that coupling adds the variance of 2 pi times the writhe of a torsionally free ring:

    <Wr^2> = 3 L^2 / (32 pi^4 P^2).

For out of plane tangent angles theta = sum (a_n cos + b_n sin)(n s / R) and in-plane ones
psi = sum (c_n cos + d_n sin), n >= 2 by closure, the energy has the variances
L / (2 pi^2 P (n^2 - 1)) and L / (2 pi^2 P n^2), the writhe is -1/(2 pi) of the integral of
theta psi', and sum 1/(n^2 - 1) = 3/4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dnacheck.cyclization.result import PER_CUBIC_ANGSTROM_IN_MOLAR
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import InputError

_LINKS_EACH_SIDE = 12.0
"""Standard deviations of the twist out to which links are summed."""


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{name.replace('_', ' ')} must be positive, not {value}")


def free_ends_j(length_A: float, persistence_A: float) -> float:
    """J in mol/L of ends that meet in any direction; lengths in Å.

    Raises
    ------
    InputError
        A length is not positive.
    """
    _positive(length_A=length_A, persistence_A=persistence_A)
    kappa = persistence_A / length_A
    density = 112.04 * kappa**2 * math.exp(0.246 / kappa - 14.054 * kappa) / length_A**3
    return PER_CUBIC_ANGSTROM_IN_MOLAR * density


def aligned_ends_j(length_A: float, persistence_A: float) -> float:
    """J in mol/L of ends that meet with aligned tangents, twist averaged over; lengths in Å.

    Raises
    ------
    InputError
        A length is not positive.
    """
    _positive(length_A=length_A, persistence_A=persistence_A)
    kuhn = 2.0 * persistence_A
    exponent = -(math.pi**2) * kuhn / length_A + 0.514 * length_A / kuhn
    density = 4.0 * math.pi**3 * kuhn**3 / length_A**6 * math.exp(exponent)
    return PER_CUBIC_ANGSTROM_IN_MOLAR * density


def long_ring_j(length_A: float, persistence_A: float) -> float:
    """J in mol/L of a long rod's ends that meet with aligned tangents, twist averaged over.

    With L in Kuhn lengths the ends of a Gaussian chain meet with the density (3 / 2 pi L)^(3/2),
    stiffness takes 5 / 8L of it off (Daniels 1952; Yamakawa & Stockmayer, J. Chem. Phys. 57, 2843
    (1972)), and given both tangents u and u' the mean end is (u + u') / 2, which multiplies with
    exp(-3 |u + u'|^2 / 8L) over its mean: another 3 / 4L for aligned ones. The next term is of
    order 1 / L^2, which limits this to L of ten or more.

    Raises
    ------
    InputError
        A length is not positive.
    """
    _positive(length_A=length_A, persistence_A=persistence_A)
    kuhn = 2.0 * persistence_A
    length = length_A / kuhn
    density = (3.0 / (2.0 * math.pi * length)) ** 1.5 * (1.0 - 11.0 / (8.0 * length)) / kuhn**3
    return PER_CUBIC_ANGSTROM_IN_MOLAR * density


def writhe_variance(length_A: float, persistence_A: float) -> float:
    """Variance (turns squared) of the writhe of a torsionally free ring, to lowest order in L/P."""
    _positive(length_A=length_A, persistence_A=persistence_A)
    return 3.0 / (32.0 * math.pi**4) * (length_A / persistence_A) ** 2


def twist_factors(relaxed_turns: float, variance: float) -> dict[int, float]:
    """Density of each link's twist over the uniform density, by link.

    Parameters
    ----------
    relaxed_turns : float
        Twist of the unstressed molecule in turns.
    variance : float
        Of the excess twist in square radians, L/C for a rod that does not bend.

    Returns
    -------
    dict
        2 pi times a normal density at 2 pi (link - relaxed turns); the sum over links tends to 1
        for a large variance, and is 1 on the mean over relaxed turns.
    """
    _positive(variance=variance)
    reach = max(_LINKS_EACH_SIDE * math.sqrt(variance) / (2.0 * math.pi), 1.0)
    links = range(math.floor(relaxed_turns - reach), math.ceil(relaxed_turns + reach) + 1)
    norm = math.sqrt(2.0 * math.pi / variance)
    return {
        link: norm * math.exp(-0.5 * (2.0 * math.pi * (link - relaxed_turns)) ** 2 / variance)
        for link in links
    }


@dataclass(frozen=True)
class RodJFactor:
    """J of an ideal rod beside a chain's.

    Attributes
    ----------
    minus_lnJ : float
        -ln J (mol/L), twist as a Gaussian of variance L/C.
    minus_lnJ_coupled : float
        The same with the writhe's variance added: what bend-twist coupling changes.
    minus_lnJ_twist_free : float
        Tangents aligned, twist averaged over.
    links : dict of int to float
        -ln of each link's part, without coupling.
    """

    minus_lnJ: float
    minus_lnJ_coupled: float
    minus_lnJ_twist_free: float
    links: dict[int, float]


def rod_j(
    length_A: float, persistence_A: float, torsional_A: float, relaxed_turns: float
) -> RodJFactor:
    """Shimada-Yamakawa J of a straight rod with twist; lengths and C/kT in Å.

    Raises
    ------
    InputError
        A length is not positive.
    """
    _positive(torsional_A=torsional_A)
    aligned = aligned_ends_j(length_A, persistence_A)
    variance = length_A / torsional_A
    plain = twist_factors(relaxed_turns, variance)
    coupled = twist_factors(
        relaxed_turns,
        variance + (2.0 * math.pi) ** 2 * writhe_variance(length_A, persistence_A),
    )
    return RodJFactor(
        minus_lnJ=-math.log(aligned * sum(plain.values())),
        minus_lnJ_coupled=-math.log(aligned * sum(coupled.values())),
        minus_lnJ_twist_free=-math.log(aligned),
        links={link: -math.log(aligned * factor) for link, factor in plain.items() if factor > 0.0},
    )


def chain_rod_j(chain: Chain) -> RodJFactor:
    """J of the straight isotropic rod with a chain's mean flexibilities and relaxed twist.

    P = 2 / (sum of the two bends' variances per length), C the inverse variance of twist per
    length, both from the mean inverse stiffness. Ground curvature is left out: for a curved
    molecule this is another molecule, and the comparison says how far off that is.
    """
    variances = np.linalg.inv(chain.energy_scale_RT * chain.stiffness).mean(axis=0)
    persistence = 2.0 * chain.rise_A / float(variances[1, 1] + variances[2, 2])
    torsional = chain.rise_A / float(variances[0, 0])
    return rod_j(chain.n_steps * chain.rise_A, persistence, torsional, chain.relaxed_turns)
