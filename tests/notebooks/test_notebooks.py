"""The notebooks are stored without output and run from beginning to end."""

import json
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "validation" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))

SMALL = {
    "continuum.ipynb": "WIDTHS = (10, 15)\nSPLINES = ((20, 5),)",
    "letters_to_j.ipynb": "TOLERANCE = 0.05\nHALVES = 5_000",
    "free_energies.ipynb": 'MOLECULES = ("09T15", "12A09")\nTOLERANCE = 0.05\nRATIOS = (1.0, 1.5)',
}
"""Settings for the tests, put in place of those of the cell tagged ``parameters``."""


def test_every_notebook_has_settings_for_the_tests():
    assert {path.name for path in NOTEBOOKS} == set(SMALL)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
def test_stored_without_output(path):
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert notebook["cells"][0]["cell_type"] == "markdown"
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            assert cell["execution_count"] is None


def with_settings(notebook, settings):
    """The notebook with the settings put in place of its own."""
    tagged = [
        cell for cell in notebook.cells if "parameters" in cell.get("metadata", {}).get("tags", [])
    ]
    assert len(tagged) == 1
    if settings:
        names = {line.partition(" =")[0] for line in settings.splitlines()}
        stored = {line.partition(" =")[0] for line in tagged[0].source.splitlines()}
        assert names <= stored
        tagged[0].source += "\n" + settings
    return notebook


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
def test_runs_on_small_settings(path, tmp_path):
    import nbformat
    from nbclient import NotebookClient

    notebook = with_settings(nbformat.read(path, as_version=4), SMALL[path.name])
    client = NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
    )
    client.execute()
    printed = [
        output
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if output.get("name") == "stderr" and "[IPKernelApp]" not in output["text"]
    ]
    assert not printed, printed
