"""Rigid base-pair steps in OpenMM: four beads a base pair, a centre and one along each director.

The frame of a pair is that of its own beads, free of the centreline. The energy of a step is a
function of three levels, because OpenMM differentiates an expression with all names written out
and the six coordinates written in positions are too large for that: scalar products of
bead-to-bead vectors, the coordinates of El Hassan & Calladine from these, the quadratic form.
Beads of a pair must lie as a rigid body holds them: at one distance along perpendicular
directors.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.md.bead_chain import BeadOptions, new_context
from dnacheck.model.chain import Chain, chain_frames
from dnacheck.numerics.outcome import InputError

if TYPE_CHECKING:
    import openmm

Array = NDArray[np.float64]

BEADS = 4
"""Beads of a base pair."""
_A_PER_NM = 10.0

# r_jk = d_j(i).d_k(i+1) and t_j = d_j(i).(r(i+1) - r(i)). With the bend vector (tilt, roll, 0) of
# length G about half the twist, the mid-step frame sees the step as Rodrigues' formula turns it.
_COORDINATES = (
    "twist",
    "tilt",
    "roll",
    "c*v1 - s*roll*t3 + k*(tilt*v1 + roll*v2)*tilt",
    "c*v2 + s*tilt*t3 + k*(tilt*v1 + roll*v2)*roll",
    "c*t3 - s*(tilt*v2 - roll*v1)",
)
_NAMES = """
k = (1 - c)/G^2; c = cos(0.5*G); s = sin(0.5*G)/G;
v1 = ch*t1 + sh*t2; v2 = ch*t2 - sh*t1;
roll = f*(r13*ch + r23*sh); tilt = f*(r13*sh - r23*ch);
f = G/sin(G); G = atan2(sqrt(r13^2 + r23^2), r33);
ch = cos(0.5*twist); sh = sin(0.5*twist);
twist = atan2(r21 - r12, r11 + r22)"""
_TWIST = ("r21", "r12", "r11", "r22")
_ANGLES = (*_TWIST, "r13", "r23", "r33")
_PRODUCTS = (_TWIST, _ANGLES, _ANGLES, *(3 * ((*_ANGLES, "t1", "t2", "t3"),)))
"""Scalar products that each coordinate is made of."""


class RigidBeads:
    """Energies and forces of a chain of rigid steps from bead positions, by OpenMM.

    Parameters
    ----------
    chain : Chain
        Of rigid steps.
    closed : bool
        N base pairs, the last step leading to the first; otherwise N + 1.
    options : BeadOptions, optional
        Only the distance of the beads, the mass and the temperature have a meaning here.
    platform : str
        "Reference" works in double precision throughout.
    """

    def __init__(
        self,
        chain: Chain,
        closed: bool,
        options: BeadOptions | None = None,
        platform: str = "Reference",
    ) -> None:
        import openmm as mm

        if not chain.rigid:
            raise InputError(f"{chain.name}: not a chain of rigid steps; use BeadChain")
        self.chain, self.closed = chain, closed
        self.options = options or BeadOptions()
        self.pairs = chain.n_steps if closed else chain.n_steps + 1
        self.system = mm.System()
        for _ in range(BEADS * self.pairs):
            self.system.addParticle(self.options.centre_mass / BEADS)
        factors = np.swapaxes(np.linalg.cholesky(chain.stiffness), 1, 2)
        for i in range(chain.n_steps):
            self.system.addForce(self._step(i, factors[i], chain.ground[i]))
        self._integrator = mm.VerletIntegrator(1e-6)
        self.context = new_context(self.system, self._integrator, platform)

    def positions(self, coordinates: ArrayLike) -> Array:
        """Beads (4 pairs, 3), in Å, of a chain in given coordinates (N, 6)."""
        centres, frames = chain_frames(coordinates, "rigid")
        beads = np.empty((self.pairs, BEADS, 3))
        beads[:, 0] = self.chain.rise_A * centres[: self.pairs]
        arms = self.options.groove_distance_A * np.swapaxes(frames[: self.pairs], 1, 2)
        beads[:, 1:] = beads[:, :1] + arms
        return beads.reshape(-1, 3)

    def energy_RT(self, positions: Array) -> float:
        """Energy of the steps in RT, at bead positions in Å."""
        self.context.setPositions(positions / _A_PER_NM)
        energy: Any = self.context.getState(getEnergy=True).getPotentialEnergy()
        return float(energy._value) / self.options.rt_kJ

    def forces(self, positions: Array) -> Array:
        """Forces (4 pairs, 3) on the beads, in RT/Å."""
        self.context.setPositions(positions / _A_PER_NM)
        forces: Any = self.context.getState(getForces=True).getForces(asNumpy=True)
        return np.asarray(forces._value) / (self.options.rt_kJ * _A_PER_NM)

    def _step(self, i: int, factor: Array, ground: Array) -> openmm.CustomCVForce:
        import openmm as mm

        rows = [
            "+".join(f"({float(factor[a, b])!r})*(q{b}-({float(ground[b])!r}))"
                     for b in range(a, 6))
            for a in range(6)
        ]  # fmt: skip
        scale = 0.5 * self.options.rt_kJ * self.chain.energy_scale_RT
        force = mm.CustomCVForce(f"{scale!r}*(" + "+".join(f"({row})^2" for row in rows) + ")")
        for k in range(6):
            force.addCollectiveVariable(f"q{k}", self._coordinate(i, k))
        return force

    def _coordinate(self, i: int, k: int) -> openmm.CustomCVForce:
        import openmm as mm

        force = mm.CustomCVForce(f"{_COORDINATES[k]};{_NAMES}")
        here, after = BEADS * i, BEADS * ((i + 1) % self.pairs)
        beads = [*range(here, here + BEADS), *range(after, after + BEADS)]
        for name in _PRODUCTS[k]:
            product = mm.CustomCompoundBondForce(2 * BEADS, self._product(name))
            product.addBond(beads, [])
            force.addCollectiveVariable(name, product)
        return force

    def _product(self, name: str) -> str:
        arm = self.options.groove_distance_A / _A_PER_NM
        one = int(name[1]) + 1
        if name[0] == "t":
            scale = arm * self.chain.rise_A / _A_PER_NM
            terms = [f"({x}{one}-{x}1)*({x}5-{x}1)" for x in "xyz"]
        else:
            scale = arm * arm
            other = int(name[2]) + 5
            terms = [f"({x}{one}-{x}1)*({x}{other}-{x}5)" for x in "xyz"]
        return f"({'+'.join(terms)})/({scale!r})"
