"""Register-constrained minima of closed chains, and Laplace's J integrated over the register.

The register, how the molecule is rolled about its own axis, is the softest mode of a ring and free
in a straight molecule, where Laplace's approximation fails. Constraining it leaves stiff modes:
with S the linear function of :mod:`dnacheck.cyclization.laplace.kernels.register`, v the row of its
phase's constraint and seven constraint rows G, the density of closed shapes per radian of register
is

    J(psi) = 8 pi^2 exp(-E) sqrt(det(K / 2 pi)) (2 pi)^((n - 7)/2) |S| / sqrt(|det KKT|)

to Laplace's order, and J is its integral over the circle by the trapezoid rule, which converges
exponentially for a smooth periodic function. Every shape has one register, so the slices share
nothing and sampling each of them (:mod:`dnacheck.cyclization.closure.sampling`) is exact.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.closure.kernels.draws import SliceCentre
from dnacheck.cyclization.laplace.constrained_minimum import (
    ConstrainedMinimum,
    Constrainer,
    RegisterOptions,
)
from dnacheck.cyclization.laplace.isolated import register_spread, register_turns
from dnacheck.cyclization.laplace.kernels import register as rk
from dnacheck.cyclization.laplace.kernels.gaussian import ROWS
from dnacheck.cyclization.result import JFactor, JStatus, LinkShare, link_shares
from dnacheck.equilibria.discrete.kernels.search import best_register, fill_start
from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
from dnacheck.equilibria.ring import RING, Equilibria
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import SolveError

Array = NDArray[np.float64]

_SAME_SHAPE = 1e-4
"""Two register-constrained minima are one when no angle differs by more, in radians."""
_ZERO_MODE_SPREAD = 4.0
"""Register spread in radians above which it is called free; the circle ends at pi."""


@dataclass(frozen=True)
class Chart:
    """Register-constrained minima of one link over the register circle.

    Attributes
    ----------
    link : int
        Of a ring; of other ends, what tells families of shapes apart.
    turns : float
        Of the rows that tell the register.
    registers : int
        Number of grid points on the whole circle; only those that matter have rings.
    rings : tuple of ConstrainedMinimum
        By position; two rings at one position are different minima (branches) there.
    rule_error : float
        Estimated relative error of the trapezoid rule, see :func:`_trapezoid_error`.
    lost : float
        Estimated relative weight of registers where no minimum could be followed.
    """

    link: int
    turns: float
    registers: int
    rings: tuple[ConstrainedMinimum, ...]
    rule_error: float
    lost: float

    @property
    def spacing(self) -> float:
        """Radians between registers."""
        return 2.0 * math.pi / self.registers

    @property
    def log_j(self) -> float:
        """ln of this link's J (mol/L) by Laplace's approximation on every slice."""
        return math.log(self.spacing) + _log_sum([ring.log_density for ring in self.rings])

    def rivals(self, ring: ConstrainedMinimum) -> Array:
        """Angles (R, N, c) of the other rings at the same register."""
        others = [r.angles for r in self.rings if r.position == ring.position and r is not ring]
        return np.array(others) if others else np.empty((0, *ring.angles.shape))


@dataclass(frozen=True)
class Slice:
    """One register-constrained minimum with all that drawing about it needs.

    Attributes
    ----------
    minimum : ConstrainedMinimum
    centre : SliceCentre
    log_mass : float
        ln of its Laplace value times the spacing of registers, mol/L.
    """

    minimum: ConstrainedMinimum
    centre: SliceCentre
    log_mass: float


@dataclass(frozen=True)
class RegisterProfile:
    """The charts of all links that matter, largest J first.

    ``omitted`` estimates the relative weight of links that have no chart.
    """

    chain: Chain
    search: Equilibria
    charts: tuple[Chart, ...]
    omitted: float
    seconds: float
    warnings: tuple[str, ...] = field(default=())

    @property
    def log_j(self) -> float:
        """ln of J (mol/L) by register-integrated Laplace."""
        return _log_sum([chart.log_j for chart in self.charts])

    def shares(
        self, log_parts: dict[int, float], errors: dict[int, float] | None = None
    ) -> tuple[LinkShare, ...]:
        """Shares of the links from ln J and error of each; none where the ends have no link."""
        return link_shares(log_parts, errors) if self.search.boundary == RING else ()

    def slices(self) -> list[Slice]:
        """Every minimum of every chart."""
        covered = np.array([chart.link for chart in self.charts], dtype=np.int64)
        boundary = self.search.boundary
        held = boundary.for_chain(self.chain)
        # Families of free ends are told apart by their twist, counted from this one's.
        origin = self.charts[0].turns - self.charts[0].link
        return [
            Slice(
                ring,
                SliceCentre(
                    ring.angles,
                    ring.direction,
                    ring.energy,
                    ring.extent,
                    chart.link,
                    covered,
                    chart.rivals(ring),
                    held,
                    boundary == RING,
                    origin,
                ),
                ring.log_density + math.log(chart.spacing),
            )
            for chart in self.charts
            for ring in chart.rings
        ]

    @property
    def bias_bound(self) -> float:
        """Relative error of the trapezoid rule, of lost registers and of omitted links.

        The error of Laplace's approximation on each slice is not in it.
        """
        total = self.log_j
        return self.omitted + sum(
            math.exp(chart.log_j - total) * (chart.rule_error + chart.lost) for chart in self.charts
        )


def _log_sum(values: list[float]) -> float:
    return float(np.logaddexp.reduce(values)) if values else -math.inf


def _seeds(search: Equilibria) -> tuple[dict[int, list[tuple[Array, Array]]], float]:
    """Angles and multipliers (RT) to start from, by link, lowest first; and turns of link 0.

    Ends without a link are told apart by the turns of their twist beyond that of the lowest.

    A search leaves out links whose rings are not isolated minima, as in a straight molecule; the
    planar circle serves for those.
    """
    chain = search.chain
    seeds: dict[int, list[tuple[Array, Array]]] = {}
    origin = 0.0
    if search.boundary != RING and search.equilibria:
        origin = register_turns(search.lowest)
    for ring in search.equilibria:
        force = np.append(chain.energy_scale_RT * ring.multipliers, 0.0)
        link = round(register_turns(ring) - origin)
        seeds.setdefault(link, []).append((np.array(ring.angles), force))
    for link in search.links_searched:
        if link not in seeds:
            circle = np.empty(chain.ground.shape)
            fill_start(chain.arrays, link, best_register(chain.arrays, link), circle)
            seeds[link] = [(circle, np.zeros(ROWS))]
    return seeds, origin


def _height(constrainer: Constrainer, seeds: list[tuple[Array, Array]]) -> float:
    """ln J of a link, had all registers the density of the seeds' own: an upper estimate."""
    best = -math.inf
    for angles, multipliers in seeds:
        register, _ = rk.register_of(angles, constrainer.along, constrainer.across)
        ring = constrainer.minimum(register / (2.0 * math.pi), 1, angles, multipliers)
        if ring is not None:
            best = max(best, ring.log_density)
    return best + math.log(2.0 * math.pi)


def _walk(
    constrainer: Constrainer,
    first: ConstrainedMinimum,
    registers: int,
    placed: dict[int, list[ConstrainedMinimum]],
    top: float,
) -> tuple[float, float]:
    """Follow a branch both ways from ``first``; returns the new top and what was lost.

    ``placed`` collects rings by position; ``top`` is the largest log-density so far.
    """
    depth = constrainer.options.depth
    lost = 0.0
    placed.setdefault(first.position, []).append(first)
    top = max(top, first.log_density)
    for step in (1, -1):
        here, before = first, None
        for _ in range(registers):
            if here.log_density < top - depth:
                break
            after = constrainer.advance(here, before, step, registers)
            if after is None:
                lost += math.exp(here.log_density - top)
                break
            known = placed.get(after.position, [])
            if any(np.abs(after.angles - r.angles).max() < _SAME_SHAPE for r in known):
                break
            placed.setdefault(after.position, []).append(after)
            top = max(top, after.log_density)
            here, before = after, here
    return top, lost


def _trapezoid_error(rings: list[ConstrainedMinimum], registers: int) -> float:
    """Estimated relative error of the trapezoid rule of so many registers.

    The rule errs by twice the Fourier coefficient of order ``registers`` of the density, over its
    mean. An analytic periodic function's coefficients fall at least geometrically, so that one is
    extrapolated from the highest order whose size the same points show whatever its phase.
    """
    top = max(ring.log_density for ring in rings)
    weights = np.exp([ring.log_density - top for ring in rings])
    positions = np.array([ring.position for ring in rings])
    order = registers // 2 - 1
    wave = np.exp(2j * math.pi * order * positions / registers)
    fraction = min(1.0, float(np.abs(weights @ wave)) / float(weights.sum()))
    return 2.0 * math.pow(fraction, registers / order)


def _chart(
    constrainer: Constrainer, seeds: list[tuple[Array, Array]], spreads: list[float]
) -> Chart | None:
    """Chart of one link from its minima."""
    options = constrainer.options
    spread = min(min(spreads), _ZERO_MODE_SPREAD)
    registers = 2 * math.ceil(math.pi / (options.spacing * spread))
    registers = int(np.clip(registers, options.fewest, options.most))
    while True:
        placed: dict[int, list[ConstrainedMinimum]] = {}
        top, lost = -math.inf, 0.0
        for angles, multipliers in seeds:
            register, _ = rk.register_of(angles, constrainer.along, constrainer.across)
            position = round(register * registers / (2.0 * math.pi))
            first = constrainer.minimum(position, registers, angles, multipliers)
            if first is None:
                continue
            known = placed.get(first.position, [])
            if any(np.abs(first.angles - r.angles).max() < _SAME_SHAPE for r in known):
                continue
            top, more = _walk(constrainer, first, registers, placed, top)
            lost += more
        rings = [ring for position in sorted(placed) for ring in placed[position]]
        rings = [ring for ring in rings if ring.log_density > top - options.depth]
        if not rings:
            return None
        error = _trapezoid_error(rings, registers)
        if error <= options.rule_error or 2 * registers > options.most:
            break
        registers *= 2
    total = sum(math.exp(ring.log_density - top) for ring in rings)
    return Chart(constrainer.link, constrainer.turns, registers, tuple(rings), error, lost / total)


def register_profile(
    target: Chain | Equilibria,
    options: RegisterOptions | None = None,
    search_options: SearchOptions | None = None,
) -> RegisterProfile:
    """Register-constrained minima over registers and links.

    Parameters
    ----------
    target : Chain or Equilibria
        A molecule, or the minima already found for it.

    Raises
    ------
    SolveError
        No register-constrained minimum was found at any link searched.
    """
    began = time.perf_counter()
    options = options or RegisterOptions()
    search = find_rings(target, search_options) if isinstance(target, Chain) else target
    chain = search.chain
    seeds, origin = _seeds(search)
    constrainers = {
        link: Constrainer(chain, link, options, search.boundary, origin + link) for link in seeds
    }
    heights = {link: _height(constrainers[link], seeds[link]) for link in seeds}
    best = max(heights.values(), default=-math.inf)
    charts: list[Chart] = []
    warnings: list[str] = []
    omitted = 0.0
    for link in sorted(seeds, key=lambda k: -heights[k]):
        if heights[link] == -math.inf:
            warnings.append(f"link {link}: no ring was found at any register")
            continue
        if heights[link] < best - options.depth:
            omitted += math.exp(heights[link] - best)
            continue
        constrainer = constrainers[link]
        spreads = [
            register_spread(
                chain, constrainer.turns, q, m[:6] / chain.energy_scale_RT, search.boundary
            )
            for q, m in seeds[link]
        ]
        chart = _chart(constrainer, seeds[link], spreads)
        if chart is None:
            warnings.append(f"link {link}: no ring was found at the grid's registers")
            continue
        if chart.lost > 1e-3:
            warnings.append(
                f"link {link}: a branch of rings ends at registers that hold about "
                f"{100 * chart.lost:.2g} % of its J"
            )
        charts.append(chart)
    if not charts:
        raise SolveError(f"J factor of {chain.name}: {search.reason}", search)
    charts.sort(key=lambda chart: -chart.log_j)
    return RegisterProfile(
        chain=chain,
        search=search,
        charts=tuple(charts),
        omitted=omitted,
        seconds=time.perf_counter() - began,
        warnings=tuple(warnings),
    )


def register_laplace(
    target: Chain | Equilibria | RegisterProfile, options: RegisterOptions | None = None
) -> JFactor:
    """J factor by Laplace's approximation at constrained registers, integrated over them.

    Right to Laplace's order for soft and zero registers alike. As for
    :func:`dnacheck.cyclization.laplace.isolated.laplace` the error of the approximation itself, 0.2
    to 0.5 at 150 base pairs, is not known without sampling.

    Raises
    ------
    SolveError
        No register-constrained minimum was found at any link searched.
    """
    began = time.perf_counter()
    profile = target if isinstance(target, RegisterProfile) else register_profile(target, options)
    chain = profile.chain
    seconds = time.perf_counter() - began
    return JFactor(
        target=chain.name,
        n_bp=chain.n_steps,
        method="register-laplace",
        minus_lnJ=-profile.log_j,
        stderr=0.0,
        links=profile.shares({chart.link: chart.log_j for chart in profile.charts}),
        seconds=seconds if target is not profile else profile.seconds,
        warnings=(*chain.warnings, *profile.warnings),
        status=JStatus.NO_ERROR_ESTIMATE,
    )
