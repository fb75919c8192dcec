"""The chapter on a bound protein: what a scene of it runs, and what its checks refuse."""

import pytest

from dnacheck.numerics.outcome import InputError
from dnacheck.validation.checks import bound
from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.plan import make_plan
from dnacheck.validation.engine.registry import Level
from dnacheck.validation.engine.verdict import Verdict
from dnacheck.validation.scene.file import load_scene, read_scene

SCENE = """title = "t"

[molecules]
embedded = ["09T15"]

[wanted]
binding = 0.2
"""


def scene_of(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_text(text)
    return read_scene(path)


def test_a_scene_that_wants_only_this_runs_only_this():
    plan = make_plan(load_scene("bound_cap"), Level.DEFAULT)
    assert {check.group for check in plan.chosen} == {"bound"}


def test_other_scenes_leave_it_out():
    plan = make_plan(load_scene("default"), Level.FULL)
    assert "bound" not in {check.group for check in plan.chosen}


def test_ratios_of_a_c_shaped_molecule(tmp_path):
    context = Context(scene_of(tmp_path, SCENE), Level.QUICK, seed=1)
    found = bound.ratios(context)
    assert all(result.verdict is Verdict.PASS for result in found.results)
    assert any("control" in result.name for result in found.results)
    (row,) = found.blocks[0].rows
    assert row["shape"] == "C"
    assert 100.0 < row["ratio"] < 400.0


def test_stiff_steps_witness_the_bound_ring(tmp_path):
    context = Context(scene_of(tmp_path, SCENE), Level.QUICK, seed=1)
    results = bound.stiffened(context).results
    assert [result.verdict for result in results] == [Verdict.PASS] * 2


def test_shapes_are_those_of_the_papers_phases():
    assert [bound.shape_of(name) for name in ("08A17", "09T15", "12A09", "17A11", "mine")] == [
        "C", "C", "S", "S", "",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("more", "what"),
    [
        ("[guest]\nsteps = 'nothing.par'\n", "nothing.par"),
        ("[guest]\nsteps = 'roll=40'\n", "no steps after @"),
        ("[guest]\nat = 'GGGGGGGG'\n", "molecule '09T15' has no site"),
        ("[guest]\nat = 400\n", "molecule '09T15' has no site"),
        ("[guest]\nsite = 4\n", "unknown key 'guest.site'"),
    ],
)
def test_guests_that_cannot_be_bound_are_refused_with_their_line(tmp_path, more, what):
    with pytest.raises(InputError, match=what) as caught:
        scene_of(tmp_path, SCENE + more)
    assert "line" in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_a_guest_without_a_wish_is_refused(tmp_path):
    text = SCENE.replace("binding = 0.2", "energy = 0.01") + "[guest]\nsteps = 'cap'\n"
    with pytest.raises(InputError, match="no wish"):
        scene_of(tmp_path, text)


def test_free_rings_lead_to_bound_ones(tmp_path):
    context = Context(scene_of(tmp_path, SCENE), Level.QUICK, seed=1)
    found = bound.kinking(context)
    (result,) = found.results
    assert result.verdict is Verdict.PASS
    (line,) = found.blocks[0].data["lines"]
    assert line["x"][0] == 0.0
    assert line["x"][-1] == 1.0
