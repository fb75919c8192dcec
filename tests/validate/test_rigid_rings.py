"""The chapter on rigid base-pair rings: what a scene of it runs, and what its checks refuse."""

from dataclasses import replace

import pytest

from dnacheck.model.parameters import load_parameters, strand_report
from dnacheck.numerics.outcome import InputError
from dnacheck.validation.checks import rigid
from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.plan import make_plan
from dnacheck.validation.engine.registry import Level
from dnacheck.validation.engine.verdict import Verdict
from dnacheck.validation.scene.file import load_scene, read_scene

SCENE = """title = "t"

[molecules]
embedded = ["11T15"]

[wanted]
rigid_ln_J = {}
"""


def scene_of(tmp_path, accuracy):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(accuracy))
    return read_scene(path)


def context_of(tmp_path):
    return Context(scene_of(tmp_path, 0.05), Level.QUICK, seed=1)


def test_a_scene_that_wants_only_this_runs_only_this():
    plan = make_plan(load_scene("rigid_rings"), Level.DEFAULT)
    assert {check.group for check in plan.chosen} == {"rigid"}


def test_the_default_scene_has_it_and_the_quick_one_has_not():
    names = {
        scene: {check.group for check in make_plan(load_scene(scene), Level.DEFAULT).chosen}
        for scene in ("default", "quick", "bound_cap")
    }
    assert {scene for scene, groups in names.items() if "rigid" in groups} == {"default"}


def test_every_printed_ring_is_found(tmp_path):
    found = rigid.outside(context_of(tmp_path))
    assert all(result.verdict is Verdict.PASS for result in found.results)
    assert sum(result.control for result in found.results) == 2
    (table,) = found.blocks
    assert len(table.rows) == 4
    assert all(abs(row["difference"]) < 2e-6 for row in table.rows)


def test_rings_of_another_set_are_refused(tmp_path, monkeypatch):
    """The chapter by the unreversed set: the strands differ, and no printed ring is found."""
    wrong = rigid.unreversed_set()
    real = load_parameters

    def swapped(name):
        return wrong if name == rigid.SET else real(name)

    monkeypatch.setattr("dnacheck.model.chain.load_parameters", swapped)
    results = rigid.outside(context_of(tmp_path)).results
    rings = [r for r in results if "[ring" in r.name]
    assert [result.verdict for result in rings] == [Verdict.FAIL] * 4
    strands = [
        result
        for result in rigid.molecules(context_of(tmp_path)).results
        if result.name == "rigid.molecules[strands]"
    ]
    assert [result.verdict for result in strands] == [Verdict.FAIL]


def test_the_unreversed_set_breaks_the_strand_relation_on_four_pairs_of_steps():
    wrong = rigid.unreversed_set()
    right = load_parameters(rigid.SET)
    departure, broken, _ = strand_report(wrong.kind, wrong.ground, wrong.stiffness)
    assert right.strand_symmetric
    assert departure == wrong.strand_asymmetry > 0.01
    assert set(broken) == {"CT", "AG", "GT", "AC", "TC", "GA", "TG", "CA"}
    assert replace(wrong, strand_asymmetry=0.0).strand_note == ""


def test_a_molecule_by_both_sets_beside_experiment(tmp_path):
    found = rigid.molecules(context_of(tmp_path))
    assert all(result.verdict is Verdict.PASS for result in found.results)
    assert {r.name for r in found.results if r.control} == {
        "rigid.molecules[strands, control]", "rigid.molecules[11T15, control]",
    }  # fmt: skip
    (row,) = found.blocks[0].rows
    assert row["experiment"] == 16.2
    assert row["trifonov_minus_lnJ"] == pytest.approx(16.16, abs=0.1)
    assert row["olson_minus_lnJ"] > row["trifonov_minus_lnJ"] + 3.0


def test_deviations_from_experiment_by_hand():
    rows = [{"a_minus_lnJ": 21.0, "experiment": 20.0}, {"a_minus_lnJ": 20.0, "experiment": 17.0}]
    apart = rigid.against_experiment(rows, "a")
    assert apart == pytest.approx({"mean": 2.0, "rms": 5.0**0.5, "spread": 1.0, "largest": 3.0})


def test_an_accuracy_that_no_sampling_reaches_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"line 7: an error of 0\.0001 on ln J"):
        scene_of(tmp_path, 1e-4)
