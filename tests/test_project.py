"""Files of the project that have to agree with one another."""

import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import dnacheck

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def locked_names():
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    return {line.partition("==")[0] for line in lines if "==" in line and line[0] != " "}


def requirement_name(requirement):
    return requirement.partition(">")[0].partition("=")[0].strip().lower()


def test_one_version_everywhere(project):
    assert project["version"] == dnacheck.__version__
    assert f"version: {dnacheck.__version__}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"## {dnacheck.__version__}" in (ROOT / "CHANGELOG.md").read_text()


def test_lock_covers_every_dependency_and_names_no_place(project):
    text = (ROOT / "requirements.lock").read_text()
    assert "://" not in text
    assert "--hash=sha256:" in text
    for group in (project["dependencies"], *project["optional-dependencies"].values()):
        assert {requirement_name(item) for item in group} <= locked_names()


def test_hooks_before_a_commit_are_those_of_make_lint():
    hooks = (ROOT / ".pre-commit-config.yaml").read_text()
    rules = (ROOT / "Makefile").read_text().split("\nlint:")[1].split("\n\n")[0]
    programs = [line.split()[0] for line in rules.splitlines() if line.startswith("\t$(BIN)/")]
    assert len(programs) == 5
    entries = [line.split()[1] for line in hooks.splitlines() if line.strip().startswith("entry:")]
    assert entries == [program.replace("$(BIN)", ".venv/bin") for program in programs]


def test_a_wheel_holds_data_scenes_and_templates(tmp_path):
    program = "import sys; from hatchling.build import build_wheel; print(build_wheel(sys.argv[1]))"
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path)],
        cwd=ROOT, capture_output=True, text=True, check=True, timeout=120,
    )  # fmt: skip
    with zipfile.ZipFile(tmp_path / done.stdout.split()[-1]) as wheel:
        names = set(wheel.namelist())
    for folder, inside in (("data", "data"), ("validation/scenes", "scenes")):
        for path in (ROOT / folder).rglob("*"):
            if path.is_file() and path.name != ".gitkeep":
                assert f"dnacheck/{inside}/{path.relative_to(ROOT / folder).as_posix()}" in names
    templates = "dnacheck/validation/report/templates"
    assert {f"{templates}/report.html.j2", f"{templates}/report.js"} <= names
    assert not [name for name in names if "validation/oracles" in name]
    assert not [name for name in names if name.startswith("tests")]
