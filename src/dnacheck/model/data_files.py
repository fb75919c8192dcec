"""Where the tables that ship with the package lie, and the names of its parameter sets."""

from __future__ import annotations

from functools import cache
from pathlib import Path

PARAMETER_SETS = ("trifonov2", "trifonov", "desantis", "olson1998")
"""Names of the parameter sets in ``data/angle_sets``, the default first."""


@cache
def data_directory() -> Path:
    """Folder of the data tables: inside the installed package, else at the top of the checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "data"
    return installed if installed.is_dir() else package.parents[1] / "data"
