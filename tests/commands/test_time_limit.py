"""A time limit counts from the command's start and ends also what does not watch the time."""

import os
import subprocess
import sys
import threading

import click
import pytest

from dnacheck.commands.time_limit import within
from dnacheck.numerics.outcome import SolveError, TimeLimitReachedError


def test_work_that_watches_no_clock_is_left_behind():
    over = threading.Event()
    with pytest.raises(TimeLimitReachedError, match=r"--max-seconds 0\.1 before"):
        within(0.1, lambda left: over.wait(100.0))
    over.set()


def test_work_within_the_limit_hands_over_its_result():
    assert within(100.0, lambda left: left) == pytest.approx(100.0)
    assert within(None, lambda left: left) == float("inf")


@pytest.mark.parametrize("kind", [SolveError, KeyboardInterrupt])
def test_what_the_work_raises_comes_out(kind):
    def fail(left):
        raise kind("its own")

    for limit in (100.0, None):
        with pytest.raises(kind, match="its own"):
            within(limit, fail)


def test_the_time_before_the_work_counts():
    began = -1e6  # long before any clock's reading
    with click.Context(click.Command("began"), obj=began), pytest.raises(TimeLimitReachedError):
        within(1000.0, lambda left: pytest.fail("the time was over before"))


@pytest.mark.parametrize("method", ["auto", "metropolis"])
def test_compilation_counts(method, tmp_path):
    """Nothing compiled is at hand: two seconds are over before the first draw."""
    arguments = f"jfactor 08T15 --method {method} --max-seconds 2"
    ended = subprocess.run(
        [sys.executable, "-m", "dnacheck", *arguments.split()],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert ended.returncode == 3
    assert ended.stdout == ""
    message = ended.stderr.strip().splitlines()[-1]
    assert message.startswith("dnacheck: stopped at --max-seconds 2 before there was a result")
