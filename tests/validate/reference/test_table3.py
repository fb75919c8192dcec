"""Table III and Figures 17 to 19 beside the paper's numbers."""

import math

import numpy as np
import pytest
from rods import ELEVEN
from scipy import stats

from dnacheck.cyclization.half_chain.sampling import HalfChainOptions, half_chain
from dnacheck.cyclization.laplace.isolated import laplace
from dnacheck.cyclization.result import JFactor
from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.molecules import embedded
from dnacheck.numerics.outcome import InputError
from dnacheck.validation.reference.table3 import (
    ANGLE_SETS,
    RATIOS,
    compare_column,
    figure17,
    fit_shift,
    free_energy_table,
    published_table,
    ring_energy_RT,
    shift_sweep,
)

# Table II, discrete energies in units of K_theta, in the order of Table III.
TABLE2 = (
    0.10746, 0.11701, 0.09469, 0.09682, 0.09860, 0.08305,
    0.07732, 0.07976, 0.07414, 0.07501, 0.07292,
)  # fmt: skip
RT_PER_UNIT = 463.0 / 3.4


@pytest.fixture(scope="module")
def table():
    return free_energy_table(laplace)


def test_published_values_are_the_papers():
    table = published_table()
    assert table.names == ELEVEN
    assert table.experiment.tolist()[:3] == [21.0, 21.0, 20.1]
    assert table.residuals["desantis"][3] == -3.0
    # A least-squares shift leaves residuals of mean zero, to the rounding of eleven of them.
    for name in ANGLE_SETS:
        assert abs(table.residuals[name].mean()) < 0.05
    assert abs(table.residuals["monte_carlo"].mean()) > 0.05


def test_shift_and_interval_are_those_of_students_t():
    experiment, model = np.array([5.0, 7.0, 6.0, 9.0]), np.array([1.0, 2.0, 2.5, 3.0])
    fit = fit_shift(experiment, model)
    d = experiment - model
    assert fit.shift == pytest.approx(4.625)
    low, high = stats.t.interval(0.95, 3, loc=d.mean(), scale=stats.sem(d))
    assert fit.interval == pytest.approx((low, high))
    assert fit.rms == pytest.approx(d.std())
    with pytest.raises(InputError):
        fit_shift([1.0], [1.0])
    with pytest.raises(InputError):
        fit_shift([1.0, math.nan], [1.0, 1.0])


def test_energies_are_those_of_table_two(table):
    energies = table.columns[2].model
    assert np.allclose(energies, RT_PER_UNIT * np.array(TABLE2), rtol=4e-4)


def test_trifonov_two_column_is_reproduced(table):
    column = table.columns[2]
    # Both residuals have one shift taken out; the paper prints one decimal of each number.
    assert column.rms_difference < 0.2
    assert column.rank_correlation > 0.9
    assert column.shift is not None
    assert column.shift.interval[0] < 5.2 < column.shift.interval[1]


def test_other_columns_differ_by_as_much_as_is_known(table):
    trifonov, desantis = table.columns[3:]
    assert 0.3 < trifonov.rms_difference < 0.5
    assert 0.6 < desantis.rms_difference < 0.9
    assert trifonov.shift is not None
    assert desantis.shift is not None
    assert trifonov.shift.shift == pytest.approx(6.4, abs=0.1)
    assert desantis.shift.shift == pytest.approx(6.9, abs=0.1)


def test_monte_carlo_column_has_no_shift_and_both_tract_readings(table):
    auto, tracts = table.columns[:2]
    assert auto.shift is None
    assert tracts.shift is None
    assert np.allclose(auto.residual, published_table().experiment - auto.model)
    assert tracts.rms_difference < auto.rms_difference
    assert not np.allclose(auto.model, tracts.model)
    # Laplace has no error of its own, and says so.
    assert np.all(np.isinf(auto.model_error))


def test_nothing_fitted_means_a_constant_shows():
    table = published_table()
    model = table.experiment - table.residuals["monte_carlo"]
    same = compare_column(
        "same", model, table.residuals["monte_carlo"], table.experiment, fitted=False
    )
    assert same.rms_difference == pytest.approx(0.0, abs=1e-12)
    shifted = compare_column(
        "shifted", model + 1.0, table.residuals["monte_carlo"], table.experiment, fitted=False
    )
    assert shifted.rms_difference == pytest.approx(1.0)
    hidden = compare_column(
        "hidden", model + 1.0, table.residuals["monte_carlo"], table.experiment, fitted=True
    )
    assert hidden.rms_difference < 0.4


def test_figures_take_their_sets_and_ratios():
    sweep = figure17((0.5, 1.5))
    assert sweep.angle_set == "trifonov"
    assert sweep.residuals_RT.shape == (2, 11)
    assert np.allclose(sweep.residuals_RT.mean(axis=1), 0.0, atol=1e-12)
    assert [s.shift for s in sweep.shifts] == pytest.approx([7.86, 6.40], abs=0.03)
    assert sweep.published_shifts == (7.5, 5.8)
    # Energies rise with the twist ratio, so the shift falls.
    assert np.all(sweep.energies_RT[1] > sweep.energies_RT[0])
    assert len(RATIOS) == 16
    assert RATIOS[0] == 0.5
    assert RATIOS[-1] == pytest.approx(1.5)
    with pytest.raises(InputError, match="17, 18 or 19"):
        shift_sweep(16)


def test_continuum_energies_are_close_and_unknown_models_refused():
    chain = build_chain(embedded("09T15"))
    assert ring_energy_RT(chain, "continuum") == pytest.approx(ring_energy_RT(chain), rel=5e-3)
    with pytest.raises(InputError, match="discrete or continuum"):
        ring_energy_RT(chain, "rod")  # type: ignore[arg-type]


@pytest.mark.slow
def test_monte_carlo_column_by_sampling():
    def sampled(chain: Chain) -> JFactor:
        return half_chain(chain, HalfChainOptions(halves=40_000, threads=2), 7)

    auto, tracts = free_energy_table(sampled).columns[:2]
    assert auto.rms_difference == pytest.approx(0.75, abs=0.06)
    assert tracts.rms_difference == pytest.approx(0.54, abs=0.06)
