"""Thermal averages of a chain under force and torque.

Chains are grown step by step from the Gaussian of each step; a chain's weight takes the work of the
loads on the step just added, and the population is resampled where its weights spread (sequential
Monte Carlo). Means over independent populations tell the error. The start is clamped along the
force and the end is free; the equilibrium of :class:`dnacheck.equilibria.boundary.Pull` holds the
end's axis too, which matters within a few persistence lengths of it.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.ensembles.kernels.pulled import PulledSteps, grow
from dnacheck.equilibria.boundary import Pull
from dnacheck.model.chain import Chain
from dnacheck.model.units import thermal_energy_pN_nm
from dnacheck.numerics.outcome import InputError
from dnacheck.numerics.seeds import Randomness, seed_sequence

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PulledMean:
    """Averages of a pulled chain, with standard errors.

    Attributes
    ----------
    extension_A, extension_stderr_A : float
        Mean distance of the ends along the force.
    turns, turns_stderr : float
        Mean turns of the end about the force; of the unstressed chain, its twist.
    excess_turns : float
        The same beyond the unstressed twist.
    log_partition : float
        ln of the partition function over that of the free chain.
    populations, chains : int
        Independent populations, and chains in each.
    seconds : float
    """

    extension_A: float
    extension_stderr_A: float
    turns: float
    turns_stderr: float
    excess_turns: float
    log_partition: float
    populations: int
    chains: int
    seconds: float

    def winds_up(self, chain: Chain, pull: Pull) -> bool:
        """Whether the end turned much further than the twist of the steps explains.

        A chain that folds back gains two turns each time its tangent passes over the axis, so that
        a torque wins over any force in the end. Where that is not slow, the mean is that of no
        lasting state: by more than one turn, and half, beyond what the steps yield by themselves.
        """
        softness = float(chain.flexibility[:, 0, 0].sum()) / chain.energy_scale_RT
        torque = pull.torque_pN_nm / thermal_energy_pN_nm(pull.temperature_K)
        yielded = torque * softness / (2.0 * math.pi)
        return torque != 0.0 and abs(self.excess_turns - yielded) > 1.0 + 0.5 * abs(yielded)


def pulled_mean(
    chain: Chain, pull: Pull, populations: int = 16, chains: int = 1000, rng: Randomness = 0
) -> PulledMean:
    """Mean extension and turn of a chain under a force and a torque.

    Parameters
    ----------
    populations, chains : int
        Independent populations, two at least, and chains in each. The bias is of the order of
        1 / chains.

    Raises
    ------
    InputError
        Steps of six parameters, or too few populations or chains.
    """
    began = time.perf_counter()
    chain.require_hinges("the thermal average of a pulled chain")
    if populations < 2 or chains < 2:
        raise InputError("a thermal average needs two populations of two chains, at least")
    values, vectors = np.linalg.eigh(chain.flexibility / chain.energy_scale_RT)
    root = np.ascontiguousarray(
        np.einsum("sij,sj,skj->sik", vectors, np.sqrt(np.maximum(values, 0.0)), vectors)
    )
    unit = thermal_energy_pN_nm(pull.temperature_K)
    steps = PulledSteps(
        chain.arrays.ground,
        root,
        chain.form_code,
        float(pull.force_pN * 0.1 * chain.rise_A / unit),
        float(pull.torque_pN_nm / unit),
    )
    means = np.empty((populations, 3))
    for row, stream in zip(means, seed_sequence(rng).spawn(populations), strict=True):
        grow(np.random.default_rng(stream), steps, chains, row)
    mean = means.mean(axis=0)
    error = means.std(axis=0, ddof=1) / math.sqrt(populations)
    turns = float(mean[1]) / (2.0 * math.pi)
    return PulledMean(
        extension_A=chain.rise_A * float(mean[0]),
        extension_stderr_A=chain.rise_A * float(error[0]),
        turns=turns,
        turns_stderr=float(error[1]) / (2.0 * math.pi),
        excess_turns=turns - float(chain.ground[:, 0].sum()) / (2.0 * math.pi),
        log_partition=float(mean[2]),
        populations=populations,
        chains=chains,
        seconds=time.perf_counter() - began,
    )


def marko_siggia_extension(length: float, persistence_A: float, pull: Pull) -> float:
    """Extension of Marko & Siggia's interpolation formula (1995), in the unit of ``length``.

    f P / kT = 1 / (4 (1 - x)^2) - 1/4 + x with x the extension over the length; within 17 % of the
    exact worm-like chain, and without the ends of a finite one.

    Raises
    ------
    InputError
        The force does not pull.
    """
    from scipy.optimize import brentq

    if pull.force_pN < 0.0:
        raise InputError(f"force_pN must not be negative for Marko & Siggia: {pull.force_pN}")
    scaled = pull.force_pN * 0.1 * persistence_A / thermal_energy_pN_nm(pull.temperature_K)
    share = brentq(lambda x: 0.25 / (1.0 - x) ** 2 - 0.25 + x - scaled, 0.0, 1.0 - 1e-12)
    return length * float(share)
