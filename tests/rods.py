"""Chains and rods that several tests share."""

from __future__ import annotations

import functools

import numpy as np

from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.molecules import embedded
from dnacheck.model.rod import Rod, RodOptions, build_rod
from dnacheck.model.sequence import Sequence

ANGLE_SETS = ("trifonov2", "trifonov", "desantis")

ELEVEN = (
    "12A09",
    "09T09",
    "13A09",
    "17A11",
    "11A17",
    "15A09",
    "11T15",
    "09A17",
    "08A17",
    "08T15",
    "09T15",
)


@functools.cache
def molecule_chain(name: str, twist_ratio: float = 1.5) -> Chain:
    return build_chain(embedded(name), twist_ratio=twist_ratio)


@functools.cache
def molecule_rod(name: str, options: RodOptions | None = None) -> Rod:
    return build_rod(molecule_chain(name), options)


def random_chain(seed: int, length: int, angles: str = "trifonov2", ratio: float = 1.5) -> Chain:
    letters = "".join(np.random.default_rng(seed).choice(list("ACGT"), length))
    return build_chain(Sequence(f"random-{seed}", letters), angles=angles, twist_ratio=ratio)


def straight_chain(length: int, twist: float = 0.6, ratio: float = 1.5) -> Chain:
    ground = np.zeros((length, 3))
    ground[:, 0] = twist
    return Chain("straight", ground, np.tile(np.diag([ratio, 1.0, 1.0]), (length, 1, 1)))
