"""Search for the equilibria of chains under any boundary: where each search starts.

A nicked ring starts from planar circles without excess twist, in the registers where the planar
ring is predicted to rest. A hinged ring starts from the nicked ones, released, and from the
circle rolled over. A loop starts from the unstressed shape, as it is and turned
evenly until its end faces as the target, and from the rings; the end is led to the target's pose in
as many steps as it needs. A pulled chain starts from its unstressed
shape.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dnacheck.equilibria.boundary import AnyBoundary, HingedRing, Loop, NickedRing, Pull
from dnacheck.equilibria.discrete.bound_search import hold_found, refuse_torn_guests
from dnacheck.equilibria.discrete.kernels.search import fill_start, predicted_registers
from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
from dnacheck.equilibria.discrete.solve import NewtonOptions, solve_ring
from dnacheck.equilibria.ring import RING, Equilibria, Equilibrium
from dnacheck.model.chain import Chain, angles_of_frames, chain_frames, rigid_coordinates
from dnacheck.numerics.outcome import InputError, Status

Array = NDArray[np.float64]

# Minima are one when their energies agree to this relative precision and their angles (rad) to the
# second; of a family of equal energy, whose register is free, one stands for all.
_SAME_ENERGY = 1e-7
_SAME_ANGLES = 1e-4
_ALL_REGISTERS = 8
# What the predicted energy of a planar ring may lack of a second minimum for one to be looked for,
# relative to a circle's; measured for rings in the compiled search.
_LACKING = 0.005
_MOST_PIECES = 64
"""Into how many the way to a target's pose is divided at most."""


def find_equilibria(
    chain: Chain, boundary: AnyBoundary = RING, options: SearchOptions | None = None
) -> Equilibria:
    """Minima of a chain held by a boundary, lowest energy (less the work of loads) first.

    Parameters
    ----------
    boundary : Ring, NickedRing, HingedRing, Loop or Pull
    options : SearchOptions, optional
        ``links`` is ``auto`` or, for more starts, ``all``; for a ring see :func:`find_rings`.

    Raises
    ------
    InputError
        A link is asked for, which ends that are free to turn do not have.
    """
    options = options or SearchOptions()
    if boundary == RING:
        return find_rings(chain, options)
    if not isinstance(options.links, str):
        raise InputError(
            f"link {options.links}: a {boundary.label} chain has no link; leave it out, or close "
            "the chain to a ring"
        )
    if chain.guests:
        refuse_torn_guests(chain, boundary)
        soft = find_equilibria(chain.elastic(), boundary, options)
        return hold_found(chain, boundary, options.newton, soft)
    began = time.perf_counter()
    newton = NewtonOptions(
        options.newton.tolerance, options.newton.max_iterations, options.newton.turn_cap
    )
    found: list[Equilibrium] = []
    starts, failed = 0, 0
    for ring in _solutions(chain, boundary, options.links == "all", newton):
        starts += 1
        if ring is None or not ring.status.ok or ring.stable is False:
            failed += 1
        elif not any(_same(ring, other) for other in found):
            found.append(ring)
    found.sort(key=_potential)
    return Equilibria(
        source=chain,
        equilibria=tuple(found),
        links_searched=(),
        starts=starts,
        failed_starts=failed,
        seconds=time.perf_counter() - began,
        status=Status.CONVERGED if found else Status.NOT_FOUND,
        boundary=boundary,
    )


def _potential(ring: Equilibrium) -> float:
    """Energy less the work of the loads; the same at all minima of one search but for turns."""
    if not isinstance(ring.boundary, Pull):
        return ring.energy
    loads = ring.boundary.for_chain(ring.chain).loads
    return ring.energy - float(loads[2] * ring.centres[-1, 2])


def _same(a: Equilibrium, b: Equilibrium) -> bool:
    if abs(a.energy - b.energy) > _SAME_ENERGY * abs(a.energy) + 1e-14:
        return False
    if a.stable is None and b.stable is None:
        return True
    return bool(np.abs(a.angles - b.angles).max() < _SAME_ANGLES)


def _solutions(
    chain: Chain, boundary: AnyBoundary, everything: bool, newton: NewtonOptions
) -> Iterator[Equilibrium | None]:
    """What every start leads to; None where the way to it ended."""
    if isinstance(boundary, Loop):
        yield from _loops(chain, boundary, everything, newton)
        return
    if isinstance(boundary, Pull):
        yield solve_ring(chain, chain.ground, newton, boundary=boundary, throw=False)
        return
    # The link only sets the excess twist: none, where the end is free to turn.
    registers = np.empty(2)
    turns = np.empty((2, chain.n_steps + 1, 3))
    count, lacking, _ = predicted_registers(chain.arrays, chain.relaxed_turns, registers, turns)
    chosen = [registers[0]]
    if count == 2:
        chosen.append(registers[1])
    elif lacking < _LACKING or chain.rigid or everything:
        chosen.append(registers[0] + math.pi)
    if isinstance(boundary, HingedRing):
        for ring in _solutions(chain, NickedRing(), everything, newton):
            if ring is not None and ring.status.ok and ring.stable is not False:
                yield solve_ring(chain, ring.angles, newton, boundary=boundary, throw=False)
        # The released ring may turn over: from half a turn away, and with all from quarters.
        turned = (0.0, 0.5, 1.0, 1.5) if everything else (1.0,)
        chosen = [registers[0] + math.pi * share for share in turned]
    if everything:
        chosen += [
            registers[0] + 2.0 * math.pi * (k + 0.5) / _ALL_REGISTERS for k in range(_ALL_REGISTERS)
        ]
    circle = np.empty(chain.ground.shape)
    for register in chosen:
        fill_start(chain.arrays, chain.relaxed_turns, register, circle)
        yield solve_ring(chain, circle, newton, boundary=boundary, throw=False)


def _loops(
    chain: Chain, boundary: Loop, everything: bool, newton: NewtonOptions
) -> Iterator[Equilibrium | None]:
    centres, frames = chain_frames(chain.ground, chain.step_form)
    yield _approach(chain, chain.ground, centres[-1], frames[-1], boundary, newton)
    for turned in _evenly_turned(chain, np.array(boundary.rotation)):
        there, facing = chain_frames(turned, chain.step_form)
        yield _approach(chain, turned, there[-1], facing[-1], boundary, newton)
    search = find_rings(chain, SearchOptions("all" if everything else "auto", newton))
    for ring in search.equilibria:
        yield _approach(chain, ring.angles, np.zeros(3), np.eye(3), boundary, newton)


def _evenly_turned(chain: Chain, target: Array) -> Iterator[Array]:
    """The unstressed shape bent and twisted evenly until its end faces as the target, both ways."""
    from scipy.spatial.transform import Rotation

    centres, frames = chain_frames(chain.ground, chain.step_form)
    turn = Rotation.from_matrix(target @ frames[-1].T).as_rotvec()
    angle = float(np.linalg.norm(turn))
    ways = [turn]
    if angle > 1e-6:
        ways.append(turn * (1.0 - 2.0 * math.pi / angle))
    along = np.arange(chain.n_steps + 1)[:, None] / chain.n_steps
    for way in ways:
        rotations = Rotation.from_rotvec(along * way).as_matrix()
        bent = np.ascontiguousarray(rotations @ frames)
        if chain.rigid:
            steps = np.einsum("sij,sj->si", rotations[:-1], np.diff(centres, axis=0))
            yield rigid_coordinates(np.concatenate([centres[:1], np.cumsum(steps, axis=0)]), bent)
        else:
            yield angles_of_frames(bent, chain.step_form)


def _approach(
    chain: Chain, angles: Array, centre: Array, frame: Array, target: Loop, newton: NewtonOptions
) -> Equilibrium | None:
    """The loop that is reached when the end of a chain is led from a pose to the target's.

    In one step if Newton's method manages it, else in ever more; the turn is the shortest.
    """
    # Loops alone need it, and loading it takes as long as a search.
    from scipy.spatial.transform import Rotation

    end = np.array(target.position_A) / chain.rise_A
    turn = Rotation.from_matrix(frame.T @ np.array(target.rotation)).as_rotvec()
    reached, pieces = 0.0, 1
    here = np.array(angles)
    while pieces <= _MOST_PIECES:
        ahead = min(1.0, reached + 1.0 / pieces)
        goal = target
        if ahead < 1.0:
            rotation = frame @ Rotation.from_rotvec(ahead * turn).as_matrix()
            position = chain.rise_A * ((1.0 - ahead) * centre + ahead * end)
            goal = Loop(tuple(position), tuple(map(tuple, rotation)))
        ring = solve_ring(chain, here, newton, boundary=goal, throw=False)
        if not ring.status.ok:
            pieces *= 2
        elif ahead >= 1.0:
            return ring
        else:
            here, reached = np.array(ring.angles), ahead
    return None
