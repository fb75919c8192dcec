"""Compiled register of a ring: how far its molecule is rolled about its own axis.

The register is the phase of S = sum_s exp(i alpha_s) (-theta_s + i phi_s), with alpha_s the twist
that a uniformly overtwisted ring of the given link accumulates up to the bend of step s: the
direction of the mean bending axis in a frame that does not turn about the ring. S is linear in
the angles, so the shapes of one register form a half hyperplane, and the register's range is a
circle: every shape has one register unless S = 0. Of rigid steps S is the sum of exp(i alpha_s)
(tilt_s + i roll_s), with alpha_s the twist up to the middle of step s.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from numba import njit

from dnacheck.equilibria.discrete.kernels.states import by_kind
from dnacheck.model.chain_kernels import WEDGE, HingeSteps
from dnacheck.model.rigid_kernels import RigidSteps


class KnownRegister(NamedTuple):
    """Registers within ``reach`` radians of a known ring's, where a solve need not go on.

    ``along`` and ``across`` (N, 3) are the rows of :func:`register_functionals`; a reach that is
    not positive means that no ring is known.
    """

    along: Any
    across: Any
    register: float
    reach: float


@njit(cache=True, nogil=True)
def register_functionals(ground: Any, form: int, link: float, along: Any, across: Any) -> None:
    """Rows of Re S and Im S, each (N, 3), for a chain of ``link`` turns, not always whole ones."""
    n = ground.shape[0]
    total = 0.0
    for s in range(n):
        total += ground[s, 0]
    excess = (2.0 * math.pi * link - total) / n
    phase = 0.0
    for s in range(n):
        twist = ground[s, 0] + excess
        phase += twist if form == WEDGE else 0.5 * twist
        c, sn = math.cos(phase), math.sin(phase)
        along[s, 0] = across[s, 0] = 0.0
        along[s, 1], along[s, 2] = -c, -sn
        across[s, 1], across[s, 2] = -sn, c
        if form != WEDGE:
            phase += 0.5 * twist


@njit(cache=True, nogil=True)
def _hinge_functionals(steps: HingeSteps, link: float, along: Any, across: Any) -> None:
    register_functionals(steps.ground, steps.form, link, along, across)


@njit(cache=True, nogil=True)
def _rigid_functionals(steps: RigidSteps, link: float, along: Any, across: Any) -> None:
    ground = steps.ground
    n = ground.shape[0]
    total = 0.0
    for s in range(n):
        total += ground[s, 0]
    excess = (2.0 * math.pi * link - total) / n
    along[:], across[:] = 0.0, 0.0
    phase = 0.0
    for s in range(n):
        twist = ground[s, 0] + excess
        middle = phase + 0.5 * twist
        c, sn = math.cos(middle), math.sin(middle)
        along[s, 1], along[s, 2] = c, -sn
        across[s, 1], across[s, 2] = sn, c
        phase += twist


register_rows = by_kind(_hinge_functionals, _rigid_functionals)
"""Rows of Re S and Im S, each (N, c): (steps, link, along, across)."""


@njit(cache=True, nogil=True)
def register_of(angles: Any, along: Any, across: Any) -> tuple[float, float]:
    """Register in radians and |S| of a shape (N, c)."""
    x, y = 0.0, 0.0
    for s in range(angles.shape[0]):
        x += along[s, 1] * angles[s, 1] + along[s, 2] * angles[s, 2]
        y += across[s, 1] * angles[s, 1] + across[s, 2] * angles[s, 2]
    return math.atan2(y, x), math.hypot(x, y)


@njit(cache=True, nogil=True)
def wrapped(angle: float) -> float:
    """The angle in [-pi, pi)."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@njit(cache=True, nogil=True)
def is_near(angles: Any, known: KnownRegister) -> bool:
    """Whether the register of a shape (N, 3) lies within the reach of a known one."""
    if not known.reach > 0.0:
        return False
    register, _ = register_of(angles, known.along, known.across)
    return abs(wrapped(register - known.register)) < known.reach
