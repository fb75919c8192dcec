"""The one result of every method: a J factor with its errors."""

from __future__ import annotations

import enum
import html
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from dnacheck.numerics.outcome import InputError, SolveError

if TYPE_CHECKING:
    from dnacheck.cyclization.gradient import LogJGradient

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
    FOLDED = (
        "many draws fold away from closure, so shapes far from every minimum may be missed; use "
        "half chains"
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
class Attempt:
    """One method that :class:`dnacheck.cyclization.automatic.Auto` tried.

    Attributes
    ----------
    method : str
    minus_lnJ : float
    error : float
        Measured error of ln J: standard error and bias bound in quadrature; for Laplace its
        difference from the pilot sample plus 2.4 of the pilot's standard errors.
    seconds : float
        Wall time that it took.
    met : bool
        Whether the error meets the tolerance and nothing speaks against the method.
    """

    method: str
    minus_lnJ: float
    error: float
    seconds: float
    met: bool


@dataclass(frozen=True, repr=False)
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
    reason : str
        Why this method, where it was chosen.
    tried : tuple of Attempt
        What was tried before it, and it itself.
    derivatives : LogJGradient or None
        Derivatives of ln J, where the method was asked for them.
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
    reason: str = ""
    tried: tuple[Attempt, ...] = ()
    derivatives: LogJGradient | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        if math.isnan(self.minus_lnJ) or not self.stderr >= 0.0:
            raise InputError(
                f"J factor of {self.target}: -ln J = {self.minus_lnJ} with error {self.stderr} "
                "is no number; weights must be finite and not negative"
            )

    @property
    def molar(self) -> float:
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

    def gradient(self, wrt: str | Sequence[str]) -> dict[str, tuple[float, float]]:
        """Derivatives of ln J with respect to named parameters, from the draws that gave J.

        Parameters
        ----------
        wrt : str or sequence of str
            Names of :mod:`dnacheck.model.named_parameters`: ``persistence_length_A``,
            ``twist_ratio``, ``twist_offset_deg``, ``bend_scale``, ``a_tract_twist_deg``, table
            entries such as ``theta[AG]`` ...

        Returns
        -------
        dict of (value, stderr)
            Per unit of each parameter.

        Raises
        ------
        InputError
            The method kept no derivatives, or the chain has no such parameter.
        """
        if self.derivatives is None:
            raise InputError(
                f"{self.method} kept no derivatives of J; ask for them with "
                "method=dnacheck.ClosureSampling(gradient=True)"
            )
        return self.derivatives.with_respect_to([wrt] if isinstance(wrt, str) else wrt)

    def of_link(self, link: int, tolerance: float = math.inf) -> JFactor:
        """The part of J at one link, with its own error.

        Parameters
        ----------
        link : int
        tolerance : float
            Error of ln J that the part should meet; the status says whether it does.

        Returns
        -------
        JFactor
            Its only link is ``link``. The bias bound of the whole is taken to lie in this part
            altogether.

        Raises
        ------
        SolveError
            Nothing was found at this link; ``partial`` holds the whole.
        """
        share = next((share for share in self.links if share.link == link), None)
        if share is None:
            found = ", ".join(str(share.link) for share in self.links) or "none"
            raise SolveError(
                f"J factor of {self.target}: no share of link {link} was found (links found: "
                f"{found}); use --link auto for all of J",
                self,
            )
        bias = self.bias_bound
        if bias is not None:
            bias *= math.exp(min(share.minus_lnJ - self.minus_lnJ, 700.0))
        part = replace(
            self,
            minus_lnJ=share.minus_lnJ,
            stderr=share.stderr,
            bias_bound=bias,
            links=(share,),
            derivatives=None,
        )
        if self.status is JStatus.CONVERGED and part.total_error > tolerance:
            return replace(part, status=JStatus.TOLERANCE_NOT_MET)
        return part

    def to_dict(self) -> dict[str, Any]:
        """The members of the command's JSON; ``reason`` where the method was chosen."""
        record = {
            "target": self.target,
            "n_bp": self.n_bp,
            "method": self.method,
            "minus_lnJ": self.minus_lnJ,
            "stderr": self.stderr,
            "bias_bound": self.bias_bound,
            "J_molar": self.molar,
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
        if self.reason:
            record["reason"] = self.reason
        return record

    @property
    def _errors(self) -> str:
        text = f" ± {self.stderr:.4f}" if self.stderr > 0.0 else ""
        return text + (f", bias at most {self.bias_bound:.1g}" if self.bias_bound else "")

    def __str__(self) -> str:
        return (
            f"{self.target}: -ln J = {self.minus_lnJ:.4f}{self._errors}; "
            f"J = {self.molar:.3g} M ({self.method}, {self.n_bp} bp)"
        )

    def __repr__(self) -> str:
        word = "" if self.status.ok else f", {self.status.name.lower().replace('_', ' ')}"
        return f"<JFactor {self}{word}>"

    def _repr_html_(self) -> str:
        """A table for a notebook."""
        rows = [
            ("−ln J", f"{self.minus_lnJ:.4f}{self._errors}"),
            ("J", f"{self.molar:.3g} M"),
            ("method", self.method),
            *(
                (f"link {s.link}", f"{s.minus_lnJ:.3f}" + (f" ± {s.stderr:.3f}" * (s.stderr > 0)))
                for s in self.links
            ),
            ("status", self.status.value),
        ]
        body = "".join(
            f"<tr><th>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>"
            for name, value in rows
        )
        title = html.escape(f"J factor of {self.target}, {self.n_bp} bp")
        return f"<table><caption>{title}</caption>{body}</table>"


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
