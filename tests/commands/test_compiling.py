import io
import json
import os
import subprocess
import sys

import pytest
from numba import njit

from dnacheck.commands.ahead import JOBS, RING, compile_jobs
from dnacheck.commands.compiling import SILENT, Bar, on_compiled


def test_a_job_waits_only_for_jobs_that_start_before_it():
    for name, job in JOBS.items():
        names = list(JOBS)
        assert all(names.index(other) < names.index(name) for other in job.after)
        assert job.kernels > 0
    assert set(RING) <= set(JOBS)


@pytest.mark.parametrize("name", RING)
def test_the_jobs_of_a_ring_run(name):
    JOBS[name].run()


def test_kernels_are_counted_when_they_compile_and_not_when_they_run():
    @njit
    def inner(x):
        return x + 1

    @njit
    def outer(x):
        return inner(x) * 2

    said = []
    with on_compiled(lambda: said.append("kernel"), lambda: said.append("first")):
        assert outer(2) == 6
        compiled = list(said)
        assert outer(3) == 8
    assert outer(2.0) == 6.0
    assert compiled == ["first", "kernel", "kernel"]
    assert said == compiled


def test_the_bar_is_lines_where_there_is_no_terminal_and_nothing_when_quiet(monkeypatch):
    texts = []
    for quiet in (False, True):
        stream = io.StringIO()
        monkeypatch.setattr(sys, "stderr", stream)
        bar = Bar(8, quiet)
        bar.draw()
        for _ in range(12):
            bar.advance()
        bar.close()
        texts.append(stream.getvalue())
    lines = texts[0].splitlines()
    assert [line.split("] ")[1].split("%")[0].strip() for line in lines[:-1]] == [
        "0",
        "25",
        "50",
        "75",
    ]
    assert lines[-1].startswith("dnacheck: 12 kernels compiled")
    assert texts[1] == ""


def test_jobs_that_fail_in_a_worker_are_done_all_the_same(monkeypatch):
    # The worker, a process of its own, does not know this job.
    monkeypatch.setattr("dnacheck.commands.ahead.JOBS", {"none": JOBS["newton"]})
    assert list(compile_jobs(("none",), 2)) == ["none"]


@pytest.mark.slow
def test_a_cold_run_says_what_it_compiles_and_a_warm_one_nothing(tmp_path):
    def run():
        return subprocess.run(
            [sys.executable, "-m", "dnacheck", "ring", "11T15", "--json"],
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), SILENT: "1"},
            capture_output=True,
            text=True,
            check=True,
        )

    cold, warm = run(), run()
    assert "compiling the kernels of 'ring'" in cold.stderr
    assert warm.stderr == ""
    energies = [
        [item["energy_RT"] for item in json.loads(done.stdout)["equilibria"]]
        for done in (cold, warm)
    ]
    assert energies[0] == energies[1]
