"""Thermal ensembles of a bead chain: replicas, checkpoints, blow-ups."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dnacheck.md.bead_chain import (
    BeadChain,
    BeadEnergy,
    BeadOptions,
    Measure,
    available_platforms,
)
from dnacheck.md.checkpoints import Checkpoints, Samples, prepared_directory, saved_platform
from dnacheck.md.dynamics import BondLangevin, OpenMMLangevin, Walker
from dnacheck.md.geometry import elastic_energies_RT, frames_of_beads, step_angles
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import InputError, SolveError, Status

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EnsembleOptions:
    """How a thermal ensemble is sampled."""

    samples: int = 1500
    """Configurations kept per replica."""
    replicas: int = 2
    """Independent runs; threads run them side by side."""
    interval: int = 20
    """Time steps between configurations kept."""
    burn_in: int = 100
    """Configurations dropped at the start of each replica."""
    step_fraction: float = 0.45
    """Time step over its limit of stability; docs/md.md shows the error that this leaves."""
    friction_factor: float = 1.0
    """Friction over the frequency of the slowest bending mode."""
    measure: Measure = "angles"
    """Weight exp(-E/RT) in the angles, or in the rotations; see :class:`BeadChain`."""
    integrator: Literal["bond-langevin", "langevin-middle"] = "bond-langevin"
    """Masses on bonds and groove arms, or on beads with OpenMM's own integrator. The second
    needs an interval some twenty times longer."""
    platform: str = "fastest"
    """OpenMM platform, or "fastest"; see :func:`fastest_platform`."""
    bath_ratio: float = 1.0
    """Temperature of the bath over that of the energies; other than 1 for tests only."""
    seed: int = 0
    checkpoint_samples: int = 250
    """Configurations between checkpoints."""
    energy_limit: float = 20.0
    """Potential energy, over that of equipartition, beyond which a run has blown up."""

    def __post_init__(self) -> None:
        for name in ("samples", "replicas", "interval", "checkpoint_samples"):
            if not getattr(self, name) >= 1:
                raise InputError(f"ensemble option {name} must be 1 or more")
        if self.burn_in < 0 or self.seed < 0:
            raise InputError("ensemble options burn_in and seed must not be negative")
        for name in ("step_fraction", "friction_factor", "bath_ratio", "energy_limit"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"ensemble option {name} must be a positive number, not {value}")
        if self.integrator not in ("bond-langevin", "langevin-middle"):
            raise InputError(f"integrator '{self.integrator}' is not known")
        if self.measure not in ("angles", "frames"):
            raise InputError(f"measure '{self.measure}' is neither angles nor frames")


@dataclass(frozen=True)
class Ensemble:
    """A sampled ensemble.

    Attributes
    ----------
    chain, closed, options, beads
        What was sampled, and how.
    replicas : tuple of Samples
    time_step_ps, friction_per_ps, degrees_of_freedom
        Of the dynamics.
    platform : str
        OpenMM platform that computed the forces.
    seconds : float
        Wall-clock time of this run (a resumed run counts its own part only).
    status : Status
    """

    chain: Chain
    closed: bool
    options: EnsembleOptions
    beads: BeadOptions
    replicas: tuple[Samples, ...]
    time_step_ps: float
    friction_per_ps: float
    degrees_of_freedom: int
    platform: str
    seconds: float
    status: Status

    @property
    def positions(self) -> Array:
        """All configurations, replica after replica, (n_frames, n_beads, 3) in Å."""
        return np.concatenate([r.positions for r in self.replicas])

    @property
    def kinetic_temperature_K(self) -> float:
        """Mean temperature of the velocities."""
        kinetic = np.concatenate([r.kinetic_RT for r in self.replicas])
        return float(2.0 * kinetic.mean() / self.degrees_of_freedom * self.beads.temperature_K)

    def angles(self) -> tuple[Array, ...]:
        """Step angles (F, N, 3) of each replica."""
        return tuple(
            step_angles(frames_of_beads(r.positions, self.closed)[1], self.chain.step_form)
            for r in self.replicas
        )

    def elastic_RT(self) -> tuple[Array, ...]:
        """Elastic energies (F,) of each replica."""
        return tuple(elastic_energies_RT(self.chain, angles) for angles in self.angles())


@dataclass(frozen=True)
class _Run:
    """What all replicas of a run share."""

    beads: BeadChain
    start: Array
    options: EnsembleOptions
    platform: str
    checkpoints: Checkpoints | None
    advance: Callable[[int], None]


def fastest_platform(
    beads: BeadChain, positions: Array, integrator: str = "bond-langevin", trials: int = 20
) -> str:
    """Name of the installed platform that evaluates forces soonest.

    OpenMM's CPU platform evaluates these forces with the code of Reference, so the two are not
    tried against each other: Reference, double precision throughout, does for bond-langevin, and
    CPU for OpenMM's integrator, because its random numbers belong to the context and replicas can
    run side by side. Any other platform is timed against that one.
    """
    names = available_platforms()
    best = "CPU" if integrator == "langevin-middle" and "CPU" in names else "Reference"
    others = [name for name in names if name not in ("CPU", "Reference")]
    best_time = _force_seconds(beads, positions, best, trials) if others else 0.0
    for name in others:
        try:
            seconds = _force_seconds(beads, positions, name, trials)
        except SolveError:
            continue
        if seconds < best_time:
            best, best_time = name, seconds
    return best


def _force_seconds(beads: BeadChain, positions: Array, platform: str, trials: int) -> float:
    energy = BeadEnergy(beads, platform)
    energy.forces(positions)
    times = []
    for _ in range(trials):
        begin = time.perf_counter()
        energy.forces(positions)
        times.append(time.perf_counter() - begin)
    return min(times)


def sample_ensemble(
    chain: Chain,
    start: Array,
    closed: bool = True,
    options: EnsembleOptions | None = None,
    beads: BeadOptions | None = None,
    threads: int = 1,
    directory: Path | str | None = None,
    resume: bool = False,
    progress: Callable[[int], None] | None = None,
) -> Ensemble:
    """Sample the thermal ensemble of a chain at the temperature of ``beads``.

    Parameters
    ----------
    chain : Chain
    start : ndarray, shape (n_beads, 3)
        First positions of every replica, in Å, such as a minimum's.
    closed : bool
    options, beads : EnsembleOptions, BeadOptions
    threads : int
        Replicas run side by side. No result depends on it.
    directory : path, optional
        Where checkpoints go; made if it is not there.
    resume : bool
        Go on from the checkpoints in ``directory``. The same configurations come out as from a
        run that was never stopped, on one machine and platform.
    progress : callable, optional
        Called with the number of configurations that are new.

    Raises
    ------
    InputError
        Wrong number of beads; checkpoints of another run, or none to resume from.
    SolveError
        A replica blew up: names the replica and the configuration; ``partial`` is an
        :class:`Ensemble` of what had been kept.
    """
    options = options or EnsembleOptions()
    bead_chain = BeadChain(chain, closed, beads, options.measure)
    start = np.array(start, dtype=float)
    if start.shape != (bead_chain.n_beads, 3):
        raise InputError(f"{len(start)} beads were given for a chain of {bead_chain.n_beads}")
    if not np.all(np.isfinite(start)):
        raise InputError("a bead's position is not a finite number")
    begin = time.perf_counter()
    place = prepared_directory(directory, resume)
    platform = options.platform
    if platform == "fastest":
        if place is not None and resume:
            platform = saved_platform(place)
        else:
            platform = fastest_platform(bead_chain, start, options.integrator)
    checkpoints = None
    if place is not None:
        fingerprint = _fingerprint(bead_chain, start, options, platform)
        checkpoints = Checkpoints(place, platform, fingerprint)
        for replica in range(options.replicas):
            checkpoints.load(replica, options.samples)
    run = _Run(
        beads=bead_chain,
        start=start,
        options=options,
        platform=platform,
        checkpoints=checkpoints,
        advance=progress or (lambda count: None),
    )
    # OpenMM's Reference platform has one random stream for the whole process.
    if options.integrator == "langevin-middle" and platform == "Reference":
        threads = 1
    seeds = np.random.SeedSequence(options.seed).spawn(options.replicas)
    with ThreadPoolExecutor(max(1, min(threads, options.replicas))) as pool:
        results = list(pool.map(lambda item: _replica(run, *item), enumerate(seeds)))
    facts = results[0][1]
    ensemble = Ensemble(
        chain=chain,
        closed=closed,
        options=options,
        beads=bead_chain.options,
        replicas=tuple(samples for samples, _, _ in results),
        time_step_ps=facts.time_step_ps,
        friction_per_ps=facts.friction_per_ps,
        degrees_of_freedom=facts.degrees_of_freedom,
        platform=facts.platform,
        seconds=time.perf_counter() - begin,
        status=Status.CONVERGED,
    )
    failures = [text for _, _, text in results if text]
    if failures:
        raise SolveError(
            f"{failures[0]}; use a smaller step_fraction",
            replace(ensemble, status=Status.NOT_FINITE),
        )
    return ensemble


def _walker(run: _Run, seed: np.random.SeedSequence) -> Walker:
    options = run.options
    if options.integrator == "bond-langevin":
        return BondLangevin(
            BeadEnergy(run.beads, run.platform),
            run.start,
            options.step_fraction,
            options.friction_factor,
            options.bath_ratio,
            np.random.default_rng(seed),
        )
    return OpenMMLangevin(
        run.beads,
        run.platform,
        run.start,
        options.step_fraction,
        options.friction_factor,
        options.bath_ratio,
        int(seed.generate_state(1)[0]) % (2**31 - 1) + 1,
    )


def _replica(run: _Run, number: int, seed: np.random.SeedSequence) -> tuple[Samples, Walker, str]:
    """One replica to its end, or to where it blew up, which the text then says."""
    options = run.options
    walker = _walker(run, seed)
    blocks = [] if run.checkpoints is None else run.checkpoints.load(number, options.samples)
    done = sum(len(samples) for samples, _ in blocks)
    kept = [samples for samples, _ in blocks]
    if blocks:
        walker.restore(blocks[-1][1])
        run.advance(done)
    else:
        trouble = _advance(run, walker, options.burn_in * options.interval)
        if trouble:
            return _joined(kept, run), walker, f"replica {number}, before frame 0: {trouble}"
    while done < options.samples:
        count = min(options.checkpoint_samples, options.samples - done)
        samples, trouble = _block(run, walker, count)
        kept.append(samples)
        if trouble:
            frame = done + len(samples)
            return _joined(kept, run), walker, f"replica {number}, frame {frame}: {trouble}"
        done += count
        if run.checkpoints is not None:
            run.checkpoints.save(number, len(kept) - 1, samples, walker.state())
    return _joined(kept, run), walker, ""


def _block(run: _Run, walker: Walker, count: int) -> tuple[Samples, str]:
    positions, potential, kinetic = [], [], []
    trouble = ""
    for _ in range(count):
        trouble = _advance(run, walker, run.options.interval)
        if trouble:
            break
        x, u, k = walker.observe()
        positions.append(x)
        potential.append(u)
        kinetic.append(k)
        run.advance(1)
    shape = (len(positions), run.beads.n_beads, 3)
    return (
        Samples(np.array(positions).reshape(shape), np.array(potential), np.array(kinetic)),
        trouble,
    )


def _advance(run: _Run, walker: Walker, steps: int) -> str:
    """Go on, and say what went wrong, if anything."""
    import openmm as mm

    try:
        walker.advance(steps)
        positions, potential, _ = walker.observe()
    except mm.OpenMMException as error:
        return f"the dynamics blew up ({error})"
    if not (np.isfinite(potential) and np.all(np.isfinite(positions))):
        return "the dynamics blew up (a position is not a number)"
    equipartition = 3.0 * run.beads.n_beads / 2.0
    if potential > run.options.energy_limit * equipartition:
        return f"the dynamics blew up (potential energy {potential:.3g} RT)"
    return ""


def _joined(parts: list[Samples], run: _Run) -> Samples:
    if not parts:
        return Samples(np.empty((0, run.beads.n_beads, 3)), np.empty(0), np.empty(0))
    return Samples(
        np.concatenate([p.positions for p in parts]),
        np.concatenate([p.potential_RT for p in parts]),
        np.concatenate([p.kinetic_RT for p in parts]),
    )


def _fingerprint(beads: BeadChain, start: Array, options: EnsembleOptions, platform: str) -> str:
    """Hash of everything that decides the configurations; more samples may be asked for later."""
    settings = asdict(options) | asdict(beads.options) | {"platform": platform}
    for name in ("samples", "replicas", "checkpoint_samples", "energy_limit"):
        del settings[name]
    chain = beads.chain
    digest = hashlib.sha256(repr(sorted(settings.items())).encode())
    digest.update(
        f"{beads.closed} {chain.step_form} {chain.energy_scale_RT} {chain.rise_A}".encode()
    )
    for array in (chain.ground, chain.stiffness, start):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
