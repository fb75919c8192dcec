"""Compiled search for the minima of a ring over links and registers."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from dnacheck.equilibria.boundary_kernels import ring_boundary
from dnacheck.equilibria.discrete.kernels.cut import roll_back, rotated
from dnacheck.equilibria.discrete.kernels.newton import (
    CLOSURE,
    CONVERGED,
    ENERGY,
    N_FIGURES,
    NEAR_KNOWN,
    NEGATIVES,
    NEUTRAL,
    RESIDUAL,
    NewtonLimits,
    newton_away,
)
from dnacheck.equilibria.discrete.kernels.registers import (
    KnownRegister,
    register_functionals,
    register_of,
)
from dnacheck.equilibria.discrete.kernels.rigid_starts import fill_rigid_circle, rigid_registers
from dnacheck.equilibria.discrete.kernels.starts import circle_registers, fill_circle, fill_relaxed
from dnacheck.equilibria.discrete.kernels.states import by_kind
from dnacheck.model.chain_kernels import HingeSteps
from dnacheck.model.cut_kernels import least_rotation
from dnacheck.model.rigid_kernels import RigidSteps
from dnacheck.numerics.arrays import copy_rows

# Two minima are one when their energies agree to this relative precision and their angles to
# the second figure, in radians; converged solutions agree far better.
_SAME_ENERGY = 1e-7
_SAME_ANGLES = 1e-4
# A start so near (rad) to the register of the minimum that it was rolled away from falls back to
# it; the 121 closest pairs among 20,000 random molecules were 1.2 rad apart and more.
REACH = 1.0
# What the predicted energy may lack of a second minimum for one to be looked for, relative to a
# circle's energy. Of 129 molecules with two minima within 3 RT among 20,000 random ones, 22 had
# none predicted, and 22 of these lacked less than 0.0035.
LACKING = 0.005
# Share of the plan's ``far`` by which a predicted energy may miss the ring's and be believed.
_MISLED = 0.3
# Starts that look for a second minimum of a link.
_SECOND = 2
# Where the first register of a link leads to no minimum, these are tried instead, in turns of it.
_INSTEAD = (0.5, 0.25, 0.75)


class SearchPlan(NamedTuple):
    """Where minima are looked for.

    Attributes
    ----------
    links : ndarray, shape (L,)
    registers : ndarray, shape (R,)
        Further registers to start from, in radians from the predicted one.
    window : float
        Links whose minimum lies so far (reduced energy) above the lowest start only once.
    near : float
        Those that lie so far above it do not start from the further registers.
    far : float
        Links predicted to lie so far above the lowest do not start at all, unless no other link
        has a ring.
    """

    links: Any
    registers: Any
    window: float
    near: float
    far: float


class Minima(NamedTuple):
    """Room for the minima found, in order of discovery.

    Attributes
    ----------
    angles : ndarray, shape (M, N, c)
    multipliers : ndarray, shape (M, 6)
    figures : ndarray, shape (M, 8)
        See :func:`dnacheck.equilibria.discrete.kernels.newton.newton`.
    tried : ndarray of bool, shape (L,)
        Links of the plan that were started from.
    """

    angles: Any
    multipliers: Any
    figures: Any
    tried: Any


@njit(cache=True, nogil=True)
def _fill_hinge_circle(steps: HingeSteps, link: int, register: float, angles: Any) -> None:
    fill_circle(steps.ground, steps.form, link, register, angles)


@njit(cache=True, nogil=True)
def _rigid_predicted(
    steps: RigidSteps, link: int, registers: Any, turns: Any
) -> tuple[int, float, float]:
    return rigid_registers(steps, link, registers), math.inf, 0.0


@njit(cache=True, nogil=True)
def _fill_rigid_start(
    steps: RigidSteps, link: int, register: float, turns: Any, angles: Any
) -> None:
    fill_rigid_circle(steps, link, register, angles)


@njit(cache=True, nogil=True)
def _hinge_rows(steps: HingeSteps, link: int, along: Any, across: Any) -> float:
    register_functionals(steps.ground, steps.form, link, along, across)
    return REACH


@njit(cache=True, nogil=True)
def _rigid_rows(steps: RigidSteps, link: int, along: Any, across: Any) -> float:
    along[:], across[:] = 0.0, 0.0
    return -1.0


fill_start = by_kind(_fill_hinge_circle, fill_rigid_circle)
"""Angles (N, c) of a closed ring of a link and register: (steps, link, register, angles)."""

predicted_registers = by_kind(circle_registers, _rigid_predicted)
"""Registers to start from: (steps, link, registers, turns), see :func:`circle_registers`."""

_fill_relaxed_start = by_kind(fill_relaxed, _fill_rigid_start)
_register_rows = by_kind(_hinge_rows, _rigid_rows)


@njit(cache=True, nogil=True)
def best_register(steps: Any, link: int) -> float:
    """Register of lowest predicted energy of the planar ring; see :func:`circle_registers`."""
    rests = np.empty(2)
    predicted_registers(steps, link, rests, np.empty((2, steps.ground.shape[0] + 1, 3)))
    return rests[0]


@njit(cache=True, nogil=True)
def _keep(trial: Any, force: Any, figure: Any, found: int, minima: Minima) -> int:
    """Add a ring to the minima unless it is there; returns how many there are.

    Of a family of equal energy (a free register) one stands for all.
    """
    for m in range(found):
        gap = abs(minima.figures[m, ENERGY] - figure[ENERGY])
        if gap > _SAME_ENERGY * abs(figure[ENERGY]) + 1e-14:
            continue
        if figure[NEUTRAL] > 0.0 and minima.figures[m, NEUTRAL] > 0.0:
            return found
        worst = 0.0
        for s in range(trial.shape[0]):
            for j in range(trial.shape[1]):
                worst = max(worst, abs(trial[s, j] - minima.angles[m, s, j]))
        if worst < _SAME_ANGLES:
            return found
    if found == minima.angles.shape[0]:
        return found
    copy_rows(trial, minima.angles[found])
    for i in range(force.shape[0]):
        minima.multipliers[found, i] = force[i]
    for i in range(figure.shape[0]):
        minima.figures[found, i] = figure[i]
    return found + 1


@njit(cache=True, nogil=True)
def from_planar(
    steps: Any,
    link: int,
    register: float,
    turns: Any,
    limits: NewtonLimits,
    known: KnownRegister,
    ring: tuple[Any, Any, Any],
) -> int:
    """Solve from the relaxed planar ring of a link and register; returns Newton's code.

    ``turns`` are those of :func:`circle_registers`; ``ring`` is angles (N, c), multipliers (6,)
    and figures (8,), to be filled.
    """
    angles, multipliers, figures = ring
    _fill_relaxed_start(steps, link, register, turns, angles)
    multipliers[:] = 0.0
    figures[:] = 0.0
    return newton_away(angles, multipliers, steps, ring_boundary(), limits, known, figures)


@njit(cache=True, nogil=True, error_model="numpy")
def search_as_cut(
    steps: Any, plan: SearchPlan, limits: NewtonLimits, minima: Minima
) -> tuple[int, int, int]:
    """:func:`search` for a ring whose cut is the canonical one."""
    n = steps.ground.shape[0]
    count = plan.links.shape[0]
    found, starts, failed = 0, 0, 0
    trial, force, figure = np.empty(steps.ground.shape), np.empty(6), np.empty(N_FIGURES)
    ring = (trial, force, figure)
    along, across = np.empty((n, 3)), np.empty((n, 3))
    nothing = KnownRegister(along, across, 0.0, -1.0)
    rests = np.empty((count, 2))
    turns = np.empty((count, 2, n + 1, 3))
    choices = np.empty(count, dtype=np.int64)
    lacking = np.empty(count)
    registers = np.zeros(count)
    energies = np.full(count, math.inf)
    predicted = np.empty(count)
    lowest = math.inf
    misled = 0.0
    for i in range(count):
        choices[i], lacking[i], predicted[i] = predicted_registers(
            steps, plan.links[i], rests[i], turns[i]
        )
        minima.tried[i] = False
    ceiling = math.inf
    for i in range(count):
        # A prediction that is not a number sets no ceiling and is below any.
        if predicted[i] + plan.far < ceiling:
            ceiling = predicted[i] + plan.far
    for k in range(2 * count):
        i, link = k % count, plan.links[k % count]
        # Links far above the lowest have a second turn, if no other led to a ring or where the
        # prediction proved to be no guide, as for molecules that are bent by about a turn.
        if k < count:
            passed = predicted[i] > ceiling
        else:
            passed = found > 0 and misled <= _MISLED * plan.far
        if minima.tried[i] or passed:
            continue
        minima.tried[i] = True
        for attempt in range(1 + len(_INSTEAD)):
            start = rests[i, 0]
            if attempt > 0:
                start += 2.0 * math.pi * _INSTEAD[attempt - 1]
            starts += 1
            code = from_planar(steps, link, start, turns[i], limits, nothing, ring)
            if code == CONVERGED and figure[NEGATIVES] == 0:
                if choices[i] > 1 or lacking[i] < LACKING:
                    _register_rows(steps, link, along, across)
                    registers[i] = register_of(trial, along, across)[0]
                energies[i] = figure[ENERGY]
                misled = max(misled, abs(figure[ENERGY] - predicted[i]))
                lowest = min(lowest, figure[ENERGY])
                found = _keep(trial, force, figure, found, minima)
                break
            failed += 1
    for i in range(count):
        if not energies[i] <= lowest + plan.window:
            continue
        link = plan.links[i]
        reach = -1.0
        if choices[i] > 1 or lacking[i] < LACKING:
            reach = _register_rows(steps, link, along, across)
        known = KnownRegister(along, across, registers[i], reach)
        second = False
        further = plan.registers.shape[0] if energies[i] <= lowest + plan.near else 0
        for k in range(_SECOND + further):
            if k == 0:
                if choices[i] < 2:
                    continue
                start = rests[i, 1]
            elif k == 1:
                if second or not lacking[i] < LACKING:
                    continue
                # A planar ring rolled by psi has the register pi/2 - psi.
                start = 1.5 * math.pi - registers[i]
            else:
                start = rests[i, 0] + plan.registers[k - _SECOND]
            starts += 1
            away = known if k < _SECOND else nothing
            code = from_planar(steps, link, start, turns[i], limits, away, ring)
            if code == NEAR_KNOWN:
                continue
            if code != CONVERGED or figure[NEGATIVES] != 0:
                failed += 1
                continue
            before = found
            found = _keep(trial, force, figure, found, minima)
            second = second or found > before
    return found, starts, failed


@njit(cache=True, nogil=True, error_model="numpy")
def search(
    steps: Any, plan: SearchPlan, limits: NewtonLimits, minima: Minima
) -> tuple[int, int, int]:
    """Distinct minima of a ring, the same for every cut.

    The ring is searched as its canonical cut has it (see ``kernels.cut``) and what is found is
    rolled back; energies and determinants are equal to the last bit for all cuts. Each link
    starts from the planar ring in the register where it is predicted to rest. Links within the
    plan's window start again: half a turn from the register of the minimum found, where the
    prediction leaves room for a second one; from the second register predicted, if there is one;
    and from the plan's registers.

    Returns
    -------
    found, starts, failed : how many distinct minima, starts, and starts that did not converge.
    """
    cut = least_rotation(steps)
    found, starts, failed = search_as_cut(rotated(steps, cut), plan, limits, minima)
    nothing = np.empty((0, 3))
    polished = np.empty(N_FIGURES)
    for m in range(found):
        angles, multipliers, figures = (
            minima.angles[m],
            minima.multipliers[m],
            minima.figures[m],
        )
        stationarity, closure = roll_back(steps, cut, angles, multipliers)
        figures[RESIDUAL], figures[CLOSURE] = max(stationarity, closure), closure
        if figures[RESIDUAL] > limits.tolerance:
            # Components mix as the frame turns; what met the tolerance may just miss it.
            away = KnownRegister(nothing, nothing, 0.0, -1.0)
            newton_away(angles, multipliers, steps, ring_boundary(), limits, away, polished)
            figures[RESIDUAL], figures[CLOSURE] = polished[RESIDUAL], polished[CLOSURE]
    return found, starts, failed
