"""Breaks one thing in a kernel at a time and runs the tests that should notice.

    python tests/mutation.py --count 200 --seed 0        (make mutation)

Signs, arithmetic and comparison operators, indices and constants inside compiled functions are
changed one at a time in a copy of the package. A mutant is killed if a test fails, or runs out of
time; survivors are listed with their line. The exit code is 1 below 90 % killed.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from package_copies import copy_package, forget_compiled

HERE = Path(__file__).parent
SOURCE = HERE.parent / "src" / "dnacheck"
ENOUGH = 0.9
SECONDS = 900

# Tests that should notice, by the beginning of a kernel's path; the first that fits.
TESTS = (
    ("equilibria/discrete", ["tests/equilibria/discrete", "tests/model/test_rigid_steps.py"]),
    ("equilibria/continuum", ["tests/equilibria/continuum"]),
    ("equilibria/continuation", ["tests/equilibria/continuation"]),
    ("equilibria", ["tests/equilibria/discrete"]),
    ("cyclization/closure", ["tests/cyclization"]),
    ("cyclization/half_chain", ["tests/cyclization/test_half_chain.py", "tests/cyclization"]),
    ("cyclization/laplace", ["tests/cyclization", "tests/scan/test_scan.py"]),
    ("cyclization/umbrella", ["tests/cyclization"]),
    ("cyclization/ensembles", ["tests/cyclization"]),
    ("scanning", ["tests/scan"]),
    ("md", ["tests/md", "tests/numerics"]),
    ("model", ["tests/model", "tests/equilibria/discrete"]),
    ("numerics", ["tests/numerics", "tests/equilibria/discrete"]),
)

SWAPPED = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
}


class Mutant(NamedTuple):
    """One change: what stands at a place of a file, and what is put there."""

    file: str
    line: int
    start: int
    old: str
    new: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.old} -> {self.new}"


def _offset(lines: list[str], line: int, column: int) -> int:
    text = lines[line - 1].encode()[:column].decode()
    return sum(map(len, lines[: line - 1])) + len(text)


def _compiled(tree: ast.AST) -> Iterator[ast.FunctionDef]:
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and any(
            "njit" in ast.dump(mark) for mark in node.decorator_list
        ):
            yield node


def mutants_of(path: Path) -> Iterator[Mutant]:
    """All changes of the compiled functions of a file."""
    text = path.read_text()
    lines = text.splitlines(keepends=True)
    name = path.relative_to(SOURCE).as_posix()

    def at(node: ast.expr, old: str, new: str) -> Mutant:
        return Mutant(name, node.lineno, _offset(lines, node.lineno, node.col_offset), old, new)

    def between(left: ast.expr, right: ast.expr, kind: type) -> Iterator[Mutant]:
        if kind not in SWAPPED:
            return
        old, new = SWAPPED[kind]
        begin = _offset(lines, left.end_lineno or 0, left.end_col_offset or 0)
        place = text.find(old, begin, _offset(lines, right.lineno, right.col_offset))
        if place >= 0:
            yield Mutant(name, text.count("\n", 0, place) + 1, place, old, new)

    for function in _compiled(ast.parse(text)):
        indices = {
            id(part)
            for node in ast.walk(function)
            if isinstance(node, ast.Subscript)
            for part in ast.walk(node.slice)
        }
        for node in (part for statement in function.body for part in ast.walk(statement)):
            if isinstance(node, ast.BinOp):
                yield from between(node.left, node.right, type(node.op))
            elif isinstance(node, ast.Compare):
                yield from between(node.left, node.comparators[0], type(node.ops[0]))
            elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
                yield at(node, "-", "+")
            elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
                old = ast.get_source_segment(text, node) or ""
                if isinstance(node.value, float):
                    yield at(node, old, repr(1.5 * node.value if node.value else 0.1))
                elif id(node) in indices:
                    yield at(node, old, str(node.value - 1 if node.value > 0 else 1))


def kernel_files() -> list[Path]:
    """Modules that hold compiled functions."""
    return sorted(path for path in SOURCE.rglob("*.py") if "@njit" in path.read_text())


def tests_for(file: str) -> list[str]:
    """Tests that should notice a change of a kernel file."""
    return next(tests for beginning, tests in TESTS if file.startswith(beginning))


def killed(mutant: Mutant) -> bool:
    """Whether a test fails, or does not end, with the mutant in a copy of the package."""
    with tempfile.TemporaryDirectory() as name:
        folder = copy_package(Path(name))
        path = folder / "dnacheck" / mutant.file
        text = path.read_text()
        end = mutant.start + len(mutant.old)
        assert text[mutant.start : end] == mutant.old, mutant
        path.write_text(text[: mutant.start] + mutant.new + text[end:])
        module = "dnacheck." + mutant.file.removesuffix(".py").replace("/", ".")
        forget_compiled(folder, module)
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
        try:
            done = subprocess.run(
                [*command, *tests_for(mutant.file)],
                cwd=HERE.parent,
                env={**os.environ, "PYTHONPATH": str(folder), "DNACHECK_AHEAD": "0"},
                capture_output=True,
                timeout=SECONDS,
                check=False,
            )
        except subprocess.TimeoutExpired:
            return True
        return done.returncode != 0


def main() -> int:
    """Print each mutant as it is judged, then the survivors."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", default="", help="kernel files whose path begins so")
    chosen = parser.parse_args()
    files = [f for f in kernel_files() if f.relative_to(SOURCE).as_posix().startswith(chosen.only)]
    every = [mutant for path in files for mutant in mutants_of(path)]
    sample = random.Random(chosen.seed).sample(every, min(chosen.count, len(every)))
    print(f"{len(sample)} of {len(every)} mutants of {len(files)} files")
    for tests in {str(tests_for(mutant.file)): mutant for mutant in sample}.values():
        # The same file with nothing changed: tests that fail anyway kill every mutant.
        if killed(tests._replace(new=tests.old)):
            print(f"the tests of {tests.file} fail without a mutant")
            return 2
    survivors = []
    with ThreadPoolExecutor(chosen.jobs) as pool:
        for mutant, dead in zip(sample, pool.map(killed, sample), strict=True):
            print("killed  " if dead else "SURVIVES", mutant, flush=True)
            if not dead:
                survivors.append(mutant)
    share = 1.0 - len(survivors) / max(len(sample), 1)
    print(f"{share:.0%} killed; survivors:", *map(str, survivors), sep="\n  ")
    return 0 if share >= ENOUGH else 1


if __name__ == "__main__":
    sys.exit(main())
