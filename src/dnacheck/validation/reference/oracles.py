"""Independent programs of the checkout's ``validation/oracles``, where there is one."""

from __future__ import annotations

import importlib.util
import sys
from functools import cache
from pathlib import Path
from types import ModuleType

FOLDER = Path(__file__).resolve().parents[4] / "validation" / "oracles"


def oracle_exists(name: str) -> bool:
    """Whether the oracle is at hand; an installed wheel has none."""
    return _path(name).is_file()


def _path(name: str) -> Path:
    package = FOLDER / name / "__init__.py"
    return package if package.is_file() else FOLDER / f"{name}.py"


@cache
def load_oracle(name: str) -> ModuleType:
    """The oracle's module, by the name of its file or folder."""
    path = _path(name)
    spec = importlib.util.spec_from_file_location(f"dnacheck_oracle_{name}", path)
    if spec is None or spec.loader is None:
        raise FileNotFoundError(path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
