"""``dnacheck compile``: compile the kernels ahead of their first use."""

from __future__ import annotations

import click

from dnacheck.commands.common import RunSettings, common_options
from dnacheck.commands.output import note, print_json


@click.command(epilog="Example:  dnacheck compile --rings")
@click.option("--rings", is_flag=True, help="Only what `dnacheck ring` needs.")
@common_options
def command(rings: bool, run: RunSettings) -> int | None:
    """Compile the kernels that rings, J factors, scans and diagrams use.

    Kernels are otherwise compiled when they are first used; either way they are kept, and compiled
    again only after an update. What is compiled already is loaded and takes seconds.
    """
    import time

    from dnacheck.commands.ahead import JOBS, RING
    from dnacheck.commands.compiling import compile_ahead

    names = RING if rings else tuple(JOBS)
    note(f"compiling in {min(run.threads, len(names))} processes", run.quiet)
    began = time.perf_counter()
    compiled = compile_ahead(names, run.threads, run.quiet)
    if run.json:
        seconds = time.perf_counter() - began
        print_json({"jobs": list(names), "kernels": compiled, "seconds": seconds})
    return None
