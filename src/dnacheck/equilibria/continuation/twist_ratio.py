"""Ring energies over a range of twist ratios K3/K1 (Section X, Figures 12 to 16).

Every minimum that is found is followed over the ratios, each point started from its neighbours,
and the search is repeated at some of the ratios; what it finds anew is followed both ways. The
lowest energy at a ratio is therefore that of the lowest of all branches there, also where branches
cross.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.equilibria.continuation.twist_ratio_models import (
    ContinuumModel,
    DiscreteModel,
    Minimum,
)
from dnacheck.model.chain import Chain
from dnacheck.model.rod.rod import Rod
from dnacheck.numerics.outcome import InputError

if TYPE_CHECKING:
    import pandas

Array = NDArray[np.float64]

# Energies that agree to this are those of one minimum, if the links do.
_SAME = 1e-6
_MOST_TRACKS = 24


@dataclass(frozen=True)
class SweepOptions:
    """How a sweep is made.

    Parameters
    ----------
    search_every : int
        The full search is repeated at the first ratio, the last, and every so many in between.
    tolerance : float
        Residual of every point.
    crossing_precision : float
        Crossings of branches are located to this in the ratio.
    """

    search_every: int = 5
    tolerance: float = 1e-10
    crossing_precision: float = 1e-6

    def __post_init__(self) -> None:
        if isinstance(self.search_every, bool) or not self.search_every >= 1:
            raise InputError(f"search_every = {self.search_every!r}: give an integer from 1")
        for name in ("tolerance", "crossing_precision"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise InputError(f"{name} = {value!r}: give a positive number")


@dataclass(frozen=True)
class Track:
    """One minimum, followed over the ratios.

    Attributes
    ----------
    energy, bend, twist, residual : ndarray, shape (R,)
        Reduced; nan where the minimum does not exist.
    link : ndarray, shape (R,)
        0 where the minimum does not exist.
    found_at : int
        Index of the ratio at whose search it was found.
    """

    energy: Array
    bend: Array
    twist: Array
    residual: Array
    link: NDArray[np.int64]
    found_at: int


@dataclass(frozen=True)
class Crossing:
    """Where another minimum becomes the lowest.

    ``exchanged`` is False when a minimum appeared or ended instead of crossing; ``ratio`` is then
    the middle of the interval in which that happened and ``precision`` its length.
    """

    ratio: float
    precision: float
    energy: float
    links: tuple[int, int]
    tracks: tuple[int, int]
    exchanged: bool


@dataclass(frozen=True)
class RatioSweep:
    """A sweep of one molecule in one model.

    Attributes
    ----------
    name : str
    model : "continuum" or "discrete"
    ratios : ndarray, shape (R,)
    energy, bend, twist, residual : ndarray, shape (R,)
        Of the lowest minimum, reduced; nan where none was found.
    link : ndarray of int, shape (R,)
    lowest : ndarray of int, shape (R,)
        Which track, -1 for none.
    tracks : tuple of Track
    crossings : tuple of Crossing
    energy_scale_RT : float
    seconds : float
    """

    name: str
    model: Literal["continuum", "discrete"]
    ratios: Array
    energy: Array
    bend: Array
    twist: Array
    residual: Array
    link: NDArray[np.int64]
    lowest: NDArray[np.int64]
    tracks: tuple[Track, ...]
    crossings: tuple[Crossing, ...]
    energy_scale_RT: float
    seconds: float

    @property
    def energy_RT(self) -> Array:
        """Lowest energy in RT."""
        return self.energy * self.energy_scale_RT

    def to_dict(self) -> dict[str, Any]:
        """Arrays in RT, tracks and crossings: a sweep in the commands' JSON."""
        from dnacheck.equilibria.continuation.figures import sweep_data

        return sweep_data(self)

    def to_frame(self) -> pandas.DataFrame:
        """A row for each ratio: energies of the lowest ring in RT, its link and residual."""
        import pandas

        data = self.to_dict()
        names = ("ratios", "energy", "bend", "twist", "link", "residual")
        columns = ("ratio", "energy_RT", "bend_RT", "twist_RT", "link", "residual")
        return pandas.DataFrame(
            {column: data[name] for name, column in zip(names, columns, strict=True)}
        )

    @property
    def missing(self) -> Array:
        """Ratios at which no minimum was found."""
        return self.ratios[self.lowest < 0]

    @property
    def status(self) -> str:
        """What is missing and what to change, or "converged"."""
        if not self.missing.size:
            return "converged"
        listed = ", ".join(f"{ratio:g}" for ratio in self.missing)
        return (
            f"no minimum was found at K3/K1 = {listed}: raise the number of ratios, narrow their "
            "range, or lower search_every"
        )


class _Model(Protocol):
    name: str
    kind: Literal["continuum", "discrete"]
    energy_scale_RT: float

    def search(self, ratio: float) -> list[Minimum]: ...

    def follow(self, ratio: float, guess: Any, like: Minimum) -> Minimum | None: ...


def check_ratios(ratios: ArrayLike) -> Array:
    """Ratios as a strictly increasing array.

    Raises
    ------
    InputError
        None, not positive, not finite, or not increasing.
    """
    values = np.atleast_1d(np.asarray(ratios, dtype=float)).copy()
    if values.ndim != 1 or values.size == 0:
        raise InputError("twist ratios: give at least one")
    if not np.all(np.isfinite(values) & (values > 0.0)):
        bad = values[~(np.isfinite(values) & (values > 0.0))][0]
        raise InputError(f"twist ratio {bad:g}: K3/K1 must be a finite number greater than 0")
    if np.any(np.diff(values) <= 0.0):
        raise InputError("twist ratios must increase: sort them and leave out repetitions")
    values.setflags(write=False)
    return values


def sweep_continuum(
    rod: Rod,
    ratios: ArrayLike,
    options: SweepOptions | None = None,
    corrected_for: Chain | None = None,
) -> RatioSweep:
    """Lowest continuum rings of a rod over twist ratios, at fixed bending stiffness.

    ``corrected_for``, the chain that the rod was made from, replaces the energy by that with the
    steps' own compliance (:mod:`dnacheck.equilibria.bridge.homogenise`); bending and twisting parts
    remain those of the isotropic rod.

    Raises
    ------
    InputError
        A ratio that is not positive, or ratios that do not increase.
    """
    options = options or SweepOptions()
    return _sweep(
        ContinuumModel(rod, options.tolerance, corrected_for), check_ratios(ratios), options
    )


def sweep_discrete(
    chain: Chain, ratios: ArrayLike, options: SweepOptions | None = None
) -> RatioSweep:
    """Lowest discrete rings of a chain over twist ratios.

    Raises
    ------
    InputError
        As for the continuum; also a chain whose stiffness depends on the sequence.
    """
    options = options or SweepOptions()
    return _sweep(DiscreteModel(chain, options.tolerance), check_ratios(ratios), options)


def _sweep(model: _Model, ratios: Array, options: SweepOptions) -> RatioSweep:
    began = time.perf_counter()
    n = ratios.size
    tracks: list[list[Minimum | None]] = []
    found_at: list[int] = []
    searches = sorted({*range(0, n, options.search_every), n - 1})
    for at in searches:
        known = [track[at] for track in tracks if track[at] is not None]
        for minimum in model.search(float(ratios[at])):
            if any(_same(minimum, other) for other in known if other is not None):
                continue
            if len(tracks) >= _MOST_TRACKS:
                break
            track: list[Minimum | None] = [None] * n
            track[at] = minimum
            _extend(model, ratios, track, range(at + 1, n), tracks)
            _extend(model, ratios, track, range(at - 1, -1, -1), tracks)
            tracks.append(track)
            found_at.append(at)
            known.append(minimum)
    energies = np.array(
        [[m.energy if m is not None else np.inf for m in track] for track in tracks]
    ).reshape(len(tracks), n)
    lowest = np.full(n, -1, dtype=np.int64)
    if tracks:
        lowest = np.where(np.isfinite(energies.min(axis=0)), energies.argmin(axis=0), -1)
    best = [tracks[t][i] if t >= 0 else None for i, t in enumerate(lowest)]
    crossings = _crossings(model, ratios, tracks, lowest, options)
    arrays = _table(best)
    return RatioSweep(
        name=model.name,
        model=model.kind,
        ratios=ratios,
        lowest=lowest,
        tracks=tuple(
            Track(**_table(track), found_at=at) for track, at in zip(tracks, found_at, strict=True)
        ),
        crossings=crossings,
        energy_scale_RT=model.energy_scale_RT,
        seconds=time.perf_counter() - began,
        **arrays,
    )


def _table(minima: Sequence[Minimum | None]) -> dict[str, Any]:
    out: dict[str, Any] = {
        name: np.array([np.nan if m is None else getattr(m, name) for m in minima])
        for name in ("energy", "bend", "twist", "residual")
    }
    out["link"] = np.array([0 if m is None else m.link for m in minima], dtype=np.int64)
    for array in out.values():
        array.setflags(write=False)
    return out


def _same(a: Minimum, b: Minimum) -> bool:
    return a.link == b.link and abs(a.energy - b.energy) <= _SAME * (abs(b.energy) + 1e-12)


def _extend(
    model: _Model,
    ratios: Array,
    track: list[Minimum | None],
    indices: range,
    others: Sequence[Sequence[Minimum | None]],
) -> None:
    """Follow a minimum from ratio to ratio until it ends or meets another track."""
    for i in indices:
        step = indices.step
        near = track[i - step]
        assert near is not None
        far = track[i - 2 * step] if 0 <= i - 2 * step < ratios.size else None
        guess = near.unknowns
        if far is not None:
            slope = (ratios[i] - ratios[i - step]) / (ratios[i - step] - ratios[i - 2 * step])
            guess = near.unknowns + slope * (near.unknowns - far.unknowns)
        found = model.follow(float(ratios[i]), guess, near)
        if found is None:
            # half a step at a time, as far as it exists
            middle = 0.5 * (ratios[i] + ratios[i - step])
            half = model.follow(float(middle), near.unknowns, near)
            if half is not None:
                guess = 2.0 * half.unknowns - near.unknowns
                found = model.follow(float(ratios[i]), guess, half)
        if found is None:
            return
        for other in others:
            twin = other[i]
            if twin is not None and _same(found, twin):
                return
        track[i] = found


def _crossings(
    model: _Model,
    ratios: Array,
    tracks: Sequence[Sequence[Minimum | None]],
    lowest: NDArray[np.int64],
    options: SweepOptions,
) -> tuple[Crossing, ...]:
    out: list[Crossing] = []
    for i in range(ratios.size - 1):
        a, b = int(lowest[i]), int(lowest[i + 1])
        if a == b or a < 0 or b < 0:
            continue
        ends = tracks[a][i], tracks[a][i + 1], tracks[b][i], tracks[b][i + 1]
        here, there = ends[0], ends[3]
        assert here is not None
        assert there is not None
        links = (here.link, there.link)
        low, high = float(ratios[i]), float(ratios[i + 1])
        if ends[1] is None or ends[2] is None:
            out.append(
                Crossing(
                    0.5 * (low + high),
                    high - low,
                    0.5 * (here.energy + there.energy),
                    links,
                    (a, b),
                    False,
                )
            )
            continue
        ratio, precision, energy = _meet(
            model, low, high, (here, ends[2]), (ends[1], there), options
        )
        out.append(Crossing(ratio, precision, energy, links, (a, b), True))
    return tuple(out)


def _meet(
    model: _Model,
    low: float,
    high: float,
    at_low: tuple[Minimum, Minimum],
    at_high: tuple[Minimum, Minimum],
    options: SweepOptions,
) -> tuple[float, float, float]:
    """Ratio at which two minima have the same energy, its precision, and the energy.

    dE/dK3 at an equilibrium is the twisting energy over K3, so Newton's method needs no
    differences; it is kept inside the bracket by bisection.
    """
    energy = 0.5 * (at_low[0].energy + at_low[1].energy)
    first, second = at_low
    base = low
    ratio = low - (first.energy - second.energy) * low / (first.twist - second.twist)
    for _ in range(40):
        if not low < ratio < high:
            ratio = 0.5 * (low + high)
        weight = (ratio - base) / (high - base) if base == low and high > base else 0.0
        guesses = [
            a.unknowns + weight * (b.unknowns - a.unknowns)
            for a, b in zip((first, second), at_high, strict=True)
        ]
        one = model.follow(ratio, guesses[0], first)
        two = model.follow(ratio, guesses[1], second)
        if one is None or two is None:
            return ratio, high - low, energy
        gap = one.energy - two.energy
        energy = 0.5 * (one.energy + two.energy)
        if gap < 0.0:
            low = ratio
        else:
            high = ratio
        first, second, base = one, two, ratio
        slope = (one.twist - two.twist) / ratio
        change = -gap / slope if slope != 0.0 else math.inf
        if abs(change) <= options.crossing_precision:
            return ratio + change, abs(change), energy
        if high - low <= options.crossing_precision:
            return 0.5 * (low + high), high - low, energy
        ratio += change
    return ratio, high - low, energy


def at_twist_ratio(rod: Rod, ratio: float) -> Rod:
    """The rod with K3 = ratio K1."""
    check_ratios(ratio)
    return replace(rod, twist_stiffness=float(ratio) * rod.bend_stiffness)
