"""Windows of a record: neighbours' rings against searches of each window's own chain."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnacheck.cyclization.laplace.isolated import laplace_log_j
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.io.sequences import SequenceSource
from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import Molecule
from dnacheck.model.sequence import parse_sequence
from dnacheck.numerics.outcome import InputError
from dnacheck.scanning.pieces import Region, WindowOptions, cut_windows, window_count
from dnacheck.scanning.windows import OTHER_LETTERS, WindowScanner, letter_codes


def random_letters(length, seed, weights=(0.25, 0.25, 0.25, 0.25)):
    return "".join(np.random.default_rng(seed).choice(list("ACGT"), length, p=weights))


def chain_of(letters, arguments):
    return build_chain(Molecule(parse_sequence(letters, "window")), **arguments)


@pytest.mark.parametrize(
    "arguments",
    [
        {"angles": "trifonov2", "a_tracts": "none"},
        {"angles": "desantis", "a_tracts": "none", "twist_ratio": 0.8},
        {"angles": "trifonov", "a_tracts": "none", "step_form": "midstep"},
    ],
    ids=lambda a: a["angles"],
)
def test_followed_rings_are_those_of_a_search(arguments):
    letters = random_letters(260, 3)
    scanner = WindowScanner(101, arguments)
    found = scanner.scan(letter_codes(letters))
    assert len(found.start) == 160
    for start in range(5, 160, 14):
        chain = chain_of(letters[start : start + 101], arguments)
        search = find_rings(chain)
        lowest = search.lowest
        np.testing.assert_allclose(found.energy_RT[start], lowest.energy_RT, rtol=1e-8)
        assert found.link[start] == lowest.link
        expected = -float(np.logaddexp.reduce([laplace_log_j(ring) for ring in search.equilibria]))
        np.testing.assert_allclose(found.minus_lnJ[start], expected, atol=1e-3)
    assert found.searches < 60


def test_the_a_tract_rule_is_that_of_the_chain():
    letters = random_letters(230, 8, (0.42, 0.08, 0.08, 0.42))
    scanner = WindowScanner(90, {})
    codes = letter_codes(letters)
    marked = 0
    for start in range(0, 140, 7):
        ours = scanner.chain_at(codes, start)
        window = letters[start : start + 90]
        # Between two copies of itself an open molecule has the steps of a ring.
        theirs = chain_of(3 * window, {}).ground[90:180]
        np.testing.assert_array_equal(np.roll(ours.ground, -start, axis=0), theirs)
        plain = chain_of(window, {"a_tracts": "none"}).ground
        marked += int((plain != theirs).any(axis=1).sum())
    assert marked > 100  # the rule was at work


def test_windows_with_other_letters_are_marked_and_the_rest_go_on():
    letters = list(random_letters(200, 5))
    letters[100] = "N"
    found = WindowScanner(60, {}).scan(letter_codes("".join(letters)))
    np.testing.assert_array_equal(np.flatnonzero(found.code == OTHER_LETTERS), np.arange(41, 101))
    assert np.isfinite(found.energy_RT[found.code != OTHER_LETTERS]).all()


def test_a_new_search_every_window_changes_nothing():
    codes = letter_codes(random_letters(500, 11))
    scanner = WindowScanner(150, {"a_tracts": "none"})
    followed, searched = scanner.scan(codes), scanner.scan(codes, every=1)
    np.testing.assert_allclose(followed.energy_reduced, searched.energy_reduced, rtol=1e-8)


@pytest.mark.slow
def test_missed_minima_are_rarer_than_one_in_two_thousand():
    codes = letter_codes(random_letters(20_149, 1))
    scanner = WindowScanner(150, {"a_tracts": "none"})
    followed, searched = scanner.scan(codes), scanner.scan(codes, every=1)
    higher = followed.energy_RT > searched.energy_RT * (1.0 + 1e-8)
    assert len(higher) == 20_000
    assert higher.sum() <= 10


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    lengths=st.lists(st.integers(0, 400), min_size=1, max_size=4),
    window=st.integers(10, 60),
    step=st.integers(1, 90),
    piece=st.integers(1, 40),
    bounds=st.none() | st.tuples(st.integers(1, 200), st.integers(0, 200)),
)
def test_pieces_hold_every_window_once(tmp_path_factory, lengths, window, step, piece, bounds):
    path = tmp_path_factory.mktemp("cut") / "records.fa"
    records = {f"r{k}": random_letters(n, k) for k, n in enumerate(lengths)}
    path.write_text("".join(f">{name}\n{text}\n" for name, text in records.items()))
    region = None
    if bounds is not None:
        region = Region("r0", bounds[0], bounds[0] + bounds[1])
    options = WindowOptions(window, step, region=region, piece=piece)
    expected = []
    for name, text in records.items():
        first, end = 0, len(text)
        if region is not None:
            first, end = (region.first - 1, min(region.last, len(text))) if name == "r0" else (0, 0)
        expected += [
            (name, start, text[start : start + window])
            for start in range(first, end - window + 1, step)
        ]
    source = SequenceSource(path)
    held = []
    for k, cut in enumerate(cut_windows(source, options)):
        assert cut.number == k
        assert len(cut.letters) <= (piece - 1) * step + window
        for at in range(0, len(cut.letters) - window + 1, step):
            held.append((cut.name, cut.offset + at, cut.letters[at : at + window]))
    assert held == expected
    if expected and (region is None or region.last <= lengths[0]):
        found = [(name, len(text)) for name, text in records.items()]
        assert window_count(found, options) == len(expected)


def test_stretches_join_to_the_records(tmp_path):
    path = tmp_path / "records.fa"
    path.write_text(">a\nACGT\nAC GT\n>empty\n>\n>b\n" + "ACGTA\n" * 30)
    source = SequenceSource(path)
    whole = [(record.name, record.letters) for record in source.records()]
    assert [name for name, _ in whole] == ["a", "empty", "record 3", "b"]
    joined = {}
    for stretch in source.stretches(7):
        name, text = joined.get(stretch.record, (stretch.name, ""))
        assert stretch.offset == len(text)
        assert stretch.last or len(stretch.letters) == 7
        joined[stretch.record] = (name, text + stretch.letters)
    assert list(joined.values()) == whole


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: WindowOptions(150, 0), "step 0"),
        (lambda: WindowOptions(5), "window 5"),
        (lambda: WindowOptions(20_000), "window 20000"),
        (lambda: WindowOptions(150, piece=0), "piece 0"),
        (lambda: Region.parse("chr1"), "name:first-last"),
        (lambda: Region.parse("chr1:10-5"), "first comes before last"),
        (lambda: Region.parse("chr1:0-5"), "count from 1"),
        (lambda: WindowScanner(90, {"a_tracts": "10..20"}), "steps of one molecule"),
    ],
)
def test_bad_options_are_refused_in_one_line(make, message):
    with pytest.raises(InputError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)
