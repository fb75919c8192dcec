"""References of the work-precision diagram, and what it does not show."""

import pytest

from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import embedded
from dnacheck.model.rod import build_rod
from dnacheck.validation.checks import speed
from dnacheck.validation.engine.plan import make_plan
from dnacheck.validation.engine.registry import Level
from dnacheck.validation.scene.file import load_scene


@pytest.fixture(scope="module")
def rod():
    return build_rod(build_chain(embedded("11T15")))


@pytest.fixture(scope="module")
def reference(rod):
    return speed.continuum_reference(rod)


def test_the_reference_is_far_finer_than_what_it_judges(rod, reference):
    ring, doubt = reference
    assert doubt < 1e-13
    floor = speed.FINER * doubt
    lines = [*speed.collocation_lines(rod, ring, floor), speed.adapted_line(rod, ring, floor)]
    for line in lines:
        assert len(line.points) == len(line.errors) == len(line.seconds) > 3
        assert min(line.errors) >= floor
        assert line.errors[-1] < 1e-4 * line.errors[0]


def test_errors_that_the_reference_cannot_tell_are_not_shown():
    line = speed.Line("x")
    line.add("coarse", 1e-3, 0.1, 1e-9)
    line.add("too fine", 1e-12, 0.2, 1e-9)
    assert line.points == ["coarse"]


def test_newton_s_errors_against_a_relabelled_ring():
    line, doubt = speed.newton_line(build_chain(embedded("11T15")))
    assert doubt < 1e-12
    assert line.errors[0] < 1e-3


def test_an_independent_solver_is_in_the_diagram(rod, reference):
    ring, doubt = reference
    line = speed.bvp_line(rod, ring, speed.FINER * doubt, (1e-2,))
    assert line.errors[0] < 1e-4


def test_absent_auto_is_told(rod, reference, monkeypatch):
    monkeypatch.setattr(speed, "oracle_exists", lambda name: False)
    assert "AUTO-07p" in speed.auto_line(rod, reference[0], 0.0, (20,))


def test_the_diagram_belongs_to_scenes_that_compare():
    def run(name):
        plan = make_plan(load_scene(name), Level.DEFAULT)
        return "speed.ring_energy" in {check.name for check in plan.chosen}

    assert run("default")
    assert not run("library")
