"""Scenes that are read, and scenes that are refused in one line."""

import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnacheck.cli import main
from dnacheck.model.data_files import data_directory
from dnacheck.numerics.outcome import InputError
from dnacheck.validation.engine.plan import make_plan
from dnacheck.validation.engine.registry import Level
from dnacheck.validation.engine.rings import scene_chain
from dnacheck.validation.engine.state import run_key
from dnacheck.validation.scene.file import load_scene, read_scene
from dnacheck.validation.scene.line_numbers import line_numbers
from dnacheck.validation.scene.scene import FILLED_IN, shipped_scenes

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
    "mean energy too fine": (changed("energy = 0.005", "thermal_energy = 1e-5"),
                             "line 10.*0.001 or more"),
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


@pytest.mark.parametrize("case", BROKEN)
def test_exit_code_and_one_line(case, tmp_path, capsys):
    path = tmp_path / "scene.toml"
    path.write_text(BROKEN[case][0])
    assert main(["validate", str(path), "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err.strip()
    assert "\n" not in error
    assert "Traceback" not in error
    assert str(path) in error
    assert re.search(r"[;:] ", error)  # what is wrong, and the mend
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


TABLES = {
    "molecules": ("embedded", "fasta", "sequences", "homopolymers", "random"),
    "model": ("angles", "twist_ratios", "persistence_length_A", "rise_A", "a_tracts"),
    "continuum": ("filter_width", "intervals", "degree", "padding"),
    "wanted": ("energy", "continuum_energy", "shape_A", "ln_J", "thermal_energy", "rigid_ln_J"),
    "checks": ("groups", "hard_cases", "against_paper", "compare_methods"),
}
SHOWN = st.one_of(
    st.sampled_from(["true", "false", "nan", "inf", "-inf", "0", "-1", "1e-30", "1e30", '""',
                     "[]", "{}", "[[]]", "[{}]", "{x = 1}", '["11T15"]', "1979-05-27", "'all'"]),
    st.integers(-10, 10).map(str),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.text(st.characters(codec="utf-8", exclude_characters="'", categories=["L", "N", "P", "S"]),
            max_size=8).map(lambda text: f"'{text}'"),
    st.lists(st.integers(-3, 500), max_size=3).map(str),
)  # fmt: skip


@settings(max_examples=200, deadline=None)
@given(table=st.sampled_from(sorted(TABLES)), data=st.data())
def test_any_value_of_any_key_is_good_or_refused_in_one_line(tmp_path_factory, table, data):
    key, shown = data.draw(st.sampled_from(TABLES[table])), data.draw(SHOWN)
    tables = {"molecules": {"embedded": '["11T15"]'}, "wanted": {"energy": "0.005"}}
    tables.setdefault(table, {})[key] = shown
    lines = ['title = "t"']
    for name, content in tables.items():
        lines += [f"[{name}]", *(f"{k} = {v}" for k, v in content.items())]
    path = tmp_path_factory.mktemp("s") / "scene.toml"
    path.write_text("\n".join(lines))
    try:
        scene = read_scene(path)
    except InputError as error:
        message = str(error)
        assert "\n" not in message
        assert message.startswith(f"scene '{path}'")
        places = (lines.index(f"{key} = {shown}") + 1, lines.index(f"[{table}]") + 1)
        named = any(f"line {number}:" in message for number in places)
        assert named or "not valid TOML" in message, (message, lines)
    else:
        make_plan(scene, Level.FULL)


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
    from dnacheck.validation.scene.scene import Scene, scenes_directory

    text = (scenes_directory() / "template.toml").read_text()
    for name, field in Scene.model_fields.items():
        if name in FILLED_IN:
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


UNIFORM = """name = "uniform"
citation = "an example"
derived_from = "trifonov"
helical_repeat_bp = {}
"""


def with_angles(tmp_path, repeat=10.5, name="scene.toml"):
    folder = tmp_path / "elsewhere"
    folder.mkdir(exist_ok=True)
    (folder / "mine.toml").write_text(UNIFORM.format(repeat))
    path = folder / name
    path.write_text(changed("twist_ratios = [1.5]", 'angles = ["mine.toml"]'))
    return path


def test_parameter_files_are_read_beside_the_scene(tmp_path, monkeypatch):
    import numpy as np

    monkeypatch.chdir(tmp_path)
    scene = read_scene(with_angles(tmp_path))
    chain = scene_chain(scene, scene.molecule_list[0])
    assert chain.angle_set == "uniform"
    np.testing.assert_allclose(chain.ground[:, 0], 2.0 * np.pi / 10.5)


def test_results_are_kept_only_while_the_parameter_file_is_the_same(tmp_path):
    def key(scene):
        return run_key(scene, Level.QUICK, 0)

    one = key(read_scene(with_angles(tmp_path)))
    again = key(read_scene(with_angles(tmp_path)))
    other = key(read_scene(with_angles(tmp_path, 10.4)))
    assert one == again
    assert one != other


def test_a_run_with_a_parameter_file_from_another_folder(tmp_path, monkeypatch, capsys):
    scene = with_angles(tmp_path)
    monkeypatch.chdir(tmp_path)
    arguments = ["validate", str(scene), "-o", "out", "--only", "wanted.energy", "--quiet"]
    assert main(arguments) == 0, capsys.readouterr()


def test_stiffnesses_of_a_parameter_file_leave_no_room_for_a_twist_ratio(tmp_path):
    import tomllib

    parent = tomllib.loads((data_directory() / "angle_sets" / "trifonov.toml").read_text())
    lines = ['name = "stiff"', 'citation = "an example"']
    for step, angles in parent["steps"].items():
        lines += [f"[steps.{step}]"] + [f"{key} = {value}" for key, value in angles.items()]
        lines.append("stiffness = [[1.2, 0, 0], [0, 1.1, 0], [0, 0, 0.9]]")
    (tmp_path / "stiff.toml").write_text("\n".join(lines))
    scene = scene_of(tmp_path, changed("twist_ratios = [1.5]", 'angles = ["stiff.toml"]'))
    assert scene_chain(scene, scene.molecule_list[0]).stiffness[0, 1, 1] == 1.1
    with pytest.raises(InputError, match=r"line 7.*leave out twist_ratios"):
        scene_of(
            tmp_path,
            changed("twist_ratios = [1.5]", 'twist_ratios = [1.5]\nangles = ["stiff.toml"]'),
        )
