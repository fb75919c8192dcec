"""``dnacheck loop`` through the command line."""

import json

import dnacheck as dc
from dnacheck import cli
from dnacheck.model.segments import between


def test_a_loop_is_that_of_the_same_piece_held_in_the_same_pose(capsys, tmp_path):
    pose = tmp_path / "pose.toml"
    pose.write_text("position_A = [0.0, 0.0, 60.0]\n")
    code = cli.main(["loop", "11T15", "--sites", "10,132", "--pose", str(pose), "--json"])
    record = json.loads(capsys.readouterr().out)
    assert code == 0
    found = dc.rings(between(dc.chain("11T15"), 10, 132), ends=dc.Loop((0.0, 0.0, 60.0)))
    assert record["equilibria"][0]["energy_RT"] == found.lowest.energy_RT
    assert record["n_bp"] == found.lowest.n_bp == 122


def test_several_records_are_refused(capsys, tmp_path):
    source = tmp_path / "two.fasta"
    source.write_text(">a\nACGTTGCATCAA\n>b\nACGTTGCATCAA\n")
    assert cli.main(["loop", str(source), "--sites", "1,11", "--pose", "absent.toml"]) == 2
    assert "2" in capsys.readouterr().err
