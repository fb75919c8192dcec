"""``dnacheck jfactor``: the cyclization probability of a molecule."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

import click

from dnacheck.commands.common import (
    LinkChoice,
    ModelSettings,
    PositiveNumber,
    RunSettings,
    common_options,
    model_options,
    target_argument,
)
from dnacheck.commands.output import note, print_json, progress

if TYPE_CHECKING:
    from collections.abc import Callable

    from dnacheck.cyclization.result import JFactor
    from dnacheck.equilibria.discrete.search import RingSearch

EXIT_NOT_CONVERGED = 3
METHODS = (
    "auto",
    "laplace",
    "register-laplace",
    "corrected-laplace",
    "closure",
    "half-chain",
    "metropolis",
)


@click.command(epilog="Example:  dnacheck jfactor 08T15 --tolerance 0.02")
@target_argument
@click.option(
    "--method",
    type=click.Choice(METHODS),
    default="auto",
    show_default=True,
    help="auto takes the cheapest method whose measured error meets the tolerance.",
)
@click.option(
    "--tolerance",
    type=PositiveNumber(),
    default=0.02,
    show_default=True,
    help="Standard error wanted on ln J.",
)
@click.option(
    "--max-seconds",
    type=PositiveNumber(),
    default=None,
    help="Stop after this time with the best so far (exit code 3).",
)
@click.option(
    "--link", type=LinkChoice(), default="auto", show_default=True, help="Links to search."
)
@model_options
@common_options
def command(
    target: str,
    method: str,
    tolerance: float,
    max_seconds: float | None,
    link: Any,
    model: ModelSettings,
    run: RunSettings,
) -> int | None:
    """J factor of TARGET: the molar density of exact closure, entropy included, nothing fitted.

    -ln J is the free energy of cyclization over RT.
    """
    from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
    from dnacheck.model.chain import build_chain
    from dnacheck.model.molecules import read_target
    from dnacheck.numerics.outcome import InputError, SolveError

    records: list[dict[str, Any]] = []
    good = True
    limit = math.inf if max_seconds is None else max_seconds
    for molecule in read_target(target):
        if isinstance(molecule, InputError):
            raise molecule
        began = time.perf_counter()
        chain = build_chain(molecule, **model.chain_arguments())
        search = find_rings(chain, SearchOptions(links=link))
        with progress(f"{chain.name}: draws", None, run.quiet or run.json) as advance:
            try:
                result, reason = _computed(search, method, tolerance, limit, run, advance)
            except SolveError as error:
                if run.json and not records:
                    raise
                note(str(error), run.quiet)
                good = False
                records.append(_failure(chain.name, chain.n_steps, method, error, began))
                continue
        record = result.to_json()
        if reason:
            record["reason"] = reason
        records.append(record)
        good = good and (result.status.ok or method in ("laplace", "register-laplace"))
        if not run.json:
            _print(result, reason)
            for warning in result.warnings:
                note(f"{chain.name}: {warning}", run.quiet)
    if run.json:
        print_json(records[0] if len(records) == 1 else {"results": records})
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


def _computed(
    search: RingSearch,
    method: str,
    tolerance: float,
    limit: float,
    run: RunSettings,
    advance: Callable[[int], None],
) -> tuple[JFactor, str]:
    """The J factor by the method asked for, and why that method if it was chosen."""
    made = 0

    def drawn(total: int) -> None:
        nonlocal made
        advance(total - made)
        made = total

    if method == "auto":
        from dnacheck.cyclization.automatic import choose

        choice = choose(search, tolerance, limit, run.seed, run.threads, drawn)
        return choice.result, choice.reason
    if method == "laplace":
        from dnacheck.cyclization.laplace.isolated import laplace

        return laplace(search), ""
    if method == "register-laplace":
        from dnacheck.cyclization.laplace.register import register_laplace

        return register_laplace(search), ""
    if method == "corrected-laplace":
        from dnacheck.cyclization.laplace.anharmonic import AnharmonicOptions, corrected_laplace

        return corrected_laplace(search, AnharmonicOptions(tolerance=tolerance), run.seed), ""
    if method == "closure":
        from dnacheck.cyclization.closure.sampling import ClosureOptions, ClosureSampler
        from dnacheck.cyclization.laplace.register import register_profile

        options = ClosureOptions(tolerance=tolerance, max_seconds=limit, threads=run.threads)
        return ClosureSampler(register_profile(search), options, run.seed).sample(drawn), ""
    if method == "half-chain":
        from dnacheck.cyclization.automatic import half_chains_to_tolerance

        return half_chains_to_tolerance(search, tolerance, limit, run.seed, run.threads), ""
    from dnacheck.cyclization.automatic import metropolis_to_tolerance

    return metropolis_to_tolerance(search, tolerance, limit, run.seed, run.threads), ""


def _print(result: JFactor, reason: str) -> None:
    """The result for a reader."""
    text = f"{result.target}: -ln J = {result.minus_lnJ:.4f}"
    if result.stderr > 0.0:
        text += f" ± {result.stderr:.4f}"
    if result.bias_bound:
        text += f", bias at most {result.bias_bound:.1g}"
    print(f"{text}; J = {result.J_molar:.3g} M ({result.method}, {result.n_bp} bp)")
    for share in result.links:
        error = f" ± {share.stderr:.3f}" if share.stderr > 0.0 else ""
        print(f"  link {share.link}: -ln J = {share.minus_lnJ:.3f}{error}")
    if result.effective_samples is not None:
        print(
            f"  {result.samples} draws, {result.effective_samples:.0f} effective, "
            f"{result.seconds:.2f} s"
        )
    if reason:
        print(f"  {reason}")
    if not result.status.ok:
        print(f"  {result.status.value}")
