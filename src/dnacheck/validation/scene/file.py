"""Scene files: read, checked, and refused with file, line and mend."""

from __future__ import annotations

import difflib
import hashlib
import math
import tomllib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from dnacheck.io.sequences import SequenceSource
from dnacheck.model.data_files import PARAMETER_SETS
from dnacheck.model.molecules import Molecule, embedded, embedded_names
from dnacheck.model.parameters import load_parameters
from dnacheck.model.sequence import parse_sequence
from dnacheck.numerics.outcome import InputError
from dnacheck.validation.scene.line_numbers import line_numbers, line_of
from dnacheck.validation.scene.scene import (
    FILLED_IN,
    FINEST_ENERGY,
    FINEST_LN_J,
    FINEST_THERMAL_ENERGY,
    MOST_BASE_PAIRS,
    AngleFile,
    RandomMolecules,
    Scene,
    scenes_directory,
    shipped_scenes,
)

T = TypeVar("T")


def load_scene(name: str) -> Scene:
    """A shipped scene by name, or one from a file.

    Raises
    ------
    InputError
        One line that names the file, the line and the mend.
    """
    if name in shipped_scenes():
        return read_scene(scenes_directory() / f"{name}.toml")
    path = Path(name)
    if not path.exists():
        known = ", ".join(shipped_scenes())
        raise InputError(f"scene '{name}': no such file; give a TOML file or one of {known}")
    return read_scene(path)


def read_scene(path: Path) -> Scene:
    """A scene from a TOML file; see :func:`load_scene`."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"scene '{path}': {error.strerror or error}; check the path") from None
    except UnicodeDecodeError:
        raise InputError(f"scene '{path}': not a text file; give a TOML file") from None
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"scene '{path}': not valid TOML: {error}") from None
    return _Reader(path, text).scene(table)


class _Reader:
    """Turns a parsed file into a scene; every complaint names file, line and mend."""

    def __init__(self, path: Path, text: str) -> None:
        self.path = path
        self.lines = line_numbers(text)

    def fail(self, message: str, *place: str | int) -> InputError:
        line = line_of(self.lines, place)
        where = f", line {line}" if line else ""
        return InputError(f"scene '{self.path}'{where}: {message}")

    def scene(self, table: dict[str, Any]) -> Scene:
        for reserved in FILLED_IN:
            if reserved in table:
                raise self.fail(f"unknown key '{reserved}'; remove it", reserved)
        try:
            scene = Scene.model_validate({**table, "source": str(self.path)})
        except ValidationError as error:
            raise self.explain(error.errors()[0]) from None
        scene = scene.model_copy(update={"angle_files": self.angle_files(scene)})
        self.possible(scene)
        resolved = tuple(
            (molecule.name, molecule.sequence.letters, molecule.a_tract_regions)
            for molecule in self.molecules(scene)
        )
        names = [name for name, _, _ in resolved]
        for name in names:
            if names.count(name) > 1:
                raise self.fail(f"two molecules are called '{name}'; rename one", "molecules")
        if not resolved:
            raise self.fail(
                "no molecule; give embedded, fasta, sequences, homopolymers or random",
                "molecules",
            )
        scene = scene.model_copy(update={"resolved": resolved})
        self.wishes(scene)
        return scene

    def explain(self, error: Any) -> InputError:
        place = tuple(part for part in error["loc"] if not _is_union_tag(part))
        dotted = ".".join(str(part) for part in place)
        kind = error["type"]
        if kind == "extra_forbidden":
            known = sorted(_known_keys(place[:-1]))
            return self.fail(f"unknown key '{dotted}'; {_mend(str(place[-1]), known)}", *place)
        if kind == "missing":
            return self.fail(f"'{dotted}' is missing; every scene needs it", *place)
        message = error["msg"].removeprefix("Value error, ")
        message = message[0].lower() + message[1:]
        given = error.get("input")
        shown = f", not {given!r}" if isinstance(given, str | int | float | bool | list) else ""
        return self.fail(f"'{dotted}': {message}{shown}", *place)

    def angle_files(self, scene: Scene) -> tuple[AngleFile, ...]:
        """The parameter files that the scene names, each read once to see that it is one."""
        files = []
        for index, name in enumerate(scene.model.angles):
            if name in PARAMETER_SETS:
                continue
            path = self._beside(name).resolve()
            try:
                table = load_parameters(str(path))
            except InputError as error:
                raise self.fail(str(error), "model", "angles", index) from None
            has_stiffness = table.stiffness is not None
            if has_stiffness and "twist_ratios" in scene.model.model_fields_set:
                raise self.fail(
                    f"'{name}' has stiffnesses of its own; leave out twist_ratios",
                    "model",
                    "twist_ratios",
                )
            files.append(
                AngleFile(
                    name=name,
                    path=str(path),
                    sha256=hashlib.sha256(path.read_bytes()).hexdigest(),
                    has_stiffness=has_stiffness,
                    has_a_tract_twist=table.a_tract_twist is not None,
                )
            )
        return tuple(files)

    def possible(self, scene: Scene) -> None:
        """Refuse what no model of ours can give."""
        rod = scene.continuum
        if 2 * (rod.filter_width - 1) > rod.padding:
            raise self.fail(
                f"filter width {rod.filter_width} reaches {2 * (rod.filter_width - 1)} base pairs "
                f"but the padding has {rod.padding}; raise padding or narrow the filter",
                "continuum",
                "filter_width",
            )
        wanted = scene.wanted
        if not scene.wants and not scene.checks.hard_cases and not scene.checks.against_paper:
            raise self.fail("nothing is wanted; name a quantity and its accuracy", "wanted")
        for name, value in wanted:
            if (
                value is not None
                and name in ("energy", "continuum_energy")
                and value < FINEST_ENERGY
            ):
                raise self.fail(
                    f"a relative accuracy of {value:g} is finer than double precision can "
                    f"promise; ask for {FINEST_ENERGY:g} or more",
                    "wanted",
                    name,
                )
        for name, value in (("ln_J", wanted.ln_J), ("rigid_ln_J", wanted.rigid_ln_J)):
            if value is not None and value < FINEST_LN_J:
                raise self.fail(
                    f"an error of {value:g} on ln J needs more sampling than a report can "
                    f"wait for; ask for {FINEST_LN_J:g} or more",
                    "wanted",
                    name,
                )
        if wanted.thermal_energy is not None and wanted.thermal_energy < FINEST_THERMAL_ENERGY:
            raise self.fail(
                f"a relative accuracy of {wanted.thermal_energy:g} of a mean energy needs more "
                f"sampling than a report can wait for; ask for {FINEST_THERMAL_ENERGY:g} or more",
                "wanted",
                "thermal_energy",
            )
        if isinstance(scene.checks.groups, list):
            from dnacheck.validation.engine.registry import groups

            known = [group.name for group in groups()]
            for index, name in enumerate(scene.checks.groups):
                if name not in known:
                    close = difflib.get_close_matches(name, known, n=1)
                    mend = (
                        f"did you mean '{close[0]}'?" if close else f"known are {', '.join(known)}"
                    )
                    raise self.fail(
                        f"no group of checks is called '{name}'; {mend}", "checks", "groups", index
                    )

    def guests(self, scene: Scene) -> None:
        """Refuse a guest that cannot be read or finds no site in a molecule."""
        from dnacheck.model.guests import guest_steps

        if scene.wanted.binding is None:
            if "guest" in scene.model_fields_set:
                raise self.fail(
                    "a guest but no wish for it; add binding = 0.05 to [wanted]", "guest"
                )
            return
        if scene.wanted.binding < FINEST_LN_J:
            raise self.fail(
                f"an error of {scene.wanted.binding:g} on ln of a ratio needs more sampling than a "
                f"report can wait for; ask for {FINEST_LN_J:g} or more",
                "wanted",
                "binding",
            )
        try:
            guest_steps(scene.guest.steps)
        except InputError as error:
            raise self.fail(str(error), "guest", "steps") from None
        for name, letters, _ in scene.resolved:
            if scene.guest.site_in(letters) is None:
                raise self.fail(
                    f"molecule '{name}' has no site {scene.guest.at!r}; give [guest] at the number "
                    "of a step or letters that all molecules have",
                    "guest",
                    "at",
                )

    def wishes(self, scene: Scene) -> None:
        """Refuse wishes that these molecules can't fulfil."""
        self.guests(scene)
        names = {name for name, _, _ in scene.resolved}
        strange = names - set(embedded_names())
        if scene.checks.against_paper and strange:
            raise self.fail(
                f"the paper has no value for '{sorted(strange)[0]}'; switch against_paper off, or "
                "name embedded molecules only",
                "checks",
                "against_paper",
            )
        if scene.checks.against_paper and (
            "trifonov2" not in scene.model.angles or 1.5 not in scene.model.twist_ratios
        ):
            raise self.fail(
                "Table II is for trifonov2 at twist ratio 1.5; add them to [model] or switch "
                "against_paper off",
                "checks",
                "against_paper",
            )
        shortest = min(len(letters) for _, letters, _ in scene.resolved)
        if scene.continuum.padding > 0 and (
            scene.wanted.continuum_energy is not None or scene.wanted.shape_A is not None
        ):
            coefficients = scene.continuum.intervals * (scene.continuum.degree - 3) + 4
            points = shortest + 2 * scene.continuum.padding + 2
            if coefficients > points:
                raise self.fail(
                    f"{coefficients} spline coefficients for {points} points of the shortest "
                    "molecule; lower intervals or degree",
                    "continuum",
                    "intervals",
                )

    def molecules(self, scene: Scene) -> Iterator[Molecule]:
        wish = scene.molecules
        if wish.embedded == "all":
            yield from map(embedded, embedded_names())
        elif isinstance(wish.embedded, list):
            for index, name in enumerate(wish.embedded):
                yield self.checked("embedded", index, make=partial(embedded, name))
        for index, file in enumerate(wish.fasta):
            path = self._beside(file)
            for record in self.checked("fasta", index, make=partial(_records, path)):
                if isinstance(record, InputError):
                    raise self.fail(f"file '{file}': {record}", "molecules", "fasta", index)
                yield record
        for name, letters in wish.sequences.items():
            make = partial(parse_sequence, letters, name)
            yield Molecule(self.checked("sequences", name, make=make))
        for unit, lengths in wish.homopolymers.items():
            yield from self.homopolymers(unit, lengths)
        if wish.random is not None:
            yield from random_molecules(wish.random)

    def homopolymers(self, unit: str, lengths: list[int]) -> Iterator[Molecule]:
        for index, length in enumerate(lengths):
            place = ("homopolymers", unit, index)
            if not unit or length > MOST_BASE_PAIRS:
                raise self.fail(
                    f"a repeat of '{unit}' with {length} base pairs; at most {MOST_BASE_PAIRS}",
                    "molecules",
                    *place,
                )
            letters = (unit * (length // len(unit) + 1))[: max(length, 0)]
            make = partial(parse_sequence, letters, f"{unit}x{len(letters)}")
            yield Molecule(self.checked(*place, make=make))

    def checked(self, *place: str | int, make: Callable[[], T]) -> T:
        """What ``make`` returns; its input error gets the place in the scene."""
        try:
            return make()
        except InputError as error:
            raise self.fail(str(error), "molecules", *place) from None

    def _beside(self, file: str) -> Path:
        """A path in a scene is meant relative to the scene's folder."""
        return self.path.parent / file


def _records(path: Path) -> list[Molecule | InputError]:
    return list(SequenceSource(path).molecules())


def random_molecules(wish: RandomMolecules) -> Iterator[Molecule]:
    """Sequences with independent, equally likely letters and equally likely lengths."""
    import numpy as np

    generator = np.random.default_rng(wish.seed)
    digits = int(math.log10(wish.count)) + 1
    for number in range(1, wish.count + 1):
        length = int(generator.integers(wish.shortest, wish.longest + 1))
        letters = "".join(np.array(list("ACGT"))[generator.integers(0, 4, length)])
        yield Molecule(parse_sequence(letters, f"random{number:0{digits}d}"))


def _mend(wrong: str, known: list[str]) -> str:
    close = difflib.get_close_matches(wrong, known, n=1)
    return f"did you mean '{close[0]}'?" if close else f"known are {', '.join(known)}"


def _is_union_tag(part: str | int) -> bool:
    """pydantic names the member of a union in the place of an error."""
    return isinstance(part, str) and ("[" in part or part in ("list", "float", "constrained-float"))


def _known_keys(place: tuple[str | int, ...]) -> list[str]:
    model: Any = Scene
    for part in place:
        field = getattr(model, "model_fields", {}).get(part)
        if field is None:
            return []
        candidates = [field.annotation, *getattr(field.annotation, "__args__", ())]
        model = next((item for item in candidates if hasattr(item, "model_fields")), None)
    return [name for name in getattr(model, "model_fields", {}) if name not in FILLED_IN]
