"""``dnacheck sweep`` and ``dnacheck diagram``."""

import json

import pytest

from dnacheck.cli import main


def test_sweep_json(capsys):
    assert main(["sweep", "11T15", "--ratios", "0.5:1.5:3", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert [s["model"] for s in data["sweeps"]] == ["continuum", "discrete"]
    for sweep in data["sweeps"]:
        assert sweep["ratios"] == [0.5, 1.0, 1.5]
        assert sweep["link"] == [15, 15, 15]
        assert max(sweep["residual"]) <= 1e-10
        for energy, bend, twist in zip(sweep["energy"], sweep["bend"], sweep["twist"], strict=True):
            assert energy == pytest.approx(bend + twist)


def test_corrected_sweep_is_closer_to_the_discrete_one(capsys):
    gaps = []
    for flags in ([], ["--corrected"]):
        assert main(["sweep", "11A17", "--ratios", "1.5", "--json", *flags]) == 0
        one, two = json.loads(capsys.readouterr().out)["sweeps"]
        gaps.append(abs(one["energy"][0] / two["energy"][0] - 1.0))
    assert gaps[0] > 0.002
    assert gaps[1] < 0.001


def test_sweep_table_and_picture(capsys, tmp_path):
    picture = tmp_path / "sweep.svg"
    arguments = ["sweep", "08T15", "--ratios", "1", "--model", "discrete", "--plot", str(picture)]
    assert main(arguments) == 0
    out = capsys.readouterr()
    assert "K3/K1" in out.out
    assert str(picture) in out.err
    assert picture.read_text().lstrip().startswith("<?xml")


@pytest.mark.parametrize(
    ("ratios", "message"),
    [
        ("0:1:3", "from 0.01 to 100"),
        ("1e-300:1:3", "from 0.01 to 100"),
        ("-0.5:1:3", "from 0.01 to 100"),
        ("1:0.5:3", "below the last"),
        ("0.5:1.5", "FIRST:LAST:NUMBER"),
        ("0.5:1.5:0", "between 1"),
        ("a:b:c", "FIRST:LAST:NUMBER"),
    ],
)
def test_sweep_bad_ratios(capsys, ratios, message):
    assert main(["sweep", "11T15", f"--ratios={ratios}"]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_diagram_json_and_picture(capsys, tmp_path):
    picture = tmp_path / "diagram.png"
    assert main(["diagram", "11T15", "--json", "--plot", str(picture)]) == 0
    out = capsys.readouterr()
    data = json.loads(out.out)
    (component,) = data["components"]
    (branch,) = component["branches"]
    marks = [p for p in branch["special"] if p["kind"] == "mark"]
    assert min(p["energy"] for p in marks) == pytest.approx(10.536, abs=0.005)
    assert "closed" in branch["status"]
    assert len(branch["link"]) == len(branch["alpha"])
    assert picture.stat().st_size > 10_000


def test_perfect_diagram(capsys):
    assert main(["diagram", "perfect", "--bounds", "-0.2", "1.3"]) == 0
    assert "branch point alpha =   1.1547005" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["perfect", "--start", "1.1547005383792515"], "not isolated"),
        (["11T15", "--bounds", "4", "5"], "widen the bounds"),
        (["11T15", "--start", "60"], "another start"),
        (["11T15", "--max-points", "4"], "raise max_points"),
    ],
)
def test_diagram_that_cannot_be_finished(capsys, arguments, message):
    assert main(["diagram", *arguments]) == 3
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["11T15", "--bounds", "2", "1"], "lower bound below"),
        (["perfect", "--components"], "connected"),
        (["perfect", "--bounds", "0", "0.2", "--plot", "x.nothing"], ".png"),
    ],
)
def test_diagram_bad_input(capsys, arguments, message):
    assert main(["diagram", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_unfinished_diagram_keeps_its_points(capsys):
    assert main(["diagram", "11T15", "--max-points", "6", "--json", "--quiet"]) == 3
    (component,) = json.loads(capsys.readouterr().out)["components"]
    assert not component["ok"]
    assert len(component["branches"][0]["value"]) == 13
