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
from dnacheck.equilibria.boundary_kernels import Boundary, end_residual, place_start
from dnacheck.equilibria.discrete.kernels.closure import energy_gradient, linearise_placed
from dnacheck.equilibria.discrete.kernels.registers import (
    register_functionals as register_functionals,
)
from dnacheck.equilibria.discrete.kernels.registers import register_of as register_of
from dnacheck.equilibria.discrete.kernels.states import hold_ground, still_axes
from dnacheck.model.chain_kernels import WEDGE, is_bound

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
"""Largest change of one angle in one iteration, in radians."""
_FIRST_PENALTY = 4.0
_PENALTY_RISES = 8


class RegisterProblem(NamedTuple):
    """One register of one link, and how well its minimum is to be met.

    Attributes
    ----------
    inverse_stiffness : ndarray, shape (N, 3, 3)
        In 1/RT.
    along, across : ndarray, shape (N, 3)
        Rows of Re S and Im S, see :func:`register_functionals`.
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
    steps : HingeSteps, stiffness in RT. problem : RegisterProblem.
    angles, multipliers : (N, 3), (7,); start and result. Energies in RT, lengths in steps.
    factors : :class:`dnacheck.cyclization.laplace.kernels.gaussian.SliceFactors`, filled.
    figures : (5,), filled with energy, ln det KKT (RT, steps), |S|, d energy / d register and
        iterations.

    Returns
    -------
    code : FOUND, NOT_CONVERGED, NOT_FINITE or NOT_A_MINIMUM.
    """
    n = angles.shape[0]
    form = steps.form
    along, across = problem.along, problem.across
    right, z, root, schur = factors.right, factors.z, factors.root, factors.schur
    centres = np.empty((n + 1, 3))
    frames = np.empty((n + 1, 3, 3))
    axes = np.empty((n, 3, 3))
    halves = np.empty((n if form != WEDGE else 0, 5, 3))
    gradient = np.empty((n, 3))
    row = np.empty((n, 3))
    moving = np.empty((n, 3))
    rows = np.zeros((n, 3, WIDTH))
    columns = np.empty((n, 3, WIDTH))
    solved = np.empty((n, 3, WIDTH))
    closure = np.empty(ROWS)
    gram = np.empty((ROWS, WIDTH))
    weight = np.empty((ROWS, ROWS))
    small = np.empty((ROWS, WIDTH))
    new = np.empty(ROWS)
    step = np.empty((n, 3))
    turn = np.zeros(1)
    boundary = problem.boundary
    place_start(boundary, centres[0], frames[0])
    c, sn = math.cos(problem.register), math.sin(problem.register)
    for s in range(n):
        for j in range(3):
            row[s, j] = c * across[s, j] - sn * along[s, j]
            moving[s, j] = 0.0 if is_bound(steps.stiffness, s) else row[s, j]
    hold_ground(steps, angles)
    for iteration in range(problem.most + 1):
        linearise_placed(angles, form, centres, frames, axes, halves)
        still_axes(steps.stiffness, axes)
        energy = energy_gradient(angles, steps.ground, steps.stiffness, gradient)
        end_residual(boundary, centres[n], frames[n], turn, closure)
        constraint_rows(centres, axes, moving, rows)
        closure[6] = 0.0
        extent = 0.0
        worst = 0.0
        for s in range(n):
            for j in range(3):
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
        drop_free(boundary.fixed, gram, 1.0)
        if math.isnan(invert_small(gram[:, :ROWS], weight)):
            return NOT_FINITE
        drop_free(boundary.fixed, weight, 0.0)
        rise = _FIRST_PENALTY
        log_det = math.nan
        for _ in range(_PENALTY_RISES):
            log_det = factorise_slice(
                steps.stiffness,
                form,
                centres,
                axes,
                halves,
                multipliers,
                rows,
                rise * weight,
                right,
                z,
                root,
            )
            if not math.isnan(log_det):
                break
            rise *= 4.0
        if math.isnan(log_det):
            return NOT_A_MINIMUM
        for s in range(n):
            for j in range(3):
                for i in range(ROWS):
                    solved[s, j, i] = rows[s, j, i]
                solved[s, j, ROWS] = gradient[s, j]
        solve_slice(right, z, root, solved)
        products(rows, solved, small)
        drop_free(boundary.fixed, small, 1.0)
        log_small = invert_small(small[:, :ROWS], schur)
        if math.isnan(log_small):
            return NOT_FINITE
        drop_free(boundary.fixed, schur, 0.0)
        if done:
            figures[LOG_DET_KKT] = log_det + log_small
            combine(solved, schur, ROWS, factors.projector)
            combine(columns, weight, 6, factors.directions)
            for s in range(n):
                for j in range(3):
                    for i in range(ROWS):
                        factors.rows[i, 3 * s + j] = rows[s, j, i]
            return FOUND
        for i in range(ROWS):
            new[i] = 0.0
            for j in range(ROWS):
                new[i] += schur[i, j] * (closure[j] - small[j, ROWS])
        largest = 0.0
        for s in range(n):
            for k in range(3):
                total = solved[s, k, ROWS]
                for i in range(ROWS):
                    total += solved[s, k, i] * new[i]
                step[s, k] = -total
                largest = max(largest, abs(total))
        fraction = 1.0 if largest <= _TURN_CAP else _TURN_CAP / largest
        for s in range(n):
            for k in range(3):
                angles[s, k] += fraction * step[s, k]
        for i in range(ROWS):
            # M holds the penalty, whose force on the step is not a multiplier.
            for j in range(ROWS):
                new[i] -= rise * weight[i, j] * closure[j]
            multipliers[i] += fraction * (new[i] - multipliers[i])
    return NOT_CONVERGED
