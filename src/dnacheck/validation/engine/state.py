"""Finished checks on disk, so that a run that was killed goes on where it stopped."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from dnacheck import __version__
from dnacheck.io.files import atomic_write
from dnacheck.model.data_files import data_directory
from dnacheck.numerics.outcome import InputError
from dnacheck.validation.engine.registry import Findings, Level
from dnacheck.validation.engine.verdict import CheckResult, Rule, Verdict
from dnacheck.validation.report.record import block_from_dict, block_to_dict
from dnacheck.validation.scene.scene import Scene


@cache
def file_digests() -> dict[str, str]:
    """SHA-256 of every data file, by path below the data folder."""
    root = data_directory()
    return {
        path.relative_to(root).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(root.rglob("*"))
        if path.is_file()
    }


@cache
def code_digest() -> str:
    """SHA-256 of the package's source files."""
    root = Path(__file__).resolve().parents[2]
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def run_key(scene: Scene, level: Level, seed: int) -> str:
    """What two runs must have in common to share results: scene, level, seed, code and data."""
    parts = (scene.digest, int(level), seed, __version__, code_digest(), file_digests())
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


def findings_to_json(findings: Findings) -> str:
    """Findings as JSON text; numbers that are not finite are kept."""
    results = []
    for result in findings.results:
        values = asdict(result)
        values["rule"] = result.rule.name
        values["verdict"] = result.verdict.value
        results.append(values)
    blocks = [block_to_dict(block) for block in findings.blocks]
    return json.dumps({"results": results, "blocks": blocks}, default=_number)


def _number(value: Any) -> Any:
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no place in a check's findings")


def findings_from_json(text: str) -> Findings:
    """The inverse of :func:`findings_to_json`."""
    data = json.loads(text)
    results = []
    for values in data["results"]:
        values["rule"] = Rule[values["rule"]]
        values["verdict"] = Verdict(values["verdict"])
        results.append(CheckResult(**values))
    return Findings(results, [block_from_dict(block) for block in data["blocks"]])


class StateFolder:
    """Findings of one run, one file per finished check, written whole."""

    def __init__(self, root: Path, key: str) -> None:
        self.root = root
        self.folder = root / key

    def open(self) -> None:
        """Make the folder; results of other runs are removed, they can't be used any more.

        Raises
        ------
        InputError
            The folder can't be made.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            for other in self.root.iterdir():
                if other != self.folder and other.is_dir():
                    shutil.rmtree(other)
        except OSError as error:
            raise InputError(
                f"output folder '{self.root.parent}': {error.strerror}; "
                "name a writable folder with -o"
            ) from None

    def path(self, check: str) -> Path:
        """Where the findings of a check lie."""
        return self.folder / f"{check}.json"

    def load(self, check: str) -> Findings | None:
        """Findings of a check, if it finished."""
        try:
            return findings_from_json(self.path(check).read_text(encoding="utf-8"))
        except FileNotFoundError:
            return None
        except (ValueError, KeyError, TypeError):
            return None  # not ours, or of another version: compute again

    def save(self, check: str, findings: Findings) -> None:
        """Write the findings of a finished check."""
        atomic_write(self.path(check), findings_to_json(findings))

    def remove(self) -> None:
        """Forget the run: it is complete and its report written."""
        shutil.rmtree(self.root, ignore_errors=True)
