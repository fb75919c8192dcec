"""Sequences and molecules: what is accepted, what is refused and how."""

import csv

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnacheck.model.a_tracts import (
    automatic_regions,
    parse_regions,
    region_steps,
    tract_regions,
)
from dnacheck.model.data_files import data_directory
from dnacheck.model.molecules import embedded, embedded_names
from dnacheck.model.sequence import STEP_NAMES, Sequence, parse_sequence
from dnacheck.numerics.outcome import InputError

letters = st.text(alphabet="ACGT", min_size=10, max_size=60)


@given(letters)
def test_lower_case_and_white_space_are_accepted(text):
    spaced = "\n".join(text[i : i + 7].lower() for i in range(0, len(text), 7))
    assert parse_sequence(spaced, "x").letters == text


@given(letters)
def test_reverse_complement_twice_is_the_same_molecule(text):
    sequence = Sequence("x", text)
    assert sequence.reverse_complement().reverse_complement() == sequence
    pairs = {"A": "T", "T": "A", "C": "G", "G": "C"}
    assert sequence.reverse_complement().letters == "".join(pairs[c] for c in reversed(text))


@given(letters)
def test_steps_are_read_one_by_one_and_the_last_leads_back(text):
    names = [STEP_NAMES[i] for i in Sequence("x", text).step_indices()]
    assert names == [text[i] + text[(i + 1) % len(text)] for i in range(len(text))]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty"),
        ("   \n", "empty"),
        ("ACGTACGTA", "9 base pairs are too few"),
        ("ACGTACGTACGTACGTNACGT", "position 17: 'N' is not one of A, C, G, T"),
        ("ACGUACGTACGT", "position 4: 'U' is not one of A, C, G, T"),
        ("ACGTACGTACGT*", "position 13"),
    ],
)
def test_bad_sequences_name_the_place(text, message):
    with pytest.raises(InputError, match=r"sequence 'foo'") as caught:
        parse_sequence(text, "foo")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_eleven_molecules_have_the_lengths_their_names_give():
    """Length is 132 plus both adaptors; 17A11 lost one base (Section X)."""
    assert len(embedded_names()) == 11
    for name in embedded_names():
        expected = 132 + int(name[:2]) + int(name[3:]) - (1 if name == "17A11" else 0)
        assert len(embedded(name).sequence) == expected


def test_published_tables_speak_of_the_same_molecules():
    for table in ("table2_ring_energies", "table3_free_energies"):
        with (data_directory() / "published" / f"{table}.csv").open() as handle:
            assert tuple(row["name"] for row in csv.DictReader(handle)) == embedded_names()


def test_the_tract_rule_gives_the_regions_that_table_2_demands():
    for name in embedded_names():
        molecule = embedded(name)
        for closed in (True, False):
            assert automatic_regions(molecule.sequence.letters, closed) == molecule.a_tract_regions


def test_tract_rule_parts_distant_tracts_and_stays_inside():
    assert automatic_regions("A" * 6 + "C" * 21 + "T" * 7, closed=False) == ((0, 33),)
    assert automatic_regions("A" * 6 + "C" * 22 + "T" * 7, closed=False) == ((0, 7), (26, 34))
    assert automatic_regions("ACGT" * 10, closed=False) == ()
    assert tract_regions("CC" + "A" * 6 + "CC", closed=False) == ((2, 6),)
    assert tract_regions("AACCAAA", closed=False) == ()


def test_in_a_ring_the_tract_rule_knows_no_first_base_pair():
    # A run of six across the joint, 30 base pairs from itself.
    assert automatic_regions("AAA" + "C" * 30 + "AAA") == ((31, 4),)
    assert tract_regions("AAA" + "C" * 30 + "AAA") == ((33, 1),)
    # Two runs 21 apart across the joint are one region, 22 apart are two.
    assert automatic_regions("C" * 10 + "A" * 6 + "C" * 40 + "T" * 6 + "C" * 11) == ((54, 17),)
    assert len(automatic_regions("C" * 10 + "A" * 6 + "C" * 40 + "T" * 6 + "C" * 12)) == 2
    # A region beside the joint reaches two steps past it.
    assert automatic_regions("A" * 6 + "C" * 40) == ((44, 7),)
    # A run that comes within 21 base pairs of itself, and a ring of one letter, are all region.
    assert automatic_regions("A" * 6 + "C" * 21) == ((0, 26),)
    assert automatic_regions("T" * 30) == tract_regions("T" * 30) == ((0, 29),)
    assert automatic_regions("ACGT" * 10) == ()


@pytest.mark.parametrize("rule", [automatic_regions, tract_regions])
def test_the_tract_rule_turns_with_the_ring(rule):
    rng = np.random.default_rng(3)
    crossing = 0
    for _ in range(200):
        n = int(rng.integers(40, 160))
        letters = list(rng.choice(list("ACGT"), n))
        for start in rng.integers(0, n, 4):
            for k in range(int(rng.integers(5, 9))):
                letters[(start + k) % n] = "AT"[int(start) % 2]
        text = "".join(letters)
        here = {int(s) for region in rule(text) for s in region_steps(region, n)}
        for cut in rng.integers(1, n, 5):
            there = rule(text[cut:] + text[:cut])
            steps = {(int(s) + int(cut)) % n for r in there for s in region_steps(r, n)}
            assert steps == here
            crossing += any(first > last for first, last in there)
    # Negative control: the sample has regions that the written ends part.
    assert crossing > 50


@pytest.mark.parametrize("text", ["5", "a..b", "7..3", "0..20", "1..2,", "-1..3"])
def test_bad_regions_are_refused(text):
    with pytest.raises(InputError, match="A-tract region"):
        parse_regions(text, 20)
