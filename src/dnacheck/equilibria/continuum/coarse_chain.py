"""Starts of continuum rings: the minima of a rod cut into straight pieces.

Newton's method on the collocation equations has no merit function; from a rolled perfect ring it
may end in any equilibrium. A chain of elastic steps that has the rod's strains and stiffness does:
its search (:mod:`dnacheck.equilibria.discrete.search`) descends to minima, knows second ones and is
the same wherever the ring is cut. What it finds differs from the rod's equilibria by the square of
the pieces' length, a start one or two Newton steps away.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, RotationSpline

from dnacheck.equilibria.continuum.collocation import aligned_mesh, discretise
from dnacheck.equilibria.continuum.kernels.interpolate import slopes_on_mesh
from dnacheck.equilibria.continuum.options import ContinuumOptions
from dnacheck.equilibria.continuum.state import State, new_state
from dnacheck.equilibria.discrete.search import search_minima
from dnacheck.equilibria.discrete.solve import NewtonOptions
from dnacheck.equilibria.ring import Equilibrium
from dnacheck.model.chain import Chain
from dnacheck.model.rod.rod import Rod

Array = NDArray[np.float64]

_FEWEST, _MOST = 60, 1000
_PAIRS_PER_PIECE = 2
_TOLERANCE = 1e-8


@dataclass(frozen=True)
class CoarseRing:
    """A minimum of the chain of pieces.

    Attributes
    ----------
    link : int
    energy : float
        Reduced.
    ring : Equilibrium
    """

    link: int
    energy: float
    ring: Equilibrium


def chain_of_pieces(rod: Rod) -> Chain:
    """The rod as M midstep steps, in frames that turn evenly by -(Omega(1) - Omega(0)) altogether.

    With psi(s) that turn from the natural frame, a piece of length h bends by Rz(-psi) (w1hat,
    w2hat) h at its middle; its stiffness is the rod's over h.
    """
    pieces = int(np.clip(rod.n_steps // _PAIRS_PER_PIECE, _FEWEST, _MOST))
    h = 1.0 / pieces
    middle = (np.arange(pieces) + 0.5) * h
    bend = rod.strains(middle)
    psi = -rod.end_rotation * middle
    c, s = np.cos(psi), np.sin(psi)
    first, second = c * bend[:, 0] + s * bend[:, 1], c * bend[:, 1] - s * bend[:, 0]
    ground = np.column_stack(
        [np.full(pieces, -rod.end_rotation * h), -first * h, second * h],
    )
    compliance = rod.relative_compliance(middle)
    stiffness = np.zeros((pieces, 3, 3))
    stiffness[:, 0, 0] = rod.twist_stiffness / (compliance[:, 1] * h)
    stiffness[:, 1, 1] = stiffness[:, 2, 2] = rod.bend_stiffness / (compliance[:, 0] * h)
    return Chain(
        name=rod.name,
        ground=ground,
        stiffness=stiffness,
        persistence_length_A=rod.energy_scale_RT * rod.rise_A,
        rise_A=rod.rise_A,
        step_form="midstep",
    )


def coarse_minima(
    rod: Rod, links: Sequence[int], registers: int, window: float
) -> tuple[CoarseRing, ...]:
    """Minima of the chain of pieces over the links, lowest first.

    Each link starts where the planar ring is predicted to rest; those within ``window`` (reduced
    energy) of the lowest look for a second minimum, and start from ``registers`` more.
    """
    turns = np.arange(registers) * (2.0 * np.pi / max(registers, 1))
    options = NewtonOptions(tolerance=_TOLERANCE)
    found = search_minima(chain_of_pieces(rod), tuple(links), turns, window, options)
    return tuple(CoarseRing(ring.link, ring.energy, ring) for ring in found.equilibria)


def start_from_pieces(rod: Rod, coarse: CoarseRing, options: ContinuumOptions) -> State:
    """The state of a minimum of the chain of pieces, interpolated, on a mesh of the rod."""
    disc = discretise(rod, aligned_mesh(rod.breaks, options.intervals), options.degree)
    state = new_state(disc)
    frames = coarse.ring.frames
    s = np.linspace(0.0, 1.0, len(frames))
    # Back from the evenly turning frames to the natural ones.
    natural = Rotation.from_matrix(frames) * Rotation.from_rotvec(
        np.outer(rod.end_rotation * s, [0.0, 0.0, 1.0])
    )
    spline = RotationSpline(s, natural)
    at_mesh = _continuous(spline(disc.mesh[:-1]).as_quat())
    at_points = spline(disc.points)
    # The spline's rates are those seen from the moving frame.
    rates = at_points.apply(spline(disc.points, 1))
    slopes_on_mesh(
        np.ascontiguousarray(disc.mesh),
        disc.rule.points,
        at_mesh,
        _continuous(at_points.as_quat()),
        np.ascontiguousarray(rates),
        state.slopes,
    )
    force, moment = coarse.ring.multipliers[:3], coarse.ring.multipliers[3:]
    state.loads[:3] = -moment
    state.loads[3:] = -force * (len(frames) - 1)
    return state


def _continuous(quaternions: Array) -> Array:
    """Signs chosen so that neighbours are near, and the first has a positive scalar part."""
    signs = np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0, -1.0, 1.0)
    first = -1.0 if quaternions[0, 3] < 0.0 else 1.0
    out = quaternions * (first * np.concatenate([[1.0], np.cumprod(signs)]))[:, None]
    return np.ascontiguousarray(out)
