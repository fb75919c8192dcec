"""Seeds of random streams."""

from __future__ import annotations

import numpy as np

from dnacheck.numerics.outcome import InputError

Randomness = int | np.random.SeedSequence | np.random.Generator


def seed_sequence(rng: Randomness) -> np.random.SeedSequence:
    """The sequence that an argument ``rng`` stands for.

    A sequence stands for itself, a number for the sequence seeded with it, and a generator for the
    next child of its own, so that calls with one generator in turn differ.

    Raises
    ------
    InputError
        Anything else, or a negative number.
    """
    if isinstance(rng, np.random.SeedSequence):
        return rng
    if isinstance(rng, np.random.Generator):
        try:
            child: np.random.SeedSequence = rng.bit_generator.seed_seq.spawn(1)[0]  # type: ignore[attr-defined]
        except (AttributeError, TypeError):
            raise InputError(
                "rng: this generator cannot spawn streams; make it by numpy.random.default_rng"
            ) from None
        return child
    number: object = rng
    if isinstance(number, (int, np.integer)) and not isinstance(number, bool) and number >= 0:
        return np.random.SeedSequence(int(number))
    raise InputError(
        "rng must be an integer not below 0, a numpy.random.SeedSequence or a "
        f"numpy.random.Generator, not {rng!r}"
    )


def generator(rng: Randomness) -> np.random.Generator:
    """The generator that an argument ``rng`` stands for; a generator stands for itself."""
    if isinstance(rng, np.random.Generator):
        return rng
    return np.random.default_rng(seed_sequence(rng))
