"""``dnacheck ring``: what it prints, writes and refuses."""

import json

import MDAnalysis
import numpy as np
import pytest

from dnacheck import cli
from dnacheck.io.structure import write_ring_structure
from dnacheck.model.chain import build_chain, chain_frames
from dnacheck.model.molecules import embedded
from dnacheck.numerics.outcome import InputError

KEYS = {
    "model",
    "energy_RT",
    "energy_reduced",
    "bend_RT",
    "twist_RT",
    "link",
    "writhe",
    "stable",
    "smallest_eigenvalue",
    "residual",
    "iterations",
    "seconds",
    "status",
}


def run(capsys, *arguments):
    code = cli.main(["ring", *arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_json_has_the_promised_members(capsys):
    code, out, _ = run(capsys, "11T15", "--json", "--quiet")
    record = json.loads(out)
    assert code == 0
    assert {"target", "n_bp", "angles", "twist_ratio", "persistence_length_A", "rise_A"} < set(
        record
    )
    assert {"strand", "equilibria", "comparison", "warnings"} < set(record)
    assert all(set(item) == KEYS for item in record["equilibria"])
    assert record["n_bp"] == 158
    assert record["strand"] == embedded("11T15").sequence.letters
    order = [(item["model"], item["energy_RT"]) for item in record["equilibria"]]
    assert order == sorted(order)


def test_energies_are_those_of_table_2_and_their_parts_add_up(capsys):
    _, out, _ = run(capsys, "09T15", "--json", "--quiet")
    record = json.loads(out)
    lowest = {}
    for item in record["equilibria"]:
        lowest.setdefault(item["model"], item)
        assert item["bend_RT"] + item["twist_RT"] == pytest.approx(item["energy_RT"], rel=1e-9)
        assert item["energy_RT"] == pytest.approx(item["energy_reduced"] * 463.0 / 3.4, rel=1e-12)
    # Table II: 0.07292 discrete and 0.07284 continuum.
    assert lowest["discrete"]["energy_reduced"] == pytest.approx(0.07292, rel=5e-4)
    assert lowest["continuum"]["energy_reduced"] == pytest.approx(0.07284, rel=1.5e-3)
    assert lowest["discrete"]["smallest_eigenvalue"] > 0.0


def test_a_tract_steps_by_hand_change_the_ring(capsys):
    energies = []
    for choice in ("17..79", "none", "auto"):
        _, out, _ = run(capsys, "11T15", "--model", "discrete", "--a-tracts", choice, "--json")
        energies.append(json.loads(out)["equilibria"][0]["energy_RT"])
    # 17..79 is the region of 11T15 in the published sequences' header.
    assert energies[0] == energies[2]
    assert abs(energies[1] - energies[0]) > 0.1


def test_table_for_people_names_both_models(capsys):
    code, out, err = run(capsys, "11T15", "--model", "discrete", "--quiet")
    assert code == 0
    assert err == ""
    assert "discrete" in out
    assert "continuum" not in out


@pytest.mark.parametrize("angles", ["trifonov2", "olson1998"])
def test_freed_ends_cost_less_and_have_no_link(capsys, angles):
    lowest = {}
    for ends in ("ring", "nicked", "hinged"):
        arguments = ["11T15", "--ends", ends, "--angles", angles, "--model", "discrete", "--json"]
        code, out, _ = run(capsys, *arguments)
        record = json.loads(out)
        assert code == 0
        lowest[ends] = record["equilibria"][0]
        assert set(lowest[ends]) == KEYS
        assert lowest[ends]["stable"]
        assert lowest[ends]["smallest_eigenvalue"] > 0.0
    assert lowest["ring"]["link"] == 15
    assert lowest["nicked"]["link"] is None
    assert lowest["hinged"]["link"] is None
    energies = [lowest[ends]["energy_RT"] for ends in ("ring", "nicked", "hinged")]
    assert energies == sorted(energies, reverse=True)


def test_a_bad_record_is_named_and_the_rest_go_on(capsys, tmp_path):
    letters = embedded("08T15").sequence.letters
    fasta = tmp_path / "some.fasta"
    fasta.write_text(f">good\n{letters}\n>bad\nACGTNACGTACG\n>also_good\n{letters[::-1]}\n")
    code, out, err = run(capsys, str(fasta), "--model", "discrete", "--json")
    assert code == 2
    assert [item["target"] for item in json.loads(out)["molecules"]] == ["good", "also_good"]
    assert "sequence 'bad', position 5: 'N' is not one of A, C, G, T" in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["ACGTNACGTACG"], "position 5: 'N' is not one of A, C, G, T"),
        (["ACGT"], "too few"),
        ([""], "empty"),
        (["no/such/file.fasta"], "no/such/file.fasta"),
        (["11T15", "--twist-ratio", "0"], "from 0.01 to 100"),
        (["11T15", "--twist-ratio", "1e-10"], "from 0.01 to 100"),
        (["11T15", "--persistence-length", "1e-5"], "from 1 to 100000 Å"),
        (["11T15", "--rise", "1e10"], "from 0.1 to 100 Å"),
        (["11T15", "--filter-width", "60"], "filter"),
        (["11T15", "--angles", "none-such"], "none-such"),
        (["11T15", "--a-tracts", "150..160"], "157"),
        (["11T15", "--structure", "ring.xyz", "--model", "discrete"], ".pdb, .gro or .cif"),
        (["11T15", "--ends", "nicked", "--link", "15"], "--link 15"),
        (["11T15", "--ends", "hinged", "--model", "continuum"], "--model discrete"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(capsys, arguments, words):
    code, out, err = run(capsys, *arguments)
    assert code == 2
    assert out == ""
    assert words in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize("suffix", ["pdb", "gro"])
def test_structure_file_holds_the_ring(capsys, tmp_path, suffix):
    path = tmp_path / f"ring.{suffix}"
    code, out, _ = run(
        capsys, "11T15", "--model", "discrete", "--structure", str(path), "--json", "--quiet"
    )
    assert code == 0
    assert json.loads(out)["comparison"] is None
    atoms = MDAnalysis.Universe(str(path)).atoms
    assert len(atoms) == 3 * 158
    centres = atoms[0::3].positions.astype(float)
    gaps = np.linalg.norm(np.roll(centres, -1, axis=0) - centres, axis=1)
    # Closed, with the helix rise between all neighbours; a GRO file keeps 0.01 Å.
    assert np.allclose(gaps, 3.4, atol=0.02)
    radius = np.linalg.norm(atoms[1::3].positions - atoms[0::3].positions, axis=1)
    # Figure 11: 2.521 and 0.769 steps, the phosphate radius of B-DNA near 9 Å.
    assert np.allclose(radius, 3.4 * np.hypot(2.521, 0.769), atol=0.02)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_structure_file_of_an_open_chain_shows_the_gap(tmp_path):
    """Negative control: the closure that the test above finds is not put in by the writer."""
    chain = build_chain(embedded("11T15"))
    centres, frames = chain_frames(chain.ground)
    path = tmp_path / "open.pdb"
    write_ring_structure(path, centres, frames, chain.letters, chain.rise_A, "open")
    centres = MDAnalysis.Universe(str(path)).atoms[0::3].positions.astype(float)
    assert np.linalg.norm(centres[0] - centres[-1]) > 50.0


def test_structure_that_cannot_be_written_leaves_nothing(tmp_path):
    chain = build_chain(embedded("11T15"))
    centres, frames = chain_frames(chain.ground)
    with pytest.raises(InputError, match="there is no folder"):
        write_ring_structure(
            tmp_path / "missing" / "ring.pdb", centres, frames, chain.letters, 3.4, "x"
        )
    assert not list(tmp_path.iterdir())


def test_a_bound_ring_is_reported_with_its_guests(capsys):
    code = cli.main(["ring", "11T15", "--bind", "125=cap", "--json"])
    out = capsys.readouterr().out
    record = json.loads(out)
    assert code == 0
    assert record["guests"] == [{"name": "CAP", "site": 125, "steps": [120, 130]}]
    assert {item["model"] for item in record["equilibria"]} == {"discrete"}
    assert any("holds no guests" in text for text in record["warnings"])


@pytest.mark.parametrize(
    ("bind", "what"),
    [
        (["200=cap"], "site 200 lies outside"),
        (["cap"], "is not SITE=FILE"),
        (["3=nothing.par"], "nothing.par"),
        (["20=cap", "30=cap"], "held by both"),
        (["20=roll=40"], "no steps after @"),
    ],
)
def test_what_cannot_be_bound_is_bad_input(capsys, bind, what):
    arguments = [part for text in bind for part in ("--bind", text)]
    code = cli.main(["ring", "11T15", *arguments])
    captured = capsys.readouterr()
    assert code == 2
    assert captured.out == ""
    assert len(captured.err.strip().splitlines()) == 1
    assert what in captured.err
