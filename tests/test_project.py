"""Files of the project that have to agree with one another."""

import tomllib
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
