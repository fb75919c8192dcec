"""The lowest closed shape of one register, and the Gaussian of the shapes about it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dnacheck.cyclization.laplace.isolated import held_components, log_prefactor
from dnacheck.cyclization.laplace.kernels import register as rk
from dnacheck.cyclization.laplace.kernels.gaussian import ROWS, SliceFactors
from dnacheck.equilibria.boundary import AnyBoundary
from dnacheck.equilibria.ring import RING
from dnacheck.model.chain import Chain
from dnacheck.model.chain_kernels import HingeSteps
from dnacheck.model.rigid_kernels import RigidSteps
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]

_SUBDIVISIONS = 5
_JUMP = 0.5
"""Change of a coordinate (radians, lengths) between neighbours that means another branch."""


@dataclass(frozen=True)
class RegisterOptions:
    """How the register is covered.

    Attributes
    ----------
    spacing : float
        Distance of neighbouring registers in standard deviations of the register in the
        narrowest minimum; a Gaussian is integrated to exp(-2 pi^2 / spacing^2).
    fewest, most : int
        Bounds on the number of registers on the circle; only those within ``depth`` are visited.
    depth : float
        Registers and links whose density lies below the largest by exp(-depth) are left out.
    tolerance : float
        Largest entry of the gradient of a register-constrained minimum's Lagrangian, RT per radian.
    max_iterations : int
        Of Newton's method for one register-constrained minimum.
    rule_error : float
        Relative error of the trapezoid rule above which the number of registers is doubled.
    """

    spacing: float = 0.9
    fewest: int = 16
    most: int = 65_536
    depth: float = 12.0
    tolerance: float = 1e-4
    max_iterations: int = 30
    rule_error: float = 1e-3

    def __post_init__(self) -> None:
        for name in ("spacing", "depth", "tolerance", "rule_error"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"register option {name} must be positive, not {value}")
        if not 4 <= self.fewest <= self.most:
            raise InputError(f"register counts need 4 <= {self.fewest} <= {self.most}")
        if self.max_iterations < 1:
            raise InputError(f"max_iterations must be at least 1, not {self.max_iterations}")


@dataclass(frozen=True)
class ConstrainedMinimum:
    """The lowest closed shape of one register and the Gaussian of its neighbours.

    Energies in RT, lengths in steps.

    Attributes
    ----------
    position : int
        Number of the register on the circle's grid.
    register : float
        In radians.
    angles : ndarray, shape (N, c)
    multipliers : ndarray, shape (7,)
        Force, moment and register multiplier.
    energy : float
    slope : float
        Derivative of the energy with respect to the register.
    extent : float
        |S|.
    log_density : float
        ln of J(psi), mol/L per radian, by Laplace's approximation.
    direction : ndarray, shape (N, c)
        Row whose product with the angles is |S| on this slice.
    factors : SliceFactors
        The Gaussian of its neighbours.
    """

    position: int
    register: float
    angles: Array
    multipliers: Array
    energy: float
    slope: float
    extent: float
    log_density: float
    direction: Array
    factors: SliceFactors


def steps_in_RT(chain: Chain) -> HingeSteps | RigidSteps:
    """The chain's steps as compiled kernels read them, their stiffness in RT."""
    stiffness = np.ascontiguousarray(chain.energy_scale_RT * chain.stiffness)
    return chain.arrays._replace(stiffness=stiffness)


def slice_constant(chain: Chain, boundary: AnyBoundary = RING) -> float:
    """ln J(psi) + E + ln det KKT / 2 - ln |S| of a register-constrained minimum, J in mol/L."""
    scale = chain.energy_scale_RT
    held = held_components(boundary)
    return (
        log_prefactor(chain, boundary)
        - 0.5 * held * math.log(scale / (2.0 * math.pi))
        + 0.5 * chain.ground.shape[1] * chain.n_free * math.log(scale)
        - 0.5 * (held + 1) * math.log(2.0 * math.pi)
    )


class Constrainer:
    """Register-constrained minima of one molecule and link; keeps what every call needs.

    Parameters
    ----------
    link : int
        Of a ring; of other ends, what tells families of shapes apart.
    boundary : Ring, NickedRing, HingedRing or Loop
    turns : float, optional
        Of the rows that tell the register; by default the link.
    """

    def __init__(
        self,
        chain: Chain,
        link: int,
        options: RegisterOptions,
        boundary: AnyBoundary = RING,
        turns: float | None = None,
    ) -> None:
        self.chain, self.link, self.options = chain, link, options
        self.boundary = boundary.for_chain(chain)
        self.turns = float(link if turns is None else turns)
        self.steps = steps_in_RT(chain)
        self.flexibility = chain.flexibility / chain.energy_scale_RT
        self.along, self.across = np.empty(chain.ground.shape), np.empty(chain.ground.shape)
        rk.register_rows(self.steps, self.turns, self.along, self.across)
        self.constant = slice_constant(chain, boundary)

    def minimum(
        self, position: float, registers: int, angles: Array, multipliers: Array
    ) -> ConstrainedMinimum | None:
        """Ring at ``position`` on a circle of so many registers, from a start close by."""
        n, c = self.chain.ground.shape
        register = 2.0 * math.pi * position / registers
        angles, multipliers = angles.copy(), multipliers.copy()
        factors = SliceFactors(
            rows=np.empty((ROWS, c * n)),
            right=np.empty((n, c, ROWS)),
            z=np.empty((n, c, ROWS)),
            root=np.empty((n, c * (c + 1) // 2)),
            projector=np.empty((ROWS, c * n)),
            schur=np.empty((ROWS, ROWS)),
            directions=np.empty((6, c * n)),
        )
        problem = rk.RegisterProblem(
            self.flexibility,
            self.along,
            self.across,
            register,
            self.options.tolerance,
            rk.CLOSED,
            self.options.max_iterations,
            self.boundary,
        )
        figures = np.zeros(rk.N_FIGURES)
        code = rk.constrained_minimum(self.steps, problem, angles, multipliers, factors, figures)
        extent = float(figures[rk.EXTENT])
        if code != rk.FOUND or not extent > 0.0:
            return None
        return ConstrainedMinimum(
            position=int(round(position)) % registers,
            register=register,
            angles=angles,
            multipliers=multipliers,
            energy=float(figures[rk.ENERGY]),
            slope=float(figures[rk.SLOPE]),
            extent=extent,
            log_density=self.constant
            - float(figures[rk.ENERGY])
            - 0.5 * float(figures[rk.LOG_DET_KKT])
            + math.log(extent),
            direction=math.cos(register) * self.along + math.sin(register) * self.across,
            factors=factors,
        )

    def advance(
        self, ring: ConstrainedMinimum, before: ConstrainedMinimum | None, step: int, registers: int
    ) -> ConstrainedMinimum | None:
        """The next ring of a branch, extrapolated from the last two and by ever smaller steps."""
        here, last = ring, before
        reached, gap, pieces = 0.0, 1.0, 1
        for _ in range(2**_SUBDIVISIONS):
            target = min(1.0, reached + 1.0 / pieces)
            angles, multipliers = here.angles, here.multipliers
            if last is not None:
                ahead = (target - reached) / gap
                angles = angles + ahead * (here.angles - last.angles)
                multipliers = multipliers + ahead * (here.multipliers - last.multipliers)
            found = self.minimum(ring.position + step * target, registers, angles, multipliers)
            if found is None or np.abs(found.angles - here.angles).max() > _JUMP:
                pieces *= 2
                if pieces > 2**_SUBDIVISIONS:
                    return None
                continue
            if target >= 1.0:
                return found
            here, last, gap, reached = found, here, target - reached, target
        return None
