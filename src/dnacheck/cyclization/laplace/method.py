"""Laplace's approximation as a method object."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dnacheck.cyclization.method import Method, Run, register_profile_of, rings_of
from dnacheck.numerics.outcome import InputError

if TYPE_CHECKING:
    from dnacheck.cyclization.laplace.anharmonic import AnharmonicOptions
    from dnacheck.cyclization.method import Target
    from dnacheck.cyclization.result import JFactor


@dataclass(frozen=True)
class Laplace(Method):
    """Laplace's approximation about the minima.

    Attributes
    ----------
    register : bool
        Integrate over the register, the softest mode of a ring, instead of treating it as a
        Gaussian too.
    order : int
        0 for Laplace's value itself, whose error it does not know (0.2 to 0.5 at 150 base pairs);
        1 for the first anharmonic term, with an estimate of the next as its bound. The term
        belongs to the register-integrated value.
    pairs : int
        Antithetic pairs of draws that the term starts with.
    """

    register: bool = False
    order: int = 0
    pairs: int = 200

    def __post_init__(self) -> None:
        if not isinstance(self.register, bool):
            raise InputError(f"Laplace: register must be True or False, not {self.register!r}")
        if isinstance(self.order, bool) or self.order not in (0, 1):
            raise InputError(f"Laplace: order must be 0 or 1, not {self.order!r}")
        if self.order == 1 and not self.register:
            raise InputError("Laplace: order 1 needs register=True")
        if self.order:
            self.options(Run())

    @property
    def name(self) -> str:
        if self.order:
            return "corrected-laplace"
        return "register-laplace" if self.register else "laplace"

    @property
    def measures_error(self) -> bool:
        return self.order > 0

    def options(self, run: Run) -> AnharmonicOptions:
        """These options with those of a run, for order 1."""
        from dnacheck.cyclization.laplace.anharmonic import AnharmonicOptions

        return AnharmonicOptions(tolerance=run.tolerance, first_pairs=self.pairs)

    def run(self, target: Target, run: Run) -> JFactor:
        if not self.register:
            from dnacheck.cyclization.laplace.isolated import laplace

            return laplace(rings_of(target, any_end=True))
        profile = register_profile_of(target)
        if not self.order:
            from dnacheck.cyclization.laplace.register import register_laplace

            return register_laplace(profile)
        from dnacheck.cyclization.laplace.anharmonic import corrected_laplace

        return corrected_laplace(profile, self.options(run), run.rng)
