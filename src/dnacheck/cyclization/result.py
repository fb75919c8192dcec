"""The one result of every method: a J factor with its errors."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Any

from dnacheck.numerics.outcome import InputError

PER_CUBIC_ANGSTROM_IN_MOLAR = 1660.539
"""One molecule per cubic ångström in mol/L, 1e27 Å^3/L over Avogadro's number."""


class JStatus(enum.Enum):
    """How far a J factor may be believed; the value is what the user should know or do next."""

    CONVERGED = "converged"
    NO_ERROR_ESTIMATE = (
        "a Laplace value without an error of its own; sample (closure or half-chain) for one"
    )
    TOLERANCE_NOT_MET = (
        "the tolerance was not met in the time or samples allowed; allow more or accept the error"
    )
    HEAVY_TAILS = (
        "a few samples carry the mean, so the standard error may be too small; use more samples "
        "or another method"
    )
    SOFT_REGISTER = (
        "the register is nearly free, so the Laplace value is unreliable; use the "
        "register-integrated one or sample"
    )
    NOT_FOUND = "no stable ring was found at any link searched; widen the search"

    @property
    def ok(self) -> bool:
        """Whether the value meets what was asked of it."""
        return self in (JStatus.CONVERGED, JStatus.NO_ERROR_ESTIMATE)


@dataclass(frozen=True)
class LinkShare:
    """Contribution of one link to J.

    Attributes
    ----------
    link : int
        Turns of the frames about the ring, of each sampled shape (of the minimum for Laplace).
    minus_lnJ, stderr : float
        Minus the logarithm of the part of J (mol/L) at this link, and its standard error.
    """

    link: int
    minus_lnJ: float
    stderr: float = 0.0


@dataclass(frozen=True)
class JFactor:
    """A J factor: the molar density of exact closure, J = exp(-minus_lnJ) mol/L.

    -ln J is the free energy over RT of (10.1), entropy included, with no fitted shift.

    Attributes
    ----------
    target : str
        Name of the molecule.
    n_bp : int
    method : str
        ``laplace``, ``register-laplace``, ``corrected-laplace``, ``closure``, ``half-chain``,
        ``half-chain-plain`` or ``metropolis``.
    minus_lnJ : float
        -ln J, J in mol/L.
    stderr : float
        Statistical standard error of ln J; 0 for a method that draws nothing.
    bias_bound : float or None
        Bound or measured estimate of the systematic error of ln J; None where none is known.
    links : tuple of LinkShare
        Largest contribution first.
    samples : int
        Draws made (0 for Laplace); for half chains the number of halves.
    effective_samples : float or None
        (sum w)^2 / sum w^2 of the weights.
    pareto_shape : float or None
        Shape k of the weights' tail; above 0.7 the error bar is not to be trusted.
    seconds : float
        Wall time.
    warnings : tuple of str
    status : JStatus
    """

    target: str
    n_bp: int
    method: str
    minus_lnJ: float
    stderr: float
    links: tuple[LinkShare, ...] = ()
    bias_bound: float | None = None
    samples: int = 0
    effective_samples: float | None = None
    pareto_shape: float | None = None
    seconds: float = 0.0
    warnings: tuple[str, ...] = ()
    status: JStatus = JStatus.CONVERGED

    def __post_init__(self) -> None:
        if math.isnan(self.minus_lnJ) or not self.stderr >= 0.0:
            raise InputError(
                f"J factor of {self.target}: -ln J = {self.minus_lnJ} with error {self.stderr} "
                "is no number; weights must be finite and not negative"
            )

    @property
    def J_molar(self) -> float:
        """J in mol/L."""
        return math.exp(-self.minus_lnJ)

    @property
    def total_error(self) -> float:
        """Standard error and bias bound of ln J, added in quadrature; infinite if none is known.

        The bias bound counts in full, as one standard error.
        """
        if self.status is JStatus.NO_ERROR_ESTIMATE and self.bias_bound is None:
            return math.inf
        return math.hypot(self.stderr, self.bias_bound or 0.0)

    def to_json(self) -> dict[str, Any]:
        """The members of the command's JSON."""
        return {
            "target": self.target,
            "n_bp": self.n_bp,
            "method": self.method,
            "minus_lnJ": self.minus_lnJ,
            "stderr": self.stderr,
            "bias_bound": self.bias_bound,
            "J_molar": self.J_molar,
            "links": [
                {"link": share.link, "minus_lnJ": share.minus_lnJ, "stderr": share.stderr}
                for share in self.links
            ],
            "samples": self.samples,
            "effective_samples": self.effective_samples,
            "pareto_shape": self.pareto_shape,
            "seconds": self.seconds,
            "status": self.status.value,
            "warnings": list(self.warnings),
        }


def link_shares(
    log_parts: dict[int, float], errors: dict[int, float] | None = None
) -> tuple[LinkShare, ...]:
    """Shares from ln J of each link and, optionally, its standard error, largest first."""
    errors = errors or {}
    return tuple(
        LinkShare(link, -value, errors.get(link, 0.0))
        for link, value in sorted(log_parts.items(), key=lambda item: (-item[1], item[0]))
        if value > -math.inf
    )
