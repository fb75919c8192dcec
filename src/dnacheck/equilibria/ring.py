"""The one result of every search for a closed ring, discrete or continuum, and their collection.

Units
-----
Names that end in ``_RT``, ``_A``, ``_deg``, ``_pN`` and ``_pN_nm`` carry their unit. ``_reduced``
is in the package's own units: energies over the bending stiffness K_theta of a step, lengths in
steps, angles in radians. Newtons need a temperature, :data:`dnacheck.model.units.TEMPERATURE_K`.

Axes
----
Coordinates, frames, force and moment are all components in the frame of the first base pair, which
lies at the origin. Force and moment are those that the rest of the molecule exerts on the end that
is joined to the first base pair, the moment about its centre.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import NDArray

from dnacheck.model.chain import Chain, chain_frames, energy_parts
from dnacheck.model.rod.rod import Rod
from dnacheck.model.units import TEMPERATURE_K, thermal_energy_pN_nm
from dnacheck.numerics.outcome import InputError, SolveError, Status

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

    from dnacheck.equilibria.continuum.curve import Curve

Array = NDArray[np.float64]
Model = Literal["discrete", "continuum"]

COLUMNS = (
    "model",
    "energy_RT",
    "energy_reduced",
    "bend_RT",
    "twist_RT",
    "link",
    "writhe",
    "stable",
    "smallest_eigenvalue",
    "residual",
    "iterations",
    "seconds",
    "status",
)
"""Members of an equilibrium's JSON and columns of its table, in their order."""

_STABLE = {True: "stable", False: "saddle", None: "stability unknown"}


@dataclass(frozen=True, eq=False, repr=False)
class Equilibrium:
    """A closed equilibrium of an elastic molecule, or the point where its search ended.

    Attributes
    ----------
    source : Chain or Rod
        What was closed: the discrete chain or the continuum rod.
    energy_reduced : float
        Elastic energy, in units of a step's bending stiffness.
    link : int
        Turns of the frames about the ring: twist plus writhe.
    writhe : float
        Turns.
    stable : bool or None
        Whether every small closed deformation raises the energy; None where that could not be
        told: the search did not converge, or an eigenvalue is zero to round-off (``status`` says).
    negative_directions : int or None
        Independent closed deformations that lower the energy, round-off apart.
    residual : float
        Largest residual of all equations, of the discrete gradient and closure (reduced units) or
        of collocation (relative) and closure.
    iterations : int
        Newton iterations.
    seconds : float
        Wall time.
    status : Status
        How the search ended; ``status.value`` is what to know or do next.
    solved_angles : ndarray, shape (N, 3) or (N, 6), or None
        Discrete ring: the unknowns of each step (tau, theta, phi in radians). None: continuum.
    multipliers : ndarray, shape (6,), or None
        Discrete ring: force (reduced energy per step length) and moment (reduced energy per
        radian) of closure: gradient + (closure Jacobian)^T multipliers = 0.
    log_abs_det_kkt : float
        Discrete ring: log |det| of [[H, G^T], [G, 0]] for Laplace's J; of no use where an
        eigenvalue is zero.
    closure : float
        Discrete ring: largest closure residual (steps, radians).
    curve : Curve or None
        Continuum ring: the solution as functions of arclength, with its loads and errors.
    """

    source: Chain | Rod
    energy_reduced: float
    link: int
    writhe: float
    stable: bool | None
    negative_directions: int | None
    residual: float
    iterations: int
    seconds: float
    status: Status
    solved_angles: Array | None = None
    multipliers: Array | None = None
    log_abs_det_kkt: float = float("nan")
    closure: float = float("nan")
    curve: Curve | None = None

    @property
    def model(self) -> Model:
        """Which model this is an equilibrium of."""
        return "discrete" if self.curve is None else "continuum"

    @property
    def chain(self) -> Chain:
        """The chain of a discrete ring."""
        if not isinstance(self.source, Chain):
            raise InputError(f"the ring of {self.name} is continuum; give a discrete one")
        return self.source

    @property
    def rod(self) -> Rod:
        """The rod of a continuum ring."""
        if not isinstance(self.source, Rod):
            raise InputError(f"the ring of {self.name} is discrete; give a continuum one")
        return self.source

    @property
    def name(self) -> str:
        """Name of the molecule."""
        return self.source.name

    @property
    def n_bp(self) -> int:
        """Number of base pairs N, which is the number of steps of the ring."""
        return self.source.n_steps

    @property
    def temperature_K(self) -> float:
        """Temperature at which force and moment are given; energies in RT need none."""
        return TEMPERATURE_K

    @property
    def energy_RT(self) -> float:
        """Elastic energy in RT."""
        return self.energy_reduced * self.source.energy_scale_RT

    @cached_property
    def parts_reduced(self) -> tuple[float, float]:
        """Bending and twisting parts of the reduced energy; their sum is the energy."""
        if self.curve is not None:
            return self.curve.bend, self.curve.twist
        assert self.solved_angles is not None
        return energy_parts(self.chain, self.solved_angles)

    @property
    def bend_RT(self) -> float:
        """Bending part of the energy in RT; couplings to the twist, if any, included."""
        return self.parts_reduced[0] * self.source.energy_scale_RT

    @property
    def twist_RT(self) -> float:
        """Twisting part of the energy in RT."""
        return self.parts_reduced[1] * self.source.energy_scale_RT

    @property
    def twist_turns(self) -> float:
        """Twist in turns: link minus writhe."""
        return self.link - self.writhe

    @cached_property
    def smallest_eigenvalue(self) -> float | None:
        """Smallest eigenvalue of the projected Hessian, reduced energy per square radian.

        None for a continuum ring, whose stability is told by its conjugate points.
        """
        if self.solved_angles is None:
            return None
        from dnacheck.equilibria.discrete.spectrum import smallest_projected_eigenvalue

        return smallest_projected_eigenvalue(self.chain, self.solved_angles, self.multipliers)

    @cached_property
    def shape(self) -> tuple[Array, Array]:
        """Centres (N+1, 3) in steps and frames (N+1, 3, 3), directors in columns.

        The last is the copy of the first that closes the ring. A discrete ring has frame 0 at the
        origin; a continuum ring, sampled at its base pairs (Section IX), has the axes of its rod.
        """
        if self.curve is not None:
            from dnacheck.equilibria.bridge.reconstruct import reconstruct

            rebuilt = reconstruct(self)
            return rebuilt.centres, rebuilt.frames
        assert self.solved_angles is not None
        return chain_frames(self.solved_angles, self.chain.step_form)

    @cached_property
    def angles(self) -> Array:
        """tau, theta, phi of each step in radians, shape (N, 3)."""
        if self.solved_angles is not None:
            return self.solved_angles
        from dnacheck.model.chain import angles_of_frames

        return _frozen(angles_of_frames(self.shape[1]))

    @cached_property
    def angles_deg(self) -> Array:
        """Angles of each step in degrees, shape (N, 3): tau (twist), theta (roll), phi (tilt).

        Step i leads from base pair i to i + 1, the last one back to the first. Steps of six
        parameters have shape (N, 6): tilt, roll, twist in degrees, shift, slide, rise in Å.
        """
        if self.angles.shape[1] == 6:
            return _frozen(np.hstack([np.degrees(self.angles[:, :3]), self.angles[:, 3:]]))
        return _frozen(np.degrees(self.angles))

    @cached_property
    def coordinates_A(self) -> Array:
        """Base-pair centres in Å, shape (N, 3); the first is the origin."""
        centres, frames = self.shape
        moved = (centres[:-1] - centres[0]) @ frames[0]
        return _frozen(self.source.rise_A * moved)

    @cached_property
    def frames(self) -> Array:
        """Base-pair frames, shape (N, 3, 3): entry [i, :, k] is director d_(k+1) of pair i.

        Components along the directors of the first base pair, whose frame is the unit matrix.
        """
        _, frames = self.shape
        return _frozen(np.einsum("ab,iac->ibc", frames[0], frames[:-1]))

    @cached_property
    def _loads_reduced(self) -> tuple[Array, Array]:
        """Force (reduced energy per step) and moment about base pair 0, in its frame."""
        if self.curve is None:
            assert self.multipliers is not None
            return -self.multipliers[:3], -self.multipliers[3:]
        centres, frames = self.shape
        force = self.curve.loads[3:] / self.n_bp
        moment = self.curve.loads[:3] - np.cross(centres[0], force)
        return force @ frames[0], moment @ frames[0]

    @cached_property
    def force_pN(self) -> Array:
        """Force that the rest of the ring exerts on the end at the first base pair, shape (3,).

        In pN, at ``temperature_K``, along the directors of the first base pair.
        """
        scale = self.source.energy_scale_RT * thermal_energy_pN_nm(self.temperature_K)
        return _frozen(self._loads_reduced[0] * scale * 10.0 / self.source.rise_A)

    @cached_property
    def moment_pN_nm(self) -> Array:
        """Moment about the first base pair's centre, shape (3,), in pN nm; see ``force_pN``."""
        scale = self.source.energy_scale_RT * thermal_energy_pN_nm(self.temperature_K)
        return _frozen(self._loads_reduced[1] * scale)

    def to_dict(self) -> dict[str, Any]:
        """What the commands print as JSON.

        Returns
        -------
        dict
            model, energy_RT, energy_reduced, bend_RT, twist_RT (RT), link, writhe (turns), stable,
            smallest_eigenvalue, residual, iterations, seconds, status; plain Python values.
        """
        values = {column: getattr(self, column) for column in COLUMNS}
        return values | {"status": self.status.value}

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the ring as a structure file, three atoms per base pair.

        Parameters
        ----------
        path : path
            Ends in .pdb or .gro; its folder must exist.

        Raises
        ------
        InputError
            Another ending, a folder that is not there, or a ring too long for the format.
        """
        from dnacheck.io.structure import write_ring_structure

        where = Path(path)
        if not where.parent.is_dir():
            raise InputError(
                f"path '{where}': there is no folder '{where.parent}'; make it or name another"
            )
        centres, frames = self.shape
        write_ring_structure(
            where, centres, frames, self.source.letters, self.source.rise_A, self.name
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the centreline and the two sugar-phosphate chains, seen along the thinnest axis.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Two- or three-dimensional; by default those of a new figure.

        Returns
        -------
        Axes
            Lengths in Å.
        """
        from dnacheck.equilibria.drawing import draw_ring

        return draw_ring(self, ax)

    def __repr__(self) -> str:
        return (
            f"<{self.model} ring of {self.name}, {self.n_bp} bp: {self.energy_RT:.4f} RT "
            f"(bend {self.bend_RT:.4f}, twist {self.twist_RT:.4f}), link {self.link}, "
            f"writhe {self.writhe:+.4f}, {_STABLE[self.stable]}>"
        )

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><th style='text-align:left'>{escape(key)}</th><td>{escape(_text(value))}</td></tr>"
            for key, value in self.to_dict().items()
        )
        return f"<table><caption>{escape(self.name)}, {self.n_bp} bp</caption>{rows}</table>"


@dataclass(frozen=True, eq=False, repr=False)
class Equilibria(Sequence[Equilibrium]):
    """Every distinct equilibrium that a search found, lowest energy first; a sequence.

    Attributes
    ----------
    source : Chain or Rod
        What was closed.
    found : tuple of Equilibrium
    links_searched : tuple of int
        Links of the starting shapes. A start may relax to another link of the same parity,
        because chains may pass through themselves.
    starts : int
        Starting shapes tried.
    failures : tuple of Equilibrium
        Starts that did not converge, where they were kept.
    failed_starts : int
        Starts that did not converge.
    seconds : float
        Wall time.
    status : Status
    """

    source: Chain | Rod
    found: tuple[Equilibrium, ...]
    links_searched: tuple[int, ...]
    starts: int
    failed_starts: int
    seconds: float
    status: Status
    failures: tuple[Equilibrium, ...] = ()

    @property
    def name(self) -> str:
        """Name of the molecule."""
        return self.source.name

    @property
    def chain(self) -> Chain:
        """The chain of a discrete search."""
        if not isinstance(self.source, Chain):
            raise InputError(f"the rings of {self.name} are continuum; give discrete ones")
        return self.source

    @property
    def model(self) -> Model:
        """Which model was searched."""
        return "discrete" if isinstance(self.source, Chain) else "continuum"

    @property
    def minima(self) -> tuple[Equilibrium, ...]:
        """Those that are not saddles."""
        return tuple(ring for ring in self.found if ring.stable is not False)

    @property
    def lowest(self) -> Equilibrium:
        """The minimum of lowest energy.

        Raises
        ------
        SolveError
            None was found; its ``partial`` is this search.
        """
        for ring in self.found:
            if ring.stable is not False:
                return ring
        what = (
            f"only {len(self.found)} saddles were found"
            if self.found
            else f"none of {self.starts} starts converged"
        )
        raise SolveError(
            f"{self.model} ring of {self.name}: {what} over links "
            f"{', '.join(map(str, self.links_searched))}; {Status.NOT_FOUND.value}",
            self,
        )

    def __len__(self) -> int:
        return len(self.found)

    @overload
    def __getitem__(self, index: int) -> Equilibrium: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Equilibrium, ...]: ...
    def __getitem__(self, index: int | slice) -> Equilibrium | tuple[Equilibrium, ...]:
        return self.found[index]

    def __iter__(self) -> Iterator[Equilibrium]:
        return iter(self.found)

    def to_dict(self) -> dict[str, Any]:
        """The search as plain Python values.

        Returns
        -------
        dict
            target, n_bp, model, links_searched, starts, failed_starts, seconds, status, and the
            list equilibria, each as :meth:`Equilibrium.to_dict` gives it.
        """
        return {
            "target": self.name,
            "n_bp": self.source.n_steps,
            "model": self.model,
            "links_searched": list(self.links_searched),
            "starts": self.starts,
            "failed_starts": self.failed_starts,
            "seconds": self.seconds,
            "status": self.status.value,
            "equilibria": [ring.to_dict() for ring in self.found],
        }

    def to_frame(self) -> pandas.DataFrame:
        """A table with a row for each equilibrium, lowest first, and the columns of the JSON."""
        import pandas

        return pandas.DataFrame([ring.to_dict() for ring in self.found], columns=list(COLUMNS))

    def __repr__(self) -> str:
        head = f"<{len(self.found)} {self.model} rings of {self.name}, {self.source.n_steps} bp"
        return "\n  ".join([head, *map(repr, self.found)]) + ">"

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{escape(column)}</th>" for column in COLUMNS)
        rows = "".join(
            "<tr>" + "".join(f"<td>{escape(_text(v))}</td>" for v in ring.to_dict().values())
            + "</tr>"
            for ring in self.found
        )  # fmt: skip
        return (
            f"<table><caption>{escape(self.name)}, {self.source.n_steps} bp</caption>"
            f"<tr>{head}</tr>{rows}</table>"
        )


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _frozen(array: Array) -> Array:
    array.setflags(write=False)
    return array
