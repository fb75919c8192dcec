"""What each step and each letter of a molecule does to ln J.

Derivatives come from the closed draws that give J. A changed letter changes the ground values (and
the stiffness, where a set has its own) of two steps, more where the A-tract rule answers; the
gradient predicts what that does to ln J, and the substitutions that matter are computed anew.
Reweighting the same draws to the changed molecule would be exact, but its weights are heavy: it
ranks substitutions worse than the gradient does.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.gradient import ClosedDraws, closed_draws
from dnacheck.model.chain import Chain
from dnacheck.model.sequence import BASES
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StepMap:
    """Derivatives of ln J along a molecule.

    Attributes
    ----------
    ground, ground_stderr : ndarray, shape (N, d)
        d ln J / d ground value of step i, per degree (per Å for translations), with errors.
    stiffness, stiffness_stderr : ndarray, shape (N, d)
        d ln J / d ln (diagonal stiffness).
    """

    ground: Array
    ground_stderr: Array
    stiffness: Array
    stiffness_stderr: Array


@dataclass(frozen=True)
class Substitution:
    """One letter changed.

    Attributes
    ----------
    position : int
        Base pair, from 0.
    old, new : str
    predicted, predicted_stderr : float
        Change of -ln J to first order.
    computed, computed_stderr : float or None
        Change of -ln J of the molecule computed anew, where that was done.
    """

    position: int
    old: str
    new: str
    predicted: float
    predicted_stderr: float
    computed: float | None = None
    computed_stderr: float | None = None

    @property
    def change(self) -> float:
        """The best value of the change of -ln J that is known."""
        return self.predicted if self.computed is None else self.computed


@dataclass(frozen=True)
class Sensitivity:
    """The map of a molecule and all its single substitutions.

    Attributes
    ----------
    name, letters : str
    minus_lnJ, stderr : float
    coordinates : tuple of str
        Names of the d ground values of a step.
    steps : StepMap
    substitutions : tuple of Substitution
        All 3N, by position.
    """

    name: str
    letters: str
    minus_lnJ: float
    stderr: float
    coordinates: tuple[str, ...]
    steps: StepMap
    substitutions: tuple[Substitution, ...]

    def most(self, count: int = 10) -> tuple[Substitution, ...]:
        """The letters that matter most: each position's largest change, largest first."""
        best: dict[int, Substitution] = {}
        for item in self.substitutions:
            if item.position not in best or abs(item.change) > abs(best[item.position].change):
                best[item.position] = item
        return tuple(sorted(best.values(), key=lambda item: -abs(item.change))[:count])

    def matrix(self) -> Array:
        """Change of -ln J by position and letter (A, C, G, T), shape (N, 4)."""
        out = np.zeros((len(self.letters), len(BASES)))
        for item in self.substitutions:
            out[item.position, BASES.index(item.new)] = item.change
        return out

    def to_frame(self) -> Any:
        """Substitutions as a pandas table."""
        import pandas as pd

        return pd.DataFrame(self.to_dict()["substitutions"])

    def to_dict(self) -> dict[str, Any]:
        """The JSON of ``dnacheck sensitivity``."""
        return {
            "target": self.name,
            "n_bp": len(self.letters),
            "minus_lnJ": self.minus_lnJ,
            "stderr": self.stderr,
            "coordinates": list(self.coordinates),
            "steps": [
                {
                    "step": i,
                    "letters": self.letters[i] + self.letters[(i + 1) % len(self.letters)],
                    "d_lnJ_d_ground_per_deg": self.steps.ground[i].tolist(),
                    "d_lnJ_d_ground_stderr": self.steps.ground_stderr[i].tolist(),
                    "d_lnJ_d_ln_stiffness": self.steps.stiffness[i].tolist(),
                    "d_lnJ_d_ln_stiffness_stderr": self.steps.stiffness_stderr[i].tolist(),
                }
                for i in range(len(self.letters))
            ],
            "substitutions": [
                {
                    "position": item.position,
                    "old": item.old,
                    "new": item.new,
                    "predicted": item.predicted,
                    "predicted_stderr": item.predicted_stderr,
                    "computed": item.computed,
                    "computed_stderr": item.computed_stderr,
                }
                for item in self.substitutions
            ],
        }


def step_map(chain: Chain, draws: ClosedDraws) -> StepMap:
    """Derivatives of ln J by ground value and by stiffness of every step, with their errors."""
    stiffness = chain.energy_scale_RT * chain.stiffness
    n, d = chain.ground.shape
    pull = np.einsum("nij,knj->kni", stiffness, draws.strains).reshape(len(draws.weights), -1)
    ground, ground_error = (part.reshape(n, d) for part in draws.average(pull))
    diagonal = np.einsum("nii->ni", stiffness)
    inverse = np.einsum("nii->ni", np.linalg.inv(stiffness))
    squares = (0.5 * diagonal * draws.strains**2).reshape(len(draws.weights), -1)
    closed, error = (part.reshape(n, d) for part in draws.average(squares))
    per_degree = math.pi / 180.0
    scale = np.array([per_degree] * 3 + [1.0] * (d - 3))
    return StepMap(ground * scale, ground_error * scale, 0.5 * diagonal * inverse - closed, error)


def _predicted(chain: Chain, changed: Chain, draws: ClosedDraws) -> tuple[float, float]:
    """Change of -ln J to first order in the changed steps' parameters, and its standard error."""
    differ = np.any(changed.ground != chain.ground, axis=1)
    differ |= np.any(changed.stiffness != chain.stiffness, axis=(1, 2))
    steps = np.flatnonzero(differ)
    stiffness = chain.energy_scale_RT * chain.stiffness[steps]
    shift = changed.ground[steps] - chain.ground[steps]
    change = changed.energy_scale_RT * changed.stiffness[steps] - stiffness
    x = draws.strains[:, steps]
    # E_p of every draw along the change; its open mean is exact
    along = -np.einsum("kni,nij,nj->k", x, stiffness, shift)
    opened = 0.0
    if change.any():
        along += 0.5 * np.einsum("kni,nij,knj->k", x, change, x)
        opened = 0.5 * float(np.einsum("nij,nji->", np.linalg.inv(stiffness), change))
    closed, error = draws.average(along)
    return float(closed) - opened, float(error)


def sensitivity_of(
    chain: Chain,
    rebuild: Callable[[str], Chain],
    tolerance: float = 0.02,
    compute: int = 30,
    rng: int | np.random.SeedSequence = 0,
    threads: int = 1,
    progress: Callable[[int], None] | None = None,
) -> Sensitivity:
    """Map of a molecule and its substitutions.

    Parameters
    ----------
    chain : Chain
        With letters.
    rebuild : callable
        Chain of other letters by the same parameters, as ``chain`` was made.
    compute : int
        Substitutions computed anew: those with the largest predicted change.
    progress : callable, optional
        Called with the number of molecules computed since the last call.

    Raises
    ------
    InputError
        A chain without letters.
    SolveError
        No J for the molecule itself.
    """
    if not chain.letters:
        raise InputError(f"sensitivity of {chain.name}: the chain has no letters to change")
    if compute < 0:
        raise InputError(f"compute must not be negative, got {compute}")
    draws = closed_draws(chain, tolerance=tolerance, rng=rng, threads=threads)
    letters = chain.letters
    found: list[Substitution] = []
    changed_chains: dict[tuple[int, str], Chain] = {}
    for position, old in enumerate(letters):
        for new in BASES:
            if new == old:
                continue
            changed = rebuild(letters[:position] + new + letters[position + 1 :])
            changed_chains[position, new] = changed
            found.append(Substitution(position, old, new, *_predicted(chain, changed, draws)))
    chosen = sorted(found, key=lambda item: -abs(item.predicted))[:compute]

    def anew(item: Substitution) -> tuple[float, float]:
        other = closed_draws(
            changed_chains[item.position, item.new], tolerance=tolerance, rng=rng, threads=1
        )
        if progress is not None:
            progress(1)
        return draws.log_j - other.log_j, math.hypot(draws.stderr, other.stderr)

    with ThreadPoolExecutor(threads) as pool:
        values = list(pool.map(anew, chosen))
    computed = {(item.position, item.new): v for item, v in zip(chosen, values, strict=True)}
    found = [
        replace(
            item,
            computed=computed[item.position, item.new][0],
            computed_stderr=computed[item.position, item.new][1],
        )
        if (item.position, item.new) in computed
        else item
        for item in found
    ]
    coordinates: tuple[str, ...] = ("tau", "theta", "phi")
    if chain.ground.shape[1] == 6:
        coordinates = ("tilt", "roll", "twist", "shift", "slide", "rise")
    return Sensitivity(
        name=chain.name,
        letters=letters,
        minus_lnJ=-draws.log_j,
        stderr=draws.stderr,
        coordinates=coordinates,
        steps=step_map(chain, draws),
        substitutions=tuple(found),
    )
