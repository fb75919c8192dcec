"""The moving point of a continuation: corrector, tangent, and where it stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.continuation import kernels
from dnacheck.equilibria.continuation.options import ContinuationOptions
from dnacheck.equilibria.continuation.parameters import Parameter
from dnacheck.equilibria.continuum.collocation import Discretisation
from dnacheck.equilibria.continuum.state import new_state

Array = NDArray[np.float64]

#: Loads in use, without and with the symmetry about s = 0.
#:
#: The perfect problem (uniform, isotropic, straight) has two continuous symmetries: the ring may
#: be rolled about its own axis (the register), and the ends may be taken anywhere along it. Each
#: leaves a neutral direction and, by the conserved quantity that belongs to it (m3, the
#: Hamiltonian), makes one closure condition redundant. Every solution is symmetric about the
#: points where its curvature is extreme, under rotation by pi about the normal there; one of its
#: copies has such a point at s = 0 with the normal along e2, and there m2(0) = n2(0) = 0. These
#: two phase conditions remove both symmetries, and what closes such a solution are four
#: conditions at s = 1/2 (``kernels.closing_rows``): a square and regular system. The defect of
#: all six conditions (4.11) at s = 1 is reported as ``left_out``.
FULL = np.arange(6)
SYMMETRIC = np.array([0, 2, 3, 5])
FULL.setflags(write=False)
SYMMETRIC.setflags(write=False)


@dataclass(frozen=True)
class Spot:
    """A converged solution, kept while the walker moves on."""

    parameter: float
    loads: Array
    slopes: Array
    scaled: Array
    tangent: Array
    slopes_rate: Array
    turn_rate: float
    residual: float
    left_out: float
    sign: float
    log_det: float
    bend: float
    twist: float
    total_twist: float
    negative_directions: int
    iterations: int


class Walker:
    """Newton's method on the bordered equations, on one mesh.

    Parameters
    ----------
    disc : Discretisation
    active : Parameter
    symmetric : bool
        Follow solutions symmetric about s = 0 (see ``SYMMETRIC``).
    options : ContinuationOptions
    """

    def __init__(
        self,
        disc: Discretisation,
        active: Parameter,
        symmetric: bool,
        options: ContinuationOptions,
    ) -> None:
        self.disc, self.active, self.options = disc, active, options
        self.symmetric = symmetric
        self.free = SYMMETRIC if symmetric else FULL
        self.state = new_state(disc)
        bend = disc.rod.bend_stiffness
        moment, force = 2.0 * np.pi * bend, (2.0 * np.pi) ** 2 * bend
        self.scale = np.array([moment] * 3 + [force] * 3 + [active.scale])
        self.parameter = np.nan
        self.step = np.zeros(kernels.UNKNOWNS)
        self.tangent = np.zeros(kernels.UNKNOWNS)
        self.figures = np.zeros(kernels.FIGURES)
        self.iterations = 0

    def place(self, parameter: float, loads: Array, slopes: Array) -> None:
        """Stand at the given unknowns."""
        self.parameter = float(parameter)
        self.state.loads[:] = loads
        self.state.slopes[:] = slopes

    def scaled(self) -> Array:
        """The point in scaled unknowns, shape (7,)."""
        return np.append(self.state.loads, self.parameter) / self.scale

    def evaluate(self, border: Array, level: float) -> bool:
        """Sweep here; fills step, tangent and figures. False if a number was not finite."""
        if not self.parameter > self.active.least:
            return False
        conditions = self.active.conditions(self.disc, self.parameter)
        state, rule = self.state, self.disc.rule
        code = kernels.bordered_step(
            state.slopes,
            state.loads,
            self.parameter,
            conditions.coefficients,
            conditions.rates,
            conditions.alpha,
            conditions.alpha_rate,
            self.disc.h,
            rule.integrals,
            rule.weights,
            state.frames,
            state.centres,
            state.sensitivity,
            state.stage_sensitivity,
            state.parts,
            self.free,
            self.scale,
            border,
            level,
            self.step,
            self.tangent,
            self.figures,
        )
        return bool(code == kernels.FINE)

    def correct(self, border: Array, level: float) -> bool:
        """Newton iterations to the solution with border . unknowns = level."""
        options = self.options
        worst = np.inf
        for iteration in range(options.max_iterations + 1):
            self.iterations = iteration
            if not self.evaluate(border, level):
                return False
            residual = self.figures[kernels.RESIDUAL]
            if residual <= options.tolerance:
                accepted = max(options.symmetry_tolerance, options.tolerance)
                return not self.symmetric or bool(self.figures[kernels.LEFT_OUT] <= accepted)
            if iteration == options.max_iterations:
                return False
            # a step that raises the residual again and again is not going anywhere
            if iteration > 2 and residual > worst:
                return False
            worst = min(worst, residual)
            turn = self.figures[kernels.TURN]
            fraction = 1.0 if turn <= 1.0 else 1.0 / turn
            kernels.move(
                self.state.slopes,
                self.state.loads,
                self.state.stage_sensitivity,
                self.scale,
                self.step,
                fraction,
                1.0,
            )
            self.parameter += fraction * self.step[6] * self.scale[6]
        return False

    def at_parameter(self, value: float) -> bool:
        """Newton iterations to the solution at a value of the parameter."""
        border = np.zeros(kernels.UNKNOWNS)
        border[6] = 1.0
        return self.correct(border, value / self.scale[6])

    def spot(self, forward: Array | None) -> Spot:
        """What is worth keeping of the converged solution here.

        ``forward`` is a direction (7,) that the unit tangent is made to agree with.
        """
        state = self.state
        size = float(np.linalg.norm(self.tangent))
        tangent = self.tangent / size
        sign = self.figures[kernels.SIGN]
        if forward is not None and tangent @ forward < 0.0:
            tangent, sign = -tangent, -sign
        stages = state.stage_sensitivity
        rates = np.append(tangent * self.scale, 0.0)  # without the Newton column
        negative = -1
        if self.options.stability and not self.symmetric:
            negative = int(kernels.conjugate_points(state.sensitivity, True))
        bend, twist, total = state.parts.sum(axis=0)
        return Spot(
            parameter=self.parameter,
            loads=state.loads.copy(),
            slopes=state.slopes.copy(),
            scaled=self.scaled(),
            tangent=tangent,
            slopes_rate=(stages.reshape(-1, rates.size) @ rates).reshape(stages.shape[:3]),
            turn_rate=float(kernels.turn_rate(state.sensitivity, self.scale, tangent)),
            residual=float(self.figures[kernels.RESIDUAL]),
            left_out=float(self.figures[kernels.LEFT_OUT]) if self.symmetric else 0.0,
            sign=float(sign),
            # as if bordered by the unit tangent itself
            log_det=float(self.figures[kernels.LOG_DET]) + float(np.log(size)),
            bend=float(bend),
            twist=float(twist),
            total_twist=float(total),
            negative_directions=negative,
            iterations=self.iterations,
        )

    def matrix(self) -> Array:
        """Derivative of the closure conditions in use by the scaled unknowns, (f, f + 1)."""
        conditions = self.active.conditions(self.disc, self.parameter)
        state = self.state
        rows = np.empty((self.free.size, 8))
        kernels.closing_rows(
            state.frames,
            state.centres,
            state.sensitivity,
            conditions.alpha,
            conditions.alpha_rate,
            self.symmetric,
            rows,
        )
        columns = np.append(self.free, 6)
        return np.asarray(rows[:, columns] * self.scale[columns], dtype=float)

    def spread(self, direction: Array) -> Array:
        """A vector (f + 1,) over the unknowns in use as one over all, (7,)."""
        out = np.zeros(kernels.UNKNOWNS)
        out[self.free] = direction[:-1]
        out[6] = direction[-1]
        return out
