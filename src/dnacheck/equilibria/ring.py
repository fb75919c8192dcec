"""The one result of every search for an equilibrium, discrete or continuum, and their collection.

Units
-----
Names that end in ``_RT``, ``_A``, ``_deg``, ``_pN`` and ``_pN_nm`` carry their unit. ``energy``,
``parts``, ``centres``, ``angles`` and ``multipliers`` are in the package's own units: energies over
the bending stiffness K_theta of a step, lengths in steps, angles in radians. Newtons need a
temperature, :data:`dnacheck.model.units.TEMPERATURE_K`.

Axes
----
Coordinates, frames, force and moment are components in the frame of the first base pair, which
lies at the origin. Force and moment are those that are exerted on the end (in a ring: by the first
base pair on the last step), the moment about the end's centre.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.boundary import AnyBoundary, Ring
from dnacheck.model.chain import Chain, angles_of_frames, chain_frames, energy_parts
from dnacheck.model.rod.rod import Rod
from dnacheck.model.units import TEMPERATURE_K, thermal_energy_pN_nm
from dnacheck.numerics.outcome import InputError, SolveError, Status

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

    from dnacheck.equilibria.continuum.curve import Curve

Array = NDArray[np.float64]
Model = Literal["discrete", "continuum"]

RING = Ring()

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

_SOLVED = (Status.CONVERGED, Status.SADDLE, Status.NEUTRAL, Status.MESH_LIMIT)
_STABLE = {True: "stable", False: "saddle", None: "stability unknown"}


@dataclass(frozen=True)
class Steps:
    """What solves a discrete chain.

    Attributes
    ----------
    angles : ndarray, shape (N, c)
        Coordinates of each step: tau, theta, phi in radians, or the six of a rigid step; read-only.
    multipliers : ndarray, shape (6,)
        Force (reduced energy per step length) and moment (reduced energy per radian) of closure,
        in the frame of the target (the first base pair's for a ring): gradient + (closure
        Jacobian)^T multipliers = 0. Minus the loads on components that are free.
    log_abs_det_kkt : float
        log |det| of the matrix [[H, G^T], [G, 0]], for the Laplace J factor; of no use where an
        eigenvalue is zero.
    closure : float
        Largest entry of the closure equations (steps, radians).
    """

    angles: Array
    multipliers: Array
    log_abs_det_kkt: float
    closure: float


@dataclass(frozen=True, eq=False, repr=False)
class Equilibrium:
    """An equilibrium of an elastic molecule, or the point where its search ended.

    Attributes
    ----------
    source : Chain or Rod
        What is in equilibrium: the discrete chain or the continuum rod.
    solution : Steps or Curve
        What solves its equations.
    energy : float
        Elastic energy, in units of a step's bending stiffness; ``energy_RT`` in RT.
    ring_link : int or None
        Turns of the frames about a ring: twist plus writhe. None unless the boundary is a ring.
    twist_turns, writhe : float
        In turns. Without a link the twist ends at the nick, and the writhe is not a number where
        the ends do not meet.
    stable : bool or None
        Whether every small deformation that the boundary allows raises the energy; None where that
        could not be told: the search did not converge, or an eigenvalue is zero to round-off
        (``status`` tells which).
    negative_directions : int or None
        Independent deformations that lower the energy, round-off apart; of a rod, conjugate points.
    residual : float
        Largest residual of all equations: of the discrete gradient and closure (reduced units), or
        of collocation (relative) and closure.
    iterations : int
        Newton iterations.
    seconds : float
        Wall time.
    status : Status
        How the search ended; ``status.value`` is what to know or do next.
    boundary : Ring, NickedRing, HingedRing, Loop or Pull
    """

    source: Chain | Rod
    solution: Steps | Curve
    energy: float
    ring_link: int | None
    twist_turns: float
    writhe: float
    stable: bool | None
    negative_directions: int | None
    residual: float
    iterations: int
    seconds: float
    status: Status
    boundary: AnyBoundary = RING

    @property
    def model(self) -> Model:
        """Which model this is an equilibrium of."""
        return "discrete" if isinstance(self.solution, Steps) else "continuum"

    @property
    def chain(self) -> Chain:
        """The chain of a discrete equilibrium.

        Raises
        ------
        InputError
            It is a rod's.
        """
        return _chain(self.source)

    @property
    def rod(self) -> Rod:
        """The rod of a continuum equilibrium.

        Raises
        ------
        InputError
            It is a chain's.
        """
        if isinstance(self.source, Rod):
            return self.source
        raise InputError(f"{self.name}: this is a discrete chain's; give a rod's")

    @property
    def steps(self) -> Steps:
        """Solution of a discrete chain.

        Raises
        ------
        InputError
            It is a rod's.
        """
        if isinstance(self.solution, Steps):
            return self.solution
        raise InputError(f"{self.name}: this is a continuum rod's; give a discrete chain's")

    @property
    def curve(self) -> Curve:
        """Solution of a continuum rod.

        Raises
        ------
        InputError
            It is a chain's.
        """
        if isinstance(self.solution, Steps):
            raise InputError(f"{self.name}: this is a discrete chain's; give a continuum rod's")
        return self.solution

    @property
    def name(self) -> str:
        """Name of the molecule."""
        return self.source.name

    @property
    def n_bp(self) -> int:
        """Number of base pairs N, which is the number of steps."""
        return self.source.n_steps

    @property
    def link(self) -> int:
        """Turns of the frames about the ring.

        Raises
        ------
        InputError
            The ends are not those of a ring.
        """
        if self.ring_link is None:
            raise InputError(f"a {self.boundary.label} chain has no link; ask a ring for it")
        return self.ring_link

    @property
    def energy_reduced(self) -> float:
        """``energy``, by its name in tables and JSON."""
        return self.energy

    @property
    def temperature_K(self) -> float:
        """Temperature at which force and moment are given; energies in RT need none."""
        return getattr(self.boundary, "temperature_K", TEMPERATURE_K)

    @property
    def energy_RT(self) -> float:
        """Elastic energy in RT."""
        return self.energy * self.source.energy_scale_RT

    @cached_property
    def parts(self) -> tuple[float, float]:
        """Bending and twisting parts of the reduced energy; their sum is the energy."""
        if isinstance(self.solution, Steps):
            return energy_parts(self.chain, self.solution.angles)
        return self.solution.bend, self.solution.twist

    @property
    def bend_RT(self) -> float:
        """Bending part of the energy in RT; couplings to the twist, if any, included."""
        return self.parts[0] * self.source.energy_scale_RT

    @property
    def twist_RT(self) -> float:
        """Twisting part of the energy in RT."""
        return self.parts[1] * self.source.energy_scale_RT

    @property
    def multipliers(self) -> Array:
        """Of a discrete chain, see :class:`Steps`."""
        return self.steps.multipliers

    @property
    def log_abs_det_kkt(self) -> float:
        """Of a discrete chain, see :class:`Steps`."""
        return self.steps.log_abs_det_kkt

    @property
    def closure(self) -> float:
        """Of a discrete chain, see :class:`Steps`."""
        return self.steps.closure

    @cached_property
    def softest(self) -> float:
        """Smallest eigenvalue of a chain's projected Hessian, reduced energy per square radian.

        Raises
        ------
        InputError
            It is a rod's, whose stability is told by its conjugate points.
        """
        from dnacheck.equilibria.discrete.spectrum import smallest_projected_eigenvalue

        chain, solution = self.chain, self.steps
        return smallest_projected_eigenvalue(
            chain, solution.angles, solution.multipliers, self.boundary.for_chain(chain)
        )

    @property
    def smallest_eigenvalue(self) -> float | None:
        """The same; None for a rod."""
        return self.softest if isinstance(self.solution, Steps) else None

    @cached_property
    def shape(self) -> tuple[Array, Array]:
        """Centres (N+1, 3) in steps and frames (N+1, 3, 3), frame 0 at the origin.

        Directors in the columns. Entry N is the end's, which lies on the first in a ring. A rod is
        sampled at its base pairs (Section IX).
        """
        if isinstance(self.solution, Steps):
            return chain_frames(self.solution.angles, self.chain.step_form)
        from dnacheck.equilibria.bridge.reconstruct import reconstruct

        pairs = reconstruct(self)
        first = pairs.frames[0]
        centres = (pairs.centres - pairs.centres[0]) @ first
        return _frozen(centres), _frozen(np.einsum("ab,iac->ibc", first, pairs.frames))

    @property
    def centres(self) -> Array:
        """Base-pair centres (N+1, 3) in steps."""
        return self.shape[0]

    @property
    def frames(self) -> Array:
        """Base-pair frames, shape (N+1, 3, 3): entry [i, :, k] is director d_(k+1) of pair i.

        Components along the directors of the first base pair. Entry N is the end's frame, in a
        ring the first's.
        """
        return self.shape[1]

    @cached_property
    def coordinates_A(self) -> Array:
        """Base-pair centres in Å, shape (N+1, 3); the first is the origin, entry N the end."""
        return _frozen(self.source.rise_A * self.centres)

    @cached_property
    def angles(self) -> Array:
        """Coordinates of each step, shape (N, c): tau, theta, phi in radians, or six (rigid)."""
        if isinstance(self.solution, Steps):
            return self.solution.angles
        return _frozen(angles_of_frames(self.frames))

    @cached_property
    def angles_deg(self) -> Array:
        """Angles of each step in degrees, shape (N, 3): tau (twist), theta and phi (the bends).

        Step i leads from base pair i to i + 1. Rigid steps have shape (N, 6): twist, tilt and roll
        in degrees, shift, slide and rise in Å.
        """
        degrees = np.degrees(self.angles[:, :3])
        return _frozen(np.hstack([degrees, self.source.rise_A * self.angles[:, 3:]]))

    @cached_property
    def _loads(self) -> tuple[Array, Array]:
        """Force (reduced energy per step) and moment on the end, in the first frame."""
        if isinstance(self.solution, Steps):
            target = np.array(getattr(self.boundary, "rotation", np.eye(3)))
            return -target @ self.multipliers[:3], -target @ self.multipliers[3:]
        from dnacheck.equilibria.bridge.reconstruct import reconstruct

        pairs = reconstruct(self)
        force = self.solution.loads[3:] / self.n_bp
        moment = self.solution.loads[:3] - np.cross(pairs.centres[0], force)
        return force @ pairs.frames[0], moment @ pairs.frames[0]

    @cached_property
    def force_pN(self) -> Array:
        """Force on the end, shape (3,), in pN at ``temperature_K``; see the module's axes.

        In a ring the first base pair exerts it on the last step.
        """
        scale = self.source.energy_scale_RT * thermal_energy_pN_nm(self.temperature_K)
        return _frozen(self._loads[0] * scale * 10.0 / self.source.rise_A)

    @cached_property
    def moment_pN_nm(self) -> Array:
        """Moment on the end about its centre, shape (3,), in pN nm; see ``force_pN``."""
        scale = self.source.energy_scale_RT * thermal_energy_pN_nm(self.temperature_K)
        return _frozen(self._loads[1] * scale)

    def rms_difference_A(self, other: Equilibrium) -> float:
        """Rms distance in Å between the base-pair centres of two rings after superposition.

        Raises
        ------
        InputError
            The two have different numbers of base pairs.
        """
        from dnacheck.equilibria.bridge.reconstruct import rms_difference

        return rms_difference(self.centres, other.centres, self.source.rise_A)

    def to_dict(self) -> dict[str, Any]:
        """What the commands print as JSON.

        Returns
        -------
        dict
            model, energy_RT, energy_reduced, bend_RT, twist_RT (RT), link, writhe (turns), stable,
            smallest_eigenvalue, residual, iterations, seconds, status; plain Python values.
        """
        values = {column: getattr(self, column) for column in COLUMNS if column != "link"}
        values |= {"link": self.ring_link, "status": self.status.value}
        return {column: _finite(values[column]) for column in COLUMNS}

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the ring as a structure file, three atoms per base pair.

        Parameters
        ----------
        path : path
            Ends in .pdb, .gro or .cif, or one of these and .gz; its folder must exist.

        Raises
        ------
        InputError
            Another ending, a folder that is not there, or a ring too long for the format.
        """
        from dnacheck.io.structure import write_ring_structure

        write_ring_structure(
            Path(path),
            self.centres,
            self.frames,
            self.source.letters,
            self.source.rise_A,
            self.name,
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
        link = "" if self.ring_link is None else f", link {self.ring_link}"
        return (
            f"<{self.model} {self.boundary.label} of {self.name}, {self.n_bp} bp: "
            f"{self.energy_RT:.4f} RT (bend {self.bend_RT:.4f}, twist {self.twist_RT:.4f}){link}, "
            f"writhe {self.writhe:+.4f}, {_STABLE[self.stable]}>"
        )

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><th>{escape(key)}</th><td>{escape(_text(value))}</td></tr>"
            for key, value in self.to_dict().items()
        )
        return f"<table><caption>{escape(self.name)}, {self.n_bp} bp</caption>{rows}</table>"


@dataclass(frozen=True, eq=False, repr=False)
class Equilibria(Sequence[Equilibrium]):
    """Every distinct equilibrium that a search found, lowest energy first; a sequence.

    Attributes
    ----------
    source : Chain or Rod
    equilibria : tuple of Equilibrium
        Minima of a chain; of a rod, saddles too. Where one link was asked for, of that link only.
    links_searched : tuple of int
        Links of the starting shapes. A start may relax to another link of the same parity,
        because chains may pass through themselves.
    starts, failed_starts : int
        Starting shapes, and those of them that did not converge.
    seconds : float
        Wall time.
    status : Status
        NOT_FOUND also where every equilibrium is a saddle.
    ends : tuple of Equilibrium
        Other places where starts came to an end: other links than the one asked for, and what did
        not converge, as far as they were kept.
    notes : tuple of str
        Bounds that the search met, and what became of a link that has no ring.
    boundary : Ring, NickedRing, HingedRing, Loop or Pull
        What the end was held to.
    """

    source: Chain | Rod
    equilibria: tuple[Equilibrium, ...]
    links_searched: tuple[int, ...]
    starts: int
    failed_starts: int
    seconds: float
    status: Status
    ends: tuple[Equilibrium, ...] = ()
    notes: tuple[str, ...] = ()
    boundary: AnyBoundary = RING

    @property
    def name(self) -> str:
        """Name of the molecule."""
        return self.source.name

    @property
    def chain(self) -> Chain:
        """The chain of a discrete search.

        Raises
        ------
        InputError
            A rod was searched.
        """
        return _chain(self.source)

    @property
    def model(self) -> Model:
        """Which model was searched."""
        return "discrete" if isinstance(self.source, Chain) else "continuum"

    @property
    def minima(self) -> tuple[Equilibrium, ...]:
        """Those that are not saddles, lowest first."""
        return tuple(ring for ring in self.equilibria if ring.stable is not False)

    @property
    def lowest(self) -> Equilibrium:
        """The minimum of lowest energy.

        Raises
        ------
        SolveError
            None was found; its ``partial`` is this search.
        """
        for ring in self.equilibria:
            if ring.stable is not False:
                return ring
        label = self.boundary.label
        raise SolveError(f"{self.model} {label} of {self.name}: {self.reason}", self)

    @property
    def reason(self) -> str:
        """Why there is no minimum, in one line."""
        if self.notes:
            return "; ".join(self.notes)
        if self.boundary != RING:
            return f"{self.failed_starts} of {self.starts} starts did not converge to a minimum"
        links = ", ".join(map(str, self.links_searched))
        where = f" at link{'s' if len(self.links_searched) > 1 else ''} {links}" if links else ""
        if self.model == "discrete":
            return (
                f"no stable ring{where}: {self.failed_starts} of {self.starts} starts did not "
                "converge to one; search links all, or others"
            )
        counts: Counter[str] = Counter()
        unfinished = [ring for ring in self.ends if ring.status not in _SOLVED]
        for ring in (*self.equilibria, *self.ends):
            if ring.status in _SOLVED:
                kind = "saddle" if ring.stable is False else "ring"
                counts[f"{kind} of link {ring.link} ({ring.energy_RT:.4f} RT)"] += 1
        if unfinished:
            nearest = min(ring.residual for ring in unfinished)
            text = f"start{'s' if len(unfinished) > 1 else ''} without convergence"
            counts[f"{text} (residual {nearest:.0e} at best)"] += len(unfinished)
        reached = ", ".join(f"{count} {what}" for what, count in counts.items())
        if self.equilibria:
            return f"only saddles were found{where}: {reached}"
        return f"no equilibrium was found{where}, but {reached}; search links auto or all"

    def __len__(self) -> int:
        return len(self.equilibria)

    @overload
    def __getitem__(self, index: int) -> Equilibrium: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Equilibrium, ...]: ...
    def __getitem__(self, index: int | slice) -> Equilibrium | tuple[Equilibrium, ...]:
        return self.equilibria[index]

    def __iter__(self) -> Iterator[Equilibrium]:
        return iter(self.equilibria)

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
            "equilibria": [ring.to_dict() for ring in self.equilibria],
        }

    def to_frame(self) -> pandas.DataFrame:
        """A table with a row for each equilibrium, lowest first, and the columns of the JSON."""
        import pandas

        return pandas.DataFrame([ring.to_dict() for ring in self.equilibria], columns=list(COLUMNS))

    def __repr__(self) -> str:
        count = len(self.equilibria)
        head = f"<{count} {self.model} equilibria of {self.name}, {self.source.n_steps} bp"
        return "\n  ".join([head, *map(repr, self.equilibria)]) + ">"

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{escape(column)}</th>" for column in COLUMNS)
        rows = "".join(
            "<tr>" + "".join(f"<td>{escape(_text(v))}</td>" for v in ring.to_dict().values())
            + "</tr>"
            for ring in self.equilibria
        )  # fmt: skip
        return (
            f"<table><caption>{escape(self.name)}, {self.source.n_steps} bp</caption>"
            f"<tr>{head}</tr>{rows}</table>"
        )


def _chain(source: Chain | Rod) -> Chain:
    if isinstance(source, Chain):
        return source
    raise InputError(f"{source.name}: this is a continuum rod; give a discrete chain")


def _finite(value: Any) -> Any:
    """None for a number that JSON does not have."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _text(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _frozen(array: Array) -> Array:
    array.setflags(write=False)
    return array
