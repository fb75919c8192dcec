"""Compiled minima of a chain under a boundary whose register is constrained.

The register is that of :mod:`dnacheck.equilibria.discrete.kernels.registers`: the shapes of one
register form a half hyperplane.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from dnacheck.cyclization.laplace.kernels.gaussian import (
    ROWS,
    WIDTH,
    combine,
    constraint_rows,
    drop_free,
    factorise_slice,
    invert_small,
    products,
    solve_slice,
    stiff_columns,
)
from dnacheck.equilibria.boundary_kernels import Boundary
from dnacheck.equilibria.discrete.kernels.registers import register_of as register_of
from dnacheck.equilibria.discrete.kernels.registers import register_rows as register_rows
from dnacheck.equilibria.discrete.kernels.states import evaluate, hold_ground, new_state
from dnacheck.model.chain_kernels import is_bound

FOUND = 0
NOT_CONVERGED = 1
NOT_FINITE = 2
NOT_A_MINIMUM = 3

# Positions of the figures of a register-constrained minimum.
ENERGY, LOG_DET_KKT, EXTENT, SLOPE, ITERATIONS = range(5)
N_FIGURES = 5

CLOSED = 1e-7
"""Closure residual (steps, radians) of a register-constrained minimum. Newton's last step leaves
far less; and what is left changes no sampled J, whose draws close by themselves."""
_TURN_CAP = 0.1
"""Largest change of one coordinate in one iteration, in radians and step lengths."""
_FIRST_PENALTY = 4.0
_PENALTY_RISES = 8


class RegisterProblem(NamedTuple):
    """One register of one link, and how well its minimum is to be met.

    Attributes
    ----------
    inverse_stiffness : ndarray, shape (N, c, c)
        In 1/RT.
    along, across : ndarray, shape (N, c)
        Rows of Re S and Im S, see :data:`register_rows`.
    register : float
        In radians.
    tolerance : float
        Largest entry of the gradient of the Lagrangian, RT per radian.
    closed : float
        Largest closure residual, steps and radians.
    most : int
        Iterations.
    boundary : Boundary
        What the end is held to; no loads.
    """

    inverse_stiffness: Any
    along: Any
    across: Any
    register: float
    tolerance: float
    closed: float
    most: int
    boundary: Boundary


@njit(cache=True, nogil=True, error_model="numpy")
def constrained_minimum(
    steps: Any, problem: Any, angles: Any, multipliers: Any, factors: Any, figures: Any
) -> int:
    """Minimum of the energy over closed shapes of one register, and the Gaussian about it.

    Newton's iteration on the seven constraints from a start close by, in place; the Hessian is
    that of the Lagrangian of closure, because the register row is linear.

    Parameters
    ----------
    steps : HingeSteps or RigidSteps, stiffness in RT. problem : RegisterProblem.
    angles, multipliers : (N, c), (7,); start and result. Energies in RT, lengths in steps.
    factors : :class:`dnacheck.cyclization.laplace.kernels.gaussian.SliceFactors`, filled.
    figures : (5,), filled with energy, ln det KKT (RT, steps), |S|, d energy / d register and
        iterations.

    Returns
    -------
    code : FOUND, NOT_CONVERGED, NOT_FINITE or NOT_A_MINIMUM.
    """
    n, width = angles.shape
    along, across = problem.along, problem.across
    schur = factors.schur
    state = new_state(steps, problem.boundary)
    gradient = state.gradient
    row = np.empty((n, width))
    moving = np.empty((n, width))
    rows = np.zeros((n, width, WIDTH))
    columns = np.empty((n, width, WIDTH))
    solved = np.empty((n, width, WIDTH))
    closure = np.empty(ROWS)
    gram = np.empty((ROWS, WIDTH))
    weight = np.empty((ROWS, ROWS))
    small = np.empty((ROWS, WIDTH))
    new = np.empty(ROWS)
    step = np.empty((n, width))
    c, sn = math.cos(problem.register), math.sin(problem.register)
    for s in range(n):
        for j in range(width):
            row[s, j] = c * across[s, j] - sn * along[s, j]
            moving[s, j] = 0.0 if is_bound(steps.stiffness, s) else row[s, j]
    hold_ground(steps, angles)
    for iteration in range(problem.most + 1):
        state.angles[:] = angles
        energy = evaluate(state, steps)
        closure[:6] = state.closure
        constraint_rows(state, moving, rows)
        closure[6] = 0.0
        extent = 0.0
        worst = 0.0
        for s in range(n):
            for j in range(width):
                closure[6] += row[s, j] * angles[s, j]
                extent += (c * along[s, j] + sn * across[s, j]) * angles[s, j]
                total = gradient[s, j]
                for i in range(ROWS):
                    total += rows[s, j, i] * multipliers[i]
                if not abs(total) <= worst:
                    worst = abs(total)
        open_by = 0.0
        for i in range(ROWS):
            if not abs(closure[i]) <= open_by:
                open_by = abs(closure[i])
        figures[ENERGY] = energy
        figures[EXTENT] = extent
        figures[SLOPE] = -multipliers[6] * extent
        figures[ITERATIONS] = iteration
        if not (math.isfinite(energy) and math.isfinite(worst) and math.isfinite(open_by)):
            return NOT_FINITE
        done = worst <= problem.tolerance and open_by <= problem.closed
        if not done and iteration == problem.most:
            return NOT_CONVERGED
        stiff_columns(rows, problem.inverse_stiffness, columns)
        products(rows, columns, gram)
        drop_free(problem.boundary.fixed, gram, 1.0)
        if math.isnan(invert_small(gram[:, :ROWS], weight)):
            return NOT_FINITE
        drop_free(problem.boundary.fixed, weight, 0.0)
        rise = _FIRST_PENALTY
        log_det = math.nan
        for _ in range(_PENALTY_RISES):
            log_det = factorise_slice(state, steps, multipliers, rows, rise * weight, factors)
            if not math.isnan(log_det):
                break
            rise *= 4.0
        if math.isnan(log_det):
            return NOT_A_MINIMUM
        for s in range(n):
            for j in range(width):
                for i in range(ROWS):
                    solved[s, j, i] = rows[s, j, i]
                solved[s, j, ROWS] = gradient[s, j]
        solve_slice(steps, factors, solved)
        products(rows, solved, small)
        drop_free(problem.boundary.fixed, small, 1.0)
        log_small = invert_small(small[:, :ROWS], schur)
        if math.isnan(log_small):
            return NOT_FINITE
        drop_free(problem.boundary.fixed, schur, 0.0)
        if done:
            figures[LOG_DET_KKT] = log_det + log_small
            combine(solved, schur, ROWS, factors.projector)
            combine(columns, weight, 6, factors.directions)
            for s in range(n):
                for j in range(width):
                    for i in range(ROWS):
                        factors.rows[i, width * s + j] = rows[s, j, i]
            return FOUND
        for i in range(ROWS):
            new[i] = 0.0
            for j in range(ROWS):
                new[i] += schur[i, j] * (closure[j] - small[j, ROWS])
        largest = 0.0
        for s in range(n):
            for k in range(width):
                total = solved[s, k, ROWS]
                for i in range(ROWS):
                    total += solved[s, k, i] * new[i]
                step[s, k] = -total
                largest = max(largest, abs(total))
        fraction = 1.0 if largest <= _TURN_CAP else _TURN_CAP / largest
        for s in range(n):
            for k in range(width):
                angles[s, k] += fraction * step[s, k]
        for i in range(ROWS):
            # M holds the penalty, whose force on the step is not a multiplier.
            for j in range(ROWS):
                new[i] -= rise * weight[i, j] * closure[j]
            multipliers[i] += fraction * (new[i] - multipliers[i])
    return NOT_CONVERGED
