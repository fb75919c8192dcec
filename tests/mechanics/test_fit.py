"""Fits to measured J: recovery, blindness, misfit, and bad data."""

import numpy as np
import pytest

from dnacheck.cyclization.gradient import closed_draws
from dnacheck.mechanics.fit import FitOptions, Prior, fit_mechanics
from dnacheck.mechanics.measurements import Measurement, read_measurements
from dnacheck.mechanics.posterior import design, posterior, profile_likelihood
from dnacheck.mechanics.profile import changed_length
from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import embedded
from dnacheck.model.named_parameters import modified_chain
from dnacheck.numerics.outcome import InputError

TRUE = {"persistence_length_A": 500.0, "twist_offset_deg": -0.08}
NOISE = 0.15


def made_up(lengths, truth, seed, tolerance=0.01):
    """Molecules of several lengths with noisy -ln J of the true mechanics."""
    rng = np.random.default_rng(seed)
    measurements, chains = [], []
    for change in lengths:
        item = changed_length(embedded("11T15"), change, 20, "ACGTTGCATC")
        chain = build_chain(item)
        value = -closed_draws(modified_chain(chain, truth), tolerance=tolerance, rng=99).log_j
        measurements.append(Measurement(item, value + NOISE * rng.standard_normal(), NOISE))
        chains.append(chain)
    return measurements, chains


@pytest.fixture(scope="module")
def data():
    return made_up(range(-9, 11, 3), TRUE, 1)


@pytest.fixture(scope="module")
def fit(data):
    return fit_mechanics(*data, list(TRUE), options=FitOptions(threads=2))


def test_the_true_mechanics_come_back_within_their_errors(fit):
    assert fit.converged
    assert fit.warnings == ()
    for item in fit.parameters:
        assert item.stderr is not None
        assert abs(item.value - TRUE[item.name]) < 3.5 * item.stderr, item.name
    # the errors themselves: J to 0.15 of eleven lengths gives P to a few per cent
    assert fit.parameters[0].stderr < 0.05 * TRUE["persistence_length_A"]
    assert fit.p_value > 0.01


def test_a_wrong_model_is_flagged_by_its_misfit(data):
    """The same data with the A-tract twist off by two degrees and nothing free to mend it."""
    measurements, chains = data
    wrong = [modified_chain(chain, {"a_tract_twist_deg": 37.0}) for chain in chains]
    fit = fit_mechanics(measurements, wrong, ["persistence_length_A"])
    assert fit.p_value < 1e-6
    assert any("does not explain the data" in text for text in fit.warnings)


def test_what_the_data_cannot_see_is_said_and_gets_no_error(data):
    """An offset of every J and a scale of nothing: tau[GG] where no molecule but one has GG."""
    measurements, chains = data
    one = [measurements[0]], [chains[0]]
    fit = fit_mechanics(
        *one,
        ["persistence_length_A", "bend_scale"],
        {"persistence_length_A": Prior(463.0, 20.0)},
    )
    blind = [d for d in fit.directions if not d.seen]
    assert len(blind) == 1  # one datum sees one direction
    assert np.isinf(blind[0].stderr) or blind[0].stderr > 10.0


def test_two_offsets_that_say_the_same_cannot_be_told_apart(data):
    measurements, chains = data
    grouped = [Measurement(m.molecule, m.minus_lnJ, m.stderr, "all") for m in measurements]
    fit = fit_mechanics(grouped, chains, ["offset", "offset[all]"])
    direction = fit.directions[0]
    assert not direction.seen
    parts = direction.parts
    assert parts["offset"] == pytest.approx(-parts["offset[all]"], abs=1e-6)
    assert fit.directions[1].seen


def test_profile_and_posterior_agree_with_the_errors_of_a_nearly_linear_fit(fit):
    drawn = posterior(fit, rng=5)
    assert drawn.converged
    for item in fit.parameters:
        low, high = profile_likelihood(fit, item.name).intervals[0.68]
        assert 0.5 * (high - low) == pytest.approx(item.stderr, rel=0.2)
        low, high = drawn.interval(item.name, 0.68)
        assert 0.5 * (high - low) == pytest.approx(item.stderr, rel=0.2)
        assert low < item.value < high


def test_leaving_one_out_is_refitting_without_it(data, fit):
    measurements, chains = data
    k = 2
    rest = [m for i, m in enumerate(measurements) if i != k]
    others = [c for i, c in enumerate(chains) if i != k]
    without = fit_mechanics(rest, others, list(TRUE))
    predicted = -closed_draws(modified_chain(chains[k], without.values), tolerance=0.01).log_j
    assert fit.leave_one_out[k] == pytest.approx(measurements[k].minus_lnJ - predicted, abs=0.05)


def test_design_prefers_the_molecule_with_the_larger_derivative(fit, data):
    _, chains = data
    ranked = design(fit, [chains[0], chains[3]], stderr=0.15)
    for item in ranked:
        for parameter in fit.parameters:
            assert item.errors[parameter.name] <= parameter.stderr * (1 + 1e-9)
    assert ranked[0].gain >= ranked[1].gain


def test_a_robust_fit_forgives_an_outlier(data):
    measurements, chains = data
    spoiled = list(measurements)
    spoiled[3] = Measurement(spoiled[3].molecule, spoiled[3].minus_lnJ + 4.0, NOISE)
    plain = fit_mechanics(spoiled, chains, list(TRUE))
    robust = fit_mechanics(spoiled, chains, list(TRUE), options=FitOptions(robust=True))
    off = [abs(f.values["persistence_length_A"] - 500.0) for f in (plain, robust)]
    assert off[1] < 0.5 * off[0]


@pytest.mark.parametrize(
    ("free", "priors", "words"),
    [
        ([], {}, "at least one free parameter"),
        (["offset", "offset"], {}, "given twice"),
        (["elasticity"], {}, "unknown"),
        (["offset"], {"twist_ratio": Prior(1.5, 0.1)}, "not a free parameter"),
        (["offset[none]"], {}, "no molecule has that group"),
        ([f"tau[{x}{y}]" for x in "ACGT" for y in "ACGT"], {}, "16 free parameters for 7"),
    ],
)
def test_impossible_fits_are_refused_in_one_line(data, free, priors, words):
    with pytest.raises(InputError) as caught:
        fit_mechanics(*data, free, priors)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


GOOD = "molecule,minus_lnJ,stderr,group\n11T15,16.2,0.7,a\n08T15,14.8,0.7,b\n"


def test_measurements_are_read(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text("\ufeff# remark\n" + GOOD, encoding="utf-8")
    rows = read_measurements(path)
    assert [(m.name, m.minus_lnJ, m.stderr, m.group) for m in rows] == [
        ("11T15", 16.2, 0.7, "a"),
        ("08T15", 14.8, 0.7, "b"),
    ]
    path.write_text("molecule,J_molar,J_stderr_molar\n11T15,1e-7,2e-8\n")
    (row,) = read_measurements(path)
    assert row.minus_lnJ == pytest.approx(-np.log(1e-7))
    assert row.stderr == pytest.approx(0.2)
    (tmp_path / "m.fasta").write_text(">one\nACGTACGTACGTACGT\n>two\nGGGGCCCCAAAATTTT\n")
    path.write_text("molecule,minus_lnJ,stderr\nm.fasta:two,20,0.5\n")
    (row,) = read_measurements(path)
    assert row.molecule.sequence.letters == "GGGGCCCCAAAATTTT"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name,minus_lnJ,stderr\nx,1,1\n", "no column 'molecule'"),
        ("molecule,stderr\n11T15,1\n", "'minus_lnJ' and 'J_molar'"),
        ("molecule,minus_lnJ\n11T15,1\n", "'stderr'"),
        ("molecule,J_molar,stderr\n11T15,0,1\n", "row 1: J is 0"),
        ("molecule,J_molar,stderr\n11T15,-1e-9,1\n", "row 1: J is -1e-09"),
        ("molecule,J_molar,stderr\n11T15,50,1\n", "more than 1 M is another unit"),
        ("molecule,minus_lnJ,stderr\n11T15,16,0\n", "row 1: the error is 0"),
        ("molecule,minus_lnJ,stderr\n11T15,16,0.7\nnobody,15,0.7\n", "row 2: "),
        ("molecule,minus_lnJ,stderr\n11T15,many,0.7\n", "'many' is no number"),
        ("molecule,minus_lnJ,stderr\n", "no row"),
    ],
)
def test_bad_rows_are_named(tmp_path, text, words):
    path = tmp_path / "data.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_measurements(path)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
