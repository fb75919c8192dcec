"""Thermal motion of rings: the bead chain's dynamics, Monte Carlo and Laplace beside each other."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Findings, Level
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge, must_fail
from dnacheck.validation.report.record import Column, Figure, Table

if TYPE_CHECKING:
    from dnacheck.cyclization.ensembles.metropolis import ClosedRingEnsemble
    from dnacheck.equilibria.ring import Equilibrium
    from dnacheck.md.ensemble import EnsembleOptions
    from dnacheck.md.ensemble_statistics import EnsembleStatistics
    from dnacheck.md.fluctuation import FluctuationProfile
    from dnacheck.model.chain import Array, Chain

EQUIPARTITION_TOLERANCE = 0.01
LEAST_CORRELATION = 0.99
RATIO_TOLERANCE = 0.03
SOFT = 0.1
"""Stiffness of the first half of a molecule whose profile must be unmistakable."""
WARM_BATH = 1.1
LONGEST = 400
"""Base pairs of the longest molecule that is shaken."""

_INTERVAL = 40
_FEWEST, _MOST = 700, 4000
_PROFILE_FRAMES = 400


@dataclass(frozen=True)
class Motion:
    """A ring in thermal motion, by three methods."""

    chain: Chain
    ring: Equilibrium
    dynamics: EnsembleStatistics
    sampling: ClosedRingEnsemble
    ours: FluctuationProfile
    theirs: FluctuationProfile
    laplace: Array
    reference: Array
    time_step_ps: float
    platform: str
    seconds: tuple[float, float]
    """Processor time of dynamics and of sampling."""


def frames_needed(n_steps: int, accuracy: float) -> int:
    """Configurations per replica for a standard error of 0.4 of the accuracy in the mean energy.

    Its variance is about 3N/2 RT², its mean a little more than 3N/2 RT.
    """
    independent = 1.0 / ((0.4 * accuracy) ** 2 * 1.5 * n_steps)
    return max(_FEWEST, min(_MOST, math.ceil(0.6 * independent)))


def motion(chain: Chain, samples: int, seed: int) -> Motion:
    """Shake a ring by dynamics and by Metropolis moves, and take its Laplace fluctuation."""
    from dnacheck.cyclization.ensembles.metropolis import ClosedRingOptions, closed_ring_ensemble
    from dnacheck.md.bead_chain import BeadChain, BeadEnergy
    from dnacheck.md.ensemble import EnsembleOptions, sample_ensemble
    from dnacheck.md.ensemble_statistics import analyse_ensemble
    from dnacheck.md.fluctuation import fluctuation_profile
    from dnacheck.md.harmonic import harmonic_fluctuation
    from dnacheck.md.minimise import minimise
    from dnacheck.validation.engine.rings import lowest_ring

    ring, n = lowest_ring(chain), chain.n_steps
    began = time.process_time()
    energy = BeadEnergy(BeadChain(chain))
    minimum = minimise(energy, energy.beads.positions(ring.angles))
    laplace = harmonic_fluctuation(energy, minimum)
    options = EnsembleOptions(samples=samples, interval=_INTERVAL, burn_in=25, seed=seed)
    ensemble = sample_ensemble(chain, minimum.positions, True, options)
    dynamics = analyse_ensemble(ensemble, minimum.energy_RT, minimum.centres_A)
    shape = (options.replicas, samples, n, 3)
    ours = fluctuation_profile(ensemble.positions[:, 0::2].reshape(shape), minimum.centres_A)
    middle = time.process_time()
    moves = ClosedRingOptions(samples=3 * samples // 2, copies=4)
    sampling = closed_ring_ensemble(chain, ring, moves, seed + 1)
    centres = sampling.centres_A.astype(float).reshape(4, -1, n, 3)
    theirs = fluctuation_profile(centres, minimum.centres_A)
    return Motion(
        chain=chain,
        ring=ring,
        dynamics=dynamics,
        sampling=sampling,
        ours=ours,
        theirs=theirs,
        laplace=laplace,
        reference=minimum.positions,
        time_step_ps=ensemble.time_step_ps,
        platform=ensemble.platform,
        seconds=(middle - began, time.process_time() - middle),
    )


def half_soft(chain: Chain) -> Chain:
    """The molecule with the first half of its steps ten times softer."""
    stiffness = chain.stiffness.copy()
    stiffness[: chain.n_steps // 2] *= SOFT
    return replace(chain, name=f"{chain.name}, half of it soft", stiffness=stiffness)


def _chosen(context: Context) -> list[Chain]:
    """The shortest molecule; at the full level three, spread over the lengths."""
    from dnacheck.validation.engine.rings import scene_chain

    chains = [scene_chain(context.scene, molecule) for molecule in context.molecules]
    fit = sorted((c for c in chains if c.n_steps <= LONGEST), key=lambda c: (c.n_steps, c.name))
    if context.level is not Level.FULL:
        return fit[:1]
    return [fit[k] for k in sorted({0, len(fit) // 2, len(fit) - 1})]


def _judge_energy(
    item: str, mean: float, sigma: float, expected: float, theirs: float, tolerance: float
) -> CheckResult:
    return judge(
        f"bead_chain.ensemble[{item}, mean energy]",
        "mean elastic energy of the shaken ring",
        mean,
        expected,
        Rule.RELATIVE,
        "closed-ring Metropolis sampling over the step angles, which shares no code with it",
        "asked for by the scene; both means have standard errors of their own",
        tolerance,
        "RT",
        got_sigma=sigma,
        expected_sigma=theirs,
    )


def _judge_equipartition(item: str, found: Motion) -> CheckResult:
    s, other = found.dynamics, found.sampling.energy_RT
    harmonic = s.equipartition_RT
    correction = abs(other.mean - harmonic) + 2.0 * other.stderr
    return judge(
        f"bead_chain.ensemble[{item}, equipartition]",
        "distance of the mean elastic energy from E_min + (3N - 6)/2 RT",
        abs(s.elastic_RT.mean - harmonic),
        max(EQUIPARTITION_TOLERANCE * harmonic, correction),
        Rule.AT_MOST,
        "equipartition over the 3N angles less six closure conditions",
        "1 %, or the anharmonic correction that Monte Carlo shows with two standard errors",
        unit="RT",
        got_sigma=s.elastic_RT.stderr,
    )


def _judge_ratio(name: str, ours: FluctuationProfile, theirs: FluctuationProfile) -> CheckResult:
    from dnacheck.md.fluctuation import compare_profiles

    found = compare_profiles(ours, theirs)
    return judge(
        name,
        "mean fluctuation of a base pair, dynamics over Metropolis sampling",
        found.mean_ratio,
        1.0,
        Rule.RELATIVE,
        "closed-ring Metropolis sampling",
        "a hundred to a thousand independent shapes give the mean to 1 to 2 %",
        RATIO_TOLERANCE,
        got_sigma=found.mean_ratio_stderr,
    )


def ensemble(context: Context) -> Findings:
    """Mean energy, writhe, radius and fluctuation of molecules in thermal motion."""
    from dnacheck.md.ensemble import EnsembleOptions

    accuracy = context.scene.wanted.thermal_energy or EQUIPARTITION_TOLERANCE
    results, rows, figures = [], [], []
    for index, chain in enumerate(_chosen(context)):
        seed = (context.seed + index) % 2**31
        found = motion(chain, frames_needed(chain.n_steps, accuracy), seed)
        s, other = found.dynamics, found.sampling
        results += [
            _judge_energy(
                chain.name, s.elastic_RT.mean, s.elastic_RT.stderr, other.energy_RT.mean,
                other.energy_RT.stderr, accuracy,
            ),
            _judge_equipartition(chain.name, found),
            _judge_ratio(
                f"bead_chain.ensemble[{chain.name}, fluctuation]", found.ours, found.theirs
            ),
        ]  # fmt: skip
        rows += _rows(found)
        figures.append(_figure(found, f"fluctuation-{chain.name}", f"Thermal motion: {chain.name}"))
    short = EnsembleOptions(
        samples=60, replicas=1, interval=_INTERVAL, burn_in=20, seed=seed, bath_ratio=WARM_BATH
    )
    mean, sigma = _warm_energy(found, short)
    wrong = _judge_energy(
        "control: warm", mean, sigma, other.energy_RT.mean, other.energy_RT.stderr, accuracy
    )
    results.append(must_fail(wrong, "the bath is 10 % too warm"))
    columns = [
        Column("name", "Molecule"),
        Column("method", "Method"),
        Column("energy", "mean energy", "RT", ".2f"),
        Column("energy_error", "±", "RT", ".2f"),
        Column("harmonic", "E_min + (3N − 6)/2", "RT", ".2f"),
        Column("writhe", "writhe", "", "+.4f"),
        Column("writhe_error", "±", "", ".4f"),
        Column("radius", "radius of gyration", "Å", ".2f"),
        Column("radius_error", "±", "Å", ".2f"),
        Column("fluctuation", "rms of a base pair", "Å", ".2f"),
        Column("frames", "shapes", "", "d"),
        Column("seconds", "processor time", "s", ".0f"),
    ]
    caption = (
        f"Langevin dynamics on OpenMM's forces (300 K, platform {found.platform}, time step "
        f"{1e3 * found.time_step_ps:.0f} fs) beside Metropolis sampling of the same closed chain."
    )
    table = Table("bead-ensemble", "Rings in thermal motion", columns, rows, caption)
    return Findings(results, [table, *figures])


def _warm_energy(found: Motion, options: EnsembleOptions) -> tuple[float, float]:
    from dnacheck.md.ensemble import sample_ensemble
    from dnacheck.md.ensemble_statistics import estimate

    warm = sample_ensemble(found.chain, found.reference, True, options)
    value = estimate(np.stack(warm.elastic_RT()))
    return value.mean, value.stderr


def profile(context: Context) -> Findings:
    """A molecule with one soft half, whose profile no statistical error can hide."""
    from dnacheck.md.fluctuation import compare_profiles

    chain = _chosen(context)[0]
    found = motion(half_soft(chain), _PROFILE_FRAMES, context.seed % 2**31)
    match = compare_profiles(found.ours, found.theirs)
    results = [
        _judge_correlation(chain.name, match.correlation),
        _judge_ratio(f"bead_chain.profile[{chain.name}, ratio]", found.ours, found.theirs),
    ]
    backwards = float(np.corrcoef(found.ours.fluctuation_A[::-1], found.theirs.fluctuation_A)[0, 1])
    control = _judge_correlation("control: backwards", backwards)
    results.append(must_fail(control, "the other half is the soft one"))
    figure = _figure(found, "fluctuation-soft", f"Thermal motion: {found.chain.name}")
    words = (
        f" Correlation of dynamics and Monte Carlo along the sequence {match.correlation:.4f}, "
        f"expected of these statistical errors {match.expected_correlation:.4f}; "
        f"{sum(found.seconds):.0f} s of processor."
    )
    return Findings(results, [replace(figure, caption=figure.caption + words)])


def _judge_correlation(item: str, correlation: float) -> CheckResult:
    return judge(
        f"bead_chain.profile[{item}, correlation]",
        "correlation of dynamics and Metropolis sampling along the sequence",
        correlation,
        LEAST_CORRELATION,
        Rule.AT_LEAST,
        "closed-ring Metropolis sampling",
        "the profile varies by a fifth, its statistical errors by a hundredth",
    )


def _rows(found: Motion) -> list[dict[str, object]]:
    s, other = found.dynamics, found.sampling
    radius, theirs = s.radius_of_gyration_A, other.radius_of_gyration_A
    return [
        {
            "name": found.chain.name,
            "method": "dynamics",
            "energy": s.elastic_RT.mean,
            "energy_error": s.elastic_RT.stderr,
            "harmonic": s.equipartition_RT,
            "writhe": s.writhe.mean,
            "writhe_error": s.writhe.stderr,
            "radius": radius.mean,
            "radius_error": radius.stderr,
            "fluctuation": float(found.ours.fluctuation_A.mean()),
            "frames": s.frames,
            "seconds": found.seconds[0],
        },
        {
            "name": found.chain.name,
            "method": "Metropolis",
            "energy": other.energy_RT.mean,
            "energy_error": other.energy_RT.stderr,
            "harmonic": s.equipartition_RT,
            "writhe": other.writhe.mean,
            "writhe_error": other.writhe.stderr,
            "radius": theirs.mean,
            "radius_error": theirs.stderr,
            "fluctuation": float(found.theirs.fluctuation_A.mean()),
            "frames": other.samples,
            "seconds": found.seconds[1],
        },
    ]


def _figure(found: Motion, name: str, title: str) -> Figure:
    lines: list[dict[str, object]] = [
        {
            "label": label,
            "values": profile.fluctuation_A.tolist(),
            "errors": profile.stderr_A.tolist(),
        }
        for label, profile in (("dynamics", found.ours), ("Monte Carlo", found.theirs))
    ]
    if np.all(np.isfinite(found.laplace)):
        lines.append({"label": "Laplace", "values": found.laplace.tolist()})
    return Figure(
        name,
        title,
        "fluctuation",
        {"lines": lines},
        "Root mean square displacement of each base pair from its mean place, every shape "
        "superposed on the minimum. Bands: two standard errors either way.",
        width=7.2,
        height=3.0,
    )
