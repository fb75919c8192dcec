"""What every way to compute a J factor offers: one verb, its options, one result."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dnacheck.numerics.outcome import InputError

if TYPE_CHECKING:
    from dnacheck.cyclization.laplace.register import RegisterProfile
    from dnacheck.cyclization.result import JFactor
    from dnacheck.equilibria.ring import Equilibria
    from dnacheck.model.chain import Chain
    from dnacheck.numerics.seeds import Randomness

    Target = Chain | Equilibria | RegisterProfile

Progress = Callable[[int], None]
DEFAULT_TOLERANCE = 0.02


@dataclass(frozen=True)
class Run:
    """What is asked of one computation, whatever its method.

    Attributes
    ----------
    rng : int, SeedSequence or Generator
    threads : int
    progress : callable or None
        Called with the number of draws made so far.
    tolerance : float
        Error of ln J that is asked for.
    max_seconds : float
        Wall time after which the best so far is returned.
    """

    rng: Randomness = 0
    threads: int = 1
    progress: Progress | None = None
    tolerance: float = DEFAULT_TOLERANCE
    max_seconds: float = math.inf

    def __post_init__(self) -> None:
        if not (_is_number(self.tolerance) and 0.0 < self.tolerance < math.inf):
            raise InputError(
                f"tolerance must be a finite number greater than 0, not {self.tolerance!r}"
            )
        if not (_is_number(self.max_seconds) and self.max_seconds > 0.0):
            raise InputError(f"max_seconds must be positive, not {self.max_seconds!r}")
        if isinstance(self.threads, bool) or not (
            isinstance(self.threads, int) and self.threads >= 1
        ):
            raise InputError(f"threads must be an integer of 1 or more, not {self.threads!r}")
        if self.progress is not None and not callable(self.progress):
            raise InputError(f"progress must be callable or None, not {self.progress!r}")


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


class Method(ABC):
    """A way to compute J: a frozen dataclass of its options, which are checked when it is made.

    A subclass gives :attr:`name` and :meth:`run`; a line in
    :data:`dnacheck.cyclization.methods.METHODS` gives it to the command line.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """Name on the command line and in the result."""

    @property
    def measures_error(self) -> bool:
        """Whether the result carries an error of its own."""
        return True

    def compute(
        self,
        target: Target,
        *,
        rng: Randomness = 0,
        threads: int = 1,
        progress: Progress | None = None,
        tolerance: float = DEFAULT_TOLERANCE,
        max_seconds: float = math.inf,
    ) -> JFactor:
        """J factor of a chain, or of one whose rings or register profile are known already.

        Parameters
        ----------
        target : Chain, Equilibria or RegisterProfile
        rng : int, numpy.random.SeedSequence or numpy.random.Generator
            The same number or fresh sequence gives the same result, whatever ``threads`` is.
        threads : int
        progress : callable, optional
            Called with the number of draws made so far.
        tolerance : float
            Error of ln J at which a method that can goes no further.
        max_seconds : float
            Wall time after which it stops with what it has.

        Returns
        -------
        JFactor
            Its status says whether the tolerance was met.

        Raises
        ------
        InputError
            An option out of its range.
        SolveError
            No ring was found, or none of the draws could be used.
        """
        from dnacheck.numerics.seeds import seed_sequence

        if not hasattr(rng, "bit_generator"):
            rng = seed_sequence(rng)
        return self.run(target, Run(rng, threads, progress, tolerance, max_seconds))

    @abstractmethod
    def run(self, target: Target, run: Run) -> JFactor:
        """Compute J; see :meth:`compute`, which is what to call."""


def rings_of(target: Target, any_end: bool = False) -> Equilibria:
    """The minima of a target, searched for where they are not given.

    Raises
    ------
    InputError
        The end is not that of a ring, and the method that asks knows no other.
    """
    from dnacheck.cyclization.laplace.register import RegisterProfile
    from dnacheck.equilibria.discrete.search import find_rings
    from dnacheck.equilibria.ring import Equilibria

    if isinstance(target, RegisterProfile):
        target = target.search
    search = target if isinstance(target, Equilibria) else find_rings(target)
    if not any_end and search.boundary.label != "ring":
        raise InputError(
            f"this method knows closed rings alone; for a {search.boundary.label} chain use "
            "closure or one of the Laplace methods"
        )
    return search


def register_profile_of(target: Target) -> RegisterProfile:
    """The register-constrained minima of a target, computed where they are not given."""
    from dnacheck.cyclization.laplace.register import RegisterProfile, register_profile

    return target if isinstance(target, RegisterProfile) else register_profile(target)
