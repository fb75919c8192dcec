"""Where the tables that ship with the package lie."""

from __future__ import annotations

from functools import cache
from pathlib import Path


@cache
def data_directory() -> Path:
    """Folder of the data tables: inside the installed package, else at the top of the checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "data"
    return installed if installed.is_dir() else package.parents[1] / "data"
