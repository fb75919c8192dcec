"""What a check is given: the scene, the level, and random numbers of its own."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dnacheck.validation.engine.registry import Level
from dnacheck.validation.scene.scene import Scene

if TYPE_CHECKING:
    import numpy as np

    from dnacheck.model.molecules import Molecule


def seed_of(name: str, seed: int) -> int:
    """Seed of a check from its name and the seed of the run, whatever runs before or beside it."""
    digest = hashlib.sha256(f"{seed}/{name}".encode()).digest()
    return int.from_bytes(digest[:6])


@dataclass(frozen=True)
class Context:
    """Surroundings of one check."""

    scene: Scene
    level: Level
    seed: int
    """Seed of this check, see :func:`seed_of`."""

    @property
    def molecules(self) -> tuple[Molecule, ...]:
        """Molecules of the scene; at the quick level only the first."""
        return self.scene.molecule_list[: 1 if self.level is Level.QUICK else None]

    def rng(self, *spawn_key: int) -> np.random.Generator:
        """A generator of this check, one per key."""
        import numpy as np

        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=spawn_key))
