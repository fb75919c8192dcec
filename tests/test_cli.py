"""The command group: laziness, errors, exit codes."""

import importlib.util
import json
import os
import subprocess
import sys
import types

import click
import pytest

from dnacheck import __version__, cli
from dnacheck.commands.common import common_options
from dnacheck.numerics.outcome import DnaCheckError, InputError, SolveError

HEAVY = {
    "Bio",
    "MDAnalysis",
    "jinja2",
    "matplotlib",
    "numba",
    "numpy",
    "openmm",
    "plotly",
    "pydantic",
    "pymbar",
    "rich",
    "scipy",
}


def python(code, **keywords):
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, **keywords
    )


@pytest.fixture
def ring_does(monkeypatch):
    """Put a command in the place of ``dnacheck ring`` whose body is the function given."""

    def replace(body):
        @click.command()
        @common_options
        def command(run):
            return body(run)

        module = types.ModuleType("dnacheck.commands.ring")
        module.command = command
        monkeypatch.setitem(sys.modules, "dnacheck.commands.ring", module)

    return replace


def raising(error):
    def body(run):
        raise error

    return body


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["nonsense"], []])
def test_start_up_imports_no_heavy_library(arguments):
    run = python(
        "import sys\n"
        "from dnacheck.cli import main\n"
        f"main({arguments!r})\n"
        "print('\\nMODULES', *(name for name in sys.modules if '.' not in name))\n"
    )
    assert run.returncode == 0, run.stderr
    loaded = run.stdout.rpartition("MODULES")[2].split()
    assert "click" in loaded
    assert HEAVY.isdisjoint(loaded)


def test_group_help_imports_no_command():
    run = python(
        "import sys\n"
        "from dnacheck.cli import main\n"
        "main(['--help'])\n"
        "print('\\nMODULES', *(n for n in sys.modules if n.startswith('dnacheck.commands.')))\n"
    )
    assert run.stdout.rpartition("MODULES")[2].split() == []


def test_help_lists_every_command(capsys):
    assert cli.main(["--help"]) == 0
    text = capsys.readouterr().out
    for name, line in cli.COMMAND_HELP.items():
        assert name in text
        assert line in text


@pytest.mark.parametrize("name", cli.COMMAND_HELP)
def test_command_help_has_an_example_and_the_common_options(name, capsys):
    if importlib.util.find_spec(f"dnacheck.commands.{name}") is None:
        pytest.skip(f"{name} is not written yet")
    assert cli.main([name, "--help"]) == 0
    text = capsys.readouterr().out
    assert f"dnacheck {name} " in text.split("\n", 1)[1]
    for option in ("--json", "--seed", "--threads", "--quiet", "--debug"):
        assert option in text


def test_version(capsys):
    assert cli.main(["--version"]) == 0
    assert __version__ in capsys.readouterr().out


def test_no_arguments_shows_help_and_is_a_usage_error(capsys):
    assert cli.main([]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "Commands:" in captured.err


@pytest.mark.parametrize("arguments", [["rnig"], ["--nonsense"], ["ring", "--threads", "0"]])
def test_usage_error_is_one_line(arguments, ring_does, capsys):
    ring_does(lambda run: None)
    assert cli.main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("dnacheck")
    assert "--help" in captured.err


def test_missing_command_module_is_named(monkeypatch, capsys):
    monkeypatch.setitem(cli.COMMAND_HELP, "absent", "Not there.")
    assert cli.main(["absent"]) == cli.EXIT_INTERNAL
    assert "'absent' is not part of this installation" in capsys.readouterr().err


def test_missing_library_is_named(monkeypatch, capsys):
    def failing(name):
        raise ModuleNotFoundError("No module named 'openmm'", name="openmm")

    monkeypatch.setattr(cli.importlib, "import_module", failing)
    assert cli.main(["md"]) == cli.EXIT_INTERNAL
    assert "needs the Python module 'openmm'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [
        (InputError("sequence 'x', position 3:\n'N' is not a base"), 2, "position 3: 'N'"),
        (SolveError("stopped after 7 iterations", partial=1), 3, "after 7 iterations"),
        (click.UsageError("no such thing"), 2, "no such thing"),
        (click.BadParameter("too small"), 2, "too small"),
        (click.FileError("a.txt", "unreadable"), 2, "a.txt"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (click.Abort(), 130, "interrupted"),
        (DnaCheckError("odd"), 70, "internal error (DnaCheckError: odd); run with --debug"),
        (ValueError("two\nlines"), 70, "internal error (ValueError: two lines); run with --debug"),
        (MemoryError(), 70, "internal error (MemoryError:); run with --debug"),
        (SystemExit(5), 5, ""),
        (SystemExit(), 0, ""),
    ],
)
def test_exception_to_exit_code_and_one_line(error, code, text, ring_does, capsys):
    ring_does(raising(error))
    assert cli.main(["ring"]) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert text in captured.err
    assert captured.err.count("\n") == (1 if text else 0)


@pytest.mark.parametrize(("error", "code"), [(InputError("bad"), 2), (ZeroDivisionError(), 70)])
def test_debug_shows_the_traceback_and_keeps_the_code(error, code, ring_does, capsys):
    ring_does(raising(error))
    assert cli.main(["ring", "--debug"]) == code
    text = capsys.readouterr().err
    assert "Traceback" in text
    assert "--debug" not in text.splitlines()[-1]


@pytest.mark.parametrize(("returned", "code"), [(None, 0), (0, 0), (1, 1), (3, 3)])
def test_returned_value_is_the_exit_code(returned, code, ring_does):
    ring_does(lambda run: returned)
    assert cli.main(["ring"]) == code


def test_exit_through_the_context(ring_does):
    ring_does(lambda run: click.get_current_context().exit(3))
    assert cli.main(["ring"]) == 3


FLOOD = """
import sys, types, click
from dnacheck.cli import main
module = types.ModuleType("dnacheck.commands.ring")
@click.command()
def command():
    for _ in range(100000):
        print("a line that nobody reads")
module.command = command
sys.modules["dnacheck.commands.ring"] = module
sys.exit(main(["ring"]))
"""


def test_reader_that_goes_away_is_no_traceback():
    process = subprocess.Popen(
        [sys.executable, "-c", FLOOD], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    process.stdout.readline()
    process.stdout.close()
    stderr = process.stderr.read()
    process.stderr.close()
    assert process.wait(timeout=60) == cli.EXIT_BROKEN_PIPE
    assert stderr == ""


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_full_disk_on_standard_output_is_reported():
    with open("/dev/full", "w") as full:
        run = subprocess.run(
            [sys.executable, "-m", "dnacheck", "--version"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
        )
    assert run.returncode == 2
    assert run.stderr.startswith("dnacheck: cannot write: ")


def test_module_entry_point_passes_the_exit_code_on():
    run = subprocess.run(
        [sys.executable, "-m", "dnacheck", "rnig"], capture_output=True, text=True, timeout=60
    )
    assert run.returncode == 2
    assert json.dumps(run.stderr).count("\\n") == 1
