"""Discrete chains of elastic base-pair steps: ground values, stiffnesses, frames and energies.

A step has the three wedge angles of Section II, in the paper's product or its mid-step form, or the
six parameters of a rigid base-pair step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.model import ranges
from dnacheck.model.a_tracts import (
    Region,
    automatic_regions,
    parse_regions,
    region_steps,
    tract_regions,
)
from dnacheck.model.chain_kernels import (
    BOUND_STIFFNESS,
    MIDSTEP,
    WEDGE,
    HingeSteps,
    fill_angles,
    fill_frames,
)
from dnacheck.model.molecules import Molecule
from dnacheck.model.parameters import ParameterSet, load_parameters
from dnacheck.model.rigid_kernels import (
    RigidSteps,
    fill_rigid_coordinates,
    fill_rigid_frames,
    relaxed_helix_turns,
)
from dnacheck.model.sequence import Sequence
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]
StepForm = Literal["wedge", "midstep", "rigid"]

PERSISTENCE_LENGTH_A = 463.0
"""Persistence length of Section X, in Å."""
RISE_A = 3.4
"""Helix rise per base pair of Section X, in Å."""
TWIST_RATIO = 1.5
"""K_tau / K_theta of Table II."""


@dataclass(frozen=True)
class Guest:
    """A protein, or any other rigid insert, that holds steps of a chain.

    Attributes
    ----------
    name : str
    site : int
        Step of the chain that the guest's step 0 is.
    steps : tuple of int
        Steps of the chain that it holds.
    ground, stiffness : ndarray, shapes (n, c) and (n, c, c)
        What those steps were before it bound.
    """

    name: str
    site: int
    steps: tuple[int, ...]
    ground: Array = field(repr=False)
    stiffness: Array = field(repr=False)


@dataclass(frozen=True)
class Chain:
    """A closed or open chain of N elastic base-pair steps.

    Attributes
    ----------
    name, letters, angle_set : str
        Molecule, its letters (empty for a chain made from arrays), and the parameters' name.
    ground : ndarray, shape (N, c)
        Unstressed coordinates of step i, which leads from frame i to frame i+1. Three angles tau,
        theta, phi in radians; or, for rigid steps, twist, tilt, roll in radians and shift, slide,
        rise in units of ``rise_A``. The first is the twist of both.
    stiffness : ndarray, shape (N, c, c)
        Symmetric positive stiffness of each step in the same order, in the reduced unit of energy.
    persistence_length_A : float
        Sets the reduced unit of energy: K_theta = RT P/l is 1. For rigid steps, whose stiffness is
        in RT, it is the rise, so that the reduced energy is the energy in RT.
    rise_A : float
        Å; the unit of length of centres. For rigid steps the mean of their ground rise.
    energy_scale_RT : float
        RT per reduced unit of energy: persistence length over rise.
    twist_ratio : float or None
        K_tau / K_theta where the stiffness is the uniform diagonal one, else None.
    step_form : {"wedge", "midstep", "rigid"}
        How the coordinates make a step: three angles as the paper's wedge (2.1) or its mid-step
        form, or six parameters.
    a_tract_regions : tuple of (first, last)
        Steps that took the A-tract twist, from 0, both ends included; of a region that goes on
        across the first base pair the first step comes after the last.
    guests : tuple of Guest
        What is bound (:func:`dnacheck.model.guests.bind`). The steps that guests hold stay at
        their ``ground`` values and cost no energy; their ``stiffness`` is without bound.
    """

    name: str
    ground: Array
    stiffness: Array
    letters: str = ""
    angle_set: str = "custom"
    persistence_length_A: float = PERSISTENCE_LENGTH_A
    rise_A: float = RISE_A
    twist_ratio: float | None = None
    step_form: StepForm = "wedge"
    a_tract_regions: tuple[Region, ...] = ()
    guests: tuple[Guest, ...] = ()
    warnings: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        ground = np.array(self.ground, dtype=float, order="C")
        stiffness = np.array(self.stiffness, dtype=float, order="C")
        if self.step_form not in ("wedge", "midstep", "rigid"):
            raise InputError(f"step form '{self.step_form}' is not wedge, midstep or rigid")
        c = 6 if self.step_form == "rigid" else 3
        if ground.ndim != 2 or ground.shape[1] != c or stiffness.shape != (*ground.shape, c):
            raise InputError(
                f"a {self.step_form} chain needs ground values (N, {c}) and stiffnesses "
                f"(N, {c}, {c})"
            )
        if not (np.all(np.isfinite(ground)) and np.all(np.isfinite(stiffness))):
            raise InputError("ground angles and stiffnesses must be finite")
        if not self.rigid:
            ranges.PERSISTENCE_LENGTH_A.checked(self.persistence_length_A, "persistence length")
        ranges.RISE_A.checked(self.rise_A, "rise")
        ground.setflags(write=False)
        stiffness.setflags(write=False)
        object.__setattr__(self, "ground", ground)
        object.__setattr__(self, "stiffness", stiffness)

    @property
    def n_steps(self) -> int:
        """Number of steps N, which is the number of base pairs."""
        return int(self.ground.shape[0])

    @property
    def energy_scale_RT(self) -> float:
        """RT per reduced unit of energy, K_theta = RT P/l (Section X); 1 for rigid steps."""
        return self.persistence_length_A / self.rise_A

    @property
    def rigid(self) -> bool:
        """Whether the steps have six parameters."""
        return self.step_form == "rigid"

    def require_hinges(self, what: str) -> None:
        """Refuse steps with six parameters where ``what`` knows three angles alone.

        Raises
        ------
        InputError
        """
        if self.rigid:
            raise InputError(
                f"{what} is not available for the six parameters of '{self.angle_set}'; use a set "
                "with three angles, such as trifonov2"
            )

    @cached_property
    def bound(self) -> NDArray[np.bool_]:
        """Which steps (N,) a guest holds."""
        held = np.zeros(self.n_steps, dtype=np.bool_)
        for guest in self.guests:
            held[list(guest.steps)] = True
        return held

    @property
    def n_free(self) -> int:
        """Number of steps that no guest holds."""
        return self.n_steps - int(self.bound.sum())

    @cached_property
    def flexibility(self) -> Array:
        """Inverse of the stiffness of each step (N, c, c), 0 for steps that a guest holds."""
        inverse = np.zeros_like(self.stiffness)
        inverse[~self.bound] = np.linalg.inv(self.stiffness[~self.bound])
        return inverse

    def elastic(self, share: float = 1.0) -> Chain:
        """The same chain with every step elastic again.

        Parameters
        ----------
        share : float
            Of the way from a held step's own unstressed coordinates, 0, to those at which its
            guest holds it, 1; the step takes them as its unstressed ones.
        """
        ground, stiffness = self.ground.copy(), self.stiffness.copy()
        for guest in self.guests:
            steps = list(guest.steps)
            ground[steps] = guest.ground + share * (ground[steps] - guest.ground)
            stiffness[steps] = guest.stiffness
        return replace(self, ground=ground, stiffness=stiffness, guests=())

    def require_free(self, what: str) -> None:
        """Refuse a chain with bound guests where ``what`` knows elastic steps alone.

        Raises
        ------
        InputError
        """
        if self.guests:
            raise InputError(
                f"{what} is not available for a chain that holds {self.guests[0].name}; leave out "
                "what is bound"
            )

    @property
    def form_code(self) -> int:
        """Integer of the form of three-angle steps, for compiled kernels.

        Raises
        ------
        InputError
            The steps have six parameters.
        """
        self.require_hinges("this computation")
        return WEDGE if self.step_form == "wedge" else MIDSTEP

    @cached_property
    def arrays(self) -> HingeSteps | RigidSteps:
        """What compiled kernels read of the steps: copies of the arrays, made once.

        They are writable only because a kernel is compiled anew for read-only arrays; nothing
        writes to them.
        """
        if self.rigid:
            return RigidSteps(self.ground.copy(), self.stiffness.copy())
        return HingeSteps(self.ground.copy(), self.stiffness.copy(), self.form_code)

    @property
    def relaxed_turns(self) -> float:
        """Turns of the unstressed chain, the reference for choosing links.

        The sum of the ground twists; for rigid steps with what the mean bend of all steps, which
        makes the chain a helix about an axis of its own, adds to it. The sum of twists is rounded
        once, so it is the same for every cut of a ring.
        """
        if self.rigid:
            return float(relaxed_helix_turns(self.arrays.ground))
        return math.fsum(self.ground[:, 0].tolist()) / (2.0 * math.pi)

    def with_twist_ratio(self, twist_ratio: float) -> Chain:
        """The same chain with another uniform diagonal stiffness.

        Raises
        ------
        InputError
            The ratio is not positive, or the stiffness is not the uniform diagonal one.
        """
        if self.twist_ratio is None:
            raise InputError("a twist ratio applies only to the uniform diagonal stiffness")
        stiffness = uniform_stiffness(self.n_steps, twist_ratio)
        guests = tuple(
            replace(guest, stiffness=stiffness[list(guest.steps)]) for guest in self.guests
        )
        stiffness[self.bound] = BOUND_STIFFNESS * np.eye(3)
        return replace(self, stiffness=stiffness, twist_ratio=float(twist_ratio), guests=guests)


def scaled_twist(chain: Chain, scale: float) -> Chain:
    """The same chain with its twist stiffness so many times its own.

    The twist's couplings change with the root of the scale, so that their correlations stay and
    the stiffness stays positive.

    Raises
    ------
    InputError
        The scale is not positive.
    """
    if not (np.isfinite(scale) and scale > 0.0):
        raise InputError(f"scale of the twist stiffness must be a positive number, not {scale}")
    factors = np.ones(chain.ground.shape[1])
    factors[0] = math.sqrt(scale)
    stiffness = chain.stiffness * np.outer(factors, factors)
    return replace(chain, stiffness=stiffness, twist_ratio=None)


def uniform_stiffness(n_steps: int, twist_ratio: float) -> Array:
    """The paper's diagonal stiffness (twist_ratio, 1, 1) on every step, shape (n_steps, 3, 3).

    Raises
    ------
    InputError
        The ratio lies outside :data:`dnacheck.model.ranges.TWIST_RATIO`.
    """
    ranges.TWIST_RATIO.checked(float(twist_ratio), "twist ratio")
    return np.tile(np.diag([float(twist_ratio), 1.0, 1.0]), (n_steps, 1, 1))


def _regions(
    molecule: Molecule, choice: str | tuple[Region, ...], closed: bool
) -> tuple[Region, ...]:
    letters = molecule.sequence.letters
    if not isinstance(choice, str):
        return parse_regions(",".join(f"{a}..{b}" for a, b in choice), len(letters))
    if choice == "none":
        return ()
    if choice == "auto":
        known = molecule.a_tract_regions
        return automatic_regions(letters, closed) if known is None else known
    if choice == "tracts-only":
        return tract_regions(letters, closed)
    return parse_regions(choice, len(letters))


def build_chain(
    molecule: Molecule | Sequence,
    angles: str | ParameterSet = "trifonov2",
    twist_ratio: float | None = None,
    persistence_length_A: float | None = None,
    rise_A: float | None = None,
    a_tracts: str | tuple[Region, ...] = "auto",
    step_form: StepForm = "wedge",
    closed: bool = True,
) -> Chain:
    """Chain of a molecule from its letters and a parameter set.

    Parameters
    ----------
    molecule : Molecule or Sequence
        What is read 5' to 3'; the strand matters for the wedge form: up to 3.4 % in energy
        over random molecules (see :meth:`Molecule.other_strand`).
    angles : str or ParameterSet
        Embedded name, file (see :func:`load_parameters`), or a set already loaded.
    twist_ratio : float, optional
        K_tau / K_theta of the uniform stiffness; default 1.5. Not allowed for a set that brings
        stiffnesses of its own.
    persistence_length_A, rise_A : float, optional
        Give the energy unit K_theta = RT P/l; in Å, 463 and 3.4 by default. Not allowed for rigid
        steps, which bring lengths and energies of their own.
    a_tracts : "auto", "tracts-only", "none", "A..B", or regions
        Steps that take the set's A-tract twist; without effect for a set that has none. The
        embedded molecules have theirs from data, others by rule.
    step_form : {"wedge", "midstep"}
        The paper's wedge, or its form symmetrised in the strands. Of no effect for rigid steps.
    closed : bool
        Whether the A-tract rule goes on across the first base pair, as in a ring, nicked or not,
        or stops at the ends, as in an open chain or a loop.

    Raises
    ------
    InputError
        Any parameter out of its range, or a ratio given for a set with its own stiffness.
    """
    if isinstance(molecule, Sequence):
        molecule = Molecule(molecule)
    table = load_parameters(angles) if isinstance(angles, str) else angles
    rows = table.rows(molecule.sequence.step_indices())
    ground = table.ground[rows]
    regions: tuple[Region, ...] = ()
    if table.a_tract_twist is not None:
        regions = _regions(molecule, a_tracts, closed)
        for region in regions:
            ground[region_steps(region, len(ground)), 0] = table.a_tract_twist
    elif a_tracts not in ("auto", "none"):
        raise InputError(f"parameter set '{table.name}' has no A-tract twist; use a_tracts none")
    if table.kind == "rigid":
        for value, name in (
            (twist_ratio, "twist ratio"),
            (persistence_length_A, "persistence length"),
            (rise_A, "rise"),
        ):
            if value is not None:
                raise InputError(
                    f"parameter set '{table.name}' has lengths and stiffnesses of its own; leave "
                    f"out the {name}"
                )
        return _rigid_chain(molecule, table, rows, ground, regions)
    if molecule.ground is not None:
        raise InputError(
            f"{molecule.name}: a shape of six parameters a step needs a set with six, such as "
            f"olson1998; '{table.name}' has three angles"
        )
    persistence_length_A = (
        PERSISTENCE_LENGTH_A if persistence_length_A is None else persistence_length_A
    )
    rise_A = RISE_A if rise_A is None else rise_A
    if table.stiffness is None:
        ratio = TWIST_RATIO if twist_ratio is None else float(twist_ratio)
        stiffness = uniform_stiffness(len(rows), ratio)
    elif twist_ratio is not None:
        raise InputError(
            f"parameter set '{table.name}' has stiffnesses of its own; leave out the twist ratio"
        )
    else:
        ratio = None
        scale = rise_A / persistence_length_A if table.stiffness_in_RT else 1.0
        stiffness = scale * table.stiffness[rows]
    return Chain(
        name=molecule.name,
        letters=molecule.sequence.letters,
        angle_set=table.name,
        ground=ground,
        stiffness=stiffness,
        persistence_length_A=persistence_length_A,
        rise_A=rise_A,
        twist_ratio=ratio,
        step_form=step_form,
        a_tract_regions=regions,
        warnings=(table.strand_note,) if table.strand_note else (),
    )


def _rigid_chain(
    molecule: Molecule,
    table: ParameterSet,
    rows: NDArray[np.intp],
    ground: Array,
    regions: tuple[Region, ...],
) -> Chain:
    """Chain of rigid steps; its unit of length is the mean rise, its unit of energy RT."""
    if table.stiffness is None:
        raise InputError(f"parameter set '{table.name}' has no stiffness; six parameters need one")
    if molecule.ground is not None:
        own = np.isfinite(molecule.ground).all(axis=1)
        ground[own] = molecule.ground[own]
    rise = float(ground[:, 5].mean())
    if not rise > 0.0:
        raise InputError(f"parameter set '{table.name}': the mean rise of the steps is {rise} Å")
    ground[:, 3:] /= rise
    units = np.array([1.0, 1.0, 1.0, rise, rise, rise])
    return Chain(
        name=molecule.name,
        letters=molecule.sequence.letters,
        angle_set=table.name,
        ground=ground,
        stiffness=table.stiffness[rows] * np.outer(units, units),
        persistence_length_A=rise,
        rise_A=rise,
        step_form="rigid",
        a_tract_regions=regions,
        warnings=(table.strand_note,) if table.strand_note else (),
    )


def chain_frames(angles: ArrayLike, step_form: StepForm = "wedge") -> tuple[Array, Array]:
    """Centres and frames of a chain in given angles, frame 0 being the laboratory frame.

    Parameters
    ----------
    angles : array_like, shape (N, c)
        Coordinates of each step: tau, theta, phi in radians, or the six of a rigid step.

    Returns
    -------
    centres : ndarray, shape (N+1, 3)
        Base-pair centres in units of the step length; the last is the fictitious base pair's.
    frames : ndarray, shape (N+1, 3, 3)
        Directors d1, d2, d3 of base pair i in the columns of ``frames[i]`` (2.2).
    """
    # Writable, as the kernels' other callers have it: read-only arrays are compiled for anew.
    angles = np.require(angles, dtype=float, requirements=["C", "W"])
    centres = np.empty((len(angles) + 1, 3))
    frames = np.empty((len(angles) + 1, 3, 3))
    if step_form == "rigid":
        fill_rigid_frames(angles, centres, frames)
        return centres, frames
    fill_frames(angles, WEDGE if step_form == "wedge" else MIDSTEP, centres, frames)
    return centres, frames


def angles_of_frames(frames: ArrayLike, step_form: StepForm = "wedge") -> Array:
    """Angles (N, 3) of hinge steps between successive frames (N+1, 3, 3), in radians."""
    frames = np.ascontiguousarray(frames, dtype=float)
    angles = np.empty((len(frames) - 1, 3))
    fill_angles(frames, WEDGE if step_form == "wedge" else MIDSTEP, angles)
    return angles


def rigid_coordinates(centres: ArrayLike, frames: ArrayLike) -> Array:
    """Six coordinates (N, 6) of the rigid steps between successive base pairs.

    Parameters
    ----------
    centres, frames : array_like, shapes (N+1, 3) and (N+1, 3, 3)
        Directors in the columns of a frame.
    """
    frames = np.ascontiguousarray(frames, dtype=float)
    coordinates = np.empty((len(frames) - 1, 6))
    fill_rigid_coordinates(np.ascontiguousarray(centres, dtype=float), frames, coordinates)
    return coordinates


def elastic_energy(chain: Chain, angles: ArrayLike) -> float:
    """Reduced energy (2.3) of the chain in given coordinates (N, c)."""
    bend, twist = energy_parts(chain, angles)
    return bend + twist


def energy_parts(chain: Chain, angles: ArrayLike) -> tuple[float, float]:
    """Bending and twisting parts of the reduced energy (2.3).

    The twisting part is the terms of the twist alone; couplings of the twist, where a stiffness has
    them, and the translations of rigid steps count as bending, so the parts add up to the energy.
    """
    strain = np.asarray(angles, dtype=float) - chain.ground
    total = 0.5 * float(np.einsum("ij,ijk,ik->", strain, chain.stiffness, strain))
    twist = 0.5 * float(np.sum(chain.stiffness[:, 0, 0] * strain[:, 0] ** 2))
    return total - twist, twist
