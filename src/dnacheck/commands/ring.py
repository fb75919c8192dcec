"""``dnacheck ring``: ring equilibria of one molecule or of every record of a FASTA file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import dnacheck as dc
from dnacheck.commands.binding import with_guests
from dnacheck.commands.common import (
    ContinuumSettings,
    ModelSettings,
    RingSettings,
    RunSettings,
    bind_option,
    common_options,
    continuum_options,
    model_options,
    ring_options,
    target_argument,
)
from dnacheck.commands.other_strand import other_strand_chain, other_strand_option, remark
from dnacheck.commands.output import note, print_json, progress

if TYPE_CHECKING:
    from dnacheck.equilibria.ring import Equilibrium
    from dnacheck.model.chain import Chain
    from dnacheck.model.molecules import Molecule

    Found = tuple[Chain, Equilibrium | None, Equilibrium | None]

EXIT_BAD_INPUT = 2
EXIT_NOT_CONVERGED = 3
# Minima this close to the lowest, in RT, share the molecule with it.
_CLOSE_RT = 1.0
# Below this, in RT per square radian, the softest motion of a ring swings by more than half a
# radian at room temperature, and its energy alone says little about J.
_SOFT_RT = 5.0


@click.command(epilog="Example:  dnacheck ring 11T15 --structure ring.pdb")
@target_argument
@click.option(
    "--structure",
    type=click.Path(path_type=Path, dir_okay=False),
    default=None,
    help="Write the lowest ring as a .pdb, .gro or .cif file, or one of these and .gz.",
)
@other_strand_option
@model_options
@ring_options
@continuum_options
@bind_option
@common_options
def command(
    target: str,
    structure: Path | None,
    both_strands: bool,
    model: ModelSettings,
    ring: RingSettings,
    continuum: ContinuumSettings,
    bind: tuple[str, ...],
    run: RunSettings,
) -> int | None:
    """Closed rings of TARGET: energies, link, writhe and stability, lowest first.

    TARGET is an embedded molecule such as 11T15, a sequence of A, C, G, T, or a FASTA file. The
    discrete base-pair model and the continuum rod are solved independently and compared.
    """
    from dnacheck.io.sequences import read_target
    from dnacheck.numerics.outcome import InputError

    molecules = list(read_target(target))
    good = [molecule for molecule in molecules if not isinstance(molecule, InputError)]
    if structure is not None and len(molecules) > 1:
        raise InputError(
            f"--structure: '{target}' holds {len(molecules)} records; give one molecule"
        )
    if len(molecules) == 1 and isinstance(molecules[0], InputError):
        raise molecules[0]
    records: list[dict[str, Any]] = []
    complete = True
    with progress("rings", len(good), run.quiet) as advance:
        for molecule in molecules:
            if isinstance(molecule, InputError):
                note(str(molecule))
                continue
            record, converged, found = _solve(molecule, structure, model, ring, continuum, bind)
            other = other_strand_chain(molecule, found[0], model) if both_strands else None
            record["other_strand"] = None if other is None else _lowest(other, ring, continuum)
            complete = complete and converged
            records.append(record)
            advance(1)
            if not run.json:
                _print(record)
                if other is not None:
                    print(remark(molecule, _energy(record["other_strand"])))
            for warning in record["warnings"]:
                # Why there is no ring is the answer, not a remark.
                note(f"{record['target']}: {warning}", run.quiet and converged)
    if run.json:
        print_json(records[0] if len(molecules) == 1 else {"target": target, "molecules": records})
    if structure is not None:
        _write(structure, *found)
    if len(good) < len(molecules):
        return EXIT_BAD_INPUT
    return None if complete else EXIT_NOT_CONVERGED


def _solve(
    molecule: Molecule,
    structure: Path | None,
    model: ModelSettings,
    ring: RingSettings,
    continuum: ContinuumSettings,
    bind: tuple[str, ...],
) -> tuple[dict[str, Any], bool, Found]:
    """The JSON record of one molecule, whether every model asked for converged, and its rings."""
    from dnacheck.model.ranges import check_link

    chain = with_guests(dc.chain(molecule, **model.chain_arguments()), bind)
    check_link(ring.link, chain.n_steps)
    if structure is not None:
        from dnacheck.io.structure import structure_file

        structure_file(structure, chain.n_steps, chain.rise_A)
    warnings = list(chain.warnings)
    if chain.rigid and ring.model == "both":
        warnings.append("continuum: left out, for steps of six parameters have none yet")
        ring = replace(ring, model="discrete")
    if chain.guests:
        ring = _without_continuum(ring, warnings)
    if ring.ends != "ring":
        ring = _discrete_only(ring, warnings)
    equilibria: list[dict[str, Any]] = []
    smooth = discrete = None
    converged = True
    if ring.model in ("continuum", "both"):
        smooth, entries = _continuum(chain, ring, continuum, warnings)
        equilibria += entries
        converged = smooth is not None
    if ring.model in ("discrete", "both"):
        discrete, entries = _discrete(chain, ring, warnings)
        equilibria += entries
        converged = converged and discrete is not None
    comparison = None
    if smooth is not None and discrete is not None:
        comparison = {
            "energy_difference_percent": 100.0 * (smooth.energy / discrete.energy - 1.0),
            "rms_A": smooth.rms_difference_A(discrete),
        }
    record = {
        "target": molecule.name,
        "n_bp": chain.n_steps,
        "angles": chain.angle_set,
        "twist_ratio": chain.twist_ratio,
        "persistence_length_A": None if chain.rigid else chain.persistence_length_A,
        "rise_A": chain.rise_A,
        "strand": chain.letters,
        "guests": [
            {"name": guest.name, "site": guest.site, "steps": list(guest.steps)}
            for guest in chain.guests
        ],
        "step_form": chain.step_form,
        "equilibria": equilibria,
        "comparison": comparison,
        "warnings": warnings,
    }
    return record, converged, (chain, smooth, discrete)


def _without_continuum(ring: RingSettings, warnings: list[str]) -> RingSettings:
    """The settings for a chain with guests, which the continuum rod does not know."""
    from dnacheck.numerics.outcome import InputError

    if ring.model == "continuum":
        raise InputError("--model continuum: the rod holds no guests; give --model discrete")
    if ring.model == "both":
        warnings.append("continuum: left out, for the rod holds no guests")
    return replace(ring, model="discrete")


def _lowest(
    chain: Chain, ring: RingSettings, continuum: ContinuumSettings
) -> dict[str, Any] | None:
    """Energy and link of the lowest ring of the other strand, discrete unless only the rod's."""
    warnings: list[str] = []
    if ring.model == "continuum":
        lowest, _ = _continuum(chain, ring, continuum, warnings)
    else:
        lowest, _ = _discrete(chain, ring, warnings)
    if lowest is None:
        return None
    entry = lowest.to_dict()
    return {key: entry[key] for key in ("model", "energy_RT", "link")}


def _energy(lowest: dict[str, Any] | None) -> str:
    if lowest is None:
        return "no ring was found"
    link = "" if lowest["link"] is None else f", link {lowest['link']}"
    return f"{lowest['energy_RT']:.4f} RT, {lowest['model']}{link}"


def _discrete_only(ring: RingSettings, warnings: list[str]) -> RingSettings:
    """The settings for ends that the continuum rod does not know."""
    from dnacheck.numerics.outcome import InputError

    if ring.model == "continuum":
        raise InputError(
            f"--model continuum: the rod is closed to a ring alone; give --model discrete for "
            f"--ends {ring.ends}"
        )
    if isinstance(ring.link, int):
        raise InputError(
            f"--link {ring.link}: {ring.ends} ends are free to turn and have no link; leave it out"
        )
    if ring.model == "both":
        warnings.append(f"continuum: left out, for the rod has no {ring.ends} ends yet")
    return replace(ring, model="discrete")


def _discrete(
    chain: Chain, ring: RingSettings, warnings: list[str]
) -> tuple[Equilibrium | None, list[dict[str, Any]]]:
    found = dc.rings(chain, ring.link, ring.ends, throw=False)
    if found.failed_starts:
        warnings.append(
            f"discrete: {found.failed_starts} of {found.starts} starts did not converge; "
            "minima may be missing"
        )
    warnings += [f"discrete: {text}" for text in found.notes]
    if not found.equilibria:
        if not found.notes:
            warnings.append(f"discrete: {found.reason}")
        return None, []
    entries = [item.to_dict() for item in found]
    lowest = found.lowest
    close = [e for e in entries[1:] if e["energy_RT"] - lowest.energy_RT < _CLOSE_RT]
    if close:
        links = ", ".join(str(entry["link"]) for entry in close if entry["link"] is not None)
        warnings.append(
            f"discrete: {len(close)} more minima within {_CLOSE_RT:g} RT of the lowest"
            + (f" (link {links})" if links else "")
            + "; all of them count for J"
        )
    if lowest.softest * chain.energy_scale_RT < _SOFT_RT:
        warnings.append(
            "discrete: the softest motion of the ring, its register, costs almost no energy; use "
            "dnacheck jfactor, which integrates over it"
        )
    return lowest, entries


def _continuum(
    chain: Chain, ring: RingSettings, continuum: ContinuumSettings, warnings: list[str]
) -> tuple[Equilibrium | None, list[dict[str, Any]]]:
    rod = dc.rod(chain, **continuum.rod_arguments())
    warnings += [f"continuum: {text}" for text in rod.warnings]
    found = dc.rings(rod, ring.link, throw=False)
    warnings += [f"continuum: {text}" for text in found.notes]
    entries = [item.to_dict() for item in found]
    if not found.minima:
        warnings.append(f"continuum: {found.reason}")
        return None, entries
    return found.lowest, entries


def _write(
    path: Path, chain: Chain, smooth: Equilibrium | None, discrete: Equilibrium | None
) -> None:
    from dnacheck.numerics.outcome import SolveError

    lowest = smooth if discrete is None else discrete
    if lowest is None:
        raise SolveError(f"{chain.name}: no ring converged, so '{path}' was not written")
    lowest.write(path)


def _print(record: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    ratio = record["twist_ratio"]
    stiffness = "own stiffness" if ratio is None else f"twist ratio {ratio:g}"
    title = f"{record['target']}: {record['n_bp']} bp, {record['angles']} angles, {stiffness}"
    table = Table(title=Text(title), title_justify="left", box=None, pad_edge=False)
    for head in ("model", "energy/RT", "reduced", "bend/RT", "twist/RT", "link", "writhe"):
        table.add_column(head, justify="left" if head == "model" else "right")
    table.add_column("stable")
    table.add_column("residual", justify="right")
    for item in record["equilibria"]:
        stable = {True: "yes", False: "saddle", None: "unknown"}[item["stable"]]
        table.add_row(
            item["model"],
            f"{item['energy_RT']:.4f}",
            f"{item['energy_reduced']:.6f}",
            f"{item['bend_RT']:.4f}",
            f"{item['twist_RT']:.4f}",
            "-" if item["link"] is None else str(item["link"]),
            f"{item['writhe']:+.4f}",
            stable,
            f"{item['residual']:.0e}",
        )
    # No column may be cut where the output is not a terminal, or a narrow one.
    console = Console(highlight=False, soft_wrap=True, width=120)
    console.print(table)
    for guest in record["guests"]:
        held = len(guest["steps"])
        console.print(f"bound: {guest['name']} at site {guest['site']}, {held} steps held")
    if record["comparison"] is not None:
        gap = record["comparison"]["energy_difference_percent"]
        rms = record["comparison"]["rms_A"]
        console.print(f"lowest continuum - discrete: {gap:+.3f} % in energy, rms {rms:.3f} Å")
