"""J against length: a molecule lengthened and shortened at one place, base pair by base pair.

J swings with the helical repeat because ends that meet must also meet in twist. The period of the
swing, read off the extrema of a smooth curve through the points, is the helical repeat that a
measured profile would be given.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.result import JFactor
from dnacheck.model.molecules import Molecule
from dnacheck.model.sequence import MINIMUM_LENGTH, parse_sequence
from dnacheck.numerics.outcome import InputError, SolveError

Array = NDArray[np.float64]

DEFAULT_FILLER = "ACGTTGCATC"
"""Letters inserted where none are given: all but neutral, no A-tract, no repeat below ten."""


def changed_length(molecule: Molecule, change: int, place: int | None, filler: str) -> Molecule:
    """A molecule with ``change`` base pairs more (letters of ``filler``, repeated) or fewer.

    Parameters
    ----------
    place : int or None
        Base pair, from 0, before which letters go in or from which they are taken; None: the end.

    Raises
    ------
    InputError
        A place outside, a filler of other letters, or fewer letters than can be taken.
    """
    letters = molecule.sequence.letters
    n = len(letters)
    place = n if place is None else place
    if not 0 <= place <= n:
        raise InputError(f"place {place}: '{molecule.name}' has base pairs 0 to {n}")
    filler = "".join(filler.split()).upper()
    if change > 0:
        if not filler or filler.strip("ACGT"):
            raise InputError(f"filler '{filler}': give letters A, C, G, T")
        insert = (filler * (change // len(filler) + 1))[:change]
        letters = letters[:place] + insert + letters[place:]
    elif change < 0:
        first = min(place, n) + change if place == n else place
        if first < 0 or first - change > n or n + change < MINIMUM_LENGTH:
            raise InputError(
                f"'{molecule.name}' has {n} base pairs; {-change} can't be taken at place {place}"
            )
        letters = letters[:first] + letters[first - change :]
    else:
        return molecule
    sequence = parse_sequence(letters, f"{molecule.name}{change:+d}")
    return Molecule(sequence)


@dataclass(frozen=True)
class ProfilePoint:
    """J at one length."""

    change: int
    n_bp: int
    result: JFactor


@dataclass(frozen=True)
class LengthProfile:
    """-ln J against length.

    Attributes
    ----------
    name : str
    points : tuple of ProfilePoint
        By length.
    failures : tuple of (int, str)
        Changes of length without a J, with the reason.
    """

    name: str
    points: tuple[ProfilePoint, ...]
    failures: tuple[tuple[int, str], ...] = field(default=())

    @property
    def n_bp(self) -> NDArray[np.int64]:
        """Lengths in base pairs."""
        return np.array([point.n_bp for point in self.points])

    @property
    def minus_lnJ(self) -> Array:
        """-ln J (mol/L)."""
        return np.array([point.result.minus_lnJ for point in self.points])

    @property
    def stderr(self) -> Array:
        """Standard errors of ln J."""
        return np.array([point.result.stderr for point in self.points])

    def curve(self) -> Callable[[Array], Array]:
        """A smooth curve through the points (cubic spline).

        Raises
        ------
        InputError
            Fewer than four points.
        """
        from scipy.interpolate import CubicSpline

        if len(self.points) < 4:
            raise InputError(f"profile of {self.name}: a curve needs four lengths or more")
        spline = CubicSpline(self.n_bp, self.minus_lnJ)
        return lambda x: np.asarray(spline(x))

    def extrema(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Lengths (bp) where J has its peaks, and its dips."""
        from scipy.interpolate import CubicSpline

        if len(self.points) < 4:
            return (), ()
        spline = CubicSpline(self.n_bp, self.minus_lnJ)
        places = spline.derivative().roots(extrapolate=False)
        bends = spline(places, 2)
        return (
            tuple(float(x) for x in places[bends > 0.0]),
            tuple(float(x) for x in places[bends < 0.0]),
        )

    @property
    def period(self) -> float | None:
        """Mean distance in bp of neighbouring peaks, or twice that of a peak and a dip.

        None without two extrema.
        """
        peaks, dips = self.extrema()
        for group in (peaks, dips):
            if len(group) > 1:
                return (group[-1] - group[0]) / (len(group) - 1)
        if peaks and dips:
            return 2.0 * abs(peaks[0] - dips[0])
        return None

    @property
    def helical_repeat(self) -> float | None:
        """Helical repeat in bp per turn that the peaks imply: length of a peak over its link.

        The link is that of most weight in J at the nearest length. The writhe of a bent ring
        belongs to it, so a molecule that is bent without stress may differ from its mean twist.
        """
        peaks, _ = self.extrema()
        repeats = []
        for peak in peaks:
            nearest = self.points[int(np.argmin(np.abs(self.n_bp - peak)))]
            if nearest.result.links:
                repeats.append(peak / nearest.result.links[0].link)
        return float(np.mean(repeats)) if repeats else None

    def to_frame(self) -> Any:
        """The points as a pandas table."""
        import pandas as pd

        return pd.DataFrame(self.to_dict()["points"])

    def to_dict(self) -> dict[str, Any]:
        """The JSON of ``dnacheck profile``."""
        peaks, dips = self.extrema()
        return {
            "target": self.name,
            "points": [
                {
                    "change_bp": point.change,
                    "n_bp": point.n_bp,
                    "minus_lnJ": point.result.minus_lnJ,
                    "stderr": point.result.stderr,
                    "J_molar": point.result.molar,
                    "method": point.result.method,
                    "status": point.result.status.value,
                }
                for point in self.points
            ],
            "peaks_bp": list(peaks),
            "dips_bp": list(dips),
            "period_bp": self.period,
            "helical_repeat_bp": self.helical_repeat,
            "failures": [{"change_bp": c, "reason": reason} for c, reason in self.failures],
        }


def read_measured_profile(path: Path) -> tuple[tuple[float, float, float], ...]:
    """Rows (n_bp, minus_lnJ, stderr) of a CSV file with these columns.

    Raises
    ------
    InputError
        The file cannot be read, lacks a column, or a row holds no numbers.
    """
    columns = ("n_bp", "minus_lnJ", "stderr")
    try:
        with path.open(encoding="utf-8-sig", newline="") as handle:
            rows = list(csv.DictReader(handle))
    except OSError as error:
        raise InputError(f"file '{path}': {error.strerror or error}; check the path") from None
    except (UnicodeDecodeError, csv.Error):
        raise InputError(f"file '{path}': not a CSV file") from None
    if not rows or not set(columns) <= set(rows[0]):
        raise InputError(f"file '{path}': give the columns {', '.join(columns)} and a row")
    found = []
    for number, row in enumerate(rows, start=1):
        try:
            n, value, sigma = (float(row[column]) for column in columns)
        except (TypeError, ValueError):
            raise InputError(f"file '{path}', row {number}: give three numbers") from None
        if not (n > 0.0 and sigma >= 0.0 and math.isfinite(value)):
            raise InputError(f"file '{path}', row {number}: a length, -ln J and an error >= 0")
        found.append((n, value, sigma))
    return tuple(found)


def length_profile(
    molecule: Molecule,
    changes: Sequence[int],
    compute: Callable[[Molecule], JFactor],
    place: int | None = None,
    filler: str = DEFAULT_FILLER,
    threads: int = 1,
    progress: Callable[[int], None] | None = None,
) -> LengthProfile:
    """J of a molecule at several lengths.

    Parameters
    ----------
    changes : sequence of int
        Base pairs more (or, negative, fewer) than the molecule has.
    compute : callable
        J of one molecule; the method, its error and the boundary are the caller's.
    place, filler : see :func:`changed_length`.
    progress : callable, optional
        Called with the number of lengths finished since the last call.

    Raises
    ------
    InputError
        No length, or one that can't be made.
    SolveError
        No length has a J.
    """
    if not len(changes):
        raise InputError("profile: give at least one change of length")
    ordered = sorted({int(change) for change in changes})
    molecules = [changed_length(molecule, change, place, filler) for change in ordered]

    def one(item: Molecule) -> JFactor | str:
        try:
            result: JFactor | str = compute(item)
        except SolveError as error:
            result = " ".join(str(error).split())
        if progress is not None:
            progress(1)
        return result

    if threads > 1:
        with ThreadPoolExecutor(threads) as pool:
            results = list(pool.map(one, molecules))
    else:
        results = [one(item) for item in molecules]
    points, failures = [], []
    for change, item, result in zip(ordered, molecules, results, strict=True):
        if isinstance(result, JFactor):
            points.append(ProfilePoint(change, len(item.sequence), result))
        else:
            failures.append((change, result))
    if not points:
        raise SolveError(f"profile of {molecule.name}: no length has a J; {failures[0][1]}")
    return LengthProfile(molecule.name, tuple(points), tuple(failures))
