"""Paths from problems that are easy to solve to the rod at hand, for starts that Newton rejects.

Three quantities lead from one problem to another: gamma, the fraction of the intrinsic curvature
(Section VII); the end twist alpha; and a factor on K3. Soft twist is served by bringing in the
curvature, or by softening the twist from K3 = K1; stiff twist, where the flat ring has buckled at
the wanted alpha, by bringing in the end twist, after or together with the curvature. With all five
paths every one of 400 random sequences of 60-400 bp, K3/K1 from 0.05 to 20, has ended in a stable
ring; without the two that start from little twist and little curvature one in thirty did not at
K3/K1 of 5 and more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from dnacheck.equilibria.continuum.kernels import newton as kernel
from dnacheck.equilibria.continuum.options import ContinuumOptions
from dnacheck.equilibria.continuum.state import (
    State,
    register_roll,
    run_newton,
    start_from_perfect_ring,
)

# A step that needs more Newton iterations than this is too long to be safe.
_PATIENCE = 8
# Steps are lengthened after at most this many iterations.
_EASY = 4
_GROW, _SHRINK = 1.7, 0.4
_FIRST_STEP, _SHORTEST_STEP = 0.2, 1e-4
# The perfect ring has a register of its own choice only once there is some curvature, and an end
# twist of exactly zero is a degenerate point (Section VII).
_SOME_CURVATURE = 0.02
_SOME_TWIST = 1e-3


@dataclass(frozen=True)
class Problem:
    """A member of the three-parameter family of problems."""

    gamma: float
    log_twist_factor: float
    alpha: float

    def towards(self, other: Problem, fraction: float) -> Problem:
        """The problem a fraction of the way along the straight path."""
        return Problem(
            self.gamma + fraction * (other.gamma - self.gamma),
            self.log_twist_factor + fraction * (other.log_twist_factor - self.log_twist_factor),
            self.alpha + fraction * (other.alpha - self.alpha),
        )


def detours(state: State, alpha: float, turn: float, options: ContinuumOptions) -> Iterator[bool]:
    """Try one path after another; each yields whether the state now solves the problem.

    Parameters
    ----------
    state : State
        Overwritten by each attempt.
    alpha : float
        End twist wanted.
    turn : float
        Added to the register that first-order perturbation selects.
    options : ContinuumOptions
    """
    rod = state.disc.rod
    ratio = math.log(rod.twist_stiffness / rod.bend_stiffness)
    goal = Problem(1.0, 0.0, alpha)
    small = math.copysign(_SOME_TWIST, alpha)
    bare = Problem(_SOME_CURVATURE, 0.0, small)
    curve_then_twist = [bare, Problem(1.0, 0.0, small), goal]
    both = [bare, goal]
    twist_in = [Problem(1.0, 0.0, small), goal]
    curve_in = [Problem(_SOME_CURVATURE, 0.0, alpha), goal]
    soften = [Problem(1.0, -ratio, alpha), goal]
    if ratio > 0.0:
        paths = [twist_in, curve_then_twist, both, curve_in, soften]
    else:
        paths = [curve_in, soften, twist_in, curve_then_twist, both]
    for path in paths:
        start = path[0]
        roll = register_roll(state.disc, start.alpha) + turn
        start_from_perfect_ring(state, start.alpha, roll)
        coefficients = state.disc.coefficients(start.gamma, math.exp(start.log_twist_factor))
        arrived = run_newton(state, coefficients, start.alpha, options)
        for here, there in pairwise(path):
            arrived = arrived and _follow(state, here, there, options)
        if not arrived and state.code in (kernel.CONVERGED, kernel.NEUTRAL_MODE):
            # what is in the state solves another problem of the family
            state.code = kernel.ITERATION_LIMIT
        yield arrived


def _follow(state: State, start: Problem, goal: Problem, options: ContinuumOptions) -> bool:
    """Follow the solution along the straight path; True at its end."""
    rates = np.empty((state.disc.h.size, state.disc.rule.points.size, 4))
    careful = replace(options, max_iterations=_PATIENCE)
    good = state.slopes.copy(), state.loads.copy()
    slopes_rate, loads_rate = np.zeros_like(state.slopes), np.zeros(6)
    d_alpha = goal.alpha - start.alpha
    d_gamma = goal.gamma - start.gamma
    d_log = goal.log_twist_factor - start.log_twist_factor
    reached, step = 0.0, _FIRST_STEP
    for _ in range(options.homotopy_steps):
        step = min(step, 1.0 - reached)
        here = start.towards(goal, reached + step)
        coefficients = state.disc.coefficients(here.gamma, math.exp(here.log_twist_factor))
        rates[..., :2] = d_gamma * state.disc.strains.reshape(*rates.shape[:2], 2)
        rates[..., 2] = 0.0
        rates[..., 3] = -d_log * coefficients[..., 3]
        state.slopes[:] = good[0] + step * slopes_rate
        state.loads[:] = good[1] + step * loads_rate
        before = state.iterations
        if run_newton(state, coefficients, here.alpha, careful, rates):
            reached += step
            if reached >= 1.0:
                return True
            good = state.slopes.copy(), state.loads.copy()
            end = -state.sensitivity[-1][:, 6]
            end[2] += d_alpha
            loads_rate = np.linalg.lstsq(state.sensitivity[-1][:, :6], end, rcond=1e-12)[0]
            slopes_rate = state.stage_sensitivity[..., :6] @ loads_rate
            slopes_rate += state.stage_sensitivity[..., 6]
            if state.iterations - before <= _EASY:
                step *= _GROW
        else:
            step *= _SHRINK
            if step < _SHORTEST_STEP:
                return False
    return False
