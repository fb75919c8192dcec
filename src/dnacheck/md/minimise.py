"""Minima of the closed bead chain, from OpenMM's forces alone.

A Newton method: the Hessian comes from differences of forces, in which base pairs five or more
apart do not meet, so six groups of base pairs give the whole of it; ordered around the ring from
one point both ways it is a band, and a Cholesky factorisation of the band tells whether a step
leads downhill. Bonds become exactly as long as the rise, at any spring constant, because each
spring's rest length is moved by what the spring is still stretched (the method of multipliers).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dnacheck.md.bead_chain import BeadEnergy
from dnacheck.md.geometry import (
    frames_of_beads,
    planar_ring,
    step_angles,
    twist_turns,
)
from dnacheck.md.writhe_kernels import fill_writhe
from dnacheck.numerics.outcome import InputError, SolveError, Status
from dnacheck.numerics.superpose import superpose

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

# Beads of one base pair feel those of base pairs up to two away, so the force columns of base
# pairs five apart do not overlap.
_REACH = 2
_BAND = 6 * (2 * _REACH + 2)
# The smallest shift, relative to the largest diagonal element, keeps the six rigid motions, which
# no force drives, from dividing zero by zero.
_SMALLEST_SHIFT = 1e-11
_MAX_SHIFTS = 60


@dataclass(frozen=True)
class MinimiseOptions:
    """Tolerances and bounds of :func:`minimise` and :func:`find_minima`."""

    max_iterations: int = 200
    force_tolerance: float = 1e-8
    """Largest force component at the end, in RT/Å."""
    bond_tolerance: float = 1e-9
    """Largest relative error of a bond length at the end."""
    first_step_A: float = 3.0
    """Largest displacement of a bead in the first iteration; adapted afterwards."""
    max_step_A: float = 30.0
    """Largest displacement of a bead in any iteration."""
    difference_A: float = 1e-4
    """Displacement for the differences of forces."""
    links: tuple[int, ...] | None = None
    """Links to start from; by default the two nearest to the relaxed twist."""
    registers: int = 2
    """Starts per link: planar circles rolled about their axis, the first to the roll of least
    energy among :attr:`scanned_registers`, the others by equal angles from there."""
    scanned_registers: int = 24
    start_noise_A: float = 0.1
    """Random displacement of the circle's beads, so that no symmetry holds it at a saddle."""
    same_rms_A: float = 0.05
    """Minima closer than this are one minimum."""
    same_energy_RT: float = 1e-4
    """And whose energies differ by less than this."""

    def __post_init__(self) -> None:
        for name in (
            "force_tolerance",
            "bond_tolerance",
            "first_step_A",
            "max_step_A",
            "difference_A",
            "same_rms_A",
            "same_energy_RT",
        ):
            if not getattr(self, name) > 0.0:
                raise InputError(f"minimise option {name} must be positive")
        for name in ("max_iterations", "registers", "scanned_registers"):
            if getattr(self, name) < 1:
                raise InputError(f"minimise option {name} must be 1 or more")
        if not self.start_noise_A >= 0.0:
            raise InputError("minimise option start_noise_A must not be negative")


@dataclass(frozen=True)
class BeadMinimum:
    """A minimum of the closed bead chain.

    Attributes
    ----------
    energy_RT : float
        Of the steps, evaluated by OpenMM.
    positions : ndarray, shape (2N, 3)
        Beads, in Å.
    angles : ndarray, shape (N, 3)
        Step angles measured on the beads, in radians.
    link, writhe : int, float
    max_force : float
        Largest force component left, RT/Å.
    bond_error : float
        Largest relative deviation of a bond from the rise.
    iterations, starts : int
        Newton iterations, and how many starts ended here.
    bond_rest_A : ndarray, shape (N,)
        Rest lengths of the springs that hold the bonds at the rise.
    status : Status
    """

    energy_RT: float
    positions: Array
    angles: Array
    link: int
    writhe: float
    max_force: float
    bond_error: float
    iterations: int
    starts: int
    bond_rest_A: Array
    status: Status

    @property
    def centres_A(self) -> Array:
        """Base-pair centres (N, 3), in Å."""
        return self.positions[0::2]


def hessian_band(
    energy: BeadEnergy, positions: Array, difference_A: float, folded: Indices
) -> Array:
    """Second derivatives of the energy, RT/Å², in the lower band form of LAPACK.

    Parameters
    ----------
    positions : ndarray, shape (2N, 3)
    folded : ndarray, shape (N,)
        Place of each base pair in the folded order (:func:`folded_order`).

    Returns
    -------
    ndarray, shape (band + 1, 6N)
        Element (d, c) is the derivative in row c + d and column c of the folded coordinates.
    """
    n = len(folded)
    colour = _colours(n)
    base = energy.forces(positions).reshape(n, 6)
    band = np.zeros((_BAND + 1, 6 * n))
    pairs = np.arange(n)
    shifts = np.arange(-_REACH, _REACH + 1)
    for group in range(int(colour.max()) + 1):
        members = pairs[colour == group]
        rows = (members[:, None] + shifts) % n
        for k in range(6):
            moved = positions.reshape(n, 6).copy()
            moved[members, k] += difference_A
            change = energy.forces(moved.reshape(-1, 3)).reshape(n, 6) - base
            columns = -change[rows] / difference_A
            _add_columns(band, columns, 6 * folded[members] + k, 6 * folded[rows])
    return band


def _add_columns(band: Array, values: Array, columns: Indices, rows: Indices) -> None:
    """Put half of each second derivative on the lower band: (i, j) and (j, i) average."""
    column = np.broadcast_to(columns[:, None, None], values.shape)
    row = rows[:, :, None] + np.arange(6)
    low, high = np.minimum(row, column), np.maximum(row, column)
    weight = np.where(low == high, 1.0, 0.5)
    np.add.at(band, (high - low, low), weight * values)


def folded_order(n_pairs: int) -> Indices:
    """Place of each base pair in the order 0, N-1, 1, N-2, ..., where neighbours stay near."""
    order = np.empty(n_pairs, dtype=np.intp)
    half = (n_pairs + 1) // 2
    order[:half] = 2 * np.arange(half)
    order[half:] = 2 * (n_pairs - np.arange(half, n_pairs)) - 1
    return order


def _colours(n_pairs: int) -> Indices:
    """Groups of base pairs, those of one group at least five apart around the ring."""
    spacing = 2 * _REACH + 1
    blocks, extra = divmod(n_pairs, spacing)
    if blocks == 0:
        return np.arange(n_pairs)
    lengths = np.full(blocks, spacing) + extra // blocks
    lengths[: extra % blocks] += 1
    return np.concatenate([np.arange(length) for length in lengths])


def minimise(
    energy: BeadEnergy, positions: Array, options: MinimiseOptions | None = None
) -> BeadMinimum:
    """Nearest minimum of a closed bead chain with bonds of exactly the rise.

    Parameters
    ----------
    energy : BeadEnergy
        Of a closed chain without ensemble terms.
    positions : ndarray, shape (2N, 3)
        Start, in Å.

    Returns
    -------
    BeadMinimum
        Its status says whether the tolerances were met.

    Raises
    ------
    InputError
        The beads are not those of this chain, or are not finite, or the chain is open.
    """
    options = options or MinimiseOptions()
    beads = energy.beads
    if not beads.closed or beads.measure is not None:
        raise InputError("only a closed bead chain without ensemble terms can be minimised")
    x = np.array(positions, dtype=float)
    if x.shape != (beads.n_beads, 3):
        raise InputError(f"{len(x)} beads were given for a chain of {beads.n_beads}")
    if not np.all(np.isfinite(x)):
        raise InputError("a bead's position is not a finite number")
    rest = np.full(beads.chain.n_steps, beads.chain.rise_A)
    beads.set_bond_rest(energy.context, rest)
    value, forces = energy.energy_and_forces(x)
    radius, status, iteration = options.first_step_A, Status.ITERATION_LIMIT, 0
    folded = folded_order(beads.chain.n_steps)
    band = hessian_band(energy, x, options.difference_A, folded)
    for iteration in range(1, options.max_iterations + 1):  # noqa: B007 (reported below)
        step, expected = _trust_step(band, x, forces, folded, radius)
        if step is None or not np.isfinite(value):
            status = Status.NOT_FINITE
            break
        longest = float(np.max(np.linalg.norm(step, axis=1)))
        trial, trial_forces = energy.energy_and_forces(x + step)
        noise = 1e-12 * max(1.0, abs(value))
        if not trial <= value + noise:
            if longest < 1e-9:
                status = Status.STEP_LIMIT
                break
            radius = 0.25 * longest
            continue
        ratio = (value - trial) / max(expected, noise)
        if ratio < 0.25:
            radius = 0.5 * longest
        elif ratio > 0.75 and longest > 0.2 * radius:
            radius = min(2.0 * radius, options.max_step_A)
        x, value, forces = x + step, trial, trial_forces
        if longest > 1e-3:
            band = hessian_band(energy, x, options.difference_A, folded)
            continue
        excess = _bond_lengths(x) - beads.chain.rise_A
        bonded = np.max(np.abs(excess)) < options.bond_tolerance * beads.chain.rise_A
        if bonded and np.max(np.abs(forces)) < options.force_tolerance:
            status = Status.CONVERGED
            break
        rest = rest - excess
        beads.set_bond_rest(energy.context, rest)
        value, forces = energy.energy_and_forces(x)
        radius = max(radius, 0.1)
    return _minimum(energy, x, forces, rest, iteration, status)


def find_minima(
    energy: BeadEnergy,
    rng: np.random.Generator,
    options: MinimiseOptions | None = None,
) -> tuple[BeadMinimum, ...]:
    """Minima reached from planar circles of several links and rolls, lowest first.

    Nothing but the chain enters: no ring, guess or link of a solver.

    Parameters
    ----------
    energy : BeadEnergy
        Of a closed chain without ensemble terms.
    rng : numpy.random.Generator
        Of the starts' noise.

    Returns
    -------
    tuple of BeadMinimum
        Distinct ones; starts that did not converge are left out.

    Raises
    ------
    SolveError
        No start converged; ``partial`` is the tuple of all that did not.
    """
    options = options or MinimiseOptions()
    chain, arm = energy.beads.chain, energy.beads.options.groove_distance_A
    turns = chain.relaxed_turns
    links = options.links or tuple(sorted((int(np.floor(turns)), int(np.floor(turns)) + 1)))
    found: list[BeadMinimum] = []
    failed: list[BeadMinimum] = []
    for link in links:
        scan = 2.0 * np.pi * np.arange(options.scanned_registers) / options.scanned_registers
        values = [energy.elastic_energy_RT(planar_ring(chain, link, roll, arm)) for roll in scan]
        best = scan[int(np.argmin(values))]
        for k in range(options.registers):
            start = planar_ring(chain, link, best + 2.0 * np.pi * k / options.registers, arm)
            start += options.start_noise_A * rng.standard_normal(start.shape)
            minimum = minimise(energy, start, options)
            if minimum.status is Status.CONVERGED:
                _add_distinct(found, minimum, options)
            else:
                failed.append(minimum)
    if not found:
        raise SolveError(
            f"none of {len(failed)} planar circles of {chain.n_steps} bp relaxed to a ring in "
            f"{options.max_iterations} iterations (largest force left "
            f"{min(minimum.max_force for minimum in failed):.1e} RT/Å); allow more iterations, "
            "which long chains need (dnacheck md --iterations)",
            tuple(failed),
        )
    return tuple(sorted(found, key=lambda m: m.energy_RT))


def _add_distinct(found: list[BeadMinimum], minimum: BeadMinimum, options: MinimiseOptions) -> None:
    for i, other in enumerate(found):
        close = abs(minimum.energy_RT - other.energy_RT) < options.same_energy_RT
        if close and superpose(minimum.positions, other.positions)[1] < options.same_rms_A:
            found[i] = replace(other, starts=other.starts + 1)
            return
    found.append(minimum)


def _trust_step(
    band: Array, x: Array, forces: Array, folded: Indices, radius: float
) -> tuple[Array | None, float]:
    """Step no longer than ``radius`` at any bead, and the decrease of energy it promises.

    The Hessian is shifted until it is positive definite and the step short enough; rigid motions
    are taken out of the step, as they change nothing.
    """
    from scipy.linalg import cho_solve_banded, cholesky_banded

    order = (6 * folded[:, None] + np.arange(6)).ravel()
    right = np.empty(forces.size)
    right[order] = forces.ravel()
    scale = float(np.max(band[0]))
    shift = _SMALLEST_SHIFT
    for _ in range(_MAX_SHIFTS):
        shifted = band.copy()
        shifted[0] += shift * scale
        try:
            factor = cholesky_banded(shifted, lower=True)
        except np.linalg.LinAlgError:
            shift *= 8.0
            continue
        except ValueError:
            return None, 0.0
        solution = cho_solve_banded((factor, True), right)
        step = _without_rigid_motion(solution[order].reshape(forces.shape), x)
        if np.max(np.linalg.norm(step, axis=1)) <= radius:
            decrease = 0.5 * float(np.sum(step * forces)) + 0.5 * shift * scale * float(
                np.sum(step**2)
            )
            return step, decrease
        shift *= 2.5
    return None, 0.0


def _without_rigid_motion(step: Array, x: Array) -> Array:
    """The displacement less its best fit by a translation and a small rotation."""
    arm = x - x.mean(axis=0)
    step = step - step.mean(axis=0)
    inertia = np.sum(arm**2) * np.eye(3) - arm.T @ arm
    spin = np.linalg.solve(inertia, np.sum(np.cross(arm, step), axis=0))
    return np.asarray(step - np.cross(spin, arm))


def _bond_lengths(positions: Array) -> Array:
    centres = positions[0::2]
    return np.asarray(np.linalg.norm(np.roll(centres, -1, axis=0) - centres, axis=1))


def _minimum(
    energy: BeadEnergy, x: Array, forces: Array, rest: Array, iterations: int, status: Status
) -> BeadMinimum:
    chain = energy.beads.chain
    _, frames = frames_of_beads(x, closed=True)
    writhe = np.full(1, np.nan)
    if np.all(np.isfinite(x)):
        fill_writhe(x[None, 0::2], writhe)
    turns = twist_turns(frames) + writhe[0]
    angles = step_angles(frames, chain.step_form)
    for array in (x, angles, rest):
        array.setflags(write=False)
    return BeadMinimum(
        energy_RT=energy.elastic_energy_RT(x),
        positions=x,
        angles=angles,
        link=round(float(turns)) if np.isfinite(turns) else 0,
        writhe=float(writhe[0]),
        max_force=float(np.max(np.abs(forces))),
        bond_error=float(np.max(np.abs(_bond_lengths(x) / chain.rise_A - 1.0))),
        iterations=iterations,
        starts=1,
        bond_rest_A=rest,
        status=status,
    )
