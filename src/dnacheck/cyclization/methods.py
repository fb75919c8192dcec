"""Every way to compute a J factor, by the name that the command line gives it.

A new method is a file with a :class:`dnacheck.cyclization.method.Method` and a line here.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from dnacheck.cyclization.automatic import Auto
from dnacheck.cyclization.closure.method import ClosureSampling
from dnacheck.cyclization.half_chain.method import HalfChain
from dnacheck.cyclization.laplace.method import Laplace
from dnacheck.cyclization.method import Method
from dnacheck.cyclization.umbrella.method import Umbrella
from dnacheck.numerics.outcome import InputError

__all__ = [
    "METHODS",
    "Auto",
    "ClosureSampling",
    "HalfChain",
    "Laplace",
    "Method",
    "Umbrella",
    "method_named",
]

METHODS: dict[str, Callable[[], Method]] = {
    "auto": Auto,
    "laplace": Laplace,
    "register-laplace": partial(Laplace, register=True),
    "corrected-laplace": partial(Laplace, register=True, order=1),
    "closure": ClosureSampling,
    "half-chain": HalfChain,
    "half-chain-plain": partial(HalfChain, tilted=False),
    "metropolis": Umbrella,
}


def method_named(name: str) -> Method:
    """The method of that name with its default options.

    Raises
    ------
    InputError
        There is none.
    """
    if name not in METHODS:
        raise InputError(f"method must be one of {', '.join(METHODS)}, not {name!r}")
    return METHODS[name]()
