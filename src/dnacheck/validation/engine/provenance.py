"""Where a report comes from: versions, machine, seeds, data."""

from __future__ import annotations

import platform
import sys
from importlib import metadata
from typing import Any

from dnacheck import __version__
from dnacheck.validation.engine.state import code_digest, file_digests
from dnacheck.validation.scene.scene import Scene

LIBRARIES = (
    "numpy", "scipy", "numba", "llvmlite", "openmm", "MDAnalysis", "pymbar",
    "matplotlib", "plotly", "pydantic", "jinja2", "biopython",
)  # fmt: skip


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def processor() -> str:
    """Name of the processor, as well as the system tells."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as handle:
            for line in handle:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def provenance(scene: Scene, level: str, seed: int, processes: int) -> dict[str, Any]:
    """Everything needed to repeat the run, except the times, which the run adds."""
    return {
        "dnacheck": __version__,
        "python": sys.version.split()[0],
        "libraries": {name: found for name in LIBRARIES if (found := _version(name))},
        "system": f"{platform.system()} {platform.machine()}",
        "processor": processor(),
        "processes": processes,
        "seed": seed,
        "level": level,
        "scene": {"title": scene.title, "sha256": scene.digest},
        "code_sha256": code_digest(),
        "data_sha256": file_digests(),
    }
