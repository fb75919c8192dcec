"""Langevin dynamics of the bead chain, on OpenMM's forces.

Ensemble averages do not depend on masses, so these are chosen for speed. With a mass on every
bond vector and groove arm (:class:`~dnacheck.md.coordinates.BondCoordinates`) instead of on the
beads, a bending wave of wave number q has a frequency proportional to sin(q/2), not to its square:
in a ring of 150 base pairs the slowest mode is then 40 times slower than the fastest, not 900
times, and the ring forgets its shape in about a hundred time steps.

The scheme is that of OpenMM's LangevinMiddleIntegrator (Zhang et al., J. Phys. Chem. A 123, 6056,
2019): kick, half drift, friction and noise, half drift, with one force evaluation. For harmonic
forces its positions have the exact distribution at any stable time step. OpenMM's own integrator,
with masses on the beads, is the second walker.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from dnacheck.md.bead_chain import BeadChain, BeadEnergy
from dnacheck.md.coordinates import BondCoordinates

Array = NDArray[np.float64]

# Lanczos steps find the highest frequency to about 1 %, which the step fraction covers.
_LANCZOS_STEPS = 30


class Walker(Protocol):
    """One replica's dynamics."""

    time_step_ps: float
    friction_per_ps: float
    degrees_of_freedom: int
    platform: str

    def advance(self, steps: int) -> None:
        """Go so many time steps."""

    def observe(self) -> tuple[Array, float, float]:
        """Bead positions (n_beads, 3) in Å, potential and kinetic energy in RT."""

    def state(self) -> dict[str, Any]:
        """What :meth:`restore` needs to go on bit by bit: arrays, bytes and text."""

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a saved state."""


def highest_frequency(force: Callable[[Array], Array], start: Array, projected: Any) -> float:
    """Highest frequency of unit masses near ``start``, by Lanczos iteration on force differences.

    Parameters
    ----------
    force : callable
        Force (n,) at coordinates (n,).
    start : ndarray, shape (n,)
    projected : callable
        Projection on the allowed directions, in place.

    Returns
    -------
    float
        Per unit of time; NaN where the forces are not finite.
    """
    rng = np.random.default_rng(0)
    vector = projected(rng.standard_normal(start.size))
    vector /= np.linalg.norm(vector)
    base, before, beta = force(start), np.zeros_like(vector), 0.0
    size = 1e-4 * np.sqrt(start.size)
    diagonal, beside = [], []
    for _ in range(_LANCZOS_STEPS):
        image = (base - force(start + size * vector)) / size - beta * before
        alpha = float(image @ vector)
        image -= alpha * vector
        diagonal.append(alpha)
        beta = float(np.linalg.norm(image))
        if not np.isfinite(beta):
            return float("nan")
        if beta < 1e-12:
            break
        beside.append(beta)
        before, vector = vector, image / beta
    order = len(diagonal)
    matrix = np.diag(diagonal) + np.diag(beside[: order - 1], 1) + np.diag(beside[: order - 1], -1)
    return float(np.sqrt(np.linalg.eigvalsh(matrix)[-1]))


class BondLangevin:
    """Langevin dynamics with unit masses on bond vectors and groove arms.

    Parameters
    ----------
    energy : BeadEnergy
    positions : ndarray, shape (n_beads, 3)
        Start, in Å.
    step_fraction : float
        Time step over 2 / (highest frequency at the start), the limit of stability.
    friction_factor : float
        Friction over the frequency of the slowest bending mode.
    bath_ratio : float
        Temperature of the bath over that at which energies are counted in RT.
    rng : numpy.random.Generator
    """

    def __init__(
        self,
        energy: BeadEnergy,
        positions: Array,
        step_fraction: float,
        friction_factor: float,
        bath_ratio: float,
        rng: np.random.Generator,
    ) -> None:
        self._energy = energy
        self._map = BondCoordinates(energy.beads)
        self._rng = rng
        self._x = self._map.of_beads(positions)
        self._v = np.sqrt(bath_ratio) * self._noise()
        highest = highest_frequency(self._force, self._x, self._map.projected)
        self._dt = step_fraction * 2.0 / highest
        friction = friction_factor * self._map.slowest_frequency
        self._keep = float(np.exp(-friction * self._dt))
        self._add = float(np.sqrt(bath_ratio * (1.0 - self._keep**2)))
        self.time_step_ps = self._dt * self._map.unit_ps
        self.friction_per_ps = friction / self._map.unit_ps
        self.degrees_of_freedom = self._map.degrees_of_freedom
        self.platform = energy.platform

    def _noise(self) -> Array:
        return self._map.projected(self._rng.standard_normal(self._map.size))

    def _force(self, x: Array) -> Array:
        return self._map.forces(self._energy.forces(self._map.beads(x)))

    def advance(self, steps: int) -> None:
        """Go so many time steps; positions may become NaN if the step is too long."""
        x, v, half = self._x, self._v, 0.5 * self._dt
        for _ in range(steps):
            v += self._dt * self._force(x)
            x += half * v
            v *= self._keep
            v += self._add * self._noise()
            x += half * v

    def observe(self) -> tuple[Array, float, float]:
        """Bead positions (n_beads, 3) in Å, potential and kinetic energy in RT."""
        positions = self._map.beads(self._x)
        return positions, self._energy.energy_RT(positions), 0.5 * float(self._v @ self._v)

    def state(self) -> dict[str, Any]:
        """Coordinates, velocities and the random generator's state."""
        return {
            "coordinates": self._x.copy(),
            "velocities": self._v.copy(),
            "generator": json.dumps(self._rng.bit_generator.state),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a saved state."""
        self._x = np.array(state["coordinates"], dtype=float)
        self._v = np.array(state["velocities"], dtype=float)
        self._rng.bit_generator.state = json.loads(str(state["generator"]))


class OpenMMLangevin:
    """OpenMM's LangevinMiddleIntegrator, with masses on the beads.

    Parameters
    ----------
    beads : BeadChain
    platform : str
    positions, step_fraction, friction_factor, bath_ratio
        As for :class:`BondLangevin`; the slowest mode is that of masses on the beads.
    seed : int
        Below 2**31.
    """

    def __init__(
        self,
        beads: BeadChain,
        platform: str,
        positions: Array,
        step_fraction: float,
        friction_factor: float,
        bath_ratio: float,
        seed: int,
    ) -> None:
        import openmm as mm

        options = beads.options
        temperature = bath_ratio * options.temperature_K
        self._rt = options.rt_kJ
        self._integrator = mm.LangevinMiddleIntegrator(temperature, 0.0, 0.0)
        self._integrator.setRandomNumberSeed(seed)
        energy = BeadEnergy(beads, platform, self._integrator)
        self._context = energy.context
        masses = [beads.system.getParticleMass(i)._value for i in range(beads.n_beads)]
        # Displacements in nm times the root of the mass; with energies in kJ/mol, frequencies
        # are per ps.
        scale = 10.0 / np.sqrt(np.repeat(masses, 3))

        def force(x: Array) -> Array:
            return energy.forces((x * scale).reshape(-1, 3)).ravel() * scale * self._rt

        highest = highest_frequency(force, positions.ravel() / scale, lambda vector: vector)
        coordinates = BondCoordinates(beads)
        self.time_step_ps = step_fraction * 2.0 / highest
        self.friction_per_ps = (
            friction_factor * coordinates.slowest_frequency**2 / coordinates.unit_ps
        )
        self.degrees_of_freedom = 3 * beads.n_beads
        self.platform = energy.platform
        self._integrator.setStepSize(self.time_step_ps)
        self._integrator.setFriction(self.friction_per_ps)
        self._context.setPositions(positions / 10.0)
        self._context.setVelocitiesToTemperature(temperature, seed)

    def advance(self, steps: int) -> None:
        """Go so many time steps; OpenMM raises its own exception on a NaN."""
        self._integrator.step(steps)

    def observe(self) -> tuple[Array, float, float]:
        """Bead positions (n_beads, 3) in Å, potential and kinetic energy in RT."""
        state = self._context.getState(getPositions=True, getEnergy=True)
        positions: Any = state.getPositions(asNumpy=True)
        return (
            10.0 * np.asarray(positions._value),
            float(state.getPotentialEnergy()._value) / self._rt,
            float(state.getKineticEnergy()._value) / self._rt,
        )

    def state(self) -> dict[str, Any]:
        """OpenMM's checkpoint, which holds its random numbers too."""
        return {"checkpoint": self._context.createCheckpoint()}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a saved state."""
        self._context.loadCheckpoint(bytes(state["checkpoint"]))
