"""Compiled kernels against the same kernels as plain Python."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(__file__).with_name("interpreted.py")


def numbers(compiled):
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "0" if compiled else "1"}
    done = subprocess.run(
        [sys.executable, str(PROGRAM)],
        env=environment, capture_output=True, text=True, timeout=1200, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout)


@pytest.mark.slow
def test_compiled_kernels_do_what_their_source_says():
    """Plain Python checks every index; samplers are short, so that rounding changes no decision."""
    compiled, interpreted = numbers(True), numbers(False)
    assert compiled.keys() == interpreted.keys()
    for problem, values in compiled.items():
        assert values == pytest.approx(interpreted[problem], rel=1e-6, abs=1e-7), problem
