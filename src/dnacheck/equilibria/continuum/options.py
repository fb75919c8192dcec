"""Options of the continuum ring solver, validated when they are made."""

from __future__ import annotations

from dataclasses import dataclass

from dnacheck.numerics.outcome import InputError


@dataclass(frozen=True)
class ContinuumOptions:
    """Mesh, tolerances and bounds of the collocation solver.

    Parameters
    ----------
    intervals : int, optional
        Mesh intervals at the start; None puts one on each smooth piece of the rod.
    degree : int
        Gauss points per interval, the degree of the pieces of the solution.
    adapt : bool
        Bisect the mesh, solve again, and keep bisecting where it matters until the energies of
        two meshes differ by less than ``energy_tolerance``. Without it the given mesh is used and
        no error estimate is made.
    energy_tolerance : float
        Wanted relative accuracy of the energy.
    max_intervals : int
        Finest mesh allowed.
    tolerance : float
        Largest residual accepted: of the collocation equations relative to the largest slope, and
        of the closure (radians; lengths of the rod).
    max_iterations : int
        Newton iterations per solve.
    largest_turn : float
        A Newton step is shortened so that no frame turns by more than this, in radians.
    homotopy_steps : int
        Bound on the steps of each path (see ``homotopy``) that is tried when Newton's method fails
        from the rolled perfect ring; 0 switches the paths off.
    writhe_points : int
        Corners of the polygon whose writhe selects the link.
    """

    intervals: int | None = None
    degree: int = 4
    adapt: bool = True
    energy_tolerance: float = 1e-6
    max_intervals: int = 2000
    tolerance: float = 1e-10
    max_iterations: int = 30
    largest_turn: float = 1.0
    homotopy_steps: int = 100
    writhe_points: int = 40

    def __post_init__(self) -> None:
        if self.intervals is not None:
            _check_integer("intervals", self.intervals, 4, 10_000)
        _check_integer("degree", self.degree, 2, 8)
        _check_integer("max_intervals", self.max_intervals, 4, 10_000)
        _check_integer("max_iterations", self.max_iterations, 1, 1000)
        _check_integer("homotopy_steps", self.homotopy_steps, 0, 10_000)
        _check_integer("writhe_points", self.writhe_points, 16, 1000)
        for name in ("energy_tolerance", "tolerance", "largest_turn"):
            value = getattr(self, name)
            if not 0.0 < value < float("inf"):
                raise InputError(f"continuum option {name} = {value!r}: give a positive number")
        if self.tolerance < 1e-13:
            raise InputError(
                f"continuum option tolerance = {self.tolerance}: rounding allows 1e-13 at best"
            )
        if self.intervals is not None and self.intervals > self.max_intervals:
            raise InputError(
                f"continuum option intervals = {self.intervals} exceeds max_intervals = "
                f"{self.max_intervals}: raise the latter"
            )


def _check_integer(name: str, value: object, least: int, most: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise InputError(
            f"continuum option {name} = {value!r}: give an integer from {least} to {most}"
        )
