"""Table III once more: mechanics fitted to the eleven measured J factors, beside nothing fitted."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Findings, Level
from dnacheck.validation.engine.verdict import Rule, judge, must_fail
from dnacheck.validation.reference.published import PAPER, table3
from dnacheck.validation.report.record import Column, Figure, Table

if TYPE_CHECKING:
    from dnacheck.mechanics.fit import MechanicsFit

_SUBSETS = (
    ("bend_scale",),
    ("persistence_length_A", "twist_ratio"),
    ("persistence_length_A", "twist_ratio", "twist_offset_deg", "bend_scale"),
)
_MORE = (
    ("offset",),
    ("twist_offset_deg", "bend_scale"),
    ("a_tract_bend_scale", "bend_scale"),
    ("offset", "persistence_length_A", "twist_ratio", "bend_scale"),
)
"""Only in a full run."""
_EXPERIMENT_RT = 0.7
"""Error of the experimental free energies (Section X)."""
_TOLERANCE = 0.03


def fitted(context: Context) -> Findings:
    """Fits of up to four parameters, in sample and with each molecule left out."""
    from dnacheck.mechanics.fit import FitOptions, fit_mechanics
    from dnacheck.mechanics.measurements import Measurement
    from dnacheck.validation.engine.rings import scene_chain

    measured = [
        Measurement(molecule, table3()[molecule.name].experiment, _EXPERIMENT_RT)
        for molecule in context.molecules
    ]
    chains = [scene_chain(context.scene, molecule, "trifonov2") for molecule in context.molecules]
    options = FitOptions(tolerance=_TOLERANCE, seed=context.seed)
    subsets = _SUBSETS + (_MORE if context.level is Level.FULL else ())
    fits = {free: fit_mechanics(measured, chains, free, options=options) for free in subsets}
    unfitted = _unfitted_rms(fits[_SUBSETS[0]], chains, context.seed)
    rows: list[dict[str, Any]] = [{"free": "nothing", "count": 0, "rms": unfitted}]
    results = []
    for free, fit in fits.items():
        name = " + ".join(free)
        rows.append(
            {
                "free": name,
                "count": len(free),
                "rms": fit.rms,
                "left_out": fit.leave_one_out_rms,
                "chi_square": fit.chi_square,
                "iterations": fit.iterations,
            }
        )
        results += [
            judge(
                f"jfactor.fitted[{name}, converged]",
                "whether the fit settled",
                fit.converged,
                True,
                Rule.EQUAL,
                "Gauss–Newton with common random numbers",
                "a fit that did not settle says nothing",
            ),
            judge(
                f"jfactor.fitted[{name}]",
                "rms residual of −ln J, fitted",
                fit.rms,
                unfitted + _TOLERANCE,
                Rule.AT_MOST,
                "the same with nothing fitted",
                "least squares cannot be worse than its start, sampling apart",
                unit="RT",
            ),
        ]
    largest = fits[_SUBSETS[-1]]
    results.append(
        must_fail(
            judge(
                "jfactor.fitted[control]",
                "rms residual of a fit to the measured values in reverse order",
                _shuffled_rms(measured, chains, options),
                largest.rms + _TOLERANCE,
                Rule.AT_MOST,
                "the fit to the right ones",
                "values that belong to other molecules must not be explained as well",
                unit="RT",
            ),
            "measured values were given to other molecules",
        )
    )
    return Findings(results, [_quality(rows), _values(largest), _picture(largest)])


def _unfitted_rms(fit: MechanicsFit, chains: Any, seed: int) -> float:
    """Rms of measured less computed with the chains as they are."""
    from dnacheck.cyclization.methods import ClosureSampling

    own = [
        ClosureSampling().compute(chain, rng=seed + i, tolerance=_TOLERANCE).minus_lnJ
        for i, chain in enumerate(chains)
    ]
    return float(np.sqrt(np.mean((fit.measured - np.array(own)) ** 2)))


def _shuffled_rms(measured: Any, chains: Any, options: Any) -> float:
    from dataclasses import replace

    from dnacheck.mechanics.fit import fit_mechanics

    values = [item.minus_lnJ for item in measured][::-1]
    wrong = [replace(m, minus_lnJ=v) for m, v in zip(measured, values, strict=True)]
    return fit_mechanics(wrong, chains, ("bend_scale",), options=options).rms


def _quality(rows: list[dict[str, Any]]) -> Table:
    return Table(
        "fits",
        "Table III with fitted mechanics",
        [
            Column("free", "Fitted"),
            Column("count", "parameters", "", "d"),
            Column("rms", "in sample", "RT", ".2f", "", "rms residual"),
            Column("left_out", "left out", "RT", ".2f", "", "rms residual"),
            Column("chi_square", "chi-square", "", ".1f"),
            Column("iterations", "iterations", "", "d"),
        ],
        rows,
        f"−ln J of the eleven molecules against experiment, whose error is about ±{_EXPERIMENT_RT} "
        "RT; Trifonov II angles. Left out: each molecule predicted by a fit to the other ten.",
    )


def _values(fit: MechanicsFit) -> Table:
    return Table(
        "fitted-mechanics",
        "Fitted mechanics beside the paper's",
        [
            Column("name", "Parameter"),
            Column("start", "assumed by the paper", "", ".4g"),
            Column("value", "fitted", "", ".4g"),
            Column("error", "±", "", ".2g"),
            Column("unit", "Unit"),
        ],
        [
            {"name": p.name, "start": p.start, "value": p.value, "error": p.stderr, "unit": p.unit}
            for p in fit.parameters
        ],
        f"Assumptions of {PAPER}. bend_scale multiplies all bends as they are in the angle set, an "
        "offset of the twist is added to every step. Without an error: the data cannot see it.",
    )


def _picture(fit: MechanicsFit) -> Figure:
    return Figure(
        "fitted",
        "Computed against measured, four parameters fitted",
        "fitted",
        fit.to_dict(),
        "Crosses: each molecule predicted by a fit to the others.",
    )
