"""Seeds of random streams."""

from __future__ import annotations

import numpy as np


def seed_sequence(seed: int | np.random.SeedSequence) -> np.random.SeedSequence:
    """The sequence that a seed stands for; a sequence stands for itself."""
    return seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
