"""J factors by half chains: first and second halves drawn apart, all pairs that meet counted.

After Alexandrowicz (1969), Levene & Crothers (1986) and Czapla, Swigon & Olson (2006). M first and
M second halves make M^2 chains; those that meet within a window about closure, divided by the
window's volume, estimate the density f of closure, and J = f / l^3 in mol/L
(docs/theory/jfactors.md).

Plain sampling draws both halves from the free chain. Tilted sampling draws them from a mixture of
Gaussians centred on closed shapes (:mod:`dnacheck.cyclization.half_chain.proposals`). The density
of the pairs is the product of the two halves' mixture densities, whatever component each half came
from, so a half drawn as a fixed share of the mixture has the weight p / sum_k share_k p_k of its
own and a pair has the product of the two.

A window of finite size has a bias. It is taken away in three steps: each pair is weighted with
exp(-m.c + c.S.c / 2), the inverse of how the density varies with the mismatch c to second order;
what is left is even in c, and is extrapolated to windows of zero size with a straight line in the
square of the window's radius, fitted to shells of the same samples; a parabola in place of the
line bounds the rest, and is reported itself where the two differ by more than chance.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.half_chain.kernels.pairs import (
    Cells,
    Halves,
    PairTotals,
    Window,
    fill_cells,
    half_poses,
    match_pairs,
    weigh,
)
from dnacheck.cyclization.half_chain.proposals import Tilt, closing_is_easy, ring_tilts
from dnacheck.cyclization.half_chain.window import HalfChainEstimate, PairSums, window_estimate
from dnacheck.cyclization.result import JFactor, JStatus
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.equilibria.ring import Equilibria
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import InputError, SolveError
from dnacheck.numerics.seeds import Randomness, generator
from dnacheck.numerics.statistics import HEAVY_PARETO_SHAPE

Array = NDArray[np.float64]

_MOST_CELLS = 2_000_000
_DRAWN_TOGETHER = 4_000_000
"""Normal numbers made at once, which bounds the memory of long chains."""
_LARGEST_SHARE = 0.1
"""One half that carries more than this fraction of J is reported as a heavy tail."""


@dataclass(frozen=True)
class HalfChainOptions:
    """How many halves are drawn, and how close a pair must meet.

    Attributes
    ----------
    halves : int
        First halves drawn, and as many second halves.
    batches : int
        Independent sets that they are drawn in; all pairs of sets are matched, and the standard
        error comes from how the pairs of sets differ.
    tilted : bool
        Draw from the mixture of tilts, unless closing costs so little that the free chain meets
        often enough; otherwise from the free chain.
    radius : float
        Largest mismatch of a pair, in standard deviations of the mismatch of tilted chains
        (about 25 steps and 1 rad each for 150 base pairs, correlated).
    shells : int
        Shells of equal width in the square of the mismatch, for the extrapolation.
    windows : tuple of float
        Radii over ``radius`` at which the uncorrected estimate is reported.
    threads : int
        Threads used; the result does not depend on it.
    """

    halves: int = 20_000
    batches: int = 16
    tilted: bool = True
    radius: float = 0.6
    shells: int = 24
    windows: tuple[float, ...] = (1.0, 0.85, 0.7, 0.55)
    threads: int = 1

    def __post_init__(self) -> None:
        if self.batches < 4:
            raise InputError(f"batches must be at least 4, not {self.batches}")
        if self.halves < 10 * self.batches:
            raise InputError(f"halves must be at least 10 a batch, not {self.halves}")
        if not 0.0 < self.radius <= 2.0:
            raise InputError(f"window radius must lie in (0, 2], not {self.radius}")
        if self.shells < 6:
            raise InputError(f"shells must be at least 6, not {self.shells}")
        if self.threads < 1:
            raise InputError(f"threads must be at least 1, not {self.threads}")
        if not all(0.0 < w <= 1.0 for w in self.windows):
            raise InputError("window radii are fractions in (0, 1]")


def joined(parts: list[Halves]) -> Halves:
    """All halves of one side."""
    return Halves(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


class HalfSampler:
    """Draws the halves of one side of the joint."""

    def __init__(self, chain: Chain, tilts: tuple[Tilt, ...], steps: slice, tilted: bool) -> None:
        free = ~chain.bound[steps]
        self.roots = np.zeros_like(chain.stiffness[steps])
        self.roots[free] = np.linalg.cholesky(
            chain.flexibility[steps][free] / chain.energy_scale_RT
        )
        self.ground = np.ascontiguousarray(chain.ground[steps])
        self.centres = [np.ascontiguousarray(tilt.angles[steps]) for tilt in tilts]
        self.pulls = np.array([tilt.pull[steps] for tilt in tilts])
        strains = np.array([centre - self.ground for centre in self.centres])
        self.energies = 0.5 * np.einsum("ksi,ksi->k", self.pulls, strains)
        self.shares = np.array([tilt.share for tilt in tilts])
        self.tilted = tilted
        self.backward = steps.start != 0
        self.steps = chain.arrays._replace(
            ground=self.ground, stiffness=np.ascontiguousarray(chain.stiffness[steps])
        )

    def counts(self, total: int) -> NDArray[np.int64]:
        """Draws of each component: its share by largest remainder, but one at least."""
        wanted = self.shares * total
        counts = np.maximum(np.floor(wanted).astype(np.int64), 1)
        missing = total - int(counts.sum())
        order = np.argsort(counts - wanted, kind="stable")
        counts[order[: max(missing, 0)]] += 1
        if missing < 0:
            counts[np.argmax(counts)] += missing
        return counts

    def draw(self, total: int, rng: np.random.Generator) -> Halves:
        counts = self.counts(total) if self.tilted else np.array([total])
        centres = self.centres if self.tilted else [self.ground]
        poses = np.empty((total, 7))
        scores, log_weights = np.empty((total, len(self.shares))), np.zeros(total)
        done = 0
        n, d = self.ground.shape
        most = max(1, _DRAWN_TOGETHER // (n * d))
        pulls = self.pulls.reshape(len(self.shares), n * d).T
        for centre, count in zip(centres, counts, strict=True):
            last = done + count
            while done < last:
                part = slice(done, min(done + most, last))
                strains = rng.standard_normal((part.stop - done, n, d))
                half_poses(self.steps, strains, self.roots, centre, self.backward, poses[part])
                scores[part] = strains.reshape(-1, n * d) @ pulls - self.energies
                done = part.stop
        if self.tilted:
            weigh(scores, np.log(counts / total), log_weights)
        return Halves(poses, log_weights, scores)


def _map(work: Callable[[int], object], count: int, threads: int) -> list[object]:
    if threads == 1:
        return [work(i) for i in range(count)]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, range(count)))


def sorted_into_cells(
    halves: Halves, batches: NDArray[np.int64], reach: float
) -> tuple[Halves, Cells]:
    """Halves sorted into cells of space and, within a cell, by one part of the rotation."""
    positions = halves.poses[:, :3]
    low, high = positions.min(axis=0), positions.max(axis=0)
    size = 0.5 * reach
    while np.prod(np.floor((high - low) / size) + 1.0) > _MOST_CELLS:
        size *= 1.25
    shape = (np.floor((high - low) / size) + 1.0).astype(np.int64)
    cells = np.empty(len(positions), np.int64)
    fill_cells(positions, low, size, shape, cells)
    order = np.lexsort((np.abs(halves.poses[:, 3]), cells))
    starts = np.searchsorted(cells[order], np.arange(int(np.prod(shape)) + 1))
    taken = Halves(*(array[order] for array in halves))
    return taken, Cells(starts, low, float(size), shape, batches[order])


def window_of(tilts: tuple[Tilt, ...], radius: float) -> Window:
    """The window of every tilt, as compiled loops read it."""
    links = sorted({tilt.link for tilt in tilts})
    spreads = np.array([tilt.window for tilt in tilts])
    roots = np.linalg.cholesky(spreads)
    turns = np.sqrt(np.linalg.eigvalsh(spreads[:, 3:, 3:])[:, -1])
    moves = np.sqrt(np.linalg.eigvalsh(spreads[:, :3, :3])[:, -1])
    return Window(
        log_shares=np.log([tilt.share for tilt in tilts]),
        inverse_roots=np.linalg.inv(roots),
        log_dets=np.log(roots[:, range(6), range(6)]).sum(axis=1),
        spreads=np.ascontiguousarray(spreads[:, :3, :3]),
        reaches=np.column_stack([moves, turns]),
        multipliers=np.array([tilt.at_joint.multipliers for tilt in tilts]),
        curvatures=np.array([tilt.at_joint.curvature for tilt in tilts]),
        links=np.array([links.index(tilt.link) for tilt in tilts]),
        radius=float(radius),
    )


def matched(
    first: Halves,
    cells: Cells,
    second: list[Halves],
    tilts: tuple[Tilt, ...],
    options: HalfChainOptions,
) -> PairSums:
    """Sums over all pairs that meet, for first halves sorted into cells."""
    window = window_of(tilts, options.radius)
    links = len({tilt.link for tilt in tilts})

    def work(b: int) -> PairTotals:
        totals = PairTotals(
            np.zeros((options.batches, links, options.shells)),
            np.zeros(options.shells, np.int64),
            np.zeros(len(first.log_weights)),
            np.zeros(len(second[b].log_weights)),
        )
        match_pairs(first, cells, second[b], window, totals)
        return totals

    parts: list[PairTotals] = _map(work, options.batches, options.threads)  # type: ignore
    return PairSums(
        table=np.stack([part.sums for part in parts], axis=1),
        counts=np.sum([part.counts for part in parts], axis=0),
        rows=np.sum([part.rows for part in parts], axis=0),
        columns=np.concatenate([part.columns for part in parts]),
    )


def half_chain_estimate(
    search: Equilibria, options: HalfChainOptions, rng: np.random.Generator
) -> HalfChainEstimate:
    """ln J by half chains, with every window's estimate.

    Parameters
    ----------
    search : Equilibria
        Minima of the molecule; tilted halves are centred on them, and plain ones take the
        window's shape and its correction from them.
    rng : numpy.random.Generator
        Spawns one stream for each batch of halves.

    Raises
    ------
    InputError
        Fewer halves in a batch than two for each tilt.
    SolveError
        No stable ring, or no pair of halves met.
    """
    chain = search.chain
    joint = chain.n_steps // 2
    tilts = ring_tilts(search, joint)
    per_batch = options.halves // options.batches
    tilted = options.tilted and not closing_is_easy(search)
    if tilted and per_batch < 2 * len(tilts):
        raise InputError(
            f"half chains of {chain.name}: {options.halves} halves are too few for {len(tilts)} "
            f"tilts; draw {2 * len(tilts) * options.batches} or more"
        )
    streams = rng.spawn(2 * options.batches)
    sides = [
        HalfSampler(chain, tilts, steps, tilted)
        for steps in (slice(0, joint), slice(joint, chain.n_steps))
    ]

    def draw(index: int) -> Halves:
        return sides[index % 2].draw(per_batch, streams[index])

    drawn: list[Halves] = _map(draw, 2 * options.batches, options.threads)  # type: ignore
    first, second = drawn[0::2], drawn[1::2]
    reach = options.radius * max(
        float(np.sqrt(np.linalg.eigvalsh(tilt.window[:3, :3])[-1])) for tilt in tilts
    )
    batches = np.repeat(np.arange(options.batches), per_batch)
    halves, cells = sorted_into_cells(joined(first), batches, reach)
    return window_estimate(
        chain,
        matched(halves, cells, second, tilts, options),
        sorted({tilt.link for tilt in tilts}),
        len(tilts),
        per_batch,
        options.radius,
        options.windows,
    )


def half_chain(
    target: Chain | Equilibria,
    options: HalfChainOptions | None = None,
    rng: Randomness = 0,
) -> JFactor:
    """J factor by half chains, plain or tilted.

    Parameters
    ----------
    target : Chain or Equilibria
        A molecule, or the minima already found for it.
    rng : int, SeedSequence or Generator

    Returns
    -------
    JFactor
        ``bias_bound`` is what extrapolating the window with a parabola changes.

    Raises
    ------
    SolveError
        No stable ring at any link searched, or no pair of halves met.
    """
    began = time.perf_counter()
    options = options or HalfChainOptions()
    search = find_rings(target) if isinstance(target, Chain) else target
    estimate = half_chain_estimate(search, options, generator(rng))
    return half_chain_result(search.chain, options, estimate, time.perf_counter() - began)


def half_chain_result(
    chain: Chain, options: HalfChainOptions, estimate: HalfChainEstimate, seconds: float
) -> JFactor:
    """J from an estimate with its diagnosis.

    Raises
    ------
    SolveError
        Too few pairs met to extrapolate the window.
    """
    log_j, stderr = estimate.best
    if not math.isfinite(log_j):
        raise SolveError(
            f"half chains of {chain.name}: too few pairs to extrapolate the window; draw more "
            "halves",
            estimate,
        )
    warnings = list(chain.warnings)
    tail = estimate.pareto_shape
    heavy = estimate.largest_share > _LARGEST_SHARE or (
        tail is not None and tail > HEAVY_PARETO_SHAPE
    )
    if heavy:
        shape = "unknown" if tail is None else f"{tail:.2f}"
        warnings.append(
            f"one half carries {100.0 * estimate.largest_share:.0f} % of J, tail shape {shape}: "
            f"{JStatus.HEAVY_TAILS.value}"
        )
    return JFactor(
        target=chain.name,
        n_bp=chain.n_steps,
        method="half-chain" if options.tilted else "half-chain-plain",
        minus_lnJ=-log_j,
        stderr=stderr,
        bias_bound=abs(estimate.bias),
        links=estimate.links,
        samples=2 * (options.halves // options.batches) * options.batches,
        effective_samples=estimate.effective_halves,
        pareto_shape=tail,
        seconds=seconds,
        warnings=tuple(warnings),
        status=JStatus.HEAVY_TAILS if heavy else JStatus.CONVERGED,
    )
