"""The ``dnacheck`` command: a group that loads a subcommand only when it is invoked.

Exit codes: 0 done and every check passed; 1 a check failed; 2 bad input or usage; 3 a computation
did not converge; 70 an internal error; 130 interrupted; 141 the reader of the output went away.
"""

from __future__ import annotations

import contextlib
import errno
import importlib
import io
import os
import sys
import threading
import time
import traceback
from collections.abc import Sequence

import click

from dnacheck import __version__

EXIT_OK = 0
EXIT_CHECK_FAILED = 1
EXIT_INPUT = 2
EXIT_NOT_CONVERGED = 3
EXIT_INTERNAL = 70
EXIT_INTERRUPTED = 130
EXIT_BROKEN_PIPE = 141

COMMAND_HELP = {
    "ring": "Ring equilibria of a molecule, discrete and continuum.",
    "sweep": "Ring energies over a range of twist ratios.",
    "diagram": "Bifurcation diagram: energy and end moment against end twist.",
    "jfactor": "Cyclization probability (J factor) of a molecule.",
    "loop": "A loop between two sites held in a pose: energies and J.",
    "pull": "A molecule under force and torque: shape, extension and turns.",
    "profile": "J factor against length.",
    "sensitivity": "What each step and each letter does to ln J.",
    "fit": "Mechanics from measured J factors.",
    "md": "Check a ring with an OpenMM bead chain.",
    "scan": "Ring energy and J factor of many sequences, resumable.",
    "validate": "Run a validation scene and write its report.",
    "compile": "Compile the kernels ahead of their first use.",
}
"""One-line help of each command, kept here so that the group's help imports none of them."""


class CommandUnavailableError(Exception):
    """A known command whose module, or a library it needs, is not installed."""


class LazyGroup(click.Group):
    """A group whose commands are the ``command`` objects of ``dnacheck.commands.NAME``."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMAND_HELP)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMAND_HELP:
            return None
        name = f"dnacheck.commands.{cmd_name}"
        try:
            command = importlib.import_module(name).command
        except ModuleNotFoundError as error:
            if error.name == name:
                reason = "is not part of this installation"
            else:
                reason = f"needs the Python module '{error.name}', which is not installed"
            raise CommandUnavailableError(f"the command '{cmd_name}' {reason}") from error
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMAND_HELP.items()))


@click.group(
    cls=LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Example:  dnacheck ring 11T15",
)
@click.version_option(__version__, prog_name="dnacheck")
def cli() -> None:
    """Elastic DNA rings: wedge chains and continuum rods, each checked against the other.

    TARGET, where a command takes one, is the name of an embedded molecule (11T15), a literal
    sequence, or a FASTA file.
    """


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code; never raises and never exits.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments without the program name; by default those of the process.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    if argv is None and isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a terminal without Å is no error
    try:
        code = _run(arguments)
    except BrokenPipeError:
        _silence_stdout()
        return EXIT_BROKEN_PIPE
    except BaseException as error:
        code = _report(error, debug="--debug" in arguments)
    code = _flushed(code)
    if argv is None and _leaves_work_behind():
        os._exit(code)
    return code


def _leaves_work_behind() -> bool:
    """Whether kernels run on past a time limit: Python would wait for them at its exit."""
    from dnacheck.commands.time_limit import LEFT_BEHIND

    return any(thread.name == LEFT_BEHIND for thread in threading.enumerate())


def _run(arguments: list[str]) -> int:
    """Parse and invoke; the exit code is what the command returned, None meaning 0."""
    try:
        with cli.make_context("dnacheck", arguments, obj=time.perf_counter()) as context:
            outcome = cli.invoke(context)
    except click.exceptions.Exit as stop:
        return stop.exit_code
    return int(outcome) if outcome is not None else EXIT_OK


def _report(error: BaseException, debug: bool) -> int:
    """Write what happened to standard error, and return the exit code."""
    code, message = _explain(error, debug)
    with contextlib.suppress(OSError):
        if debug and not isinstance(error, SystemExit):
            traceback.print_exception(error)
        if message:
            print(message, file=sys.stderr)
    return code


def _flushed(code: int) -> int:
    """Flush standard output; the exit code tells if that failed."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        _silence_stdout()
        return EXIT_BROKEN_PIPE
    except OSError as error:
        _silence_stdout()
        print(f"dnacheck: cannot write: {error.strerror}", file=sys.stderr)
        return code or EXIT_INPUT
    return code


def _explain(error: BaseException, debug: bool) -> tuple[int, str]:
    """Exit code and message of an exception."""
    # Imported here: help and usage errors of a healthy run do not need it.
    from dnacheck.numerics.outcome import InputError, SolveError, TimeLimitReachedError

    if isinstance(error, click.exceptions.NoArgsIsHelpError):
        return EXIT_INPUT, error.format_message()
    if isinstance(error, click.UsageError):
        path = error.ctx.command_path if error.ctx else "dnacheck"
        return EXIT_INPUT, f"{path}: {_one_line(error.format_message())} (see '{path} --help')"
    if isinstance(error, click.ClickException):
        return EXIT_INPUT, f"dnacheck: {_one_line(error.format_message())}"
    if isinstance(error, InputError):
        return EXIT_INPUT, f"dnacheck: {_one_line(str(error))}"
    if isinstance(error, SolveError | TimeLimitReachedError):
        return EXIT_NOT_CONVERGED, f"dnacheck: {_one_line(str(error))}"
    if isinstance(error, KeyboardInterrupt | click.Abort):
        return EXIT_INTERRUPTED, "dnacheck: interrupted"
    if isinstance(error, CommandUnavailableError):
        return EXIT_INTERNAL, f"dnacheck: {_one_line(str(error))}"
    if isinstance(error, SystemExit):
        if error.code is None or isinstance(error.code, int):
            return error.code or EXIT_OK, ""
        return EXIT_CHECK_FAILED, str(error.code)
    if isinstance(error, OSError) and error.errno == errno.ENOSPC:
        return EXIT_INPUT, f"dnacheck: cannot write: {error.strerror}"
    hint = "" if debug else "; run with --debug for the traceback"
    what = _one_line(f"{type(error).__name__}: {error}")
    return EXIT_INTERNAL, f"dnacheck: internal error ({what}){hint}"


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _silence_stdout() -> None:
    """Point standard output at nothing, so that the interpreter's last flush does not fail."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (OSError, ValueError):
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - lives as long as the process
