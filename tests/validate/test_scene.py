"""Scenes that are read, and scenes that are refused in one line."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnacheck.cli import main
from dnacheck.numerics.outcome import InputError
from dnacheck.validate.plan import make_plan
from dnacheck.validate.registry import Level
from dnacheck.validate.scene import shipped_scenes
from dnacheck.validate.scene_file import load_scene, read_scene
from dnacheck.validate.toml_lines import line_numbers

GOOD = """title = "t"

[molecules]
embedded = ["11T15"]

[model]
twist_ratios = [1.5]

[wanted]
energy = 0.005
"""


def scene_of(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_text(text)
    return read_scene(path)


def changed(old, new):
    assert old in GOOD
    return GOOD.replace(old, new)


BROKEN = {
    "not TOML": ("title = ", "not valid TOML"),
    "empty": ("", "missing"),
    "no title": (changed('title = "t"', ""), "'title' is missing"),
    "no wish": (changed("energy = 0.005", ""), "nothing is wanted"),
    "no wanted": (GOOD[: GOOD.index("[wanted]")], "'wanted' is missing"),
    "no molecules": (changed('[molecules]\nembedded = ["11T15"]', ""), "'molecules' is missing"),
    "no molecule": (changed('embedded = ["11T15"]', ""), "no molecule"),
    "unknown key": (changed("twist_ratios", "twist_ratio"), "line 7.*did you mean 'twist_ratios'"),
    "unknown table": (GOOD + "\n[models]\nx = 1\n", "line 12.*did you mean 'model'"),
    "unknown quantity": (changed("energy = 0.005", "enegy = 0.005"), "line 10.*'energy'"),
    "reserved key": ('resolved = "x"\n' + GOOD, "line 1.*remove it"),
    "text for a number": (changed("0.005", '"small"'), "line 10.*number"),
    "number for text": (changed('"t"', "3"), "line 1.*string"),
    "bool for a number": (changed("0.005", "true"), "line 10.*number"),
    "negative accuracy": (changed("0.005", "-1.0"), "line 10.*greater than 0"),
    "zero accuracy": (changed("0.005", "0"), "line 10.*greater than 0"),
    "accuracy not a number": (changed("0.005", "nan"), "line 10"),
    "infinite accuracy": (changed("0.005", "inf"), "line 10.*finite"),
    "too fine": (changed("0.005", "1e-15"), "line 10.*double precision"),
    "ln J too fine": (changed("energy = 0.005", "ln_J = 1e-5"), "line 10.*0.002 or more"),
    "ratio zero": (changed("[1.5]", "[0.0]"), "line 7.*greater than 0"),
    "no ratio": (changed("[1.5]", "[]"), "line 7"),
    "ratio a number": (changed("[1.5]", "1.5"), "line 7.*list"),
    "unknown molecule": (changed("11T15", "11X15"), "line 4.*not embedded"),
    "twice": (changed('["11T15"]', '["11T15", "11T15"]'), "two molecules are called '11T15'"),
    "bad letters": (GOOD + '\n[molecules.sequences]\nx = "ACGTNACGTACGT"\n', "line 13.*'N'"),
    "short sequence": (GOOD + '\n[molecules.sequences]\nx = "ACGT"\n', "line 13.*too few"),
    "absent FASTA": (
        changed('embedded = ["11T15"]', 'fasta = ["no.fasta"]'), "line 4.*check the path"
    ),
    "absent angle set": (
        changed("twist_ratios = [1.5]", 'angles = ["nobody"]'), "line 7.*parameter file"
    ),
    "wide filter": (GOOD + "\n[continuum]\nfilter_width = 60\n", "line 13.*raise padding"),
    "float for a count": (GOOD + "\n[continuum]\nintervals = 2.5\n", "line 13.*integer"),
    "too many coefficients": (
        GOOD + "continuum_energy = 1e-4\n\n[continuum]\nintervals = 200\n", "line 14.*lower"
    ),
    "unknown group": (GOOD + '\n[checks]\ngroups = ["table3"]\n', "line 13.*'table2'"),
    "against the paper with strangers": (
        GOOD + "\n[molecules.homopolymers]\nA = [100]\n\n[checks]\nagainst_paper = true\n",
        "line 16.*the paper has no value",
    ),
    "against the paper at another ratio": (
        changed("[1.5]", "[1.0]") + "\n[checks]\nagainst_paper = true\n", "line 13.*1.5"
    ),
    "random count": (GOOD + "\n[molecules.random]\ncount = 0\n", "line 13.*greater than"),
    "random order": (
        GOOD + "\n[molecules.random]\ncount = 1\nshortest = 90\nlongest = 80\n", "exceeds longest"
    ),
    "huge homopolymer": (GOOD + "\n[molecules.homopolymers]\nA = [1000000]\n", "line 13.*at most"),
}  # fmt: skip


def test_the_good_scene_is_good(tmp_path):
    assert scene_of(tmp_path, GOOD).wants == ("energy",)


@pytest.mark.parametrize("case", BROKEN)
def test_broken_scenes_are_refused_in_one_line(case, tmp_path):
    text, message = BROKEN[case]
    with pytest.raises(InputError, match=message) as caught:
        scene_of(tmp_path, text)
    assert "\n" not in str(caught.value)
    assert "scene.toml" in str(caught.value)


def test_there_are_thirty_broken_scenes():
    assert len(BROKEN) >= 30


@pytest.mark.parametrize("case", ["unknown key", "bad letters", "not TOML"])
def test_exit_code_and_one_line(case, tmp_path, capsys):
    path = tmp_path / "scene.toml"
    path.write_text(BROKEN[case][0])
    assert main(["validate", str(path), "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err.strip()
    assert "\n" not in error
    assert "Traceback" not in error
    assert not (tmp_path / "out").exists()


values = st.one_of(
    st.none(), st.booleans(), st.integers(-5, 5), st.floats(), st.text(max_size=5),
    st.lists(st.integers(), max_size=2),
)  # fmt: skip


@given(key=st.from_regex(r"[a-z_]{1,12}", fullmatch=True), value=values)
def test_any_extra_key_is_refused(tmp_path_factory, key, value):
    path = tmp_path_factory.mktemp("s") / "scene.toml"
    shown = {True: "true", False: "false"}.get(value) if isinstance(value, bool) else repr(value)
    path.write_text(GOOD + f"\n[continuum]\nz{key} = {shown}\n")
    with pytest.raises(InputError) as caught:
        read_scene(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", shipped_scenes())
def test_shipped_scenes_are_valid_and_plan_something(name):
    scene = load_scene(name)
    assert make_plan(scene, Level.DEFAULT).chosen


def test_a_new_scene_is_the_template_and_never_overwrites(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    assert main(["validate", "--new-scene", str(path), "--quiet"]) == 0
    assert read_scene(path).wants == ("energy",)
    assert main(["validate", "--new-scene", str(path)]) == 2
    assert "exists" in capsys.readouterr().err


def test_the_template_names_every_key():
    from dnacheck.validate.scene import Scene, scenes_directory

    text = (scenes_directory() / "template.toml").read_text()
    for name, field in Scene.model_fields.items():
        if name in ("source", "resolved"):
            continue
        assert re.search(rf"\b{name}\b", text), name
        for key in getattr(field.annotation, "model_fields", {}):
            assert re.search(rf"\b{key}\b", text), key


def test_energies_to_half_a_percent_need_no_sampling_and_no_dynamics(tmp_path):
    plan = make_plan(scene_of(tmp_path, GOOD), Level.DEFAULT)
    assert {check.group for check in plan.chosen} == {"wanted", "discrete"}
    left_out = {step.check.group: step.reason for step in plan.steps if not step.run}
    assert "ln_J" in left_out["jfactor"]
    assert "thermal_energy" in left_out["bead_chain"]


def test_random_molecules_are_the_same_for_the_same_seed(tmp_path):
    extra = "\n[molecules.random]\ncount = 3\nseed = {}\n"
    one, again, other = (
        [m.sequence.letters for m in scene_of(tmp_path, GOOD + extra.format(s)).molecule_list]
        for s in (1, 1, 2)
    )
    assert one == again
    assert one != other


def test_line_numbers_of_nested_and_multi_line_values():
    text = (
        '[a]\nx = [\n 1,\n]\n\n["b c"]\n\n"y z".w = 1\n[[t]]\nk = """\nk = 2\n"""\n[[t]]\nk = 1\n'
    )
    lines = line_numbers(text)
    assert lines["a", "x"] == 2
    assert lines["b c", "y z", "w"] == 8
    assert lines["t", 0, "k"] == 10
    assert lines["t", 1, "k"] == 14


def test_paths_are_relative_to_the_scene(tmp_path):
    (tmp_path / "sub").mkdir()
    Path(tmp_path / "sub" / "x.fasta").write_text(">one\nACGTACGTACGTACGT\n")
    text = changed('embedded = ["11T15"]', 'fasta = ["sub/x.fasta"]')
    assert [m.name for m in scene_of(tmp_path, text).molecule_list] == ["one"]
