"""``jfactor``: the molar density of exact closure."""

from __future__ import annotations

import math
import time
from typing import Any

from dnacheck.api.arguments import Progress, positive, thread_count, told
from dnacheck.api.equilibria import boundary_of, checked_link
from dnacheck.api.molecules import Target, as_chain
from dnacheck.cyclization.method import Method
from dnacheck.cyclization.methods import METHODS, Auto, method_named
from dnacheck.cyclization.result import JFactor
from dnacheck.equilibria.boundary import AnyBoundary
from dnacheck.equilibria.ring import Equilibria
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import InputError
from dnacheck.numerics.seeds import Randomness


def method_of(method: Any) -> Method:
    """An argument ``method``: an object, a name, or None for :class:`Auto`."""
    if method is None:
        return Auto()
    if isinstance(method, str):
        from dnacheck.api.arguments import one_of

        return method_named(one_of("method", method, METHODS))
    if isinstance(method, Method):
        return method
    raise InputError(
        f"method must be an object such as dnacheck.Auto() or one of {', '.join(METHODS)}, not "
        f"{method!r}"
    )


def jfactor(
    source: Chain | Equilibria | Target,
    method: Method | str | None = None,
    *,
    link: str | int | None = None,
    ends: str | AnyBoundary | None = None,
    tolerance: float = 0.02,
    max_seconds: float = math.inf,
    rng: Randomness = 0,
    threads: int | None = None,
    progress: Progress = False,
) -> JFactor:
    """J factor of a chain, entropy included, nothing fitted: J = exp(-minus_lnJ) mol/L.

    Parameters
    ----------
    source : Chain, its Equilibria, or what :func:`dnacheck.chain` takes
    method : Laplace, ClosureSampling, HalfChain, Umbrella or Auto, or a name, optional
        By default the cheapest whose measured error meets the tolerance.
    link : "auto", "all" or int, optional
        Links to search; an integer asks for the part of J at that link.
    ends : Ring, NickedRing, HingedRing, Loop, or the name of one of the first three
        What the end has to meet: place and orientation, place and axis, place alone, or a pose.
    tolerance : float
        Error of ln J that is asked for; the result's ``status`` says whether it was met.
    max_seconds : float
        Wall time, the search for rings included, after which the best so far is returned.
    rng : int, SeedSequence or Generator
    threads : int, optional
        By default every processor; no result depends on it.
    progress : bool or callable
        A callable is told the draws that were made since its last call.

    Returns
    -------
    JFactor
        ``minus_lnJ``, ``stderr``, ``bias_bound``, ``molar``, ``links``, ``to_dict()``.

    Raises
    ------
    InputError
        One line that names the argument and the mend.
    SolveError
        No equilibrium at the links asked for, or no draw could be used.

    Examples
    --------
    >>> import dnacheck as dc
    >>> j = dc.jfactor("11T15", dc.Laplace())
    >>> j.links[0].link, j.stderr, 10.0 < j.minus_lnJ < 25.0
    (15, 0.0, True)
    """
    from dnacheck.equilibria.discrete.boundary_search import find_equilibria
    from dnacheck.equilibria.discrete.search import SearchOptions

    way = method_of(method)
    tolerance = positive("tolerance", tolerance)
    if max_seconds != math.inf:
        positive("max_seconds", max_seconds)
    count = thread_count(threads)
    began = time.perf_counter()
    body = source if isinstance(source, Equilibria) else as_chain(source)
    links = checked_link(link, body.chain.n_steps if isinstance(body, Equilibria) else body.n_steps)
    if isinstance(body, Equilibria):
        search = body
    else:
        search = find_equilibria(body, boundary_of(ends), SearchOptions(links=links))
    if isinstance(links, int):
        # Raises where the link has no ring: no other's J may stand for it.
        _ = search.lowest
    with told(progress, f"{search.name}: draws", None) as advance:
        made = 0

        def total(draws: int) -> None:
            nonlocal made
            advance(draws - made)
            made = draws

        result = way.compute(
            search,
            rng=rng,
            threads=count,
            progress=total,
            tolerance=tolerance,
            max_seconds=max(max_seconds - (time.perf_counter() - began), 1e-3),
        )
    return result.of_link(links, tolerance) if isinstance(links, int) else result
