"""Compiled state of a chain of elastic steps: its shape, derivatives, energy and closure.

The solver above this module is written once. What depends on the kind of steps, three angles about
a pivot (:class:`HingeState`) or six parameters (:class:`RigidState`), is chosen here when a kernel
is compiled, by the type of its first argument; a kernel that meets hinges alone holds no code for
rigid steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numba.extending import overload

from dnacheck.equilibria.boundary_kernels import Boundary, end_residual, place_start
from dnacheck.equilibria.discrete.kernels.closure import (
    closure_jacobian,
    energy_gradient,
    lagrangian_gradient,
    linearise_placed,
)
from dnacheck.equilibria.discrete.kernels.factorisation import (
    FACTOR_WIDTH,
    back_substitute,
    eliminate,
    factorise,
)
from dnacheck.equilibria.discrete.kernels.rigid_closure import (
    rigid_energy_gradient,
    rigid_jacobian,
    rigid_lagrangian_gradient,
)
from dnacheck.equilibria.discrete.kernels.rigid_factorisation import (
    RIGID_FACTOR_WIDTH,
    back_substitute_rigid,
    eliminate_rigid,
    factorise_rigid,
)
from dnacheck.model.chain_kernels import HingeSteps, fill_angles, is_bound
from dnacheck.model.rigid_kernels import (
    RigidSteps,
    fill_rigid_coordinates,
    linearise_rigid,
    new_kinematics,
)
from dnacheck.numerics.curve_topology import edge_frames, link_of_ring


class HingeState(NamedTuple):
    """State of a chain of three-angle steps.

    Attributes
    ----------
    angles, gradient : ndarray, shape (N, 3)
        Coordinates, and the energy's gradient by them.
    closure : ndarray, shape (6,)
        Residual of the boundary, zero for free components.
    boundary : Boundary
    turn : ndarray, shape (1,)
        Angle of the end about a target's d3 that carries a torque.
    centres, frames, axes, halves
        See :func:`dnacheck.equilibria.discrete.kernels.closure.linearise`.
    form : int
        ``WEDGE`` or ``MIDSTEP``.
    """

    angles: Any
    gradient: Any
    closure: Any
    boundary: Boundary
    turn: Any
    centres: Any
    frames: Any
    axes: Any
    halves: Any
    form: int


class RigidState(NamedTuple):
    """State of a chain of rigid base-pair steps.

    Attributes
    ----------
    angles, gradient : ndarray, shape (N, 6)
        Coordinates in the order of ``RIGID_COORDINATES``, and the energy's gradient by them.
    closure : ndarray, shape (6,)
        Residual of the boundary, zero for free components.
    boundary : Boundary
    turn : ndarray, shape (1,)
        Angle of the end about a target's d3 that carries a torque.
    kinematics : RigidKinematics
    scales : ndarray, shape (N, 3)
        By what the residuals of the translations count beside those of the angles: bending over
        translational stiffness, at most 1. What counts of a stiff coordinate is how far it is from
        rest; the round-off of its gradient is that of its strain times its stiffness.
    """

    angles: Any
    gradient: Any
    closure: Any
    boundary: Boundary
    turn: Any
    kinematics: Any
    scales: Any


def by_kind(hinge: Callable[..., Any], rigid: Callable[..., Any]) -> Callable[..., Any]:
    """One name for two compiled functions, chosen by the type of the first argument."""
    hinge_types = (HingeSteps, HingeState)

    def chosen(first: Any, *rest: Any) -> Any:
        return hinge(first, *rest) if isinstance(first, hinge_types) else rigid(first, *rest)

    def for_hinge(first: Any, *rest: Any) -> Any:
        return hinge(first, *rest)

    def for_rigid(first: Any, *rest: Any) -> Any:
        return rigid(first, *rest)

    def choose(first: Any, *rest: Any) -> Any:
        kind = getattr(first, "instance_class", None)
        if kind in hinge_types:
            return for_hinge
        return for_rigid if kind in (RigidSteps, RigidState) else None

    overload(chosen)(choose)
    return chosen


@njit(cache=True, nogil=True)
def _new_hinge_state(steps: HingeSteps, boundary: Boundary) -> HingeState:
    n = steps.ground.shape[0]
    state = HingeState(
        np.empty((n, 3)),
        np.empty((n, 3)),
        np.empty(6),
        boundary,
        np.zeros(1),
        np.empty((n + 1, 3)),
        np.empty((n + 1, 3, 3)),
        np.empty((n, 3, 3)),
        np.empty((n if steps.form != 0 else 0, 5, 3)),
        steps.form,
    )
    place_start(boundary, state.centres[0], state.frames[0])
    return state


@njit(cache=True, nogil=True)
def _new_rigid_state(steps: RigidSteps, boundary: Boundary) -> RigidState:
    n = steps.ground.shape[0]
    scales = np.empty((n, 3))
    for s in range(n):
        bend = 0.5 * (steps.stiffness[s, 1, 1] + steps.stiffness[s, 2, 2])
        for j in range(3):
            scales[s, j] = min(1.0, bend / steps.stiffness[s, 3 + j, 3 + j])
    kinematics = new_kinematics(n)
    place_start(boundary, kinematics.centres[0], kinematics.frames[0])
    return RigidState(
        np.empty((n, 6)), np.empty((n, 6)), np.empty(6), boundary, np.zeros(1), kinematics, scales
    )


new_state = by_kind(_new_hinge_state, _new_rigid_state)
"""State with room for the shape of ``steps``, placed for a boundary: (steps, boundary)."""


@njit(cache=True, nogil=True)
def _hinge_factors(steps: HingeSteps) -> Any:
    return np.empty((steps.ground.shape[0], FACTOR_WIDTH))


@njit(cache=True, nogil=True)
def _rigid_factors(steps: RigidSteps) -> Any:
    return np.empty((steps.ground.shape[0], RIGID_FACTOR_WIDTH))


new_factors = by_kind(_hinge_factors, _rigid_factors)
"""Room for the factors of :data:`factorise_state`, from ``steps``."""


@njit(cache=True, nogil=True)
def still_axes(stiffness: Any, axes: Any) -> None:
    """Clear the ``axes`` of steps that a guest holds: nothing turns about them.

    Everything that is made of axes (the closure's Jacobian, the Lagrangian's gradient) then has
    no entries for these steps.
    """
    for s in range(axes.shape[0]):
        if is_bound(stiffness, s):
            axes[s] = 0.0


@njit(cache=True, nogil=True)
def hold_ground(steps: Any, angles: Any) -> None:
    """Put the steps that a guest holds to their ground values, in place."""
    for s in range(angles.shape[0]):
        if is_bound(steps.stiffness, s):
            angles[s] = steps.ground[s]


@njit(cache=True, nogil=True)
def _evaluate_hinges(state: HingeState, steps: HingeSteps) -> float:
    linearise_placed(
        state.angles, state.form, state.centres, state.frames, state.axes, state.halves
    )
    still_axes(steps.stiffness, state.axes)
    n = state.angles.shape[0]
    work = end_residual(
        state.boundary, state.centres[n], state.frames[n], state.turn, state.closure
    )
    return energy_gradient(state.angles, steps.ground, steps.stiffness, state.gradient) - work


@njit(cache=True, nogil=True)
def _evaluate_rigid(state: RigidState, steps: RigidSteps) -> float:
    linearise_rigid(state.angles, state.kinematics)
    still_axes(steps.stiffness, state.kinematics.axes)
    still_axes(steps.stiffness, state.kinematics.velocities)
    n = state.angles.shape[0]
    work = end_residual(
        state.boundary,
        state.kinematics.centres[n],
        state.kinematics.frames[n],
        state.turn,
        state.closure,
    )
    energy = rigid_energy_gradient(state.angles, steps.ground, steps.stiffness, state.gradient)
    return energy - work


evaluate = by_kind(_evaluate_hinges, _evaluate_rigid)
"""Fill a ``state`` from its angles and ``steps``; returns the energy less the work of loads."""


@njit(cache=True, nogil=True)
def _hinge_slope(state: HingeState, multipliers: Any, out: Any) -> float:
    return lagrangian_gradient(state.gradient, state.centres, state.axes, multipliers, out)


@njit(cache=True, nogil=True)
def _rigid_slope(state: RigidState, multipliers: Any, out: Any) -> float:
    return rigid_lagrangian_gradient(
        state.gradient, state.kinematics, state.scales, multipliers, out
    )


lagrangian_slope = by_kind(_hinge_slope, _rigid_slope)
"""Gradient of the Lagrangian of a ``state`` with ``multipliers`` into ``out``; its largest."""


@njit(cache=True, nogil=True)
def _hinge_jacobian(state: HingeState, out: Any) -> None:
    closure_jacobian(state.centres, state.axes, out)


@njit(cache=True, nogil=True)
def _rigid_jacobian(state: RigidState, out: Any) -> None:
    rigid_jacobian(state.kinematics, out)


jacobian = by_kind(_hinge_jacobian, _rigid_jacobian)
"""Closure Jacobian (6, cN) of a ``state`` with c coordinates a step into ``out``."""


@njit(cache=True, nogil=True)
def _factorise_hinges(
    state: HingeState, steps: HingeSteps, shift: float, multipliers: Any, factors: Any, small: Any,
    slope: Any,
) -> tuple[int, float, float]:  # fmt: skip
    return factorise(
        slope, steps.stiffness, shift, state.form, state.centres, state.axes, state.halves,
        multipliers, factors, small,
    )  # fmt: skip


@njit(cache=True, nogil=True)
def _factorise_rigid(
    state: RigidState, steps: RigidSteps, shift: float, multipliers: Any, factors: Any, small: Any,
    slope: Any,
) -> tuple[int, float, float]:  # fmt: skip
    return factorise_rigid(
        slope, steps.stiffness, shift, state.angles, state.kinematics, multipliers, factors, small
    )


factorise_state = by_kind(_factorise_hinges, _factorise_rigid)
"""LDL^T of the Lagrangian's Hessian: (state, steps, shift, multipliers, factors, small, slope);
see :func:`dnacheck.equilibria.discrete.kernels.factorisation.factorise`."""


@njit(cache=True, nogil=True)
def _substitute_hinges(
    state: HingeState, factors: Any, multipliers: Any, weight: float, step: Any
) -> None:
    back_substitute(factors, multipliers, weight, step)


@njit(cache=True, nogil=True)
def _substitute_rigid(
    state: RigidState, factors: Any, multipliers: Any, weight: float, step: Any
) -> None:
    back_substitute_rigid(factors, multipliers, weight, step)


substitute = by_kind(_substitute_hinges, _substitute_rigid)
"""Backward substitution: (state, factors, new multipliers, weight, step)."""


@njit(cache=True, nogil=True)
def _replace_hinges(state: HingeState, factors: Any, rhs: Any, small: Any) -> None:
    eliminate(factors, rhs, small)


@njit(cache=True, nogil=True)
def _replace_rigid(state: RigidState, factors: Any, rhs: Any, small: Any) -> None:
    eliminate_rigid(factors, rhs, small)


replace_rhs = by_kind(_replace_hinges, _replace_rigid)
"""Forward substitution of another right-hand side: (state, factors, rhs, small)."""


@njit(cache=True, nogil=True)
def _hinge_link(state: HingeState) -> int:
    return link_of_ring(state.centres, state.frames)[0]


@njit(cache=True, nogil=True)
def _rigid_link(state: RigidState) -> int:
    kinematics = state.kinematics
    along = np.empty(kinematics.frames.shape)
    edge_frames(kinematics.centres, kinematics.frames, along)
    return link_of_ring(kinematics.centres, along)[0]


link_of = by_kind(_hinge_link, _rigid_link)
"""Link of a closed ``state``."""


@njit(cache=True, nogil=True)
def _largest_turn(axes: Any, step: Any) -> float:
    """Largest rotation that a step gives to any frame, to first order, in radians."""
    x, y, z, worst = 0.0, 0.0, 0.0, 0.0
    for s in range(step.shape[0]):
        for j in range(3):
            x += axes[s, j, 0] * step[s, j]
            y += axes[s, j, 1] * step[s, j]
            z += axes[s, j, 2] * step[s, j]
        square = x * x + y * y + z * z
        if not square <= worst:
            worst = square
    return math.sqrt(worst)


@njit(cache=True, nogil=True)
def _largest_hinge_turn(state: HingeState, step: Any) -> float:
    return _largest_turn(state.axes, step)


@njit(cache=True, nogil=True)
def _largest_rigid_turn(state: RigidState, step: Any) -> float:
    return _largest_turn(state.kinematics.axes, step)


accumulated_turn = by_kind(_largest_hinge_turn, _largest_rigid_turn)
"""Largest rotation that a ``step`` gives to any frame of a ``state``, to first order, radians."""


@njit(cache=True, nogil=True, error_model="numpy")
def _turned(frames: Any, axes: Any, step: Any, fraction: float, turned: Any) -> None:
    """Turn every frame by what a step accumulates up to it, less the mean over the ring.

    The mean is a rigid rotation. Coordinates 0, 1, 2 of a step are its angles.
    """
    n = step.shape[0]
    mean = np.zeros(3)
    turn = np.zeros(3)
    for s in range(n):
        for i in range(3):
            for j in range(3):
                turn[i] += axes[s, j, i] * step[s, j]
            mean[i] += turn[i] / n
    for i in range(3):
        turn[i] = -mean[i]
    half = 0.5 * fraction
    for s in range(n + 1):
        # Cayley's rotation by c: v -> v + 2/(1 + c.c) c x (v + c x v), near exp(2 c).
        c0, c1, c2 = half * turn[0], half * turn[1], half * turn[2]
        factor = 2.0 / (1.0 + c0 * c0 + c1 * c1 + c2 * c2)
        for j in range(3):
            v0, v1, v2 = frames[s, 0, j], frames[s, 1, j], frames[s, 2, j]
            x0 = v0 + c1 * v2 - c2 * v1
            x1 = v1 + c2 * v0 - c0 * v2
            x2 = v2 + c0 * v1 - c1 * v0
            turned[s, 0, j] = v0 + factor * (c1 * x2 - c2 * x1)
            turned[s, 1, j] = v1 + factor * (c2 * x0 - c0 * x2)
            turned[s, 2, j] = v2 + factor * (c0 * x1 - c1 * x0)
        if s < n:
            for i in range(3):
                for j in range(3):
                    turn[i] += axes[s, j, i] * step[s, j]


@njit(cache=True, nogil=True, error_model="numpy")
def _turn_hinges(state: HingeState, step: Any, fraction: float, out: Any) -> None:
    angles = state.angles
    n = angles.shape[0]
    turned = np.empty((n + 1, 3, 3))
    _turned(state.frames, state.axes, step, fraction, turned)
    fill_angles(turned, state.form, out)
    for s in range(n):
        close = True
        for j in range(3):
            plain = angles[s, j] + fraction * step[s, j]
            if j != 1:
                out[s, j] += 2.0 * math.pi * round((plain - out[s, j]) / (2.0 * math.pi))
            if not abs(out[s, j] - plain) < 0.5:
                close = False
        # What a guest holds does not move, not even by round-off.
        if not close or (step[s, 0] == 0.0 and step[s, 1] == 0.0 and step[s, 2] == 0.0):
            for j in range(3):
                out[s, j] = angles[s, j] + fraction * step[s, j]


@njit(cache=True, nogil=True, error_model="numpy")
def _turn_rigid(state: RigidState, step: Any, fraction: float, out: Any) -> None:
    angles, kinematics = state.angles, state.kinematics
    n = angles.shape[0]
    turned = np.empty((n + 1, 3, 3))
    _turned(kinematics.frames, kinematics.axes, step, fraction, turned)
    fill_rigid_coordinates(kinematics.centres, turned, out)
    for s in range(n):
        plain = angles[s, 0] + fraction * step[s, 0]
        out[s, 0] += 2.0 * math.pi * round((plain - out[s, 0]) / (2.0 * math.pi))
        close = abs(out[s, 0] - plain) < 0.5
        for j in range(1, 3):
            close = close and abs(out[s, j] - angles[s, j] - fraction * step[s, j]) < 0.5
        close = close and not (step[s, 0] == 0.0 and step[s, 1] == 0.0 and step[s, 2] == 0.0)
        # Translations are seen from the mid-step frame: they do not change when it turns.
        for j in range(0 if not close else 3, 6):
            out[s, j] = angles[s, j] + fraction * step[s, j]


turn_frames = by_kind(_turn_hinges, _turn_rigid)
"""Apply a step by turning frames instead of adding angles: (state, step, fraction, out).

Frame k turns by the rotation vector that the step accumulates up to it, and the new angles are read
off. A roll about the ring's own axis is thereby followed exactly and keeps the ring closed. Where
the angles so found differ much from the sum (a bend near 90 degrees, where they are not unique),
the sum is kept.
"""
