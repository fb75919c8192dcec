"""Ranges in which a number makes sense, with one message for what lies outside."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import Any

from dnacheck.numerics.outcome import InputError


@dataclass(frozen=True)
class Range:
    """Numbers from ``least`` to ``most``, both included."""

    least: float
    most: float
    unit: str = ""

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        return f"from {_written(self.least)} to {_written(self.most)}{unit}"

    def __contains__(self, value: Any) -> bool:
        return bool(self.least <= value <= self.most)  # False for NaN

    def checked(self, value: Any, name: str) -> float:
        """The value itself, as a float.

        Raises
        ------
        InputError
            It is not a number, or lies outside; the message has the name and the range.
        """
        if isinstance(value, bool) or not isinstance(value, Real) or value not in self:
            raise InputError(f"{name} {value!r}: give a number {self}")
        return float(value)


def _written(bound: float) -> str:
    return str(int(bound)) if abs(bound) >= 1.0 and bound == int(bound) else f"{bound:g}"
