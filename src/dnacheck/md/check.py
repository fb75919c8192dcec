"""The check of a molecule's ring by its bead chain, in one call and one result."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.md.bead_chain import BeadChain, BeadEnergy, BeadOptions
from dnacheck.md.ensemble import Ensemble, EnsembleOptions, sample_ensemble
from dnacheck.md.ensemble_statistics import EnsembleStatistics, analyse_ensemble
from dnacheck.md.findings import Finding, RingMatch
from dnacheck.md.geometry import elastic_energies_RT, frames_of_beads
from dnacheck.md.harmonic import LARGEST_DENSE, harmonic_fluctuation
from dnacheck.md.minimise import BeadMinimum, MinimiseOptions, find_minima, minimise
from dnacheck.model.chain import Chain, angles_of_frames, elastic_energy
from dnacheck.numerics.outcome import InputError, SolveError, Status
from dnacheck.numerics.superpose import superpose

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MdOptions:
    """What :func:`run_md_check` does, and what it tolerates."""

    beads: BeadOptions = field(default_factory=BeadOptions)
    minimise: MinimiseOptions | None = field(default_factory=MinimiseOptions)
    """None leaves out the minima."""
    ensemble: EnsembleOptions | None = field(default_factory=EnsembleOptions)
    """None leaves out the dynamics."""
    noise_A: float = 0.1
    """Random displacement, per coordinate, of the perturbed ring."""
    noisy_rings: int = 3
    """Perturbed rings at which OpenMM's energy is compared with the chain's."""
    energy_tolerance: float = 1e-10
    """Relative difference of energies at given positions."""
    minimum_tolerance: float = 1e-5
    """Relative difference of minimised energies."""
    rms_tolerance_A: float = 0.02
    """Rms distance of minimised centres."""
    equipartition_tolerance: float = 0.01
    """Relative difference of the mean elastic energy from E_min + (3N - 6)/2 RT."""
    temperature_tolerance: float = 0.01
    """Relative difference of the velocities' temperature from the bath's."""
    platform: str = "Reference"
    """OpenMM platform of energies and minima; the ensemble has its own."""
    seed: int = 0
    threads: int = 1

    def __post_init__(self) -> None:
        for name in (
            "noise_A",
            "energy_tolerance",
            "minimum_tolerance",
            "rms_tolerance_A",
            "equipartition_tolerance",
            "temperature_tolerance",
        ):
            if not getattr(self, name) > 0.0:
                raise InputError(f"MD option {name} must be positive")
        if self.noisy_rings < 1 or self.threads < 1 or self.seed < 0:
            raise InputError("noisy_rings and threads must be 1 or more, the seed 0 or more")


@dataclass(frozen=True)
class MdCheck:
    """Result of :func:`run_md_check`.

    Attributes
    ----------
    chain : Chain
    rings : tuple of RingMatch
        One for each ring given.
    minima : tuple of BeadMinimum
        From planar circles, lowest first; empty if left out.
    energy_RT : float
        Of the lowest minimum; without minima, OpenMM's energy of the first ring given.
    harmonic_fluctuation_A : ndarray, shape (N,), or None
        Laplace fluctuation of each base pair about the lowest minimum.
    statistics : EnsembleStatistics or None
    ensemble : Ensemble or None
        The configurations themselves.
    findings : tuple of Finding
        Every comparison, with its verdict.
    platform : str
        Of energies and minima; the ensemble names its own.
    energy_seconds, minimise_seconds, ensemble_seconds : float
    status : Status
        CONVERGED, or what stopped the check early.
    trouble : str
        Why it stopped, if it did.
    """

    chain: Chain
    rings: tuple[RingMatch, ...]
    minima: tuple[BeadMinimum, ...]
    energy_RT: float
    harmonic_fluctuation_A: Array | None
    statistics: EnsembleStatistics | None
    ensemble: Ensemble | None
    findings: tuple[Finding, ...]
    platform: str
    energy_seconds: float
    minimise_seconds: float
    ensemble_seconds: float
    status: Status
    trouble: str

    @property
    def undecided(self) -> int:
        """How many findings are neither passed nor failed."""
        return sum(finding.verdict == "inconclusive" for finding in self.findings)

    @property
    def passed(self) -> bool:
        """Whether nothing failed and nothing stopped early."""
        failed = any(finding.verdict == "fail" for finding in self.findings)
        return self.status is Status.CONVERGED and not failed


def run_md_check(
    chain: Chain,
    ring_angles: ArrayLike | None = None,
    options: MdOptions | None = None,
    built_from: Chain | None = None,
    directory: Path | str | None = None,
    resume: bool = False,
    progress: Callable[[int], None] | None = None,
) -> MdCheck:
    """Build the bead chain of a molecule, relax it, shake it, and compare.

    Parameters
    ----------
    chain : Chain
    ring_angles : array_like, shape (N, 3) or (M, N, 3), optional
        Closed rings found by other means, for comparison; the first is the lowest.
    options : MdOptions
    built_from : Chain, optional
        Chain to build the beads from. A negative control passes a faulty one here, and must see
        the check fail.
    directory, resume, progress
        Of the dynamics; see :func:`~dnacheck.md.ensemble.sample_ensemble`.

    Returns
    -------
    MdCheck
        Also where minimisation or dynamics failed: its status and trouble say so, and it holds
        what had been computed.

    Raises
    ------
    InputError
        Angles of another number of steps, or a ring that does not close.
    """
    options = options or MdOptions()
    rings = _checked_rings(chain, ring_angles)
    begin = time.perf_counter()
    rng = np.random.default_rng(options.seed)
    beads = BeadChain(built_from or chain, True, options.beads)
    energy = BeadEnergy(beads, options.platform)
    findings: list[Finding] = []
    ring_energies = [chain.energy_scale_RT * elastic_energy(chain, ring) for ring in rings]
    differences = []
    for ring, expected in zip(rings, ring_energies, strict=True):
        got = energy.elastic_energy_RT(beads.positions(ring))
        differences.append(_relative(got, expected))
        findings.append(Finding("energy of the ring", differences[-1], options.energy_tolerance))
    energy_seconds = time.perf_counter() - begin

    begin = time.perf_counter()
    minima: tuple[BeadMinimum, ...] = ()
    status, trouble = Status.CONVERGED, ""
    perturbed: list[BeadMinimum | None] = [None] * len(rings)
    if options.minimise is not None:
        try:
            minima = find_minima(energy, rng, options.minimise)
        except SolveError as error:
            status, trouble = Status.NOT_FOUND, str(error)
        for i, ring in enumerate(rings):
            start = beads.positions(ring)
            start += options.noise_A * rng.standard_normal(start.shape)
            perturbed[i] = minimise(energy, start, options.minimise)
    base = [beads.positions(ring) for ring in rings] or [m.positions for m in minima]
    findings += _noisy_findings(chain, energy, base[:1], rng, options)
    matches = tuple(
        _match(chain, ring, expected, difference, relaxed, minima)
        for ring, expected, difference, relaxed in zip(
            rings, ring_energies, differences, perturbed, strict=True
        )
    )
    if options.minimise is not None:
        for match in matches:
            findings += _minimum_findings(match, options)
    harmonic = None
    if minima and chain.n_steps <= LARGEST_DENSE:
        harmonic = harmonic_fluctuation(energy, minima[0])
    minimise_seconds = time.perf_counter() - begin

    ensemble = statistics = None
    if options.ensemble is not None and base and status is Status.CONVERGED:
        lowest = minima[0].positions if minima else base[0]
        lowest_RT = energy.elastic_energy_RT(lowest)
        try:
            ensemble = sample_ensemble(
                built_from or chain,
                lowest,
                True,
                options.ensemble,
                options.beads,
                options.threads,
                directory,
                resume,
                progress,
            )
            statistics = analyse_ensemble(ensemble, lowest_RT, lowest[0::2])
            findings += _ensemble_findings(statistics, ensemble, options)
        except SolveError as error:
            status, trouble = Status.NOT_FINITE, str(error)
            ensemble = error.partial
    if not base:
        energy_RT = float("nan")
    else:
        energy_RT = minima[0].energy_RT if minima else energy.elastic_energy_RT(base[0])
    return MdCheck(
        chain=chain,
        rings=matches,
        minima=minima,
        energy_RT=energy_RT,
        harmonic_fluctuation_A=harmonic,
        statistics=statistics,
        ensemble=ensemble,
        findings=tuple(findings),
        platform=energy.platform,
        energy_seconds=energy_seconds,
        minimise_seconds=minimise_seconds,
        ensemble_seconds=0.0 if ensemble is None else ensemble.seconds,
        status=status,
        trouble=trouble,
    )


def _relative(got: float, expected: float) -> float:
    """Relative difference; absolute for energies far below RT, where relative means nothing."""
    return (got - expected) / max(abs(expected), 1e-3)


def _checked_rings(chain: Chain, ring_angles: ArrayLike | None) -> Array:
    if ring_angles is None:
        return np.empty((0, chain.n_steps, 3))
    rings = np.asarray(ring_angles, dtype=float)
    if rings.ndim == 2:
        rings = rings[None]
    if rings.ndim != 3 or rings.shape[1:] != (chain.n_steps, 3):
        raise InputError(
            f"ring angles have shape {np.shape(ring_angles)}; '{chain.name}' needs "
            f"({chain.n_steps}, 3)"
        )
    if not np.all(np.isfinite(rings)):
        raise InputError("a ring angle is not a number")
    from dnacheck.model.chain import chain_frames

    for ring in rings:
        centres, frames = chain_frames(ring, chain.step_form)
        gap = float(np.linalg.norm(centres[-1]) + np.linalg.norm(frames[-1] - np.eye(3)))
        if gap > 1e-6:
            raise InputError(f"the ring does not close: gap {gap:.2g} (steps and radians)")
    return rings


def _noisy_findings(
    chain: Chain,
    energy: BeadEnergy,
    base: list[Array],
    rng: np.random.Generator,
    options: MdOptions,
) -> list[Finding]:
    """OpenMM against the chain's own formula where every angle is off its ground value."""
    findings = []
    for positions in base * options.noisy_rings:
        noisy = positions + options.noise_A * rng.standard_normal(positions.shape)
        _, frames = frames_of_beads(noisy, closed=True)
        angles = angles_of_frames(frames, chain.step_form)
        expected = float(elastic_energies_RT(chain, angles))
        difference = _relative(energy.elastic_energy_RT(noisy), expected)
        findings.append(Finding("energy of a perturbed ring", difference, options.energy_tolerance))
    return findings


def _match(
    chain: Chain,
    ring: Array,
    expected: float,
    difference: float,
    perturbed: BeadMinimum | None,
    minima: tuple[BeadMinimum, ...],
) -> RingMatch:
    from dnacheck.model.chain import chain_frames

    centres = chain.rise_A * chain_frames(ring, chain.step_form)[0][:-1]
    nan = float("nan")
    close = (nan, nan)
    if perturbed is not None:
        rms = superpose(perturbed.centres_A, centres)[1]
        close = (_relative(perturbed.energy_RT, expected), rms)
    own = (nan, nan)
    if minima:
        distances = [superpose(m.centres_A, centres)[1] for m in minima]
        nearest = int(np.argmin(distances))
        own = (_relative(minima[nearest].energy_RT, expected), distances[nearest])
    return RingMatch(expected, difference, *close, *own)


def _minimum_findings(match: RingMatch, options: MdOptions) -> list[Finding]:
    energy, rms = options.minimum_tolerance, options.rms_tolerance_A
    return [
        Finding("minimum from the perturbed ring, energy", match.perturbed_difference, energy),
        Finding("minimum from the perturbed ring, rms (Å)", match.perturbed_rms_A, rms),
        Finding("minimum from planar circles, energy", match.own_difference, energy),
        Finding("minimum from planar circles, rms (Å)", match.own_rms_A, rms),
    ]


def _ensemble_findings(
    statistics: EnsembleStatistics, ensemble: Ensemble, options: MdOptions
) -> list[Finding]:
    energy, expected = statistics.elastic_RT, statistics.equipartition_RT
    bath = ensemble.beads.temperature_K * ensemble.options.bath_ratio
    temperature = statistics.temperature_K
    return [
        Finding(
            "mean elastic energy against equipartition",
            energy.mean / expected - 1.0,
            options.equipartition_tolerance,
            energy.stderr / expected,
        ),
        Finding(
            "temperature of the velocities",
            temperature.mean / bath - 1.0,
            options.temperature_tolerance,
            temperature.stderr / bath,
        ),
    ]
