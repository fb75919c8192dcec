"""Scenes: which molecules, which model, which quantities, how accurate.

A scene is a TOML file; ``dnacheck validate --new-scene FILE`` writes one with every key explained.
"""

from __future__ import annotations

import hashlib
import json
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from dnacheck.model.a_tracts import Region
from dnacheck.model.molecules import Molecule
from dnacheck.model.sequence import parse_sequence

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]

FINEST_ENERGY = 1e-10
"""Relative; the discrete solver's residual of 1e-10 leaves about the square of it in the energy,
but sums of some hundred terms round at 1e-13 and the promise should have room."""
FINEST_LN_J = 0.002
"""Absolute; the exact-closure sampler reaches 0.01 in 0.2 s, so this is already 25 times the work
per molecule, and every halving is four times more."""
FINEST_THERMAL_ENERGY = 1e-3
"""Relative; errors of 0.01 on two ln J leave 0.14 RT of some 240."""
MOST_BASE_PAIRS = 20_000


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class RandomMolecules(_Part):
    """Random sequences, the same for the same seed."""

    count: int = Field(ge=1, le=100_000)
    shortest: int = Field(default=80, ge=10)
    longest: int = Field(default=400, le=MOST_BASE_PAIRS)
    seed: int = Field(default=0, ge=0)

    @model_validator(mode="after")
    def _ordered(self) -> RandomMolecules:
        if self.shortest > self.longest:
            raise ValueError(f"shortest {self.shortest} exceeds longest {self.longest}")
        return self


class Molecules(_Part):
    """Where the molecules come from; all kinds given are joined."""

    embedded: Literal["all", "none"] | list[str] = "none"
    fasta: list[str] = []
    sequences: dict[str, str] = {}
    homopolymers: dict[str, list[int]] = {}
    random: RandomMolecules | None = None


class Model(_Part):
    """Elastic parameters."""

    angles: list[str] = Field(default=["trifonov2"], min_length=1)
    twist_ratios: list[Positive] = Field(default=[1.5], min_length=1)
    persistence_length_A: Positive = 463.0
    rise_A: Positive = 3.4
    a_tracts: Literal["auto", "tracts-only", "none"] = "auto"


class Continuum(_Part):
    """How the rod is made: the paper's w, k, m and the padding."""

    filter_width: int = Field(default=15, ge=1)
    intervals: int = Field(default=20, ge=1)
    degree: int = Field(default=6, ge=4)
    padding: int = Field(default=50, ge=0)


class Wanted(_Part):
    """Quantities and the accuracy wanted of each; what is absent is not computed."""

    energy: Positive | None = None
    continuum_energy: Positive | None = None
    shape_A: Positive | None = None
    ln_J: Positive | None = None
    thermal_energy: Positive | None = None
    binding: Positive | None = None
    """Absolute error of ln of the ratio of binding constants, ring over linear; see Guest."""
    rigid_ln_J: Positive | None = None
    """Absolute error of -ln J by rigid base-pair steps, with the rings of another program."""


class Guest(_Part):
    """What is bound where, for the quantity ``binding``."""

    steps: str = Field(default="cap", min_length=1)
    """Bundled guest, or a kink such as roll=40@-5,5."""
    at: str | int = "GTGAGCTAACTCAC"
    """Step that is the guest's step 0; or letters of its site, of which that is the middle step."""

    def site_in(self, letters: str) -> int | None:
        """Step of a molecule that is the guest's step 0; None if it has no such site."""
        if isinstance(self.at, int):
            return self.at if 0 <= self.at < len(letters) else None
        found = letters.find(self.at.upper())
        return None if found < 0 else found + (len(self.at) - 1) // 2


class Checks(_Part):
    """Groups of checks besides those that the wanted quantities bring."""

    groups: Literal["all"] | list[str] = "all"
    hard_cases: bool = False
    compare_methods: bool = False
    against_paper: bool = False


class AngleFile(_Part):
    """A parameter file that a scene names: where it lies, what it holds."""

    name: str
    path: str
    sha256: str
    has_stiffness: bool
    has_a_tract_twist: bool


FILLED_IN = ("source", "resolved", "angle_files")
"""Fields of a scene that its reader fills in; a file must not hold them."""


class Scene(_Part):
    """A validated scene; ``source`` is the file it came from."""

    title: str = Field(min_length=1, max_length=200)
    description: str = ""
    molecules: Molecules
    model: Model = Model()
    continuum: Continuum = Continuum()
    wanted: Wanted
    guest: Guest = Guest()
    checks: Checks = Checks()
    source: str = ""
    resolved: tuple[tuple[str, str, tuple[Region, ...] | None], ...] = ()
    angle_files: tuple[AngleFile, ...] = ()

    @cached_property
    def molecule_list(self) -> tuple[Molecule, ...]:
        """The molecules, in the order of the scene."""
        return tuple(
            Molecule(parse_sequence(letters, name), regions)
            for name, letters, regions in self.resolved
        )

    @property
    def wants(self) -> tuple[str, ...]:
        """Names of the wanted quantities."""
        return tuple(name for name, value in self.wanted if value is not None)

    def angle_file(self, angles: str) -> AngleFile | None:
        """The parameter file behind a name in [model] angles; None for an embedded set."""
        return next((file for file in self.angle_files if file.name == angles), None)

    @property
    def digest(self) -> str:
        """SHA-256 of everything in the scene that a result can depend on."""
        content = self.model_dump(mode="json", exclude={"source"})
        for file in content["angle_files"]:
            del file["path"]  # the content counts, wherever it lies
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def scenes_directory() -> Path:
    """Folder of the scenes that ship: inside the installed package, else in the checkout."""
    package = Path(__file__).resolve().parents[2]
    installed = package / "scenes"
    return installed if installed.is_dir() else package.parents[1] / "validation" / "scenes"


def shipped_scenes() -> tuple[str, ...]:
    """Names of the scenes that ship."""
    return tuple(sorted(path.stem for path in scenes_directory().glob("*.toml")))
