"""The discrete wedge chain of Section II: ground angles, stiffnesses, frames and energies."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.model.a_tracts import Region, automatic_regions, parse_regions, tract_regions
from dnacheck.model.chain_kernels import MIDSTEP, WEDGE, HingeSteps, fill_angles, fill_frames
from dnacheck.model.molecules import Molecule
from dnacheck.model.parameters import AngleSet, load_angle_set
from dnacheck.model.sequence import Sequence
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]
StepForm = Literal["wedge", "midstep"]

PERSISTENCE_LENGTH_A = 463.0
"""Persistence length of Section X, in Å."""
RISE_A = 3.4
"""Helix rise per base pair of Section X, in Å."""
TWIST_RATIO = 1.5
"""K_tau / K_theta of Table II."""


@dataclass(frozen=True)
class Chain:
    """A closed or open chain of N elastic base-pair steps.

    Attributes
    ----------
    name, letters, angle_set : str
        Molecule, its letters (empty for a chain made from arrays), and the parameters' name.
    ground : ndarray, shape (N, 3)
        Unstressed tau, theta, phi of step i, which turns frame i into frame i+1; radians.
    stiffness : ndarray, shape (N, 3, 3)
        Symmetric positive stiffness of each step in the same order, reduced (K_theta = 1).
    energy_scale_RT : float
        RT per reduced unit of energy: persistence length over rise.
    twist_ratio : float or None
        K_tau / K_theta where the stiffness is the uniform diagonal one, else None.
    step_form : {"wedge", "midstep"}
        How the three angles make a rotation; the wedge is the paper's (2.1).
    a_tract_regions : tuple of (first, last)
        Steps that took the A-tract twist, from 0, both ends included.
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
    warnings: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        ground = np.array(self.ground, dtype=float, order="C")
        stiffness = np.array(self.stiffness, dtype=float, order="C")
        if ground.ndim != 2 or ground.shape[1] != 3 or stiffness.shape != (*ground.shape, 3):
            raise InputError("a chain needs ground angles (N, 3) and stiffnesses (N, 3, 3)")
        if not (np.all(np.isfinite(ground)) and np.all(np.isfinite(stiffness))):
            raise InputError("ground angles and stiffnesses must be finite")
        for value, name in (
            (self.persistence_length_A, "persistence length"),
            (self.rise_A, "rise"),
        ):
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"{name} must be a positive number of Å, not {value}")
        if self.step_form not in ("wedge", "midstep"):
            raise InputError(f"step form '{self.step_form}' is neither wedge nor midstep")
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
        """RT per reduced unit of energy, K_theta = RT P/l (Section X)."""
        return self.persistence_length_A / self.rise_A

    @property
    def form_code(self) -> int:
        """Integer of the step form, for compiled kernels."""
        return WEDGE if self.step_form == "wedge" else MIDSTEP

    @cached_property
    def arrays(self) -> HingeSteps:
        """What compiled kernels read of the steps: copies of the arrays, made once.

        They are writable only because a kernel is compiled anew for read-only arrays; nothing
        writes to them.
        """
        return HingeSteps(self.ground.copy(), self.stiffness.copy(), self.form_code)

    @property
    def relaxed_turns(self) -> float:
        """Sum of the ground twists in turns, the reference for choosing links."""
        return float(self.ground[:, 0].sum() / (2.0 * np.pi))

    def with_twist_ratio(self, twist_ratio: float) -> Chain:
        """The same chain with another uniform diagonal stiffness.

        Raises
        ------
        InputError
            The ratio is not positive, or the stiffness is not the uniform diagonal one.
        """
        if self.twist_ratio is None:
            raise InputError("a twist ratio applies only to the uniform diagonal stiffness")
        from dataclasses import replace

        return replace(
            self,
            stiffness=uniform_stiffness(self.n_steps, twist_ratio),
            twist_ratio=float(twist_ratio),
        )


def uniform_stiffness(n_steps: int, twist_ratio: float) -> Array:
    """The paper's diagonal stiffness (twist_ratio, 1, 1) on every step, shape (n_steps, 3, 3).

    Raises
    ------
    InputError
        The ratio is not a positive finite number.
    """
    if not (np.isfinite(twist_ratio) and twist_ratio > 0.0):
        raise InputError(f"twist ratio must be a positive number, not {twist_ratio}")
    return np.tile(np.diag([float(twist_ratio), 1.0, 1.0]), (n_steps, 1, 1))


def _regions(molecule: Molecule, choice: str | tuple[Region, ...]) -> tuple[Region, ...]:
    letters = molecule.sequence.letters
    if not isinstance(choice, str):
        return parse_regions(",".join(f"{a}..{b}" for a, b in choice), len(letters))
    if choice == "none":
        return ()
    if choice == "auto":
        known = molecule.a_tract_regions
        return automatic_regions(letters) if known is None else known
    if choice == "tracts-only":
        return tract_regions(letters)
    return parse_regions(choice, len(letters))


def build_chain(
    molecule: Molecule | Sequence,
    angles: str | AngleSet = "trifonov2",
    twist_ratio: float | None = None,
    persistence_length_A: float = PERSISTENCE_LENGTH_A,
    rise_A: float = RISE_A,
    a_tracts: str | tuple[Region, ...] = "auto",
    step_form: StepForm = "wedge",
) -> Chain:
    """Chain of a molecule from its letters and an angle set.

    Parameters
    ----------
    molecule : Molecule or Sequence
        What is read 5' to 3'; the strand matters for the wedge form (up to 2.5 % in energy).
    angles : str or AngleSet
        Embedded name, TOML file, or a set already loaded.
    twist_ratio : float, optional
        K_tau / K_theta of the uniform stiffness; default 1.5. Not allowed for a set that brings
        stiffnesses of its own.
    persistence_length_A, rise_A : float
        Give the energy unit K_theta = RT P/l; in Å.
    a_tracts : "auto", "tracts-only", "none", "A..B", or regions
        Steps that take the set's A-tract twist; without effect for a set that has none.
    step_form : {"wedge", "midstep"}
        The paper's wedge, or its form symmetrised in the strands.

    Raises
    ------
    InputError
        Any parameter out of its range, or a ratio given for a set with its own stiffness.
    """
    if isinstance(molecule, Sequence):
        molecule = Molecule(molecule)
    table = load_angle_set(angles) if isinstance(angles, str) else angles
    steps = molecule.sequence.step_indices()
    ground = table.ground[steps]
    regions: tuple[Region, ...] = ()
    if table.a_tract_twist is not None:
        regions = _regions(molecule, a_tracts)
        for first, last in regions:
            ground[first : last + 1, 0] = table.a_tract_twist
    elif a_tracts not in ("auto", "none"):
        raise InputError(f"angle set '{table.name}' has no A-tract twist; use a_tracts none")
    if table.stiffness is None:
        ratio = TWIST_RATIO if twist_ratio is None else float(twist_ratio)
        stiffness = uniform_stiffness(len(steps), ratio)
    elif twist_ratio is not None:
        raise InputError(
            f"angle set '{table.name}' has stiffnesses of its own; leave out the twist ratio"
        )
    else:
        ratio = None
        scale = rise_A / persistence_length_A if table.stiffness_in_RT else 1.0
        stiffness = scale * table.stiffness[steps]
    warnings: tuple[str, ...] = ()
    if not table.strand_symmetric:
        warnings = (
            f"angle set '{table.name}' departs from the strand relation by "
            f"{table.strand_asymmetry:.3g}; the two strands are different molecules to it",
        )
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
        warnings=warnings,
    )


def chain_frames(angles: ArrayLike, step_form: StepForm = "wedge") -> tuple[Array, Array]:
    """Centres and frames of a chain in given angles, frame 0 being the laboratory frame.

    Parameters
    ----------
    angles : array_like, shape (N, 3)
        tau, theta, phi of each step in radians.

    Returns
    -------
    centres : ndarray, shape (N+1, 3)
        Base-pair centres in units of the step length; the last is the fictitious base pair's.
    frames : ndarray, shape (N+1, 3, 3)
        Directors d1, d2, d3 of base pair i in the columns of ``frames[i]`` (2.2).
    """
    angles = np.ascontiguousarray(angles, dtype=float)
    centres = np.empty((len(angles) + 1, 3))
    frames = np.empty((len(angles) + 1, 3, 3))
    fill_frames(angles, WEDGE if step_form == "wedge" else MIDSTEP, centres, frames)
    return centres, frames


def angles_of_frames(frames: ArrayLike, step_form: StepForm = "wedge") -> Array:
    """Step angles (N, 3) between successive frames (N+1, 3, 3), in radians."""
    frames = np.ascontiguousarray(frames, dtype=float)
    angles = np.empty((len(frames) - 1, 3))
    fill_angles(frames, WEDGE if step_form == "wedge" else MIDSTEP, angles)
    return angles


def elastic_energy(chain: Chain, angles: ArrayLike) -> float:
    """Reduced energy (2.3) of the chain in given angles (N, 3)."""
    bend, twist = energy_parts(chain, angles)
    return bend + twist


def energy_parts(chain: Chain, angles: ArrayLike) -> tuple[float, float]:
    """Bending and twisting parts of the reduced energy (2.3).

    The twisting part is the terms of tau alone; couplings of tau to the bends, where a stiffness
    has them, count as bending, so the parts add up to the energy.
    """
    strain = np.asarray(angles, dtype=float) - chain.ground
    total = 0.5 * float(np.einsum("ij,ijk,ik->", strain, chain.stiffness, strain))
    twist = 0.5 * float(np.sum(chain.stiffness[:, 0, 0] * strain[:, 0] ** 2))
    return total - twist, twist
