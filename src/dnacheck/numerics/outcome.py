"""How a computation ended, and the errors that carry a message for the user."""

from __future__ import annotations

import enum
from typing import Any


class Status(enum.Enum):
    """End of a computation; the value is what the user should know or do next."""

    CONVERGED = "converged"
    SADDLE = (
        "converged to an equilibrium that is not a minimum; start from another register "
        "or ask for minima only"
    )
    NEUTRAL = (
        "converged to one of a family of equilibria of equal energy (a zero mode, such as the "
        "register of a straight molecule); its energy holds for all of them"
    )
    ITERATION_LIMIT = (
        "stopped at the iteration limit before the tolerance was met; raise max_iterations "
        "or start from another register or link"
    )
    STEP_LIMIT = (
        "no step lowers the merit function any further although the tolerance is not met; "
        "loosen the tolerance or start from another register or link"
    )
    SINGULAR = (
        "the equilibrium is not isolated (a zero mode, such as the register of a straight "
        "molecule); treat the register separately"
    )
    NOT_FINITE = (
        "a number overflowed or became undefined; check the input angles and stiffnesses "
        "for extreme values"
    )
    NOT_FOUND = "no equilibrium was found at the links that were searched; widen the search"
    MESH_LIMIT = (
        "the error estimate exceeds the tolerance on the finest mesh allowed; raise the "
        "number of intervals or the degree"
    )

    @property
    def ok(self) -> bool:
        """Whether the result may be used as an equilibrium."""
        return self in (Status.CONVERGED, Status.SADDLE, Status.NEUTRAL)


class DnaCheckError(Exception):
    """Base of every error that this package raises on purpose."""


class InputError(DnaCheckError):
    """Bad input; the message is one line that names the place and the mend."""


class SolveError(DnaCheckError):
    """A computation that did not converge; ``partial`` holds what it had.

    Parameters
    ----------
    message : str
        Which computation, how far it came, and what to try.
    partial : object, optional
        The unfinished result.
    """

    def __init__(self, message: str, partial: Any = None) -> None:
        super().__init__(message)
        self.partial = partial


class TimeLimitReachedError(DnaCheckError):
    """The time that a command was given is over."""
