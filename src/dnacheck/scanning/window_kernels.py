"""Compiled rings of neighbouring windows, each started from its neighbour's.

Base pair g of a record stands at place g mod N of a window's ring, so that two neighbouring windows
differ in the step that enters, the step that leaves and nothing else: the converged angles of one
are the start of the next as they stand, one or two Newton steps from its answer.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from dnacheck.equilibria.boundary_kernels import ring_boundary
from dnacheck.equilibria.discrete.kernels.newton import (
    CONVERGED,
    ENERGY,
    LOG_DET_KKT,
    N_FIGURES,
    NEGATIVES,
    NEUTRAL,
    NewtonLimits,
    newton,
)
from dnacheck.equilibria.discrete.kernels.registers import (
    KnownRegister,
    register_functionals,
    register_of,
)
from dnacheck.equilibria.discrete.kernels.search import LACKING, REACH, from_planar
from dnacheck.equilibria.discrete.kernels.starts import circle_registers, fill_circle
from dnacheck.equilibria.discrete.kernels.states import by_kind
from dnacheck.model.chain_kernels import HingeSteps
from dnacheck.model.rigid_kernels import RigidSteps

NO_RULE, RUNS_AND_FLANKS, RUNS_ONLY = range(3)
OTHER_LETTER = 4
"""Code of a letter other than A, C, G, T, which are 0 to 3."""

_ADENINE, _THYMINE = 0, 3
_SAME_ENERGY = 1e-7
_SHARE = 5.0
"""Links whose J lies further below the best (in ln J) are not searched for a second minimum."""


class StepTables(NamedTuple):
    """Parameters of all steps, by the letters that they depend on.

    Attributes
    ----------
    ground : ndarray, shape (4^k, d)
        In the order AA, AC, ..., TT for k = 2 letters, AAAA, AAAC, ... for k = 4.
    stiffness : ndarray, shape (4^k, d, d)
        Reduced.
    log_det : ndarray, shape (4^k,)
        ln det of each stiffness.
    tract_twist : float
        Twist of steps inside an A-tract region, radians.
    rule : int
        ``NO_RULE``, ``RUNS_AND_FLANKS`` or ``RUNS_ONLY``.
    shortest, gap, flank : int
        Of the rule, see :mod:`dnacheck.model.a_tracts`.
    """

    ground: Any
    stiffness: Any
    log_det: Any
    tract_twist: float
    rule: int
    shortest: int
    gap: int
    flank: int


class Followed(NamedTuple):
    """Minima that are followed from window to window: arrays with room for M of them."""

    angles: Any
    multipliers: Any
    figures: Any
    links: Any
    live: Any


class Judgement(NamedTuple):
    """What a followed ring must meet.

    ``scale`` is RT per reduced unit, ``constant`` that of ln J = constant + ln det K / 2 - E -
    ln det KKT / 2, ``jump_RT`` the largest change of an energy from window to window. Below
    ``amplitude_RT`` of :func:`register_amplitude` a link may have two minima.
    """

    scale: float
    constant: float
    jump_RT: float
    amplitude_RT: float


class Work(NamedTuple):
    """Room for one minimum on trial and for what predicts it."""

    trial: Any
    force: Any
    figure: Any
    registers: Any
    turns: Any
    along: Any
    across: Any


@njit(cache=True, nogil=True)
def new_work(steps: Any) -> Work:
    """Room for chains like this one."""
    n = steps.ground.shape[0]
    return Work(
        np.empty(steps.ground.shape),
        np.empty(6),
        np.empty(N_FIGURES),
        np.empty(2),
        np.empty((2, n + 1, 3)),
        np.empty((n, 3)),
        np.empty((n, 3)),
    )


class WindowRows(NamedTuple):
    """Results by window: reduced energy, link, ln J, number of minima, and free registers."""

    energy: Any
    link: Any
    log_j: Any
    minima: Any
    free: Any


@njit(cache=True, nogil=True)
def mark_tracts(letters: Any, tables: StepTables, inside: Any) -> None:
    """Which steps of a closed molecule take the A-tract twist, into ``inside`` (N,)."""
    n = letters.shape[0]
    inside[:] = False
    if tables.rule == NO_RULE:
        return
    begin = -1
    for i in range(n):
        if letters[i] != letters[i - 1] or letters[i] not in (_ADENINE, _THYMINE):
            begin = i
            break
    if begin < 0:
        inside[:] = True
        return
    first_of = np.empty(n, dtype=np.int64)
    last_of = np.empty(n, dtype=np.int64)
    runs = 0
    least = tables.shortest if tables.rule == RUNS_AND_FLANKS else tables.shortest - 1
    k = 0
    while k < n:
        letter = letters[(begin + k) % n]
        end = k
        while end + 1 < n and letters[(begin + end + 1) % n] == letter:
            end += 1
        if end - k + 1 >= least and letter in (_ADENINE, _THYMINE):
            first_of[runs], last_of[runs] = k, end
            runs += 1
        k = end + 1
    if tables.rule == RUNS_ONLY:
        for r in range(runs):
            for k in range(first_of[r], last_of[r]):
                inside[(begin + k) % n] = True
        return
    for r in range(runs):
        nearest = first_of[(r + 1) % runs] + (n if r + 1 == runs else 0)
        joined = nearest - last_of[r] - 1 <= tables.gap
        to = nearest if joined else last_of[r] + tables.flank
        for k in range(first_of[r] - tables.flank, to + 1):
            inside[(begin + k) % n] = True


@njit(cache=True, nogil=True)
def fill_window(codes: Any, start: int, tables: StepTables, steps: Any, inside: Any) -> float:
    """Ground values and stiffness of a window's ring, base pair g at place g mod N.

    Returns ln det of all stiffnesses.
    """
    log_det = 0.0
    n = steps.ground.shape[0]
    mark_tracts(codes[start : start + n], tables, inside)
    wide = tables.ground.shape[0] > 16
    for k in range(n):
        index = 4 * codes[start + k] + codes[start + (k + 1) % n]
        if wide:  # the letters before and after belong to the step
            index = 64 * codes[start + (k - 1) % n] + 4 * index + codes[start + (k + 2) % n]
        place = (start + k) % n
        steps.ground[place] = tables.ground[index]
        steps.stiffness[place] = tables.stiffness[index]
        log_det += tables.log_det[index]
        if inside[k]:
            steps.ground[place, 0] = tables.tract_twist
    return log_det


@njit(cache=True, nogil=True)
def register_amplitude(steps: Any, angles: Any) -> float:
    """Reduced energy by which the ground bends prefer one register of a ring to its opposite.

    The first harmonic of the energy of a planar ring with angles (N, 3), as its molecule is
    turned about its own axis inside it.
    """
    along, across = 0.0, 0.0
    for s in range(steps.ground.shape[0]):
        stiffness = 0.5 * (steps.stiffness[s, 1, 1] + steps.stiffness[s, 2, 2])
        theta, phi = steps.ground[s, 1], steps.ground[s, 2]
        along += stiffness * (theta * angles[s, 1] + phi * angles[s, 2])
        across += stiffness * (phi * angles[s, 1] - theta * angles[s, 2])
    return math.sqrt(along * along + across * across)


@njit(cache=True, nogil=True)
def has_room(steps: HingeSteps, link: int, work: Work) -> tuple[int, float]:
    """Minima predicted for a link, and what its energy lacks of one more."""
    count, lacking, _ = circle_registers(steps, link, work.registers, work.turns)
    return count, lacking


@njit(cache=True, nogil=True)
def amplitude_of_link(steps: HingeSteps, link: int, work: Work) -> float:
    """:func:`register_amplitude` of the planar ring of a link."""
    fill_circle(steps.ground, steps.form, link, 0.0, work.trial)
    return register_amplitude(steps, work.trial)


@njit(cache=True, nogil=True)
def _rigid_amplitude(steps: RigidSteps, link: int, work: Work) -> float:
    return math.inf


@njit(cache=True, nogil=True)
def _hinge_second(
    steps: HingeSteps, link: int, angles: Any, limits: NewtonLimits, work: Work
) -> bool:
    """Whether a link has another minimum than a known one, into ``work``; as a search looks."""
    count, lacking = has_room(steps, link, work)
    if count < 2 and not lacking < LACKING:
        return False
    register_functionals(steps.ground, steps.form, link, work.along, work.across)
    register = register_of(angles, work.along, work.across)[0]
    known = KnownRegister(work.along, work.across, register, REACH)
    ring = (work.trial, work.force, work.figure)
    for k in range(2):
        if (k == 0 and count < 2) or (k > 0 and not lacking < LACKING):
            continue
        start = work.registers[1] if k == 0 else 1.5 * math.pi - register
        code = from_planar(steps, link, start, work.turns, limits, known, ring)
        if code == CONVERGED and work.figure[NEGATIVES] == 0:
            return True
    return False


@njit(cache=True, nogil=True)
def _rigid_second(
    steps: RigidSteps, link: int, angles: Any, limits: NewtonLimits, work: Work
) -> bool:
    return False


_amplitude = by_kind(amplitude_of_link, _rigid_amplitude)
_second = by_kind(_hinge_second, _rigid_second)


@njit(cache=True, nogil=True)
def add_second_minimum(
    steps: Any, minima: Followed, m: int, limits: NewtonLimits, work: Work
) -> int:
    """Look for the other minimum of the link of minimum ``m`` where there is room for one.

    Returns its place in ``minima``, -1 if there is none.
    """
    link = minima.links[m]
    free = -1
    for other in range(minima.live.shape[0]):
        if not minima.live[other]:
            free = other
        elif other != m and minima.links[other] == link:
            return -1
    if free < 0 or not _second(steps, link, minima.angles[m], limits, work):
        return -1
    for other in range(minima.live.shape[0]):
        gap = abs(minima.figures[other, ENERGY] - work.figure[ENERGY])
        if minima.live[other] and gap <= _SAME_ENERGY * work.figure[ENERGY] + 1e-14:
            return -1
    minima.angles[free] = work.trial
    minima.multipliers[free] = work.force
    minima.figures[free] = work.figure
    minima.links[free] = link
    minima.live[free] = True
    return free


@njit(cache=True, nogil=True, error_model="numpy")
def follow_windows(
    codes: Any,
    start: int,
    stride: int,
    tables: StepTables,
    steps: Any,
    limits: NewtonLimits,
    judgement: Judgement,
    minima: Followed,
    rows: WindowRows,
) -> int:
    """Follow minima through windows from ``start`` on; fills ``rows`` and returns how many.

    Where the ground bends hardly prefer a register, a link's second minimum is looked for. It
    stops early where a minimum is lost, where the lowest energy jumps, or where no minimum is
    left; the caller searches anew there.
    """
    n = steps.ground.shape[0]
    inside = np.empty(n, dtype=np.bool_)
    work = new_work(steps)
    boundary = ring_boundary()
    room = minima.live.shape[0]
    parts = np.empty(room)
    before = math.inf
    for w in range(rows.energy.shape[0]):
        constant = judgement.constant
        constant += 0.5 * fill_window(codes, start + w * stride, tables, steps, inside)
        lowest, chosen, best = math.inf, -1, -math.inf
        for m in range(room):
            if not minima.live[m]:
                continue
            work.trial[:] = minima.angles[m]
            work.force[:] = minima.multipliers[m]
            work.figure[:] = 0.0
            needed = minima.figures[m, ENERGY] * judgement.scale
            code = newton(work.trial, work.force, steps, boundary, limits, work.figure)
            energy = work.figure[ENERGY]
            lost = code != CONVERGED or work.figure[NEGATIVES] > 0
            if not lost and w > 0:
                lost = abs(energy * judgement.scale - needed) > judgement.jump_RT
            for other in range(m):
                if not lost and minima.live[other]:
                    gap = abs(minima.figures[other, ENERGY] - energy)
                    lost = gap <= _SAME_ENERGY * energy + 1e-14
            if lost:
                if w > 0:
                    return w
                minima.live[m] = False
                continue
            minima.angles[m] = work.trial
            minima.multipliers[m] = work.force
            minima.figures[m] = work.figure
            if energy < lowest:
                lowest, chosen = energy, m
            parts[m] = constant - judgement.scale * energy - 0.5 * work.figure[LOG_DET_KKT]
            best = max(best, parts[m])
        if chosen < 0:
            return w
        amplitude = _amplitude(steps, minima.links[chosen], work) * judgement.scale
        if amplitude < judgement.amplitude_RT:
            for m in range(room):
                if not minima.live[m] or parts[m] < best - _SHARE:
                    continue
                new = add_second_minimum(steps, minima, m, limits, work)
                if new >= 0:
                    energy = minima.figures[new, ENERGY]
                    parts[new] = constant - judgement.scale * energy
                    parts[new] -= 0.5 * minima.figures[new, LOG_DET_KKT]
                    best = max(best, parts[new])
                    if energy < lowest:
                        lowest, chosen = energy, new
        if w > 0 and abs(lowest - before) * judgement.scale > judgement.jump_RT:
            return w
        before = lowest
        total = 0.0
        count = 0
        free = 0
        for m in range(room):
            if minima.live[m]:
                total += math.exp(parts[m] - best)
                count += 1
                free += 1 if minima.figures[m, NEUTRAL] > 0.0 else 0
        rows.energy[w] = lowest
        rows.link[w] = minima.links[chosen]
        rows.log_j[w] = best + math.log(total)
        rows.minima[w] = count
        rows.free[w] = free
    return rows.energy.shape[0]
