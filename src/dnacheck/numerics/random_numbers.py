"""Compiled random numbers with an explicit state: xoshiro256++ of Blackman & Vigna (2021).

ACM Trans. Math. Softw. 47, 36. The state is an array of four 64-bit words, seeded from a numpy
SeedSequence, so that a chain's numbers depend on its seed alone, on any number of threads.
(A numpy Generator can be passed to a compiled function, but its code is then compiled anew in
every process.)
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

_ONE = np.uint64(1)
_S17, _S19, _S23, _S41, _S45 = (np.uint64(k) for k in (17, 19, 23, 41, 45))
_S11 = np.uint64(11)
_UNIT = 2.0**-53


def random_state(rng: np.random.Generator) -> NDArray[np.uint64]:
    """State (4,) of a new stream, drawn from ``rng``'s own seed sequence by spawning."""
    (child,) = rng.bit_generator.seed_seq.spawn(1)  # type: ignore[attr-defined]
    state: NDArray[np.uint64] = child.generate_state(4, np.uint64)
    return state


@njit(cache=True, nogil=True)
def next_word(state: Any) -> Any:
    """Next 64-bit word; ``state`` (4,) is updated."""
    total = state[0] + state[3]
    result = ((total << _S23) | (total >> _S41)) + state[0]
    t = state[1] << _S17
    state[2] ^= state[0]
    state[3] ^= state[1]
    state[1] ^= state[2]
    state[0] ^= state[3]
    state[2] ^= t
    state[3] = (state[3] << _S45) | (state[3] >> _S19)
    return result


@njit(cache=True, nogil=True)
def uniform(state: Any) -> float:
    """Uniform number in [0, 1)."""
    return (next_word(state) >> _S11) * _UNIT


@njit(cache=True, nogil=True)
def below(state: Any, n: int) -> int:
    """Integer in 0 ... n - 1, for n far below 2^53."""
    return min(int(uniform(state) * n), n - 1)


@njit(cache=True, nogil=True)
def normal(state: Any) -> float:
    """Standard normal number (Marsaglia's polar method, one of the pair)."""
    for _ in range(1000):
        x = 2.0 * uniform(state) - 1.0
        y = 2.0 * uniform(state) - 1.0
        square = x * x + y * y
        if 0.0 < square < 1.0:
            return x * math.sqrt(-2.0 * math.log(square) / square)
    return 0.0


@njit(cache=True, nogil=True)
def unit_vector(state: Any, out: Any) -> None:
    """Uniform direction into ``out`` (3,)."""
    z = 2.0 * uniform(state) - 1.0
    angle = 2.0 * math.pi * uniform(state)
    planar = math.sqrt(1.0 - z * z)
    out[0], out[1], out[2] = planar * math.cos(angle), planar * math.sin(angle), z
