"""Options of the continuation, validated when they are made."""

from __future__ import annotations

from dataclasses import dataclass

from dnacheck.numerics.outcome import InputError


@dataclass(frozen=True)
class ContinuationOptions:
    """Steps, tolerances and bounds of a branch.

    Lengths along the branch are dimensionless: loads in those of a circle (moment 2 pi K1, force
    4 pi**2 K1), the parameter in its own scale.

    Parameters
    ----------
    intervals : int, optional
        Mesh intervals; None puts at least ``least_intervals`` on the rod, with every break of its
        strains a mesh point.
    least_intervals : int
    degree : int
        Gauss points per interval.
    first_step, shortest_step, longest_step : float
        Length of the first step and limits of all.
    largest_turn : float
        No mesh frame turns by more than this in a predicted step, radians.
    sharpest_turn : float
        Largest angle between successive tangents of the branch, radians; a step that exceeds it
        is halved, so that the branch is not left for a neighbour.
    max_points : int
        Points per branch and direction.
    max_iterations : int
        Newton iterations per point.
    wanted_iterations : int
        Steps grow while fewer are needed.
    tolerance : float
        Residual accepted, as for the ring solver.
    precision : float
        Folds and branch points are bracketed to this in the parameter.
    symmetry_tolerance : float
        Accepted defect of the closure conditions that a symmetry makes redundant.
    stability : bool
        Count conjugate points at every point.
    max_branches : int
        Bound on the branches of a component.
    """

    intervals: int | None = None
    least_intervals: int = 24
    degree: int = 4
    first_step: float = 0.02
    shortest_step: float = 1e-7
    longest_step: float = 0.1
    largest_turn: float = 0.3
    sharpest_turn: float = 0.35
    max_points: int = 3000
    max_iterations: int = 7
    wanted_iterations: int = 3
    tolerance: float = 1e-10
    precision: float = 1e-8
    symmetry_tolerance: float = 1e-8
    stability: bool = True
    max_branches: int = 12

    def __post_init__(self) -> None:
        whole = (
            ("least_intervals", 4, 10_000),
            ("degree", 2, 8),
            ("max_points", 1, 1_000_000),
            ("max_iterations", 2, 100),
            ("wanted_iterations", 1, 100),
            ("max_branches", 1, 1000),
        )
        for name, least, most in whole:
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
                raise InputError(
                    f"continuation option {name} = {value!r}: give an integer from {least} "
                    f"to {most}"
                )
        if self.intervals is not None and not 4 <= self.intervals <= 10_000:
            raise InputError(
                f"continuation option intervals = {self.intervals!r}: give 4 to 10000, or None"
            )
        for name in (
            "first_step",
            "shortest_step",
            "longest_step",
            "largest_turn",
            "sharpest_turn",
            "tolerance",
            "precision",
            "symmetry_tolerance",
        ):
            value = getattr(self, name)
            if not 0.0 < value < float("inf"):
                raise InputError(f"continuation option {name} = {value!r}: give a positive number")
        if not self.shortest_step <= self.first_step <= self.longest_step:
            raise InputError(
                "continuation options: need shortest_step <= first_step <= longest_step, not "
                f"{self.shortest_step} <= {self.first_step} <= {self.longest_step}"
            )
        if self.tolerance < 1e-13:
            raise InputError(
                f"continuation option tolerance = {self.tolerance}: rounding allows 1e-13 at best"
            )
