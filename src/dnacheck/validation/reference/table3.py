"""Table III and Figures 17 to 19: free energies of the eleven molecules against experiment.

The paper compares experimental -ln J with ring energies plus one fitted shift for all molecules
(Delta S), at K3/K1 = 1.5 in Table III and over 0.5 to 1.5 in the figures, and with Monte Carlo
values of -ln J. Here beside it: ring energies with a shift fitted in the same way, and -ln J
computed, with nothing fitted.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dnacheck.cyclization.result import JFactor
from dnacheck.equilibria.continuum.search import lowest_continuum_ring
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.chain import TWIST_RATIO, Chain, build_chain
from dnacheck.model.data_files import data_directory
from dnacheck.model.molecules import embedded
from dnacheck.model.rod.rod import build_rod
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]
Model = Literal["discrete", "continuum"]

EXPERIMENT_ERROR_RT = 0.7
"""Error of the experimental free energies, in RT (Section X)."""
ANGLE_SETS = ("trifonov2", "trifonov", "desantis")
FIGURE_SETS = {17: "trifonov", 18: "desantis", 19: "trifonov2"}
RATIOS = tuple(0.5 + k / 15.0 for k in range(16))
"""Twist ratios of Figures 12 to 19: sixteen, evenly spaced (Section X)."""
PUBLISHED_SHIFTS = {"trifonov2": (6.5, 5.2), "trifonov": (7.5, 5.8), "desantis": (8.6, 6.1)}
"""Delta S / R at K3/K1 = 0.5 and 1.5 from the captions of Figures 17 to 19; Figure 19's caption
read as docs/theory/misprints.md mends it."""


@dataclass(frozen=True)
class PublishedTable:
    """Table III. Arrays have the table's order of molecules; energies in RT.

    ``residuals`` holds experiment minus model by column: ``monte_carlo``, and the three angle
    sets with their fitted shifts.
    """

    names: tuple[str, ...]
    numbers: tuple[int, ...]
    experiment: Array
    residuals: dict[str, Array]


@cache
def published_table() -> PublishedTable:
    """Table III from the data file."""
    path = data_directory() / "published" / "table3_free_energies.csv"
    with path.open(encoding="utf-8", newline="") as handle:
        rows = list(csv.DictReader(line for line in handle if not line.startswith("#")))
    columns = ("monte_carlo", *ANGLE_SETS)

    def column(name: str) -> Array:
        values = np.array([float(row[name]) for row in rows])
        values.setflags(write=False)
        return values

    return PublishedTable(
        names=tuple(row["name"] for row in rows),
        numbers=tuple(int(row["number"]) for row in rows),
        experiment=column("dG_experiment_RT"),
        residuals={name: column(f"experiment_minus_{name}_RT") for name in columns},
    )


@dataclass(frozen=True)
class FittedShift:
    """One constant added to all model values to meet experiment best.

    Attributes
    ----------
    shift : float
        Mean of experiment minus model, the least-squares fit, in RT.
    stderr : float
        Its standard error from the scatter of the molecules.
    interval : (float, float)
        Confidence interval (Student's t) at ``level``.
    level : float
    rms : float
        Root mean square of what is left.
    """

    shift: float
    stderr: float
    interval: tuple[float, float]
    level: float
    rms: float


def fit_shift(experiment: ArrayLike, model: ArrayLike, level: float = 0.95) -> FittedShift:
    """Least-squares shift from model to experiment, both in RT, with its confidence interval.

    Raises
    ------
    InputError
        Fewer than two molecules, arrays of different length, or values that are not finite.
    """
    from scipy.stats import t

    difference = np.asarray(experiment, dtype=float) - np.asarray(model, dtype=float)
    if difference.ndim != 1 or difference.size < 2 or not np.isfinite(difference).all():
        raise InputError("a shift needs two finite free energies or more")
    if not 0.0 < level < 1.0:
        raise InputError(f"confidence level must lie in (0, 1), not {level}")
    shift = float(difference.mean())
    stderr = float(difference.std(ddof=1)) / math.sqrt(difference.size)
    half = float(t.ppf(0.5 + 0.5 * level, difference.size - 1)) * stderr
    rms = float(np.sqrt(np.mean((difference - shift) ** 2)))
    return FittedShift(shift, stderr, (shift - half, shift + half), level, rms)


def ring_energy_RT(chain: Chain, model: Model = "discrete") -> float:
    """Energy in RT of the lowest ring, discrete or continuum.

    Raises
    ------
    SolveError
        No ring was found.
    """
    if model == "discrete":
        return find_rings(chain).lowest.energy_RT
    if model == "continuum":
        ring = lowest_continuum_ring(build_rod(chain)).lowest
        return float(ring.energy * chain.energy_scale_RT)
    raise InputError(f"model must be discrete or continuum, not {model!r}")


@dataclass(frozen=True)
class Column:
    """One column of Table III, the paper's beside ours. Arrays follow the molecules; RT.

    Attributes
    ----------
    name : str
        The paper's heading and how ours was computed.
    model : ndarray, shape (11,)
        Ours: -ln J with nothing fitted, or ring energies without the shift.
    model_error : ndarray, shape (11,)
        Standard errors of -ln J; zeros for energies.
    shift : FittedShift or None
        None where nothing is fitted.
    residual : ndarray, shape (11,)
        Ours: experiment minus model (minus shift).
    published : ndarray, shape (11,)
        The paper's.
    difference : ndarray, shape (11,)
        Ours minus the paper's.
    rms_residual, rms_published, rms_difference : float
    mean_difference : float
    rank_correlation, rank_p_value : float
        Spearman's, of our model values with experiment.
    published_rank_correlation : float
    """

    name: str
    model: Array
    model_error: Array
    shift: FittedShift | None
    residual: Array
    published: Array
    difference: Array
    rms_residual: float
    rms_published: float
    rms_difference: float
    mean_difference: float
    rank_correlation: float
    rank_p_value: float
    published_rank_correlation: float


def compare_column(
    name: str,
    model: ArrayLike,
    published: Array,
    experiment: Array,
    *,
    fitted: bool,
    model_error: ArrayLike | None = None,
) -> Column:
    """Ours beside the paper's, with or without a shift fitted to experiment."""
    from scipy.stats import spearmanr

    values = np.asarray(model, dtype=float)
    shift = fit_shift(experiment, values) if fitted else None
    residual = experiment - values - (shift.shift if shift else 0.0)
    difference = residual - published
    rank = spearmanr(values, experiment)

    def rms(x: Array) -> float:
        return float(np.sqrt(np.mean(x**2)))

    return Column(
        name=name,
        model=values,
        model_error=np.zeros_like(values) if model_error is None else np.asarray(model_error),
        shift=shift,
        residual=residual,
        published=published,
        difference=difference,
        rms_residual=rms(residual),
        rms_published=rms(published),
        rms_difference=rms(difference),
        mean_difference=float(difference.mean()),
        rank_correlation=float(rank.statistic),
        rank_p_value=float(rank.pvalue),
        published_rank_correlation=float(spearmanr(experiment - published, experiment).statistic),
    )


@dataclass(frozen=True)
class FreeEnergyTable:
    """Table III, every column of the paper with ours beside it.

    Attributes
    ----------
    published : PublishedTable
    columns : tuple of Column
        -ln J with the A-tract twist on the steps of Table II and then inside the tracts only,
        both against the Monte Carlo column; then ring energies with a fitted shift for Trifonov
        II, Trifonov and De Santis.
    twist_ratio : float
    """

    published: PublishedTable
    columns: tuple[Column, ...]
    twist_ratio: float


def free_energy_table(
    j_factor: Callable[[Chain], JFactor],
    model: Model = "discrete",
    twist_ratio: float = TWIST_RATIO,
) -> FreeEnergyTable:
    """Table III with -ln J from ``j_factor`` and energies of the discrete or continuum rings.

    Nothing is fitted but one shift for each energy column, as in the paper. The Trifonov and De
    Santis columns of the paper are not reproduced (about 0.4 and 0.8 RT rms and shifts 0.6 and
    0.8 larger were met); the differences are shown as they are.
    """
    table = published_table()
    experiment = table.experiment
    columns = []
    for choice, label in (("auto", "steps of Table II"), ("tracts-only", "inside the tracts only")):
        results = [
            j_factor(build_chain(embedded(name), twist_ratio=twist_ratio, a_tracts=choice))
            for name in table.names
        ]
        columns.append(
            compare_column(
                f"Monte Carlo: -ln J, A-tract twist on {label}",
                [result.minus_lnJ for result in results],
                table.residuals["monte_carlo"],
                experiment,
                fitted=False,
                model_error=[result.total_error for result in results],
            )
        )
    for angles in ANGLE_SETS:
        energies = [
            ring_energy_RT(build_chain(embedded(name), angles, twist_ratio=twist_ratio), model)
            for name in table.names
        ]
        columns.append(
            compare_column(
                f"{angles}: {model} ring energy and fitted shift",
                energies,
                table.residuals[angles],
                experiment,
                fitted=True,
            )
        )
    return FreeEnergyTable(table, tuple(columns), twist_ratio)


@dataclass(frozen=True)
class ShiftSweep:
    """One of Figures 17 to 19: experiment minus model at every twist ratio.

    Attributes
    ----------
    figure : int
    angle_set : str
    model : {"discrete", "continuum"}
    names : tuple of str, numbers : tuple of int
        Molecules in the order of Table III, and their curve labels.
    ratios : ndarray, shape (R,)
    energies_RT : ndarray, shape (R, 11)
    residuals_RT : ndarray, shape (R, 11)
        Experiment minus energy minus the shift fitted at that ratio: the curves of the figure.
    shifts : tuple of FittedShift
        One for each ratio.
    rank_correlations : ndarray, shape (R,)
        Spearman's, of energy with experiment.
    published_shifts : (float, float)
        The paper's at ratios 0.5 and 1.5.
    """

    figure: int
    angle_set: str
    model: str
    names: tuple[str, ...]
    numbers: tuple[int, ...]
    ratios: Array
    energies_RT: Array
    residuals_RT: Array
    shifts: tuple[FittedShift, ...]
    rank_correlations: Array
    published_shifts: tuple[float, float]


def shift_sweep(
    figure: int, ratios: ArrayLike = RATIOS, model: Model = "discrete", level: float = 0.95
) -> ShiftSweep:
    """Figure 17 (Trifonov), 18 (De Santis) or 19 (Trifonov II).

    Raises
    ------
    InputError
        Another figure.
    """
    from scipy.stats import spearmanr

    if figure not in FIGURE_SETS:
        raise InputError(f"figure must be 17, 18 or 19, not {figure}")
    angles = FIGURE_SETS[figure]
    table = published_table()
    values = np.atleast_1d(np.asarray(ratios, dtype=float))
    chains = [build_chain(embedded(name), angles) for name in table.names]
    energies = np.array(
        [
            [ring_energy_RT(chain.with_twist_ratio(ratio), model) for chain in chains]
            for ratio in values
        ]
    )
    shifts = tuple(fit_shift(table.experiment, row, level) for row in energies)
    return ShiftSweep(
        figure=figure,
        angle_set=angles,
        model=model,
        names=table.names,
        numbers=table.numbers,
        ratios=values,
        energies_RT=energies,
        residuals_RT=table.experiment - energies - np.array([[s.shift] for s in shifts]),
        shifts=shifts,
        rank_correlations=np.array(
            [float(spearmanr(row, table.experiment).statistic) for row in energies]
        ),
        published_shifts=PUBLISHED_SHIFTS[angles],
    )


def figure17(ratios: ArrayLike = RATIOS, model: Model = "discrete") -> ShiftSweep:
    """Figure 17: Trifonov angles."""
    return shift_sweep(17, ratios, model)


def figure18(ratios: ArrayLike = RATIOS, model: Model = "discrete") -> ShiftSweep:
    """Figure 18: De Santis angles."""
    return shift_sweep(18, ratios, model)


def figure19(ratios: ArrayLike = RATIOS, model: Model = "discrete") -> ShiftSweep:
    """Figure 19: Trifonov II angles."""
    return shift_sweep(19, ratios, model)
