"""Angle sets: the embedded ones against Table I, a user's own against every mistake."""

import csv

import numpy as np
import pytest

from dnacheck.model.chain import build_chain
from dnacheck.model.data_files import data_directory
from dnacheck.model.parameters import load_parameters, strand_departures
from dnacheck.model.sequence import STEP_NAMES, Sequence
from dnacheck.numerics.outcome import InputError

STIFFNESS = np.array([[1.5, 0.1, 0.0], [0.1, 1.0, 0.0], [0.0, 0.0, 1.2]])


@pytest.mark.parametrize("name", ["trifonov", "desantis"])
def test_embedded_sets_are_table_1(name):
    table = load_parameters(name)
    path = data_directory() / "published" / "table1_unstressed_angles_deg.csv"
    with path.open() as handle:
        rows = {row["step"]: row for row in csv.DictReader(handle)}
    for index, step in enumerate(STEP_NAMES):
        printed = [float(rows[step][f"{angle}_{name}"]) for angle in ("tau", "theta", "phi")]
        assert np.rad2deg(table.ground[index]) == pytest.approx(printed, abs=1e-12)
    assert table.strand_symmetric


def test_trifonov_2_is_section_10():
    first, second = load_parameters("trifonov"), load_parameters("trifonov2")
    assert second.ground[:, 1:] == pytest.approx(0.61 * first.ground[:, 1:], abs=1e-15)
    # The paper prints these two rounded to 0.01 degrees.
    assert np.rad2deg(second.ground[:, 0]) == pytest.approx(34.45, abs=5e-3)
    assert np.rad2deg(second.a_tract_twist) == pytest.approx(34.85, abs=5e-3)


def write_set(path, *, stiffness=None, drop=None, change=None, head=""):
    base = load_parameters("trifonov")
    lines = [head, 'name = "mine"', 'unit = "degree"']
    for index, step in enumerate(STEP_NAMES):
        if step == drop:
            continue
        tau, theta, phi = np.rad2deg(base.ground[index])
        lines += [f"[steps.{step}]", f"tau = {tau!r}", f"theta = {theta!r}", f"phi = {phi!r}"]
        if stiffness is not None:
            lines.append(f"stiffness = {stiffness.tolist()}")
    text = "\n".join(lines).replace("np.float64(", "").replace(")", "")
    for old, new in change or ():
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text)
    return str(path)


def test_own_set_with_stiffness_reaches_the_chain(tmp_path):
    table = load_parameters(write_set(tmp_path / "p.toml", stiffness=STIFFNESS))
    chain = build_chain(Sequence("x", "ACGTACGTACGTAC"), table)
    assert chain.twist_ratio is None
    assert chain.stiffness[3] == pytest.approx(STIFFNESS)
    assert chain.ground[0] == pytest.approx(load_parameters("trifonov").ground[1], abs=1e-15)
    with pytest.raises(InputError, match="stiffnesses of its own"):
        build_chain(Sequence("x", "ACGTACGTACGTAC"), table, twist_ratio=1.0)


def test_stiffness_in_rt_is_brought_to_the_reduced_unit(tmp_path):
    path = write_set(
        tmp_path / "p.toml", stiffness=100.0 * STIFFNESS, head='stiffness_unit = "RT/rad^2"'
    )
    chain = build_chain(
        Sequence("x", "ACGTACGTACGTAC"), path, persistence_length_A=500.0, rise_A=3.3
    )
    # 1 reduced unit is RT P/l.
    assert chain.stiffness[0] * 500.0 / 3.3 == pytest.approx(100.0 * STIFFNESS)


@pytest.mark.parametrize(
    ("kwargs", "message", "line"),
    [
        ({"drop": "GC"}, "missing step GC", False),
        ({"change": [("tau = 35.6", 'tau = "x"')]}, "must be a number", True),
        ({"change": [("tau = 35.6", "tau = nan")]}, "must be finite", True),
        ({"change": [("tau = 35.6", "tua = 35.6")]}, "unknown key 'tua' in step AA", True),
        ({"change": [("[steps.AA]", "[steps.AX]")]}, "'AX' is not a base-pair step", True),
        ({"change": [('unit = "degree"', 'unit = "turn"')]}, "'unit' must be", True),
        ({"change": [('name = "mine"', 'nam = "mine"')]}, "unknown key 'nam'", True),
        ({"change": [("theta = -6.5", "theta = -6.4")]}, "strand relation", True),
        ({"stiffness": -STIFFNESS}, "step AA is not positive definite", True),
        ({"stiffness": STIFFNESS + np.triu(np.ones((3, 3)), 1)}, "not symmetric", True),
        ({"stiffness": STIFFNESS[:2]}, "3 rows of 3 numbers", True),
        ({"change": [("[steps.AA]", "[steps.AA")]}, "not valid TOML", False),
    ],
)
def test_mistakes_name_the_file_the_line_and_the_mend(tmp_path, kwargs, message, line):
    path = write_set(tmp_path / "p.toml", **kwargs)
    with pytest.raises(InputError, match=message) as caught:
        load_parameters(path)
    assert str(path) in str(caught.value)
    assert ("line" in str(caught.value)) or not line
    assert "\n" not in str(caught.value)


def test_a_stiffness_that_is_not_given_for_all_steps(tmp_path):
    path = tmp_path / "p.toml"
    write_set(path, stiffness=STIFFNESS)
    text = path.read_text()
    start = text.index("stiffness", text.index("[steps.CG]"))
    path.write_text(text[:start] + "#" + text[start:])
    with pytest.raises(InputError, match="step CG has no stiffness"):
        load_parameters(str(path))


def test_a_broken_strand_relation_passes_when_it_is_meant(tmp_path):
    path = write_set(
        tmp_path / "p.toml",
        change=[("theta = -6.5", "theta = -6.4")],
        head="strand_symmetric = false",
    )
    table = load_parameters(path)
    assert table.strand_asymmetry == pytest.approx(np.deg2rad(0.1))
    assert "strand" in build_chain(Sequence("x", "ACGTACGTACGT"), table).warnings[0]


def test_strand_relation_of_stiffness_couplings():
    ground = load_parameters("trifonov").ground
    even = np.tile(STIFFNESS, (16, 1, 1))
    assert strand_departures("hinge", ground, even).max() < 1e-12
    odd = even.copy()
    odd[:, 0, 2] = odd[:, 2, 0] = 0.2
    # phi changes sign on the other strand, so a coupling tau-phi may not be the same for all.
    assert strand_departures("hinge", ground, odd).max() > 0.1


@pytest.mark.parametrize("name", ["nowhere.toml", "trifonov3"])
def test_unknown_sets(name):
    with pytest.raises(InputError, match=name):
        load_parameters(name)
