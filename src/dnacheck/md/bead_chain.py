"""The elastic chain as OpenMM beads: centre and groove bead per base pair.

Everything here comes from the :class:`~dnacheck.model.chain.Chain` alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.md import expressions
from dnacheck.md.geometry import bead_count, beads_of_angles
from dnacheck.model.chain import Chain
from dnacheck.model.units import TEMPERATURE_K
from dnacheck.numerics.outcome import InputError, SolveError

if TYPE_CHECKING:
    import openmm

Array = NDArray[np.float64]
Measure = Literal["angles", "frames"]

GAS_CONSTANT_KJ = 8.31446261815324e-3
"""kJ/(mol K)."""
_A_PER_NM = 10.0
_WEDGE_GROUP, _SPRING_GROUP = 0, 1


@dataclass(frozen=True)
class BeadOptions:
    """Springs and masses of the beads. None of them has a counterpart in the wedge chain.

    Spring constants of the groove beads do not matter to any ensemble average and those of the
    bonds matter little (docs/md.md); masses matter to none. The defaults put the fastest
    stretching, bending and twisting waves of a uniform chain at about one frequency, so that none
    of them alone limits the time step.
    """

    groove_distance_A: float = 10.0
    """Distance of the groove bead from its centre, about the radius of the double helix."""
    bond_factor: float = 4.0
    """Spring constant of the centre-to-centre bonds over (mean bending stiffness / rise²)."""
    groove_stiffness_RT: float = 100.0
    """Spring constants of the groove bead's distance, over distance², and of its angle."""
    centre_mass: float = 650.0
    """Mass of a centre, in dalton: about one base pair."""
    temperature_K: float = TEMPERATURE_K
    """Enters only the conversion of RT into OpenMM's kJ/mol, and the velocities."""

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"bead option {name} must be a positive number, not {value}")

    @property
    def rt_kJ(self) -> float:
        """RT in kJ/mol."""
        return GAS_CONSTANT_KJ * self.temperature_K


def available_platforms() -> tuple[str, ...]:
    """Names of the OpenMM platforms of this installation, slowest first."""
    import openmm as mm

    platforms = [mm.Platform.getPlatform(i) for i in range(mm.Platform.getNumPlatforms())]
    return tuple(p.getName() for p in sorted(platforms, key=lambda p: float(p.getSpeed())))


class BeadChain:
    """An OpenMM system of one chain, with energies in RT and lengths in Å.

    Parameters
    ----------
    chain : Chain
        What to build; nothing else about the molecule is used.
    closed : bool
        Ring, or open chain with free ends.
    options : BeadOptions
    measure : {None, "frames", "angles"}
        None for energies and minimisation. The others prepare the ensemble of unit bonds:
        "frames" weights configurations by exp(-E/RT) times the volume element of the rotations
        (what beads do by themselves), "angles" by exp(-E/RT) times d(tau) d(theta) d(phi).

    Attributes
    ----------
    system : openmm.System
        Force group 0 holds the steps' energy, group 1 the springs.
    bend_RT : float
        Mean bending stiffness of the steps, RT per square radian.
    bond_RT_per_A2 : float
        Spring constant of the bonds.
    """

    def __init__(
        self,
        chain: Chain,
        closed: bool = True,
        options: BeadOptions | None = None,
        measure: Measure | None = None,
    ) -> None:
        if measure not in (None, "frames", "angles"):
            raise InputError(f"measure '{measure}' is neither frames nor angles")
        chain.require_hinges("the bead chain")
        chain.require_free("the bead chain")
        if closed and chain.n_steps < 6:
            raise InputError(f"a closed bead chain needs 6 base pairs or more, not {chain.n_steps}")
        self.chain = chain
        self.closed = closed
        self.options = options or BeadOptions()
        self.measure = measure
        self.n_beads = bead_count(chain.n_steps, closed)
        self.bend_RT = chain.energy_scale_RT * float(
            np.mean(chain.stiffness[:, 1, 1] + chain.stiffness[:, 2, 2]) / 2.0
        )
        self.bond_RT_per_A2 = self.options.bond_factor * self.bend_RT / chain.rise_A**2
        self.system = self._system()

    @property
    def bond_deviation(self) -> float:
        """Thermal standard deviation of a bond, over its length."""
        return float(1.0 / np.sqrt(self.bond_RT_per_A2 * self.chain.rise_A**2))

    def positions(self, angles: ArrayLike) -> Array:
        """Bead positions (n_beads, 3), in Å, of step angles (N, 3)."""
        return beads_of_angles(self.chain, angles, self.closed, self.options.groove_distance_A)

    def _system(self) -> openmm.System:
        import openmm as mm

        system = mm.System()
        groove_mass = self._groove_mass()
        for bead in range(self.n_beads):
            system.addParticle(self.options.centre_mass if bead % 2 == 0 else groove_mass)
        system.addForce(self._steps())
        self.bonds = self._bonds()
        system.addForce(self.bonds)
        for force in self._grooves():
            system.addForce(force)
        return system

    def _groove_mass(self) -> float:
        """Mass at which the fastest twist wave is as fast as the fastest bending wave."""
        chain, options = self.chain, self.options
        twist_RT = chain.energy_scale_RT * float(np.mean(chain.stiffness[:, 0, 0]))
        arm = options.groove_distance_A / chain.rise_A
        return options.centre_mass * twist_RT / (4.0 * self.bend_RT * arm**2)

    def _steps(self) -> openmm.CustomCompoundBondForce:
        import openmm as mm

        chain = self.chain
        diagonal = np.diagonal(chain.stiffness, axis1=1, axis2=2)
        coupled = bool(np.any(chain.stiffness != diagonal[:, :, None] * np.eye(3)))
        expression = expressions.step_expression(chain.step_form, coupled, self.measure == "angles")
        force = mm.CustomCompoundBondForce(expressions.PARTICLES, expression)
        names = expressions.COUPLED_PARAMETERS if coupled else expressions.DIAGONAL_PARAMETERS
        for name in names + expressions.GROUND_PARAMETERS:
            force.addPerBondParameter(name)
        if self.measure == "angles":
            force.addGlobalParameter("rt", self.options.rt_kJ)
        scale = chain.energy_scale_RT * self.options.rt_kJ
        if coupled:
            order = np.array([1, 2, 0])
            factors = np.linalg.cholesky(chain.stiffness[:, order[:, None], order[None, :]])
            upper = np.sqrt(scale) * np.swapaxes(factors, 1, 2)
            stiffness = upper[:, *np.triu_indices(3)]
        else:
            stiffness = scale * diagonal
        tau, theta, phi = chain.ground.T
        ground = np.stack(
            [np.cos(tau), np.sin(tau), tau, theta, phi, np.cos(phi), np.sin(phi)], axis=1
        )
        for i, values in enumerate(np.concatenate([stiffness, ground], axis=1).tolist()):
            here, after, beyond = (self._centre(i + k) for k in range(3))
            force.addBond([here, after, beyond, here + 1, after + 1], values)
        force.setForceGroup(_WEDGE_GROUP)
        return force

    def _centre(self, pair: int) -> int:
        return 2 * (pair % self.chain.n_steps if self.closed else pair)

    @property
    def bond_rest_A(self) -> float:
        """Rest length of the bonds before any adjustment.

        In an ensemble a spring's length is drawn with weight l² exp(-k(l-l0)²/2RT); a rest length
        of rise - 2RT/(k rise) puts the most likely length at the rise.
        """
        rise = self.chain.rise_A
        return rise - (0.0 if self.measure is None else 2.0 / (self.bond_RT_per_A2 * rise))

    def _bonds(self) -> openmm.HarmonicBondForce:
        import openmm as mm

        force = mm.HarmonicBondForce()
        count = self.chain.n_steps if self.closed else self.chain.n_steps + 1
        for i in range(count):
            force.addBond(self._centre(i), self._centre(i + 1), *self._bond(self.bond_rest_A))
        force.setForceGroup(_SPRING_GROUP)
        return force

    def _bond(self, rest_A: float) -> tuple[float, float]:
        constant = self.bond_RT_per_A2 * self.options.rt_kJ * _A_PER_NM**2
        return float(rest_A) / _A_PER_NM, constant

    def set_bond_rest(self, context: openmm.Context, rest_A: Array) -> None:
        """Give every bond its own rest length, in Å, in this system and a context of it."""
        for i, rest in enumerate(rest_A):
            self.bonds.setBondParameters(i, self._centre(i), self._centre(i + 1), *self._bond(rest))
        self.bonds.updateParametersInContext(context)

    def _grooves(self) -> tuple[openmm.HarmonicBondForce, openmm.HarmonicAngleForce]:
        import openmm as mm

        distance = self.options.groove_distance_A / _A_PER_NM
        stiffness = self.options.groove_stiffness_RT * self.options.rt_kJ
        arms, tilts = mm.HarmonicBondForce(), mm.HarmonicAngleForce()
        pairs = self.chain.n_steps if self.closed else self.chain.n_steps + 1
        for i in range(pairs):
            here = self._centre(i)
            arms.addBond(here, here + 1, distance, stiffness / distance**2)
            tilts.addAngle(here + 1, here, self._centre(i + 1), np.pi / 2.0, stiffness)
        for force in (arms, tilts):
            force.setForceGroup(_SPRING_GROUP)
        return arms, tilts


class BeadEnergy:
    """Energies and forces of a :class:`BeadChain` on one OpenMM platform.

    Parameters
    ----------
    beads : BeadChain
    platform : str
        "Reference" works in double precision throughout.
    integrator : openmm.Integrator, optional
        What the context shall move the beads with.

    Attributes
    ----------
    context : openmm.Context
    platform : str
        Name of the platform in use.
    """

    def __init__(
        self,
        beads: BeadChain,
        platform: str = "Reference",
        integrator: openmm.Integrator | None = None,
    ) -> None:
        import openmm as mm

        self.beads = beads
        self._integrator = mm.VerletIntegrator(1e-6) if integrator is None else integrator
        self.context = new_context(beads.system, self._integrator, platform)
        self.platform = str(self.context.getPlatform().getName())
        self._rt = beads.options.rt_kJ

    def elastic_energy_RT(self, positions: Array) -> float:
        """Energy of the steps alone, in RT, at bead positions (n_beads, 3) in Å."""
        return self._energy(positions, 1 << _WEDGE_GROUP)

    def energy_RT(self, positions: Array) -> float:
        """Energy of steps and springs, in RT."""
        return self._energy(positions, -1)

    def forces(self, positions: Array) -> Array:
        """Forces (n_beads, 3), in RT/Å."""
        self.context.setPositions(positions / _A_PER_NM)
        forces: Any = self.context.getState(getForces=True).getForces(asNumpy=True)
        return np.asarray(forces._value) / (self._rt * _A_PER_NM)

    def energy_and_forces(self, positions: Array) -> tuple[float, Array]:
        """Energy in RT and forces (n_beads, 3) in RT/Å, of steps and springs."""
        self.context.setPositions(positions / _A_PER_NM)
        state = self.context.getState(getEnergy=True, getForces=True)
        forces: Any = state.getForces(asNumpy=True)
        energy = float(state.getPotentialEnergy()._value) / self._rt
        return energy, np.asarray(forces._value) / (self._rt * _A_PER_NM)

    def _energy(self, positions: Array, groups: int) -> float:
        self.context.setPositions(positions / _A_PER_NM)
        state = self.context.getState(getEnergy=True, groups=groups)
        return float(state.getPotentialEnergy()._value) / self._rt


def new_context(
    system: openmm.System, integrator: openmm.Integrator, platform: str
) -> openmm.Context:
    """OpenMM context on a platform by name; one processor thread, so that runs can be repeated.

    Raises
    ------
    InputError
        The platform is not part of this installation.
    SolveError
        The platform is there but cannot be used (no device, for instance).
    """
    import openmm as mm

    if platform not in available_platforms():
        known = ", ".join(available_platforms())
        raise InputError(f"OpenMM platform '{platform}' is not installed; there are {known}")
    properties = {"CPU": {"Threads": "1"}}.get(platform, {})
    if platform in ("CUDA", "OpenCL", "HIP"):
        properties = {"Precision": "mixed"}
    try:
        return mm.Context(system, integrator, mm.Platform.getPlatformByName(platform), properties)
    except mm.OpenMMException as error:
        raise SolveError(f"OpenMM platform '{platform}' cannot be used: {error}") from error


def sabotaged(chain: Chain, kind: Literal["sign", "stiffness"], step: int) -> Chain:
    """A chain with one deliberate fault, for negative controls.

    Parameters
    ----------
    kind : {"sign", "stiffness"}
        Reverse the sign of one step's ground bend theta, or raise its bending stiffness in phi
        by 5 %.
    step : int
        Where.
    """
    ground, stiffness = chain.ground.copy(), chain.stiffness.copy()
    if kind == "sign":
        ground[step, 1] = -ground[step, 1]
    elif kind == "stiffness":
        stiffness[step, 2, 2] *= 1.05
    else:
        raise InputError(f"no fault '{kind}'; there are sign and stiffness")
    return replace(chain, ground=ground, stiffness=stiffness)
