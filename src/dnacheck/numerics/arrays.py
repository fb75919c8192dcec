"""Compiled copies of arrays by plain loops.

``a[:] = b`` carries the text of its error message into every kernel that holds it, at half a second
of compiling each.
"""

from __future__ import annotations

from typing import Any

from numba import njit


@njit(cache=True, nogil=True)
def copy_rows(source: Any, target: Any) -> None:
    """Copy an array (n, c) into one of the same shape."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@njit(cache=True, nogil=True)
def rolled_rows(source: Any, first: int, target: Any) -> None:
    """Copy an array (n, c) into another, from row ``first`` on and around."""
    n = source.shape[0]
    for i in range(n):
        row = (i + first) % n
        for j in range(source.shape[1]):
            target[i, j] = source[row, j]
