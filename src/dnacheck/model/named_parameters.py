"""Mechanical parameters by name, and the chain that they make of a molecule's own chain.

They act in this order: table entries replace the ground values of the steps with these letters;
the A-tract twist replaces the twist of the steps in an A-tract region; the bend scales multiply
ground bends; the twist offset is added to every ground twist; the twist ratio, the persistence
length and the stiffness scale make the stiffness. Every one is affine in each parameter by itself,
so central differences of the arrays are exact derivatives.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dnacheck.model.a_tracts import region_steps
from dnacheck.model.chain import Chain, uniform_stiffness
from dnacheck.model.sequence import STEP_NAMES, reverse_complement
from dnacheck.model.sequence import Sequence as Letters
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

_UNITS = {
    "persistence_length_A": "Å",
    "twist_ratio": "1",
    "stiffness_scale": "1",
    "twist_offset_deg": "degree",
    "bend_scale": "1",
    "a_tract_twist_deg": "degree",
    "a_tract_bend_scale": "1",
}
_POSITIVE = {"persistence_length_A", "twist_ratio", "stiffness_scale"}
_ENTRY = re.compile(r"(tau|theta|phi)\[([ACGT]{2})\]")
_ANGLES = ("tau", "theta", "phi")
_STRAND_SIGN = {"tau": 1.0, "theta": 1.0, "phi": -1.0}
_OFFSET = re.compile(r"offset(\[(?P<group>[^\]]+)\])?")
DEGREE = math.pi / 180.0

_DIFFERENCE = {
    "persistence_length_A": 1.0,
    "twist_ratio": 1e-2,
    "stiffness_scale": 1e-2,
    "bend_scale": 1e-2,
    "a_tract_bend_scale": 1e-2,
}
"""Half widths of the exact differences; 0.1 degree for angles."""


def is_offset(name: str) -> bool:
    """Whether a parameter is an offset common to all -ln J, or to those of one group."""
    return _OFFSET.fullmatch(name) is not None


def offset_group(name: str) -> str | None:
    """The group of ``offset[GROUP]``, None for the offset of all."""
    match = _OFFSET.fullmatch(name)
    return match["group"] if match else None


def checked_name(name: str) -> str:
    """The name itself, if it names a parameter.

    Raises
    ------
    InputError
        It does not; the message lists those that do.
    """
    if name in _UNITS or is_offset(name) or _ENTRY.fullmatch(name):
        return name
    known = ", ".join(sorted(_UNITS))
    raise InputError(
        f"parameter '{name}' is unknown; known are {known}, offset, offset[GROUP], and table "
        "entries such as tau[AA], theta[AG], phi[CA]"
    )


def unit(name: str) -> str:
    """Unit of a parameter, as text."""
    if is_offset(name):
        return "RT"
    return _UNITS.get(name, "degree")


@dataclass(frozen=True)
class Parameters:
    """Free parameters, in order, and the values of fixed ones that differ from the chain's own.

    Raises
    ------
    InputError
        An unknown name, a name twice, or a value that is not finite or not positive.
    """

    free: tuple[str, ...]
    fixed: Mapping[str, float]

    def __post_init__(self) -> None:
        names = [*self.free, *self.fixed]
        for name in names:
            checked_name(name)
            if names.count(name) > 1:
                raise InputError(f"parameter '{name}' is given twice")
        for name, value in self.fixed.items():
            _check_value(name, value)


def _check_value(name: str, value: float) -> None:
    if not math.isfinite(value) or (name in _POSITIVE and not value > 0.0):
        kind = "a positive number" if name in _POSITIVE else "a finite number"
        raise InputError(f"parameter {name} must be {kind}, not {value}")


def own_value(chain: Chain, name: str) -> float:
    """The value at which a parameter changes nothing of the chain.

    Raises
    ------
    InputError
        The chain has no such parameter: a twist ratio where the stiffness is the set's own, an
        A-tract twist without a region, a table entry without letters.
    """
    checked_name(name)
    if name == "persistence_length_A":
        if chain.twist_ratio is None:
            raise InputError(
                f"{name}: the set of '{chain.name}' has stiffnesses of its own; use stiffness_scale"
            )
        return chain.persistence_length_A
    if name == "twist_ratio":
        if chain.twist_ratio is None:
            raise InputError(f"{name}: the set of '{chain.name}' has stiffnesses of its own")
        return chain.twist_ratio
    if name in ("bend_scale", "a_tract_bend_scale", "stiffness_scale"):
        return 1.0
    if name == "a_tract_twist_deg":
        steps = np.flatnonzero(_in_tract(chain))
        return float(chain.ground[steps[0], 0]) / DEGREE if steps.size else math.nan
    match = _ENTRY.fullmatch(name)
    if match is None:
        return 0.0
    steps = np.flatnonzero(_with_letters(chain, match[2]) & ~_in_tract(chain))
    if steps.size:
        return float(chain.ground[steps[0], _ANGLES.index(match[1])]) / DEGREE
    steps = np.flatnonzero(_with_letters(chain, reverse_complement(match[2])) & ~_in_tract(chain))
    if steps.size:
        sign = _STRAND_SIGN[match[1]]
        return sign * float(chain.ground[steps[0], _ANGLES.index(match[1])]) / DEGREE
    return math.nan


def _in_tract(chain: Chain) -> NDArray[np.bool_]:
    inside = np.zeros(chain.n_steps, dtype=bool)
    for region in chain.a_tract_regions:
        inside[region_steps(region, chain.n_steps)] = True
    return inside


def _with_letters(chain: Chain, step: str) -> NDArray[np.bool_]:
    if not chain.letters:
        raise InputError(f"'{chain.name}' has no letters, so no step {step}")
    indices = Letters(chain.name, chain.letters).step_indices()
    return np.asarray(indices == STEP_NAMES.index(step))


def modified_chain(chain: Chain, values: Mapping[str, float]) -> Chain:
    """A chain with some parameters at other values; offsets are passed over.

    Raises
    ------
    InputError
        See :func:`own_value` and :func:`checked_name`; a value that has no meaning.
    """
    ground = chain.ground.copy()
    inside = _in_tract(chain)
    bend = np.ones(chain.n_steps)
    offset = 0.0
    ratio, persistence, scale = chain.twist_ratio, chain.persistence_length_A, 1.0
    for name, value in sorted(values.items(), key=lambda item: _ENTRY.fullmatch(item[0]) is None):
        if is_offset(checked_name(name)):
            continue
        _check_value(name, value)
        if name in ("persistence_length_A", "twist_ratio"):
            own_value(chain, name)
        if name == "persistence_length_A":
            persistence = value
        elif name == "twist_ratio":
            ratio = value
        elif name == "stiffness_scale":
            scale = value
        elif name == "twist_offset_deg":
            offset = value * DEGREE
        elif name == "bend_scale":
            bend *= value
        elif name == "a_tract_bend_scale":
            bend[inside] *= value
        elif name == "a_tract_twist_deg":
            ground[inside, 0] = value * DEGREE
        else:
            _set_entry(chain, ground, inside, name, value * DEGREE)
    ground[:, 1:] *= bend[:, None]
    ground[:, 0] += offset
    stiffness = chain.stiffness
    if ratio is not None and ratio != chain.twist_ratio:
        stiffness = uniform_stiffness(chain.n_steps, ratio)
    return replace(
        chain,
        ground=ground,
        stiffness=scale * stiffness,
        twist_ratio=ratio if scale == 1.0 else None,
        persistence_length_A=persistence,
    )


def _set_entry(
    chain: Chain, ground: Array, inside: NDArray[np.bool_], name: str, value: float
) -> None:
    match = _ENTRY.fullmatch(name)
    assert match is not None
    column = _ANGLES.index(match[1])
    other = reverse_complement(match[2])
    for step, sign in ((match[2], 1.0), (other, _STRAND_SIGN[match[1]])):
        chosen = _with_letters(chain, step)
        if column == 0:  # the A-tract twist of a region replaces the table's
            chosen &= ~inside
        ground[chosen, column] = sign * value


@dataclass(frozen=True)
class ChainDerivatives:
    """Derivatives of a chain's arrays with respect to parameters; stiffness in RT.

    Attributes
    ----------
    ground : ndarray, shape (p, N, d)
        Of the ground values, radians per unit of the parameter.
    stiffness : ndarray, shape (p, N, d, d)
        Of the stiffness in RT.
    second_ground, second_stiffness : ndarray, shapes (p, p, N, d), (p, p, N, d, d)
        Mixed second derivatives; zero on the diagonal.
    """

    ground: Array
    stiffness: Array
    second_ground: Array
    second_stiffness: Array


def _arrays(chain: Chain, values: Mapping[str, float]) -> tuple[Array, Array]:
    made = modified_chain(chain, values)
    return made.ground, made.energy_scale_RT * made.stiffness


def chain_derivatives(
    chain: Chain, names: Sequence[str], values: Mapping[str, float]
) -> ChainDerivatives:
    """Exact derivatives of the arrays of :func:`modified_chain` at the given values."""
    p = len(names)
    n, d = chain.ground.shape
    ground, stiffness = np.zeros((p, n, d)), np.zeros((p, n, d, d))
    second_ground, second_stiffness = np.zeros((p, p, n, d)), np.zeros((p, p, n, d, d))
    steps = {name: _DIFFERENCE.get(name, 0.1) for name in names}

    def shifted(moves: Mapping[str, float]) -> tuple[Array, Array]:
        return _arrays(chain, {**values, **{k: values[k] + v for k, v in moves.items()}})

    active = [(i, name) for i, name in enumerate(names) if not is_offset(name)]
    for i, name in active:
        h = steps[name]
        plus, minus = shifted({name: h}), shifted({name: -h})
        ground[i] = (plus[0] - minus[0]) / (2.0 * h)
        stiffness[i] = (plus[1] - minus[1]) / (2.0 * h)
    for i, a in active:
        for j, b in active:
            if j <= i:
                continue
            h, k = steps[a], steps[b]
            corners = [
                (s * t, shifted({a: s * h, b: t * k})) for s in (1.0, -1.0) for t in (1.0, -1.0)
            ]
            for out, place in ((second_ground, 0), (second_stiffness, 1)):
                value = sum(sign * pair[place] for sign, pair in corners) / (4.0 * h * k)
                out[i, j] = out[j, i] = value
    return ChainDerivatives(ground, stiffness, second_ground, second_stiffness)
