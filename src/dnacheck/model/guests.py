"""Bound proteins and other rigid inserts: steps of a chain held at given values.

A guest holds some steps at the values that it brings; the rest of the chain stays elastic. Its
steps are numbered from the site, the step of the chain that is the guest's step 0, and are counted
on across the joint of a ring.
"""

from __future__ import annotations

import math
import re
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.model.chain import Chain, Guest, angles_of_frames, chain_frames
from dnacheck.model.chain_kernels import BOUND_STIFFNESS
from dnacheck.model.data_files import data_directory
from dnacheck.model.rigid_kernels import RIGID_COORDINATES
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

_ANGLES = ("twist", "tilt", "roll")
_MOST_STEPS = 100_000
_FEWEST_FREE = 4
"""Elastic steps that a ring needs at least: six components to close, and some to give way."""

# Directors d1, d2, d3 of three-angle steps along x, y, z of six parameters (docs/theory).
_HINGE_DIRECTORS = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class GuestSteps:
    """The steps that a guest brings.

    Attributes
    ----------
    name, citation : str
    offsets : tuple of int
        Which step each row of ``values`` is, from the site; may be negative.
    values : ndarray, shape (n, 6)
        Twist, tilt, roll in radians and shift, slide, rise in Å, as in
        ``RIGID_COORDINATES``. NaN where the chain's own unstressed value stays.
    """

    name: str
    offsets: tuple[int, ...]
    values: Array
    citation: str = ""


def bind(chain: Chain, site: int, steps: GuestSteps | str | Path | ArrayLike) -> Chain:
    """The chain with a guest bound: its steps are held at the guest's values.

    Parameters
    ----------
    chain : Chain
        May hold other guests already.
    site : int
        Step of the chain, from 0, that is the guest's step 0.
    steps : GuestSteps, str, path or array_like
        A kink such as ``"roll=40@5,6"`` (degrees and Å, at steps counted from the site); a
        3DNA ``.par`` file or a TOML file with a list of steps; the name of a bundled guest; or
        numbers (n, 6): twist, tilt, roll in radians and shift, slide, rise in Å. Three-angle
        steps take the rotation of a step and keep their own rise.

    Returns
    -------
    Chain
        Its rings, J factors and coordinates have all base pairs, those of the guest included.

    Raises
    ------
    InputError
        A site outside the chain, a step held twice, a file that cannot be read, or too few
        elastic steps left.

    Examples
    --------
    >>> import dnacheck as dc
    >>> bound = dc.bind(dc.chain("11T15"), 60, "cap")
    >>> [guest.name for guest in bound.guests], bound.n_free < bound.n_steps
    (['CAP'], True)
    """
    guest = guest_steps(steps)
    n = chain.n_steps
    if isinstance(site, bool) or not isinstance(site, int | np.integer):
        raise InputError(f"bind: site must be a step number, not {site!r}")
    site = int(site)
    if not 0 <= site < n:
        raise InputError(f"bind: site {site} lies outside the steps 0..{n - 1} of {chain.name}")
    if len(guest.offsets) > n:
        raise InputError(
            f"bind: {guest.name} has {len(guest.offsets)} steps and {chain.name} only {n}"
        )
    span = max(guest.offsets) - min(guest.offsets) + 1
    if span > n:
        raise InputError(f"bind: {guest.name} spans {span} steps and {chain.name} has only {n}")
    held = [(site + offset) % n for offset in guest.offsets]
    for step in held:
        for other in chain.guests:
            if step in other.steps:
                raise InputError(
                    f"bind: step {step} of {chain.name} is held by both {other.name} at site "
                    f"{other.site} and {guest.name} at site {site}; move one of them"
                )
    left = chain.n_free - len(held)
    if left < _FEWEST_FREE:
        raise InputError(
            f"bind: {guest.name} at site {site} leaves {left} elastic steps of {chain.name}; "
            f"{_FEWEST_FREE} are needed"
        )
    ground, stiffness = chain.ground.copy(), chain.stiffness.copy()
    before = Guest(guest.name, site, tuple(held), ground[held].copy(), stiffness[held].copy())
    for step, values in zip(held, guest.values, strict=True):
        ground[step] = _coordinates(chain, ground[step], values)
    stiffness[held] = BOUND_STIFFNESS * np.eye(stiffness.shape[1])
    return replace(chain, ground=ground, stiffness=stiffness, guests=(*chain.guests, before))


def _coordinates(chain: Chain, own: Array, values: Array) -> Array:
    """Coordinates (c,) of a held step in the chain's form, from its own and a guest's (6,)."""
    given = ~np.isnan(values)
    out = own.copy()
    if chain.rigid:
        unit = np.array([1.0, 1.0, 1.0, *(3 * [chain.rise_A])])
        out[given] = values[given] / unit[given]
        return out
    if given[:3].all():
        step = np.concatenate([values[:3], [0.0, 0.0, 1.0]])
        rotation = _HINGE_DIRECTORS.T @ chain_frames(step[None], "rigid")[1][1] @ _HINGE_DIRECTORS
        return angles_of_frames(np.array([np.eye(3), rotation]), chain.step_form)[0]
    # Twist, tilt and roll are tau, phi and theta.
    for place, value in zip((0, 2, 1), values[:3], strict=True):
        if not math.isnan(value):
            out[place] = value
    return out


def guest_steps(source: GuestSteps | str | Path | ArrayLike) -> GuestSteps:
    """Steps of a guest from any source that :func:`bind` takes.

    Raises
    ------
    InputError
    """
    if isinstance(source, GuestSteps):
        return source
    if isinstance(source, Path):
        return _from_file(source)
    if isinstance(source, str):
        if "=" in source:
            return _from_kink(source)
        bundled = data_directory() / "guests" / f"{source.lower()}.toml"
        if source in bundled_guests():
            return _from_file(bundled)
        return _from_file(Path(source))
    try:
        values: Array = np.array(source, dtype=float)
    except (TypeError, ValueError):
        raise InputError("bind: steps must be numbers (n, 6), a file or a kink") from None
    if values.ndim != 2 or values.shape[1] != 6 or len(values) == 0:
        raise InputError(f"bind: steps must be an array (n, 6), not of shape {values.shape}")
    if not np.isfinite(values).all():
        raise InputError("bind: steps must be finite")
    return GuestSteps("guest", tuple(range(len(values))), values)


def bundled_guests() -> tuple[str, ...]:
    """Names of the guests that come with the package."""
    return tuple(sorted(path.stem for path in (data_directory() / "guests").glob("*.toml")))


def parse_site(text: str, n_steps: int) -> tuple[int, str]:
    """Site and source of ``SITE=SOURCE``, as the command line takes it.

    Raises
    ------
    InputError
    """
    match = re.fullmatch(r"\s*(-?[0-9]{1,9})\s*=\s*(\S.*)", text)
    if match is None:
        raise InputError(
            f"--bind '{text}' is not SITE=FILE or SITE=roll=40@5,6, with the number of a step as "
            "SITE"
        )
    site = int(match[1])
    if not 0 <= site < n_steps:
        raise InputError(f"--bind '{text}': site {site} lies outside the steps 0..{n_steps - 1}")
    return site, match[2].strip()


def _from_kink(text: str) -> GuestSteps:
    """``roll=40@5,6``: values in degrees and Å, and the steps that take them."""
    values, mark, places = text.partition("@")
    mend = "write a kink as roll=40@5,6 or roll=40,twist=30@-5,5"
    if not mark:
        raise InputError(f"kink '{text}' names no steps after @; {mend}")
    row = np.full(6, np.nan)
    for part in values.split(","):
        name, _, number = (piece.strip() for piece in part.partition("="))
        if name not in RIGID_COORDINATES:
            raise InputError(
                f"kink '{text}': '{name}' is not one of {', '.join(RIGID_COORDINATES)}; {mend}"
            )
        row[RIGID_COORDINATES.index(name)] = _in_units(name, _number(number, f"kink '{text}'"))
    offsets = []
    for place in places.split(","):
        if not re.fullmatch(r"\s*[+-]?[0-9]{1,6}\s*", place):
            raise InputError(f"kink '{text}': '{place.strip()}' is no step number; {mend}")
        offsets.append(int(place))
    return _checked(text, offsets, np.tile(row, (len(offsets), 1)), f"kink '{text}'")


def _in_units(name: str, value: float) -> float:
    return math.radians(value) if name in _ANGLES else value


def _number(text: str, place: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise InputError(f"{place}: '{text}' is no number") from None
    if not math.isfinite(value):
        raise InputError(f"{place}: '{text}' is not finite")
    return value


def _checked(
    name: str, offsets: list[int], values: Array, place: str, citation: str = ""
) -> GuestSteps:
    if not offsets:
        raise InputError(f"{place}: no steps")
    if len(offsets) > _MOST_STEPS:
        raise InputError(f"{place}: more than {_MOST_STEPS} steps")
    twice = sorted({offset for offset in offsets if offsets.count(offset) > 1})
    if twice:
        raise InputError(f"{place}: step {twice[0]} is given twice")
    bend = np.hypot(np.nan_to_num(values[:, 1]), np.nan_to_num(values[:, 2]))
    if bend.max() >= math.pi:
        worst = offsets[int(bend.argmax())]
        raise InputError(f"{place}: step {worst} bends by 180 degrees or more")
    values.setflags(write=False)
    return GuestSteps(name, tuple(offsets), values, citation)


def _from_file(path: Path) -> GuestSteps:
    place = f"file '{path}'"
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        known = ", ".join(bundled_guests())
        raise InputError(
            f"{place}: {error.strerror or error}; check the path, or take a bundled guest: {known}"
        ) from None
    except UnicodeDecodeError as error:
        raise InputError(f"{place}: not text: {error}") from None
    if path.suffix == ".toml":
        return _from_toml(text, path.stem, place)
    if path.suffix == ".par":
        return _from_par(text, path.stem, place)
    raise InputError(f"{place}: not a 3DNA .par or a .toml file; name it so")


def _from_par(text: str, name: str, place: str) -> GuestSteps:
    """Steps of a 3DNA parameter file (``bp_step.par``).

    Its rows are base pairs; the last six of twelve columns are shift, slide, rise (Å), tilt, roll
    and twist (degrees) of the step from the pair before, so those of the first row are of no step.
    """
    lines = text.splitlines()
    counts = re.match(r"\s*([0-9]+)", lines[0]) if lines else None
    rows = []
    for number, line in enumerate(lines[1:], 2):
        fields = line.split()
        if not fields or line.lstrip().startswith("#") or "#" in line:
            continue
        if len(fields) != 13:
            raise InputError(
                f"{place}, line {number}: {len(fields)} columns; a base pair and 12 numbers are "
                "needed"
            )
        rows.append([_number(field, f"{place}, line {number}") for field in fields[7:]])
    if counts is None or len(rows) != int(counts[1]):
        said = "no number" if counts is None else counts[1]
        raise InputError(f"{place}: its first line says {said} base pairs, and {len(rows)} follow")
    if len(rows) < 2:
        raise InputError(f"{place}: one base pair has no step; two are needed")
    shift, slide, rise, tilt, roll, twist = np.array(rows[1:]).T
    values = np.column_stack(
        [np.radians(twist), np.radians(tilt), np.radians(roll), shift, slide, rise]
    )
    return _checked(name, list(range(len(values))), values, place)


def _from_toml(text: str, name: str, place: str) -> GuestSteps:
    """Steps of a TOML file; ``data/guests/README.md`` says how one is written."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{place}: not valid TOML: {error}") from None
    unknown = sorted(set(table) - {"name", "citation", "steps", "superhelix"})
    if unknown:
        raise InputError(
            f"{place}: unknown key '{unknown[0]}'; known are name, citation, steps, superhelix"
        )
    name, citation = (_text(table, key, default, place) for key, default in
                      (("name", name), ("citation", "")))  # fmt: skip
    if ("steps" in table) == ("superhelix" in table):
        raise InputError(f"{place}: give either [[steps]] or [superhelix]")
    if "superhelix" in table:
        values = _superhelix(table["superhelix"], place)
        return _checked(name, list(range(len(values))), values, place, citation)
    entries = table["steps"]
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise InputError(f"{place}: steps must be a list of tables, [[steps]]")
    offsets: list[int] = []
    rows: list[Array] = []
    for number, entry in enumerate(entries):
        here = f"{place}, entry {number + 1} of steps"
        unknown = sorted(set(entry) - {"at", *RIGID_COORDINATES})
        if unknown:
            raise InputError(
                f"{here}: unknown key '{unknown[0]}'; known are at, {', '.join(RIGID_COORDINATES)}"
            )
        at = entry.get("at", offsets[-1] + 1 if offsets else 0)
        if isinstance(at, bool) or not isinstance(at, int):
            raise InputError(f"{here}: 'at' must be a step number, not {at!r}")
        row = np.full(6, np.nan)
        for place_in_row, key in enumerate(RIGID_COORDINATES):
            if key in entry:
                row[place_in_row] = _in_units(key, _entry(entry, key, here))
        offsets.append(at)
        rows.append(row)
    return _checked(name, offsets, np.array(rows).reshape(-1, 6), place, citation)


def _text(table: dict[str, Any], key: str, default: str, place: str) -> str:
    value = table.get(key, default)
    if not isinstance(value, str):
        raise InputError(f"{place}: '{key}' must be text in quotes")
    return value


def _entry(table: dict[str, Any], key: str, place: str) -> float:
    value = table.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{place}: '{key}' must be a finite number, not {value!r}")
    return float(value)


_SUPERHELIX_KEYS = (
    "base_pairs", "turns", "radius_A", "pitch_A", "rise_A", "helical_repeat_bp", "register_deg",
)  # fmt: skip


def _superhelix(table: Any, place: str) -> Array:
    """Steps (n, 6) of DNA that lies along a left-handed superhelix, its ends straight.

    See :func:`superhelix`.
    """
    here = f"{place}, superhelix"
    if not isinstance(table, dict) or set(table) != set(_SUPERHELIX_KEYS):
        raise InputError(f"{here}: needs {', '.join(_SUPERHELIX_KEYS)}, no more and no less")
    numbers = {key: _entry(table, key, here) for key in _SUPERHELIX_KEYS}
    for key, value in numbers.items():
        if key != "register_deg" and not value > 0.0:
            raise InputError(f"{here}: '{key}' must be positive, not {value}")
    if numbers["base_pairs"] != int(numbers["base_pairs"]) or numbers["base_pairs"] < 2:
        raise InputError(f"{here}: 'base_pairs' must be a whole number of 2 or more")
    return superhelix(
        int(numbers["base_pairs"]),
        numbers["turns"],
        numbers["radius_A"],
        numbers["pitch_A"],
        numbers["rise_A"],
        numbers["helical_repeat_bp"],
        math.radians(numbers["register_deg"]),
        here,
    )


def superhelix(
    base_pairs: int,
    turns: float,
    radius_A: float,
    pitch_A: float,
    rise_A: float,
    repeat_bp: float,
    register: float = 0.0,
    place: str = "superhelix",
) -> Array:
    """Steps (base_pairs - 1, 6) of DNA whose axis is a left-handed superhelix in the middle.

    The curved part has the length of ``turns`` turns; what is left over at both ends is straight.
    Base pairs lie ``rise_A`` apart along the axis, across which they stand, and turn about it by
    one turn in ``repeat_bp`` of them, measured in the frame that does not turn about the axis (so
    the twist is that of the steps). At the middle base pair ``register`` is the angle from the
    direction to the superhelix's own axis to the major groove.

    Raises
    ------
    InputError
        The base pairs are too few for so many turns.
    """
    around = 2.0 * math.pi * radius_A
    length = turns * math.hypot(around, pitch_A)
    n = base_pairs - 1
    if length > n * rise_A:
        raise InputError(
            f"{place}: {turns:g} turns are {length:.0f} Å long and {base_pairs} base pairs only "
            f"{n * rise_A:.0f} Å; take fewer turns, or a smaller radius"
        )
    # Curvature and torsion of a helix; left-handed, so the torsion is negative.
    size = radius_A**2 + (pitch_A / (2.0 * math.pi)) ** 2
    curvature, torsion = radius_A / size, -(pitch_A / (2.0 * math.pi)) / size
    middle = 0.5 * n
    values = np.zeros((n, 6))
    twist = 2.0 * math.pi / repeat_bp
    for s in range(n):
        low = max(-0.5 * length, (s - middle) * rise_A)
        high = min(0.5 * length, (s + 1 - middle) * rise_A)
        curved = max(0.0, high - low)
        # Angle from the principal normal to the major groove at the middle of the step: the twist
        # against the frame that does not turn, less the torsion's turn of the normal.
        along = (s + 0.5 - middle) * rise_A
        normal = torsion * min(max(along, -0.5 * length), 0.5 * length)
        groove = register + (s + 0.5 - middle) * twist - normal
        bend = curvature * curved
        # The axis tips towards the normal, which stands at -groove from the groove's direction x;
        # positive roll tips it towards x, positive tilt towards -y.
        values[s] = (twist, bend * math.sin(groove), bend * math.cos(groove), 0.0, 0.0, rise_A)
    return values
