"""Options that the commands share, each group gathered into one frozen object.

A command is written ::

    @click.command()
    @target_argument
    @model_options
    @common_options
    def command(target: str, model: ModelSettings, run: RunSettings) -> int | None: ...
"""

from __future__ import annotations

import functools
import importlib
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal, TypeVar

import click

from dnacheck.commands import option_types as allowed
from dnacheck.commands.option_types import Count, LinkChoice, Number, StepRange
from dnacheck.model import ranges
from dnacheck.model.data_files import PARAMETER_SETS
from dnacheck.numerics.processors import available_processors

Function = TypeVar("Function", bound=Callable[..., Any])


@dataclass(frozen=True)
class RunSettings:
    """How to run and how to report, as given by ``--json --seed --threads --quiet --debug``."""

    json: bool
    """One JSON object on standard output and nothing else there."""
    seed: int
    """Seed of every random stream of the run."""
    threads: int
    """Threads to use, at least 1; no result depends on it."""
    quiet: bool
    """No progress bar and no notes on standard error."""
    debug: bool
    """Show the traceback of an error."""


@dataclass(frozen=True)
class ModelSettings:
    """Which elastic chain is meant."""

    angles: str
    """Name of a parameter set, or path of a file with one."""
    twist_ratio: float | None
    """Twisting over bending stiffness, K_tau / K_theta; None leaves it to the set, or 1.5."""
    persistence_length: float | None
    """Å; None for 463."""
    rise: float | None
    """Å per base-pair step; None for 3.4, or what a set with six parameters brings."""
    a_tracts: Literal["auto", "tracts-only", "none"] | tuple[int, int]
    """Steps with the A-tract twist: by a rule, none, or first and last (0-based, included)."""
    step_form: Literal["wedge", "midstep"] = "wedge"
    """How three angles make a step: as the paper's wedge, or symmetric in the strands."""

    def chain_arguments(self) -> dict[str, Any]:
        """Keyword arguments of :func:`dnacheck.chain`."""
        return {
            "parameters": self.angles,
            "twist_ratio": self.twist_ratio,
            "persistence_length_A": self.persistence_length,
            "rise_A": self.rise,
            "a_tracts": self.a_tracts if isinstance(self.a_tracts, str) else (self.a_tracts,),
            "step_form": self.step_form,
        }

    def build_arguments(self) -> dict[str, Any]:
        """Keyword arguments of :func:`dnacheck.model.chain.build_chain`."""
        arguments = self.chain_arguments()
        return {"angles": arguments.pop("parameters"), **arguments}


@dataclass(frozen=True)
class RingSettings:
    """Which rings are sought."""

    model: Literal["continuum", "discrete", "both"]
    link: Literal["auto", "all"] | int
    ends: str
    """What the end is held to: ring, nicked or hinged."""


@dataclass(frozen=True)
class ContinuumSettings:
    """How the continuum rod is made: the paper's w, k and m."""

    filter_width: int
    """Base pairs, w."""
    intervals: int
    """Spline pieces, k."""
    degree: int
    """Of the polynomials, m."""

    def rod_arguments(self) -> dict[str, int]:
        """Keyword arguments of :func:`dnacheck.rod`."""
        return asdict(self)


def limit_library_threads(threads: int) -> None:
    """Tell libraries that are not loaded yet to use at most so many threads."""
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = str(threads)


def _threads(ctx: click.Context, param: click.Parameter, value: int | None) -> int:
    if value is None:
        return available_processors()
    limit_library_threads(value)
    return value


def _gathered(
    function: Function, argument: str, settings: type, options: list[Callable[[Any], Any]]
) -> Function:
    """Add the options to a command function and pass them as one settings object."""
    names = [field.name for field in fields(settings)]

    @functools.wraps(function)
    def call(**values: Any) -> Any:
        values[argument] = settings(**{name: values.pop(f"{argument}__{name}") for name in names})
        return function(**values)

    decorated: Any = call
    for option in reversed(options):
        decorated = option(decorated)
    return decorated


target_argument = click.argument("target", metavar="TARGET")


def _announced(function: Function) -> Function:
    """Tell the user of a command when it has to compile first."""

    @functools.wraps(function)
    def call(run: RunSettings, **values: Any) -> Any:
        # Loads the compiler, which the start-up of the command line must not.
        announced = importlib.import_module("dnacheck.commands.compiling").announced
        name = click.get_current_context().info_name or ""
        with announced(name, run.threads, run.quiet):
            return function(run=run, **values)

    wrapped: Any = call
    return wrapped


def common_options(function: Function) -> Function:
    """Give a command ``--json --seed --threads --quiet --debug``; it receives ``run``.

    Where kernels must be compiled, it is said on standard error.
    """
    return _gathered(
        _announced(function),
        "run",
        RunSettings,
        [
            click.option(
                "--json",
                "run__json",
                is_flag=True,
                help="Print one JSON object on standard output and nothing else.",
            ),
            click.option(
                "--seed",
                "run__seed",
                type=Count(allowed.SEED),
                default=0,
                show_default=True,
                help="Seed of the random numbers.",
            ),
            click.option(
                "--threads",
                "run__threads",
                type=Count(allowed.THREADS),
                default=None,
                callback=_threads,
                help="Threads to use; results do not depend on it.  [default: all processors]",
            ),
            click.option("--quiet", "run__quiet", is_flag=True, help="No progress, no notes."),
            click.option(
                "--debug", "run__debug", is_flag=True, help="Show the traceback of an error."
            ),
        ],
    )


def model_options(function: Function) -> Function:
    """Give a command the options of the elastic chain; it receives ``model``."""
    return _gathered(
        function,
        "model",
        ModelSettings,
        [
            click.option(
                "--parameters",
                "--angles",
                "model__angles",
                metavar=f"{'|'.join(PARAMETER_SETS)}|FILE",
                default=PARAMETER_SETS[0],
                show_default=True,
                help="Parameters of the base-pair steps: a set, or a TOML file with one.",
            ),
            click.option(
                "--twist-ratio",
                "model__twist_ratio",
                type=Number(ranges.TWIST_RATIO),
                default=None,
                help="Twisting over bending stiffness.  [default: 1.5, or the set's own]",
            ),
            click.option(
                "--persistence-length",
                "model__persistence_length",
                type=Number(ranges.PERSISTENCE_LENGTH_A),
                default=None,
                help="In Å.  [default: 463, or what six parameters bring]",
            ),
            click.option(
                "--rise",
                "model__rise",
                type=Number(ranges.RISE_A),
                default=None,
                help="In Å per base-pair step.  [default: 3.4, or what six parameters bring]",
            ),
            click.option(
                "--a-tracts",
                "model__a_tracts",
                type=StepRange(),
                default="auto",
                show_default=True,
                help="Steps with the A-tract twist, 0-based, both ends included.",
            ),
            click.option(
                "--step-form",
                "model__step_form",
                type=click.Choice(["wedge", "midstep"]),
                default="wedge",
                show_default=True,
                help="How three angles make a step: the paper's wedge, whose values depend on "
                "the strand that is read, or the mid-step form, which knows no strand.",
            ),
        ],
    )


def ends_option(name: str) -> Callable[[Function], Function]:
    """``--ends``, which a command receives as ``name``."""
    return click.option(
        "--ends",
        name,
        type=click.Choice(["ring", "nicked", "hinged"]),
        default="ring",
        show_default=True,
        help="How the end meets the start: closed, free to turn about its axis, or in any way.",
    )


def bind_option(function: Function) -> Function:
    """Give a command ``--bind``; it receives ``bind``, a tuple of SITE=SOURCE."""
    return click.option(
        "--bind",
        "bind",
        metavar="SITE=FILE",
        multiple=True,
        help="Hold steps at a bound protein's values: SITE is the step, from 0, that is its step "
        "0; FILE a 3DNA .par file, a TOML file, a bundled guest (cap, nucleosome) or a kink such "
        "as roll=40@-5,5. May be given more than once.",
    )(function)


def ring_options(function: Function) -> Function:
    """Give a command ``--model``, ``--link`` and ``--ends``; it receives ``ring``."""
    return _gathered(
        function,
        "ring",
        RingSettings,
        [
            click.option(
                "--model",
                "ring__model",
                type=click.Choice(["continuum", "discrete", "both"]),
                default="both",
                show_default=True,
                help="Which equilibria to compute.",
            ),
            click.option(
                "--link",
                "ring__link",
                type=LinkChoice(),
                default="auto",
                show_default=True,
                help="Links to search.",
            ),
            ends_option("ring__ends"),
        ],
    )


def continuum_options(function: Function) -> Function:
    """Give a command ``--filter-width --intervals --degree``; it receives ``continuum``."""
    return _gathered(
        function,
        "continuum",
        ContinuumSettings,
        [
            click.option(
                "--filter-width",
                "continuum__filter_width",
                type=Count(allowed.FILTER_WIDTH),
                default=15,
                show_default=True,
                help="Width of the filter, base pairs.",
            ),
            click.option(
                "--intervals",
                "continuum__intervals",
                type=Count(allowed.INTERVALS),
                default=20,
                show_default=True,
                help="Pieces of the spline.",
            ),
            click.option(
                "--degree",
                "continuum__degree",
                type=Count(allowed.DEGREE),
                default=6,
                show_default=True,
                help="Degree of the spline.",
            ),
        ],
    )
