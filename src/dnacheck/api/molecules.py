"""``chain`` and ``rod``: the elastic models of a molecule."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeAlias, get_args

from dnacheck.api.arguments import nearest, one_of, positive_or_none, whole
from dnacheck.model.a_tracts import Region
from dnacheck.model.chain import Chain, StepForm, build_chain
from dnacheck.model.data_files import PARAMETER_SETS
from dnacheck.model.molecules import Molecule, embedded_names
from dnacheck.model.parameters import ParameterSet
from dnacheck.model.rod import Rod, RodOptions, build_rod
from dnacheck.model.sequence import Sequence
from dnacheck.numerics.outcome import InputError

Target: TypeAlias = str | os.PathLike[str] | Molecule | Sequence
Tracts: TypeAlias = str | Iterable[Region]


def molecule(target: Target) -> Molecule:
    """The one molecule that a target names.

    Raises
    ------
    InputError
        It is none, or several.
    """
    from dnacheck.io.sequences import read_target

    if isinstance(target, Molecule):
        return target
    if isinstance(target, Sequence):
        return Molecule(target)
    if not isinstance(target, (str, os.PathLike)):
        raise InputError(
            "target must be the name of an embedded molecule, letters, a path or a Molecule, not "
            f"{type(target).__name__}"
        )
    text = os.fspath(target)
    if not text.strip():
        raise InputError("target is empty; give a name such as 11T15, letters or a FASTA file")
    if isinstance(target, os.PathLike) and not Path(text).exists():
        raise InputError(f"target: there is no file '{text}'; check the path")
    try:
        found = list(read_target(text))
    except InputError as error:
        raise InputError(f"target: {error}{_meant(text)}") from None
    if len(found) != 1:
        raise InputError(
            f"target: '{text}' holds {len(found)} molecules, a chain is of one; use scan, or "
            "letters"
        )
    if isinstance(found[0], InputError):
        raise InputError(f"target: {found[0]}{_meant(text)}")
    return found[0]


def _meant(text: str) -> str:
    """Nearest embedded names, where a name may have been meant."""
    if re.fullmatch(r"\w{1,12}", text) and text.upper().strip("ACGT"):
        return nearest(text, embedded_names())
    return ""


def chain(
    target: Target,
    parameters: str | os.PathLike[str] | ParameterSet = "trifonov2",
    *,
    a_tracts: Tracts = "auto",
    twist_ratio: float | None = None,
    persistence_length_A: float | None = None,
    rise_A: float | None = None,
    step_form: StepForm = "wedge",
    closed: bool = True,
) -> Chain:
    """Discrete chain of a molecule: a ground shape and a stiffness for every base-pair step.

    Parameters
    ----------
    target : str, path, Molecule or Sequence
        Name of an embedded molecule such as ``11T15``, letters read 5' to 3', or a FASTA or
        GenBank file with one record.
    parameters : str, path or ParameterSet
        Name of a set (three angles: trifonov2, trifonov, desantis; six parameters: olson1998 ...)
        or a TOML file with one.
    a_tracts : "auto", "tracts-only", "none", "A..B" or pairs of int
        Steps (0-based, both ends included) that take the set's A-tract twist.
    twist_ratio : float, optional
        K_tau / K_theta, twisting over bending stiffness; 1.5 by default. Not for a set that brings
        stiffnesses of its own.
    persistence_length_A, rise_A : float, optional
        Å; 463 and 3.4 by default. Not for six parameters.
    step_form : {"wedge", "midstep"}
        The paper's step, or its form symmetrised in the strands.
    closed : bool
        Whether the A-tract rule goes on across the first base pair, as in a ring, or stops at the
        ends, as for a loop or a pulled molecule.

    Returns
    -------
    Chain
        ``ground`` (N, 3) in radians and ``stiffness`` (N, 3, 3), or (N, 6) and (N, 6, 6).

    Raises
    ------
    InputError
        One line that names the argument and the mend.

    Examples
    --------
    >>> import dnacheck as dc
    >>> chain = dc.chain("11T15", twist_ratio=1.4)
    >>> chain.n_steps, chain.angle_set, chain.letters[:8]
    (158, 'trifonov2', 'GATGAATT')
    """
    if isinstance(parameters, os.PathLike):
        parameters = os.fspath(parameters)
    if not isinstance(parameters, (str, ParameterSet)):
        raise InputError(f"parameters must be a name, a path or a set, not {parameters!r}")
    one_of("step_form", step_form, [form for form in get_args(StepForm) if form != "rigid"])
    arguments: dict[str, Any] = {
        "twist_ratio": positive_or_none("twist_ratio", twist_ratio),
        "persistence_length_A": positive_or_none("persistence_length_A", persistence_length_A),
        "rise_A": positive_or_none("rise_A", rise_A),
        "a_tracts": a_tracts if isinstance(a_tracts, str) else _regions(a_tracts),
        "step_form": step_form,
        "closed": closed,
    }
    item = molecule(target)
    try:
        return build_chain(item, parameters, **arguments)
    except InputError as error:
        unknown = isinstance(parameters, str) and "is neither" in str(error)
        meant = nearest(parameters, PARAMETER_SETS) if unknown else ""
        raise InputError(f"{error}{meant}") from None


def _regions(a_tracts: Any) -> tuple[Region, ...]:
    try:
        return tuple((int(first), int(last)) for first, last in a_tracts)
    except (TypeError, ValueError):
        raise InputError(
            "a_tracts must be auto, tracts-only, none, A..B or pairs (first, last) of steps, not "
            f"{a_tracts!r}"
        ) from None


def as_chain(target: Chain | Target) -> Chain:
    """A chain as it is; anything else by the default parameters."""
    return target if isinstance(target, Chain) else chain(target)


def rod(
    source: Chain | Target, *, filter_width: int = 15, intervals: int = 20, degree: int = 6
) -> Rod:
    """Continuum rod of a molecule: its filtered centreline as a curved, twisted elastic rod.

    Parameters
    ----------
    source : Chain, or what :func:`dnacheck.chain` takes
    filter_width : int
        Base pairs of the filter, the paper's w.
    intervals, degree : int
        Spline pieces and the degree of their polynomials, the paper's k and m.

    Returns
    -------
    Rod

    Raises
    ------
    InputError
        Six-parameter steps, which the rod does not know, or a number out of its range.

    Examples
    --------
    >>> import dnacheck as dc
    >>> rod = dc.rod(dc.chain("11T15"))
    >>> rod.n_steps, round(rod.relaxed_turns, 1)
    (158, 15.2)
    """
    options = RodOptions(
        filter_width=whole("filter_width", filter_width, 1),
        intervals=whole("intervals", intervals, 1),
        degree=whole("degree", degree, 1),
    )
    return build_rod(as_chain(source), options)
