"""Error of ln J against processor time, for every method.

The error of a sampler is its own standard error; that of plain and register-integrated Laplace is
their distance from exact closure, sampled at least ten times finer; that of Laplace with its first
anharmonic term is the standard error and the estimated next term together.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from dnacheck.cyclization.methods import ClosureSampling, HalfChain, Laplace, Method, Umbrella
from dnacheck.cyclization.result import JFactor
from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.molecules import embedded
from dnacheck.model.sequence import parse_sequence
from dnacheck.numerics.outcome import DnaCheckError

REFERENCE_ERROR = 0.02
"""Standard error of exact closure against which Laplace's bias, 0.25 or more, is measured."""
_BRIEF = 0.1
_REPEATS = 3
_ANY = 1e6
"""A tolerance that any error meets: the number of draws is then the one asked for."""


@dataclass(frozen=True)
class SpeedOptions:
    """Sizes of the runs; an empty tuple leaves a method out.

    Attributes
    ----------
    batches : tuple of int
        Batches of exact-closure sampling, 16 draws each.
    pairs : tuple of int
        Pairs of draws for the anharmonic term.
    halves, plain_halves : tuple of int
        Halves on each side, tilted and plain.
    records : tuple of int
        Recorded shapes per strength and copy of restrained Metropolis sampling.
    """

    batches: tuple[int, ...] = (20, 80)
    pairs: tuple[int, ...] = (50, 200)
    halves: tuple[int, ...] = (4_000, 8_000)
    plain_halves: tuple[int, ...] = (20_000,)
    records: tuple[int, ...] = (40,)


LONG = SpeedOptions(
    batches=(20, 80, 320, 1280),
    pairs=(50, 200, 800, 3200),
    halves=(4_000, 8_000, 16_000, 32_000),
    plain_halves=(20_000, 80_000),
    records=(40, 100, 250),
)


@dataclass(frozen=True)
class SpeedPoint:
    """One run of one method.

    Attributes
    ----------
    method, size : str
        ``size`` says how long the run was, empty for methods without a size.
    seconds : float
        Processor time from the chain to its J factor, search included, compiled code warm.
    minus_lnJ : float
    error : float
        See the module.
    bias : float
        -ln J minus the reference.
    """

    method: str
    size: str
    seconds: float
    minus_lnJ: float
    error: float
    bias: float


@dataclass(frozen=True)
class SpeedStudy:
    """Points of one molecule.

    Attributes
    ----------
    name : str
    reference, reference_error : float
        -ln J by exact closure with another seed, and its standard error.
    points : tuple of SpeedPoint
    failed : tuple of str
        Runs without a result and why.
    """

    name: str
    reference: float
    reference_error: float
    points: tuple[SpeedPoint, ...]
    failed: tuple[str, ...]


def molecules() -> dict[str, Chain]:
    """An easy, a middling and a hard molecule.

    The hard one, 386 random base pairs with a soft twist, has a soft register and several links.
    """
    letters = "".join(np.random.default_rng(7).choice(list("ACGT"), 386))
    return {
        "easy: 08T15": build_chain(embedded("08T15")),
        "middling: 09T09": build_chain(embedded("09T09")),
        "hard: random, 386 bp": build_chain(parse_sequence(letters, "soft"), twist_ratio=0.6),
    }


def _timed(run: Callable[[], JFactor]) -> tuple[JFactor, float]:
    """The result of a run and its processor time, the least of three if it is brief."""
    times: list[float] = []
    while True:
        began = time.process_time()
        result = run()
        times.append(time.process_time() - began)
        if times[0] > _BRIEF or len(times) == _REPEATS:
            return result, min(times)


def _runs(
    chain: Chain, options: SpeedOptions, seeds: np.random.SeedSequence
) -> list[tuple[str, str, Callable[[], JFactor]]]:
    """Method, size and computation of every run."""

    def computed(method: Method, seed: np.random.SeedSequence) -> JFactor:
        return method.compute(chain, rng=seed, tolerance=_ANY)

    def fixed(work: Callable[..., JFactor], *arguments: object) -> Callable[[], JFactor]:
        (seed,) = seeds.spawn(1)
        # A seed sequence remembers what it spawned; every repeat starts from a fresh one.
        return lambda: work(
            *arguments, np.random.SeedSequence(seed.entropy, spawn_key=seed.spawn_key)
        )

    runs: list[tuple[str, str, Callable[[], JFactor]]] = [
        (method.name, "", partial(method.compute, chain))
        for method in (Laplace(), Laplace(register=True))
    ]
    sized: list[tuple[Method, str]] = [
        *((Laplace(True, 1, n), f"{2 * n} draws") for n in options.pairs),
        *((ClosureSampling(first_batches=n), f"{16 * n} draws") for n in options.batches),
        *((HalfChain(n), f"2 x {n} halves") for n in options.halves),
        *((HalfChain(n, tilted=False), f"2 x {n} halves") for n in options.plain_halves),
        *((Umbrella(n, burn_in=16, thinning=1), f"{n} records") for n in options.records),
    ]
    runs += [(method.name, size, fixed(computed, method)) for method, size in sized]
    return runs


def study(name: str, chain: Chain, options: SpeedOptions, seed: int = 0) -> SpeedStudy:
    """Run every method at every size on one molecule.

    Raises
    ------
    SolveError
        The reference cannot be computed.
    """
    own, others = np.random.SeedSequence(seed).spawn(2)
    exact = ClosureSampling().compute(chain, rng=own, tolerance=REFERENCE_ERROR)
    points: list[SpeedPoint] = []
    failed: list[str] = []
    for method, size, run in _runs(chain, options, others):
        try:
            result, seconds = _timed(run)
        except DnaCheckError as error:
            failed.append(f"{method}, {size}: {error}")
            continue
        bias = result.minus_lnJ - exact.minus_lnJ
        if method in ("laplace", "register-laplace"):
            error_of = abs(bias)
        elif method == "corrected-laplace":
            error_of = math.hypot(result.stderr, result.bias_bound or 0.0)
        else:
            error_of = result.stderr
        points.append(SpeedPoint(method, size, seconds, result.minus_lnJ, error_of, bias))
    return SpeedStudy(name, exact.minus_lnJ, exact.stderr, tuple(points), tuple(failed))


def warm_up() -> None:
    """Load the compiled code of every method."""
    chain = build_chain(embedded("09T15"))
    tiny = SpeedOptions((2,), (16,), (4_000,), (4_000,), (20,))
    for _, _, run in _runs(chain, tiny, np.random.SeedSequence(0)):
        try:
            run()
        except DnaCheckError:
            continue
