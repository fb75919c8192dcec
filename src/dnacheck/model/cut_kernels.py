"""Canonical cut of a ring: which base pair is called the first does not matter to it.

The canonical cut is the least rotation of the rows (ground values, stiffness) of the steps in
lexicographic order. Whatever works on it and rolls its results back gives every cut of one ring
the same numbers, to the last bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from dnacheck.numerics.arrays import copy_rows, rolled_rows


@njit(cache=True, nogil=True)
def _order(steps: Any, i: int, j: int) -> int:
    """Sign of row i less row j of the steps, in lexicographic order."""
    width = steps.ground.shape[1]
    for a in range(width):
        x, y = steps.ground[i, a], steps.ground[j, a]
        if x != y:
            return 1 if x > y else -1
    for a in range(width):
        for b in range(a, width):
            x, y = steps.stiffness[i, a, b], steps.stiffness[j, a, b]
            if x != y:
                return 1 if x > y else -1
    return 0


@njit(cache=True, nogil=True)
def least_rotation(steps: Any) -> int:
    """First step of the least rotation, in linear time by two rivals and their common length."""
    n = steps.ground.shape[0]
    first, rival, length = 0, 1, 0
    while first < n and rival < n and length < n:
        order = _order(steps, (first + length) % n, (rival + length) % n)
        if order == 0:
            length += 1
            continue
        if order > 0:
            first += length + 1
        else:
            rival += length + 1
        if first == rival:
            rival += 1
        length = 0
    return min(first, rival)


@njit(cache=True, nogil=True)
def rolled(ground: Any, stiffness: Any, cut: int) -> tuple[Any, Any]:
    """Ground (N, c) and stiffness (N, c, c), from step ``cut`` on."""
    out, matrices = np.empty(ground.shape), np.empty(stiffness.shape)
    rolled_rows(ground, cut, out)
    n = stiffness.shape[0]
    for s in range(n):
        copy_rows(stiffness[(s + cut) % n], matrices[s])
    return out, matrices
