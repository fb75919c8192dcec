"""The two models that a sweep in the twist ratio follows: continuum rod and discrete chain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.bridge.homogenise import StepAxes, local_moment, moment_energy, step_axes
from dnacheck.equilibria.continuation.kernels import conjugate_points
from dnacheck.equilibria.continuum.collocation import aligned_mesh, discretise
from dnacheck.equilibria.continuum.kernels import newton as kernel
from dnacheck.equilibria.continuum.options import ContinuumOptions
from dnacheck.equilibria.continuum.search import lowest_continuum_ring
from dnacheck.equilibria.continuum.state import State, new_state, run_newton
from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
from dnacheck.equilibria.discrete.solve import NewtonOptions, solve_ring
from dnacheck.model.chain import Chain, scaled_twist
from dnacheck.model.rod.rod import Rod
from dnacheck.numerics.curve_topology import polygon_writhe

Array = NDArray[np.float64]

# Mesh intervals per smooth piece of the rod in a sweep: energies to a few parts in a million.
_PER_PIECE = 2
_WRITHE_CORNERS = 48
# Newton iterations from a neighbouring ratio; more means that it fell to another minimum.
_MOST_ITERATIONS = 12
# A warm start that ends farther than this from its guess, as a fraction, has left its branch.
_FAR = 0.5


@dataclass(frozen=True)
class Minimum:
    """A stable ring at one ratio.

    Attributes
    ----------
    energy, bend, twist : float
        Reduced.
    link : int
    residual : float
    unknowns : ndarray
        What starts the next solve, one-dimensional.
    alpha : float
        End twist of the continuum ring; 0 for the discrete one.
    """

    energy: float
    bend: float
    twist: float
    link: int
    residual: float
    unknowns: Array
    alpha: float = 0.0


class ContinuumModel:
    """Continuum rings on one mesh, at fixed bending stiffness."""

    kind: Literal["continuum", "discrete"] = "continuum"

    def __init__(self, rod: Rod, tolerance: float, chain: Chain | None = None) -> None:
        self.name = rod.name
        self.chain = chain
        self.axes: StepAxes | None = None if chain is None else step_axes(chain, rod)
        self.energy_scale_RT = rod.energy_scale_RT
        self.rod = rod
        intervals = _PER_PIECE * (rod.breaks.size - 1)
        self.options = ContinuumOptions(
            intervals=intervals, adapt=False, tolerance=tolerance, max_iterations=30
        )
        self.warm = replace(self.options, max_iterations=_MOST_ITERATIONS)
        self.disc = discretise(rod, aligned_mesh(rod.breaks, intervals), self.options.degree)
        self.state: State = new_state(self.disc)
        self.n_slopes = self.state.slopes.size

    def search(self, ratio: float) -> list[Minimum]:
        """Minima over links and registers."""
        rod = replace(self.rod, twist_stiffness=ratio * self.rod.bend_stiffness)
        search = lowest_continuum_ring(rod, options=self.options)
        found: list[Minimum] = []
        for ring in search.equilibria:
            if not ring.stable:
                continue
            unknowns = np.concatenate([ring.curve.slopes.ravel(), ring.curve.loads])
            energy = ring.energy
            if self.axes is not None:
                solution = ring.curve.solution(self.axes.s)
                energy = self._corrected(
                    energy, ratio, solution[:, 3:7], solution[:, :3], ring.curve.loads
                )
            found.append(
                Minimum(
                    energy,
                    ring.curve.bend,
                    ring.curve.twist,
                    ring.link,
                    ring.residual,
                    unknowns,
                    ring.curve.alpha,
                )
            )
        return found

    def follow(self, ratio: float, guess: Array, like: Minimum) -> Minimum | None:
        """The minimum near a guess, or None."""
        state = self.state
        state.slopes[:] = guess[: self.n_slopes].reshape(state.slopes.shape)
        state.loads[:] = guess[self.n_slopes :]
        factor = ratio * self.rod.bend_stiffness / self.rod.twist_stiffness
        coefficients = self.disc.coefficients(1.0, factor)
        if not run_newton(state, coefficients, like.alpha, self.warm):
            return None
        if state.code != kernel.CONVERGED or conjugate_points(state.sensitivity, True) != 0:
            return None
        unknowns = np.concatenate([state.slopes.ravel(), state.loads])
        if np.linalg.norm(unknowns - guess) > _FAR * np.linalg.norm(guess):
            return None
        bend, twist, total = (float(x) for x in state.parts.sum(axis=0))
        corners = np.arange(_WRITHE_CORNERS) / _WRITHE_CORNERS
        quaternions = state.quaternions()
        centres = state.evaluate(corners, quaternions)[1]
        turns = (total - self.rod.end_rotation) / (2.0 * np.pi)
        link = int(np.rint(turns + polygon_writhe(centres)))
        energy = bend + twist
        if self.axes is not None:
            q, r, _ = state.evaluate(self.axes.s, quaternions)
            energy = self._corrected(energy, ratio, q, r, state.loads)
        return Minimum(energy, bend, twist, link, state.residual, unknowns, like.alpha)

    def _corrected(self, energy: float, ratio: float, q: Array, r: Array, loads: Array) -> float:
        """See :mod:`dnacheck.equilibria.bridge.homogenise`."""
        assert self.axes is not None
        assert self.chain is not None
        compliance = self.axes.compliance(self.chain.with_twist_ratio(ratio).stiffness)
        return 2.0 * energy - moment_energy(local_moment(q, r, loads), compliance)


class DiscreteModel:
    """Discrete rings of a chain with the uniform diagonal stiffness, or of rigid steps.

    The ratio of rigid steps, which bring stiffnesses of their own, multiplies their twist's.
    """

    kind: Literal["continuum", "discrete"] = "discrete"

    def __init__(self, chain: Chain, tolerance: float) -> None:
        self.name = chain.name
        self.energy_scale_RT = chain.energy_scale_RT
        self.chain = chain
        self.newton = NewtonOptions(tolerance=tolerance)
        self.warm = NewtonOptions(
            tolerance=tolerance, minima_only=False, max_iterations=_MOST_ITERATIONS
        )

    def _at(self, ratio: float) -> Chain:
        if self.chain.rigid:
            return scaled_twist(self.chain, ratio)
        return self.chain.with_twist_ratio(ratio)

    def search(self, ratio: float) -> list[Minimum]:
        """Minima over links and registers."""
        chain = self._at(ratio)
        search = find_rings(chain, SearchOptions(newton=self.newton))
        return [
            Minimum(
                ring.energy,
                *ring.parts,
                ring.link,
                ring.residual,
                ring.angles.ravel(),
            )
            for ring in search.equilibria
        ]

    def follow(self, ratio: float, guess: Array, like: Minimum) -> Minimum | None:
        """The minimum near a guess, or None."""
        chain = self._at(ratio)
        ring = solve_ring(chain, guess.reshape(chain.ground.shape), self.warm, throw=False)
        if not ring.status.ok or not ring.stable:
            return None
        unknowns = ring.angles.ravel()
        shift = float(np.linalg.norm(unknowns - guess))
        if shift > _FAR * float(np.linalg.norm(guess - self.chain.ground.ravel())):
            return None
        return Minimum(ring.energy, *ring.parts, ring.link, ring.residual, unknowns)
