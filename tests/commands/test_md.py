"""``dnacheck md``: what it prints, writes and refuses."""

import json

import numpy as np
import pytest
from bead_chains import ring_chain

from dnacheck import cli
from dnacheck.md.geometry import beads_of_angles, planar_ring
from dnacheck.md.trajectory import write_topology, write_trajectory
from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import embedded

KEYS = {
    "target",
    "energy_RT",
    "discrete_energy_RT",
    "relative_difference",
    "rms_A",
    "platform",
    "ensemble",
    "seconds",
}


def run(capsys, *arguments):
    code = cli.main(["md", *arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


@pytest.fixture
def files(tmp_path):
    chain = build_chain(embedded("11T15"))
    ring = planar_ring(chain, 15, 0.0, 10.0)
    positions = ring + 0.2 * np.random.default_rng(0).standard_normal((4, *ring.shape))
    write_topology(tmp_path / "ring.pdb", chain, ring)
    write_trajectory(tmp_path / "ring.dcd", chain, positions)
    return tmp_path


def test_a_users_trajectory(capsys, files):
    code, out, _ = run(
        capsys, "11T15", "--trajectory", str(files / "ring.dcd"),
        "--topology", str(files / "ring.pdb"), "--stop", "3", "--json",
    )  # fmt: skip
    record = json.loads(out)
    assert code == 0
    assert record["closed"] is True
    assert record["frames"] == 3
    assert np.shape(record["angles"]) == (3, 158, 3)
    assert len(record["elastic_RT"]) == 3


def test_a_users_trajectory_as_text(capsys, files):
    code, out, _ = run(capsys, "11T15", "--trajectory", str(files / "ring.pdb"))
    assert code == 0
    assert "ring of 158 steps, 1 frames" in out
    assert len(out.splitlines()) == 3 + 158


def test_a_trajectory_that_turns_to_nan_exits_3_and_keeps_the_frames_before(capsys, files):
    data = bytearray((files / "ring.dcd").read_bytes())
    # The last four bytes but one record mark are the last bead's z in the last frame.
    data[-8:-4] = np.float32("nan").tobytes()
    (files / "bad.dcd").write_bytes(data)
    code, out, err = run(
        capsys, "11T15", "--trajectory", str(files / "bad.dcd"),
        "--topology", str(files / "ring.pdb"), "--json",
    )  # fmt: skip
    assert code == 3
    assert json.loads(out)["frames"] == 3
    assert "frame 3: the position of bead 315" in err


def test_a_trajectory_cut_short_exits_3_and_says_how_many_frames_it_promised(capsys, files):
    data = (files / "ring.dcd").read_bytes()
    (files / "half.dcd").write_bytes(data[: len(data) // 2 + 40])
    code, out, err = run(
        capsys, "11T15", "--trajectory", str(files / "half.dcd"),
        "--topology", str(files / "ring.pdb"), "--json",
    )  # fmt: skip
    held = json.loads(out)["frames"]
    assert code == 3
    assert 0 < held < 4
    assert f"its header promises 4 frames, {held} are there" in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--trajectory", "{d}/ring.dcd"], "--topology"),
        (["--trajectory", "{d}/ring.dcd", "--topology", "{d}/small.pdb"], "cannot read"),
        (["--trajectory", "{d}/ring.dcd", "--topology", "{d}/none.pdb"], "no file"),
        (["--trajectory", "{d}/none.dcd", "--topology", "{d}/ring.pdb"], "no file"),
        (["--topology", "{d}/ring.pdb"], "belongs to --trajectory"),
        (["--resume"], "--output"),
        (["--trajectory", "{d}/small.pdb"], "beads of 42 steps"),
        (["--trajectory", "{d}/ring.pdb", "--step", "0"], "--step 0"),
        (["--trajectory", "{d}/ring.pdb", "--centres", "name X"], "make no chain"),
        (["--step-fraction", "0"], "from 0.001 to 1"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(capsys, files, arguments, message):
    small = ring_chain()
    beads = planar_ring(small, 4, 0.0, 10.0)
    write_topology(files / "small.pdb", small, beads)
    assert len(beads_of_angles(small, small.ground, False, 10.0)) == 87
    code, out, err = run(capsys, "11T15", *(a.format(d=files) for a in arguments))
    assert code == 2
    assert out == ""
    assert message in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.md
def test_json_of_a_molecule_and_the_files_of_a_run(capsys, tmp_path):
    output = tmp_path / "run"
    arguments = ["11T15", "--samples", "20", "-o", str(output), "--quiet", "--json"]
    code, out, _ = run(capsys, *arguments)
    record = json.loads(out)
    assert set(record) >= KEYS
    assert code == 0, record["findings"]
    assert abs(record["evaluated_relative_difference"]) < 1e-10
    assert abs(record["relative_difference"]) < 1e-5
    assert record["rms_A"] < 0.02
    assert record["platform"] == "Reference"
    assert record["ensemble"]["frames"] == 40
    assert {path.name for path in output.iterdir()} == {
        "checkpoints",
        "topology.pdb",
        "trajectory.dcd",
    }
    code, out, _ = run(capsys, *arguments, "--resume")
    assert json.loads(out)["ensemble"]["elastic_RT"] == record["ensemble"]["elastic_RT"]
    code, _, err = run(capsys, *arguments)
    assert code == 2
    assert "resume" in err


SHORT_SEQUENCE = "CGATTCGAGCTAGGCATCGATTCCGAGCTAGGCATCGATTCCGA"


@pytest.mark.md
def test_a_step_too_long_exits_3_and_still_reports_the_minimum(capsys):
    code, out, err = run(
        capsys, SHORT_SEQUENCE, "--samples", "20", "--step-fraction", "1.5", "--json"
    )
    assert code == 3
    assert "replica 0, before frame 0: the dynamics blew up" in err
    assert "smaller step_fraction" in err
    assert json.loads(out)["energy_RT"] > 0.0


@pytest.mark.md
def test_frames_before_a_blow_up_are_written(capsys, tmp_path, monkeypatch):
    from dnacheck.md import ensemble
    from dnacheck.md.trajectory import open_trajectory

    advance, calls = ensemble._advance, []

    def failing(run, walker, steps):
        calls.append(steps)
        return "the dynamics blew up (by order)" if len(calls) == 9 else advance(run, walker, steps)

    monkeypatch.setattr(ensemble, "_advance", failing)
    code, out, err = run(
        capsys, SHORT_SEQUENCE, "--samples", "20", "--replicas", "1", "-o", str(tmp_path / "run")
    )
    assert code == 3
    assert "replica 0, frame 7: the dynamics blew up" in err
    assert "with 7 configurations kept" in out
    universe = open_trajectory(
        tmp_path / "run" / "trajectory.dcd", tmp_path / "run" / "topology.pdb"
    )
    assert len(universe.trajectory) == 7
