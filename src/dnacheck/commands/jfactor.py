"""``dnacheck jfactor``: the cyclization probability of a molecule."""

from __future__ import annotations

import math
import time
from functools import partial
from typing import TYPE_CHECKING, Any

import click

import dnacheck as dc
from dnacheck.commands import option_types as allowed
from dnacheck.commands.binding import with_guests
from dnacheck.commands.common import (
    ModelSettings,
    RunSettings,
    bind_option,
    common_options,
    ends_option,
    model_options,
    target_argument,
)
from dnacheck.commands.option_types import LinkChoice, Number
from dnacheck.commands.other_strand import other_strand_chain, other_strand_option, remark
from dnacheck.commands.output import note, print_json, progress
from dnacheck.commands.time_limit import within
from dnacheck.cyclization.methods import METHODS, method_named

if TYPE_CHECKING:
    from dnacheck.cyclization.binding import Binding
    from dnacheck.cyclization.result import JFactor
    from dnacheck.model.chain import Chain

EXIT_BAD_INPUT = 2
EXIT_NOT_CONVERGED = 3


@click.command(epilog="Example:  dnacheck jfactor 08T15 --tolerance 0.02")
@target_argument
@click.option(
    "--method",
    type=click.Choice(list(METHODS)),
    default="auto",
    show_default=True,
    help="auto takes the cheapest method whose measured error meets the tolerance.",
)
@click.option(
    "--tolerance",
    type=Number(allowed.TOLERANCE),
    default=0.02,
    show_default=True,
    help="Standard error wanted on ln J.",
)
@click.option(
    "--max-seconds",
    type=Number(allowed.SECONDS),
    default=None,
    help="Stop this long after the start with the best so far (exit code 3).",
)
@click.option(
    "--link", type=LinkChoice(), default="auto", show_default=True, help="Links to search."
)
@ends_option("ends")
@other_strand_option
@model_options
@bind_option
@common_options
def command(
    target: str,
    method: str,
    tolerance: float,
    max_seconds: float | None,
    link: Any,
    ends: str,
    both_strands: bool,
    model: ModelSettings,
    bind: tuple[str, ...],
    run: RunSettings,
) -> int | None:
    """J factor of TARGET: the molar density of exact closure, entropy included, nothing fitted.

    -ln J is the free energy of cyclization over RT. With nicked ends J is the density of closure in
    place and axis, with hinged ends in place alone.
    """
    from dnacheck.io.sequences import read_target
    from dnacheck.model.ranges import check_link
    from dnacheck.numerics.outcome import InputError, SolveError, TimeLimitReachedError

    records: list[dict[str, Any]] = []
    good = True
    way = method_named(method)
    molecules = list(read_target(target))
    if len(molecules) == 1 and isinstance(molecules[0], InputError):
        raise molecules[0]
    refused = False

    def compute(chain: Chain, left: float) -> tuple[JFactor, Binding | None]:
        searching = time.perf_counter()
        with progress(f"{chain.name}: draws", None, run.quiet or run.json) as advance:
            result = dc.jfactor(
                chain,
                way,
                link=link,
                ends=ends,
                rng=run.seed,
                threads=run.threads,
                progress=advance,
                tolerance=tolerance,
                # A bound molecule leaves half of the time to the free one.
                max_seconds=left * (0.5 if chain.guests else 1.0),
            )
        if not chain.guests:
            return result, None
        from dnacheck.cyclization.binding import binding
        from dnacheck.cyclization.method import Run
        from dnacheck.equilibria.boundary import ENDS
        from dnacheck.equilibria.discrete.search import SearchOptions

        rest = max(left - (time.perf_counter() - searching), 1e-3)
        asked = Run(run.seed, run.threads, None, tolerance, rest)
        options = SearchOptions(links=link)
        return result, binding(chain, way, asked, options, result, ENDS[ends])

    for molecule in molecules:
        if isinstance(molecule, InputError):
            note(str(molecule))
            refused = True
            continue
        began = time.perf_counter()
        chain = with_guests(dc.chain(molecule, **model.chain_arguments()), bind)
        check_link(link, chain.n_steps)

        try:
            result, linkage = within(max_seconds, partial(compute, chain))
        except (SolveError, TimeLimitReachedError) as error:
            if run.json and len(molecules) == 1:
                raise
            note(str(error), run.quiet)
            good = False
            records.append(_failure(chain.name, chain.n_steps, method, error, began))
            continue
        record = {**result.to_dict(), "step_form": chain.step_form, "other_strand": None}
        records.append(record)
        good = good and (result.status.ok or not way.measures_error)
        if linkage is not None:
            record["binding"] = linkage.to_dict()
            good = good and (linkage.free.status.ok or not way.measures_error)
        if not run.json:
            _print(result)
            if linkage is not None:
                _print_binding(linkage)
            for warning in result.warnings:
                note(f"{chain.name}: {warning}", run.quiet)
        other = other_strand_chain(molecule, chain, model) if both_strands else None
        if other is None:
            continue
        try:
            across, _ = within(max_seconds, partial(compute, other))
        except (SolveError, TimeLimitReachedError) as error:
            record["warnings"].append(f"other strand: {error}")
            note(f"{chain.name}: other strand: {error}", run.quiet)
            continue
        record["other_strand"] = {"minus_lnJ": across.minus_lnJ, "stderr": across.stderr}
        if not run.json:
            error_bar = f" ± {across.stderr:.4f}" if across.stderr > 0.0 else ""
            print(f"  {remark(molecule, f'-ln J = {across.minus_lnJ:.4f}{error_bar}')}")
    if run.json:
        print_json(records[0] if len(molecules) == 1 else {"results": records})
    if refused:
        return EXIT_BAD_INPUT
    return None if good else EXIT_NOT_CONVERGED


def _failure(name: str, n_bp: int, method: str, error: Exception, began: float) -> dict[str, Any]:
    """Record of a molecule without a J factor."""
    return {
        "target": name,
        "n_bp": n_bp,
        "method": method,
        "minus_lnJ": None,
        "stderr": None,
        "J_molar": None,
        "links": [],
        "effective_samples": None,
        "seconds": time.perf_counter() - began,
        "warnings": [" ".join(str(error).split())],
    }


def _print_binding(linkage: Binding) -> None:
    """What binding does to the ring, for a reader."""
    names = ", ".join(f"{name} at site {site}" for name, site in linkage.guests)
    low, high = (math.exp(linkage.ln_ratio + sign * linkage.stderr) for sign in (-1.0, 1.0))
    print(f"  bound: {names}")
    print(f"  free molecule: -ln J = {linkage.free.minus_lnJ:.3f} ± {linkage.free.stderr:.3f}")
    print(
        f"  binding constant, ring over linear: {linkage.ratio:.4g} ({low:.4g} to {high:.4g}); "
        f"ln {linkage.ln_ratio:.3f} ± {linkage.stderr:.3f}"
    )
    print(
        f"  middle of the ring from the major groove at the site: {linkage.facing_free_deg:.0f}° "
        f"free, {linkage.facing_bound_deg:.0f}° bound ({linkage.register_change_deg:+.0f}°)"
    )


def _print(result: JFactor) -> None:
    """The result for a reader."""
    print(result)
    for share in result.links:
        error = f" ± {share.stderr:.3f}" if share.stderr > 0.0 else ""
        print(f"  link {share.link}: -ln J = {share.minus_lnJ:.3f}{error}")
    if result.effective_samples is not None:
        print(
            f"  {result.samples} draws, {result.effective_samples:.0f} effective, "
            f"{result.seconds:.2f} s"
        )
    if result.reason:
        print(f"  {result.reason}")
    if not result.status.ok:
        print(f"  {result.status.value}")
