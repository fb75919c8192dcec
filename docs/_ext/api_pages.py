"""One API page per layer, written before the build from the modules that exist."""

from __future__ import annotations

import importlib
import pkgutil
import re
from pathlib import Path
from typing import Any

LAYERS = {
    "numerics": "Numerics",
    "model": "Model",
    "io": "Files",
    "equilibria": "Equilibria",
    "cyclization": "J factors",
    "md": "Bead chain",
    "mechanics": "Mechanics",
    "scanning": "Many sequences",
    "validation": "Validation",
    "api": "Behind the public names",
    "commands": "Command line",
}
"""Packages in the order of the imports, lowest first."""


def modules(layer: str) -> list[str]:
    """Names of a layer's modules, without those that hold only compiled loops."""
    package = importlib.import_module(f"dnacheck.{layer}")
    names = [package.__name__]
    for entry in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not re.search(r"(^|[._])kernels($|\.)", entry.name):
            names.append(entry.name)
    return names


def write_pages(app: Any) -> None:
    """Write ``reference/generated/LAYER.md``; pages that would not change keep their date."""
    folder = Path(app.srcdir) / "reference" / "generated"
    folder.mkdir(parents=True, exist_ok=True)
    for layer, title in LAYERS.items():
        lines = [f"# {title}: `dnacheck.{layer}`", ""]
        for name in modules(layer):
            lines += [
                f"## `{name}`",
                "",
                "```{eval-rst}",
                f".. automodule:: {name}",
                "   :members:",
                "   :ignore-module-all:",
                "   :show-inheritance:",
                "```",
                "",
            ]
        page = folder / f"{layer}.md"
        text = "\n".join(lines)
        if not page.exists() or page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")


def plain_bars(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Escape the bars of ``|x|`` in docstrings: they are absolute values, not references."""
    for i, line in enumerate(lines):
        if "|" in line and "``" not in line and not line.lstrip().startswith("|"):
            lines[i] = line.replace("|", "\\|")


def setup(app: Any) -> dict[str, Any]:
    """Register the hooks."""
    app.connect("builder-inited", write_pages)
    app.connect("autodoc-process-docstring", plain_bars, priority=900)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
