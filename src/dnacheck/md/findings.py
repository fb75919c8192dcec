"""Single comparisons of a check, and their verdicts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

Verdict = Literal["pass", "fail", "inconclusive"]


@dataclass(frozen=True)
class Finding:
    """One comparison.

    Attributes
    ----------
    name : str
    difference : float
        What was found, as a deviation from what was expected.
    tolerance : float
    sigma : float
        Standard error of the difference, 0 where there is none.
    """

    name: str
    difference: float
    tolerance: float
    sigma: float = 0.0

    @property
    def verdict(self) -> Verdict:
        """Whether the difference is within the tolerance.

        "inconclusive" where twice the standard error exceeds the tolerance and could by itself
        explain the difference.
        """
        if not np.isfinite(self.difference):
            return "fail"
        if 2.0 * self.sigma > self.tolerance and abs(self.difference) <= 3.0 * self.sigma:
            return "inconclusive"
        return "pass" if abs(self.difference) <= self.tolerance else "fail"


@dataclass(frozen=True)
class RingMatch:
    """A ring that was given, beside the bead chain's.

    Attributes
    ----------
    energy_RT : float
        Of the ring, by the chain's own formula.
    openmm_difference : float
        Relative: OpenMM's energy of the same positions.
    perturbed_difference, perturbed_rms_A : float
        Relative energy and rms distance of the minimum reached from the perturbed ring; NaN if
        minima were left out.
    own_difference, own_rms_A : float
        The same for the nearest minimum reached from planar circles.
    """

    energy_RT: float
    openmm_difference: float
    perturbed_difference: float
    perturbed_rms_A: float
    own_difference: float
    own_rms_A: float
