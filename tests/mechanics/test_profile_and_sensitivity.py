"""J against length, and what letters do to it."""

import numpy as np
import pytest
from scipy.stats import spearmanr

from dnacheck.cyclization.gradient import closed_draws
from dnacheck.cyclization.methods import ClosureSampling, Laplace
from dnacheck.mechanics.profile import changed_length, length_profile, read_measured_profile
from dnacheck.mechanics.sensitivity import sensitivity_of
from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import Molecule, embedded
from dnacheck.model.named_parameters import modified_chain
from dnacheck.model.sequence import parse_sequence
from dnacheck.numerics.outcome import InputError


def test_letters_go_in_and_out_where_they_should():
    molecule = Molecule(parse_sequence("AAAACCCCGGGGTTTT", "m"))
    longer = changed_length(molecule, 5, 4, "TG")
    assert longer.sequence.letters == "AAAATGTGTCCCCGGGGTTTT"
    shorter = changed_length(molecule, -3, 4, "TG")
    assert shorter.sequence.letters == "AAAACGGGGTTTT"
    assert changed_length(molecule, -2, None, "A").sequence.letters == "AAAACCCCGGGGTT"
    assert changed_length(molecule, 2, None, "CA").sequence.letters == "AAAACCCCGGGGTTTTCA"
    assert changed_length(molecule, 0, 3, "A") is molecule


@pytest.mark.parametrize(
    ("change", "place", "filler", "words"),
    [
        (1, 17, "A", "place 17"),
        (1, 0, "AN", "filler 'AN'"),
        (1, 0, "", "filler ''"),
        (-8, 0, "A", "can't be taken"),
        (-5, 13, "A", "can't be taken"),
    ],
)
def test_impossible_lengths_are_refused(change, place, filler, words):
    with pytest.raises(InputError) as caught:
        changed_length(Molecule(parse_sequence("AAAACCCCGGGGTTTT", "m")), change, place, filler)
    assert words in str(caught.value)


def test_a_straight_molecule_swings_with_its_helical_repeat():
    """No bends, no A-tracts: the peaks lie at whole turns of the ground twist, by theory."""
    straight = Molecule(parse_sequence("A" * 150, "straight"))

    def chain_of(item):
        return modified_chain(build_chain(item, a_tracts="none"), {"bend_scale": 0.0})

    profile = length_profile(
        straight,
        range(-12, 13),
        lambda item: ClosureSampling().compute(chain_of(item), tolerance=0.03),
        filler="A",
    )
    twist = build_chain(straight, a_tracts="none").ground[0, 0]
    repeat = 2.0 * np.pi / twist
    peaks, dips = profile.extrema()
    assert len(peaks) >= 2
    for peak in peaks:
        assert abs(peak / repeat - round(peak / repeat)) < 0.06
    for dip in dips:
        assert abs(dip / repeat - round(dip / repeat)) > 0.4
    assert profile.period == pytest.approx(repeat, abs=0.4)
    assert profile.helical_repeat == pytest.approx(repeat, abs=0.05)
    assert len(profile.to_frame()) == 25


def test_lengths_that_fail_are_named_and_the_rest_go_on():
    from dnacheck.numerics.outcome import SolveError

    def compute(item):
        if len(item.sequence) == 157:
            raise SolveError("no ring")
        return Laplace().compute(build_chain(item))

    profile = length_profile(embedded("11T15"), (-2, -1, 0), compute, place=20)
    assert [p.n_bp for p in profile.points] == [156, 158]
    assert profile.failures == ((-1, "no ring"),)


def test_a_measured_profile_is_read_or_refused(tmp_path):
    path = tmp_path / "points.csv"
    path.write_text("n_bp,minus_lnJ,stderr\n150,17.5,0.2\n")
    assert read_measured_profile(path) == ((150.0, 17.5, 0.2),)
    path.write_text("n_bp,minus_lnJ\n150,17.5\n")
    with pytest.raises(InputError, match="columns n_bp, minus_lnJ, stderr"):
        read_measured_profile(path)
    path.write_text("n_bp,minus_lnJ,stderr\n150,x,0.2\n")
    with pytest.raises(InputError, match="row 1"):
        read_measured_profile(path)


def test_the_gradient_ranks_single_letters_as_computing_them_does():
    rng = np.random.default_rng(8)
    letters = "".join(rng.choice(list("ACGT"), size=120))

    def rebuild(text):
        return build_chain(Molecule(parse_sequence(text, "m")), a_tracts="none")

    found = sensitivity_of(rebuild(letters), rebuild, tolerance=0.01, compute=0, threads=2)
    assert len(found.substitutions) == 3 * 120
    some = [found.substitutions[i] for i in rng.choice(360, size=40, replace=False)]
    computed = []
    for item in some:
        text = letters[: item.position] + item.new + letters[item.position + 1 :]
        computed.append(-closed_draws(rebuild(text), tolerance=0.01).log_j - found.minus_lnJ)
    predicted = [item.predicted for item in some]
    assert spearmanr(predicted, computed).statistic > 0.95
    shuffled = rng.permutation(predicted)
    assert abs(spearmanr(shuffled, computed).statistic) < 0.6


def test_the_letters_that_matter_most_are_computed():
    chain = build_chain(embedded("11T15"))
    regions = embedded("11T15").a_tract_regions

    def rebuild(text):
        return build_chain(Molecule(parse_sequence(text, "m"), regions))

    found = sensitivity_of(chain, rebuild, compute=6)
    largest = sorted(found.substitutions, key=lambda item: -abs(item.predicted))[:6]
    assert all(item.computed is not None for item in largest)
    assert len(found.most(10)) == 10
    matrix = found.matrix()
    assert matrix.shape == (158, 4)
    assert all(matrix[i]["ACGT".index(b)] == 0.0 for i, b in enumerate(chain.letters))
    with pytest.raises(InputError, match="must not be negative"):
        sensitivity_of(chain, rebuild, compute=-1)


def test_step_map_against_a_step_by_step_difference():
    """One step's twist and one step's bend moved: the map's entry is the difference quotient."""
    from dataclasses import replace

    chain = build_chain(embedded("08T15"))
    found = sensitivity_of(chain, lambda _: chain, tolerance=0.004, compute=0)
    for step, column, h in ((40, 0, 1.0), (77, 1, 2.0), (120, 2, 2.0)):
        ends = []
        for sign in (1.0, -1.0):
            ground = chain.ground.copy()
            ground[step, column] += sign * np.radians(h)
            ends.append(closed_draws(replace(chain, ground=ground), tolerance=0.004).log_j)
        slope = (ends[0] - ends[1]) / (2.0 * h)
        error = np.hypot(found.steps.ground_stderr[step, column], 0.5 * 0.004 / h)
        assert abs(found.steps.ground[step, column] - slope) < 3.5 * error
