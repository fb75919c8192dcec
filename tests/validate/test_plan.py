"""What a scene wants decides what runs: no model that is not needed, the cheapest that suffices."""

import json
import subprocess
import sys

import pytest

from dnacheck.validation.checks.requested.ln_j import ln_J
from dnacheck.validation.checks.requested.shapes import shape
from dnacheck.validation.checks.requested.thermal import equipartition, sampled, thermal_energy
from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.pilots import Candidate, choose
from dnacheck.validation.engine.plan import make_plan
from dnacheck.validation.engine.registry import Level
from dnacheck.validation.engine.verdict import Verdict
from dnacheck.validation.scene.file import read_scene
from dnacheck.validation.scene.scene import Wanted

SCENE = """title = "t"

[molecules]
embedded = ["09T15", "11T15"]

[wanted]
{}
"""


def scene_of(tmp_path, wanted, more=""):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(wanted) + more)
    return read_scene(path)


def chosen(scene, level=Level.DEFAULT):
    return {check.name for check in make_plan(scene, level).chosen}


def findings(tmp_path, wanted, run):
    return run(Context(scene_of(tmp_path, wanted), Level.DEFAULT, seed=3))


def rows(found, table):
    return next(block.rows for block in found.blocks if block.id == table)


@pytest.mark.parametrize("quantity", Wanted.model_fields)
def test_every_quantity_that_can_be_wanted_is_computed(quantity, tmp_path):
    chapters = {"binding": "bound.ratios", "rigid_ln_J": "rigid.molecules"}
    name = chapters.get(quantity, f"wanted.{quantity}")
    assert name in chosen(scene_of(tmp_path, f"{quantity} = 0.1"), Level.QUICK)


def test_energies_alone_load_neither_sampling_nor_dynamics(tmp_path):
    scene_of(tmp_path, "energy = 0.005")
    program = f"""
import json, sys
from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.plan import make_plan
from dnacheck.validation.engine.registry import Level
from dnacheck.validation.scene.file import load_scene
scene = load_scene({str(tmp_path / "scene.toml")!r})
checks = make_plan(scene, Level.DEFAULT).chosen
for check in checks:
    if check.group == "wanted":
        check.run(Context(scene, Level.DEFAULT, 0))
print(json.dumps([[check.name for check in checks], sorted(sys.modules)]))
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=300
    )
    names, modules = json.loads(done.stdout)
    assert names == ["wanted.energy", "discrete.derivatives"]
    assert not [name for name in modules if name.startswith(("openmm", "pymbar", "dnacheck.md"))]
    # the package's own first lines may be loaded to list its checks, a sampler may not
    sampling = ("closure", "half_chain", "umbrella", "ensembles")
    assert not [name for name in modules if name.removeprefix("dnacheck.cyclization.") in sampling]


def test_ln_j_stops_at_the_cheapest_method_that_gives_it(tmp_path):
    scene = scene_of(tmp_path, "ln_J = 0.3")
    assert chosen(scene) == {"wanted.ln_J"}
    loose = findings(tmp_path, "ln_J = 0.5", ln_J)
    assert {row["method"] for row in rows(loose, "ln-J")} == {"laplace"}
    decisions = {row["method"]: row for row in rows(loose, "pilot-ln-J")}
    assert decisions["laplace"]["decision"] == "chosen for 2 of 2"
    assert 0.2 < decisions["laplace"]["error"] < 0.5
    for dearer in ("register-laplace", "closure", "half-chain", "metropolis"):
        assert decisions[dearer]["tried"] == 0
    tight = findings(tmp_path, "ln_J = 0.1", ln_J)
    assert "laplace" not in {row["method"] for row in rows(tight, "ln-J")}
    assert all(row["error"] <= 0.1 for row in rows(tight, "ln-J"))
    decisions = {row["method"]: row["decision"] for row in rows(tight, "pilot-ln-J")}
    assert decisions["laplace"] == "left out: not accurate enough"
    assert decisions["metropolis"].startswith("left out: dearer")
    for found in (loose, tight):
        assert {result.verdict for result in found.results} == {Verdict.PASS}
        assert sum(result.control for result in found.results) == 1


def test_methods_are_compared_only_where_the_scene_asks(tmp_path):
    left_out = {
        step.check.name: step.reason
        for step in make_plan(scene_of(tmp_path, "ln_J = 0.05"), Level.FULL).steps
        if not step.run
    }
    assert "compare methods" in left_out["jfactor.pairwise"]
    asked = chosen(scene_of(tmp_path, "ln_J = 0.05", "[checks]\ncompare_methods = true\n"))
    assert {"jfactor.pairwise", "wanted.ln_J"} <= asked


def test_mean_energy_by_equipartition_where_it_is_enough(tmp_path):
    loose = findings(tmp_path, "thermal_energy = 0.01", thermal_energy)
    assert rows(loose, "pilot-thermal")[0]["decision"] == "chosen"
    assert {result.verdict for result in loose.results} == {Verdict.PASS}
    tight = findings(tmp_path, "thermal_energy = 1e-3", thermal_energy)
    assert rows(tight, "pilot-thermal")[0]["decision"] == "left out: not accurate enough"
    assert rows(tight, "pilot-thermal")[1]["decision"] == "chosen"


def test_mean_energy_of_a_stiff_chain_is_equipartition(tmp_path):
    """Ten times the stiffness leaves a tenth of what is not harmonic."""
    from dataclasses import replace

    from dnacheck.validation.engine.rings import scene_chain

    scene = scene_of(tmp_path, "thermal_energy = 0.01")
    chain = scene_chain(scene, scene.molecule_list[0])
    stiff = replace(chain, stiffness=10.0 * chain.stiffness, twist_ratio=None)
    soft, _ = sampled(chain, 0.003, 1)
    mean, error = sampled(stiff, 0.003, 1)
    assert abs(mean - equipartition(stiff)) < 0.1 * (soft - equipartition(chain)) + 3.0 * error


def test_shapes_on_the_coarsest_mesh_that_suffices(tmp_path):
    found = findings(tmp_path, "shape_A = 0.1", shape)
    assert [result.verdict for result in found.results] == [Verdict.PASS]
    assert rows(found, "pilot-shapes")[0]["decision"] == "chosen"
    assert all(0.3 < row["rms"] < 0.7 for row in rows(found, "shapes"))


def test_an_inaccurate_candidate_is_left_out_and_a_later_one_not_run():
    class Stick:
        n_steps, name = 1, "a"

    ran = []

    def giving(value, name):
        def compute(chain):
            ran.append(name)
            return value

        return Candidate(name, compute)

    candidates = [giving(v, n) for v, n in ((1.1, "bad"), (1.001, "good"), (1.0, "better"),
                                            (1.0, "best"))]  # fmt: skip
    found = choose(candidates, lambda chain: 1.0, [Stick()], 0.01)
    assert found.chosen.name == "good"
    assert found.error == pytest.approx(1e-3)
    assert "best" not in ran
    assert [row["decision"].partition(":")[0] for row in found.rows] == [
        "left out", "chosen", "left out", "left out",
    ]  # fmt: skip
