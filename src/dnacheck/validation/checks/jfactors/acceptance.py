"""Metropolis moves keep the distribution that they sample, and wrong acceptance rules do not."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Findings, Level
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge, must_fail
from dnacheck.validation.report.record import Column, Table

if TYPE_CHECKING:
    from dnacheck.model.chain import Chain

Array = NDArray[np.float64]

SIGMAS = 5.0
"""Chance of a false alarm over all results below is under 1e-5 for any seed."""
_STEPS = 4
_STIFFNESS_RT = 9.0
"""So soft that cos(theta), the measure of rotations over that of angles, varies by a tenth."""
_RING_STIFFNESS_RT = 60.0
_LARGEST_RING_ERROR_RT = 1.0
_ENERGY_SHARE = 0.9
"""Fraction of the energy that wrong acceptance rules use."""
_REACH = 0.8
_SWEEPS = 4
_QUICK_DRAWS = 12_000
"""Pivots without the measure are then some fifteen standard errors off."""


@dataclass(frozen=True)
class _Moves:
    label: str
    use: tuple[int, int, int]  # singles, pivots, crankshafts of a sweep


_MOVES = (
    _Moves("single angle", (1, 0, 0)),
    _Moves("pivot", (0, 1, 0)),
    _Moves("crankshaft", (0, 0, 6 * _STEPS)),
)


def _soft_chain() -> Chain:
    """A short chain with uneven rest angles and a full stiffness matrix on every step."""
    from dnacheck.model.chain import Chain

    rng = np.random.default_rng(1)
    spread = np.array([0.2, 0.3, 0.3])
    ground = np.array([0.6, 0.0, 0.0]) + spread * rng.uniform(-1.0, 1.0, (_STEPS, 3))
    root = np.eye(3) + 0.2 * rng.standard_normal((_STEPS, 3, 3))
    return Chain(
        "soft", ground, root @ root.transpose(0, 2, 1), persistence_length_A=3.4 * _STIFFNESS_RT
    )


def _moved(
    chain: Chain, start: Array, moves: _Moves, rng: np.random.Generator, use_volume: bool = True
) -> tuple[Array, float]:
    """Every shape of ``start`` (M, N, 3) after some sweeps, and the fraction accepted."""
    from dnacheck.cyclization.ensembles.kernels import open_moves as mk
    from dnacheck.numerics.random_numbers import random_state

    stiffness = chain.energy_scale_RT * chain.stiffness
    state, accepted, mismatch = random_state(rng), np.zeros((3, 2)), np.empty(6)
    use, reach = np.array(moves.use, dtype=np.int64), np.full(3, _REACH)
    out = start.copy()
    for angles in out:
        for _ in range(_SWEEPS):
            if moves.use[2]:
                mk.crankshaft_sweep(
                    angles, chain.ground, stiffness, chain.form_code, moves.use[2], _REACH,
                    use_volume, state, accepted,
                )  # fmt: skip
            else:
                mk.local_sweep(
                    angles, chain.ground, stiffness, chain.form_code, 0.0, 1.0, reach, use,
                    use_volume, state, accepted, mismatch,
                )  # fmt: skip
    return out, float(accepted[:, 0].sum() / accepted[:, 1].sum())


def _drift(chain: Chain, start: Array, end: Array) -> tuple[float, float, float, float]:
    """Mean change of 2E per angle and of ln(rotation measure), each with its standard error.

    Both means are zero for moves that keep the distribution exp(-E) dq of ``start``. The measure of
    a step's rotation is cos(theta) d tau d theta d phi.
    """
    stiffness = chain.energy_scale_RT * chain.stiffness

    def energies(shapes: Array) -> Array:
        strain = shapes - chain.ground
        total: Array = np.einsum("tsi,sij,tsj->t", strain, stiffness, strain) / strain[0].size
        return total

    def volumes(shapes: Array) -> Array:
        logs: Array = np.log(np.abs(np.cos(shapes[..., 1]))).sum(axis=1)
        return logs

    figures: list[float] = []
    for function in (energies, volumes):
        change = function(end) - function(start)
        figures += [float(change.mean()), float(change.std(ddof=1) / math.sqrt(len(change)))]
    return figures[0], figures[1], figures[2], figures[3]


def _judged(item: str, quantity: str, got: float, sigma: float) -> CheckResult:
    return judge(
        f"jfactor.acceptance[{item}]",
        quantity,
        got,
        0.0,
        Rule.SIGMAS,
        "theory: Metropolis moves leave the distribution of independent exact draws as it is",
        "standard error of independent chains; a false alarm once in 1e5 runs",
        SIGMAS,
        got_sigma=sigma,
    )


_ENERGY = "change of the mean of 2E/RT per angle"
_MEASURE = "change of the mean logarithm of the measure of rotations"


def _closed_energy(chain: Chain, constrained: bool, seed: int) -> tuple[float, float]:
    """Mean energy (RT) of a closed ring and its standard error, by one kind of move."""
    from dnacheck.cyclization.ensembles.metropolis import ClosedRingOptions, closed_ring_ensemble
    from dnacheck.equilibria.discrete.search import find_rings

    options = (
        ClosedRingOptions(samples=400, thinning=2, crankshafts=0, constrained=10)
        if constrained
        else ClosedRingOptions(samples=800, thinning=10, constrained=0)
    )
    energy = closed_ring_ensemble(chain, find_rings(chain).lowest, options, seed).energy_RT
    return energy.mean, energy.stderr


def _closed_rings(seed: int) -> list[CheckResult]:
    """Constrained moves against crankshafts: they share no acceptance rule."""
    from dnacheck.model.chain import Chain

    rng = np.random.default_rng(1)
    n = 20
    ground = np.array([4.0 * math.pi / n, 0.0, 0.0])
    ground = ground + np.array([0.05, 0.1, 0.1]) * rng.uniform(-1.0, 1.0, (n, 3))
    root = np.eye(3) + 0.1 * rng.standard_normal((n, 3, 3))
    stiffness = root @ root.transpose(0, 2, 1)
    ring = Chain("closed", ground, stiffness, persistence_length_A=3.4 * _RING_STIFFNESS_RT)
    hot = replace(ring, persistence_length_A=_ENERGY_SHARE * ring.persistence_length_A)
    expected, expected_sigma = _closed_energy(ring, False, seed)

    def judged(item: str, got: float, sigma: float) -> CheckResult:
        return judge(
            f"jfactor.acceptance[{item}]",
            "mean energy of a closed ring by constrained moves",
            got,
            expected,
            Rule.SIGMAS,
            "the same by crankshafts",
            "standard errors from autocorrelation and from copies",
            SIGMAS,
            "RT",
            got_sigma=sigma,
            expected_sigma=expected_sigma,
        )

    mean, sigma = _closed_energy(ring, True, seed + 1)
    own = judged("closed ring", mean, sigma)
    # A chain that is stuck agrees with anything within its error.
    error = judge(
        "jfactor.acceptance[closed ring, error]",
        "standard error of the mean energy of a closed ring by constrained moves",
        sigma,
        _LARGEST_RING_ERROR_RT,
        Rule.AT_MOST,
        "autocorrelation and scatter of copies",
        "0.1 to 0.3 for moves that work",
        unit="RT",
    )
    mean, sigma = _closed_energy(hot, True, seed + 2)
    wrong = judged("control: closed ring", mean / _ENERGY_SHARE, sigma / _ENERGY_SHARE)
    return [own, error, must_fail(wrong, "constrained moves accept with 0.9 of the energy")]


def _exact_draws(chain: Chain, size: int, rng: np.random.Generator) -> Array:
    """Independent shapes (size, N, 3) of the free chain."""
    roots = np.linalg.cholesky(np.linalg.inv(chain.energy_scale_RT * chain.stiffness))
    draws = rng.standard_normal((size, _STEPS, 3))
    start: Array = chain.ground + np.einsum("sij,tsj->tsi", roots, draws)
    return start


def measure(context: Context) -> Findings:
    """Pivots alone: whether their acceptance holds |cos theta|, the measure of rotations."""
    chain = _soft_chain()
    rng = context.rng()
    start = _exact_draws(chain, _QUICK_DRAWS, rng)
    pivots = _MOVES[1]

    def judged(item: str, use_volume: bool) -> CheckResult:
        end, _ = _moved(chain, start, pivots, rng, use_volume)
        _, _, change, error = _drift(chain, start, end)
        result = _judged(item, f"{_MEASURE}, pivot moves", change, error)
        return replace(result, name=f"jfactor.measure[{item}]")

    control = must_fail(judged("control: pivot", False), "pivot moves forget the rotation measure")
    return Findings([judged("pivot", True), control])


def acceptance(context: Context) -> Findings:
    """Each kind of move on independent draws from the free chain, and with wrong rules."""
    chain = _soft_chain()
    size = 40_000 if context.level is Level.FULL else 12_000
    rng = context.rng()
    start = _exact_draws(chain, size, rng)
    results: list[CheckResult] = []
    rows = []
    for moves in _MOVES:
        end, rate = _moved(chain, start, moves, rng)
        energy, energy_error, measure, measure_error = _drift(chain, start, end)
        results += [
            _judged(f"{moves.label}, energy", f"{_ENERGY}, {moves.label} moves", energy,
                    energy_error),
            _judged(f"{moves.label}, measure", f"{_MEASURE}, {moves.label} moves", measure,
                    measure_error),
        ]  # fmt: skip
        rows.append(
            {
                "name": moves.label,
                "accepted": 100.0 * rate,
                "energy": energy,
                "energy_error": energy_error,
                "measure": measure,
                "measure_error": measure_error,
            }
        )
        # An acceptance rule with another temperature, and one without the measure.
        hot = replace(chain, persistence_length_A=_ENERGY_SHARE * chain.persistence_length_A)
        energy, energy_error, _, _ = _drift(chain, start, _moved(hot, start, moves, rng)[0])
        control = _judged(f"control: {moves.label}, energy", _ENERGY, energy, energy_error)
        results.append(must_fail(control, f"{moves.label} moves accept with 0.9 of the energy"))
        if moves.label != "single angle":
            end, _ = _moved(chain, start, moves, rng, use_volume=False)
            _, _, measure, measure_error = _drift(chain, start, end)
            control = _judged(f"control: {moves.label}, measure", _MEASURE, measure, measure_error)
            results.append(must_fail(control, f"{moves.label} moves forget the rotation measure"))
    results += _closed_rings(context.seed)
    table = Table(
        "acceptance",
        "Metropolis moves on exact draws of a soft chain",
        [
            Column("name", "Move"),
            Column("accepted", "accepted", "%", ".0f"),
            Column("energy", "change", "", "+.4f", "", "2E/RT per angle"),
            Column("energy_error", "±", "", ".4f", "", "2E/RT per angle"),
            Column("measure", "change", "", "+.4f", "", "ln of rotation measure"),
            Column("measure_error", "±", "", ".4f", "", "ln of rotation measure"),
        ],
        rows,
        f"{size:,} independent draws from the free chain, {_SWEEPS} sweeps on each. Changes must "
        "vanish within their errors; controls with wrong acceptance rules must not.",
        collapsed=True,
    )
    return Findings(results, [table])
