"""Structure files: what a format holds is known before, and long rings come back."""

import gzip
import io
import os
import stat
import tempfile
from pathlib import Path

import MDAnalysis
import numpy as np
import pytest
from Bio.PDB.MMCIF2Dict import MMCIF2Dict

from dnacheck.cli import main
from dnacheck.io.structure import (
    LARGEST_PDB_RING,
    structure_file,
    sugar_phosphate_helices,
    write_ring_structure,
)
from dnacheck.numerics.outcome import InputError

RISE_A = 3.4


def circle(n):
    """Centres and frames (N+1) of a planar circle in steps, and some letters."""
    azimuth = 2.0 * np.pi * np.arange(n + 1) / n
    radius = 0.5 / np.sin(np.pi / n)
    centres = radius * np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(n + 1)], axis=1)
    outward = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(n + 1)], axis=1)
    up = np.tile([0.0, 0.0, 1.0], (n + 1, 1))
    along = np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros(n + 1)], axis=1)
    frames = np.stack([up, outward, along], axis=2)
    letters = "".join(np.random.default_rng(n).choice(list("ACGT"), n))
    return centres, frames, letters


def written(path, n):
    centres, frames, letters = circle(n)
    write_ring_structure(path, centres, frames, letters, RISE_A, f"circle {n}")
    first, second = sugar_phosphate_helices(centres[:-1], frames[:-1])
    expected = RISE_A * np.stack([centres[:-1], first, second], axis=1).reshape(-1, 3)
    return expected - expected.mean(axis=0), letters


def read_back(path):
    """Positions, residue numbers and residue names of the centres."""
    suffixes = [s for s in path.suffixes if s in (".pdb", ".gro", ".cif", ".gz")]
    if suffixes[0] == ".cif":
        stored = path.read_bytes()
        text = gzip.decompress(stored) if suffixes[-1] == ".gz" else stored
        data = MMCIF2Dict(io.StringIO(text.decode()))
        positions = np.stack([np.array(data[f"_atom_site.Cartn_{x}"], float) for x in "xyz"], 1)
        numbers = [int(i) for i in data["_atom_site.label_seq_id"][0::3]]
        return positions, numbers, data["_atom_site.label_comp_id"][0::3]
    with tempfile.TemporaryDirectory() as folder:
        if suffixes[-1] == ".gz":
            plain = Path(folder) / f"ring{suffixes[0]}"
            plain.write_bytes(gzip.decompress(path.read_bytes()))
            path = plain
        universe = MDAnalysis.Universe(str(path))
        return (
            universe.atoms.positions.astype(float),
            universe.residues.resids.tolist(),
            universe.residues.resnames.tolist(),
        )


@pytest.mark.parametrize(
    ("n", "name", "grid_A"),
    [
        (150, "r.pdb", 0.001),
        (150, "r.GRO", 0.01),
        (150, "r.cif", 0.001),
        (150, "r.pdb.gz", 0.001),
        (150, "r.gro.gz", 0.01),
        (1_850, "r.pdb", 0.001),
        (1_850, "r.cif", 0.001),
        (5_000, "r.pdb", 0.001),
        (5_000, "r.gro", 0.01),
        (5_000, "r.cif.gz", 0.001),
        (40_000, "r.gro", 0.01),
        (40_000, "r.cif", 0.001),
    ],
)
def test_rings_come_back_as_they_were_written(n, name, grid_A, tmp_path):
    path = tmp_path / name
    expected, letters = written(path, n)
    path = path.rename(tmp_path / name.lower())
    positions, numbers, residues = read_back(path)
    # half a unit of the last column, and single precision of the readers
    bound = 0.5 * grid_A + 4.0 * np.finfo(np.float32).eps * np.abs(positions).max() + 1e-9
    moved = positions - expected
    assert np.ptp(moved, axis=0).max() <= 2.0 * bound
    assert numbers == list(range(1, n + 1))
    assert residues == [f"D{letter}" for letter in letters]


@pytest.mark.parametrize("name", ["r.pdb", "r.gro", "r.cif"])
def test_a_ring_that_fits_is_centred(name, tmp_path):
    written(tmp_path / name, 500)
    positions, _, _ = read_back(tmp_path / name)
    assert np.abs(positions.mean(axis=0)).max() < 0.01


@pytest.mark.parametrize(
    ("name", "n", "message"),
    [
        ("r.xyz", 100, "must end in .pdb, .gro or .cif"),
        ("r", 100, "must end in"),
        ("r.gz", 100, "must end in"),
        ("r.pdb", LARGEST_PDB_RING + 1, "numbers at most 9999 base pairs, this ring has 10000"),
        ("r.pdb", 8_000, "may be wider than the columns .* write a .cif file"),
        ("r.gro", 100_000, "may be wider than the columns .* write a .cif file"),
        ("absent/r.pdb", 100, "there is no folder"),
        ("r.cif", 100, None),
    ],
)
def test_what_cannot_be_written_is_known_before(name, n, message, tmp_path):
    if message is None:
        assert structure_file(tmp_path / name, 10**6, RISE_A).suffix == ".cif"
        return
    with pytest.raises(InputError, match=message):
        structure_file(tmp_path / name, n, RISE_A)


def test_any_ring_up_to_the_bound_fits_the_columns(tmp_path):
    """The widest closed curve is folded flat: half its length across."""
    n = 6_000
    half = n // 2
    along = np.concatenate([np.arange(half), np.arange(half, 0, -1), [0]]).astype(float)
    centres = np.stack([along, np.zeros(n + 1), np.zeros(n + 1)], axis=1)
    frames = np.tile(np.eye(3), (n + 1, 1, 1))
    write_ring_structure(tmp_path / "r.pdb", centres, frames, "A" * n, RISE_A, "flat")
    positions, _, _ = read_back(tmp_path / "r.pdb")
    assert np.ptp(positions[:, 0]) == pytest.approx(RISE_A * half, abs=20.0)


def test_an_open_chain_too_wide_for_the_columns_is_refused(tmp_path):
    n = 5_000
    centres = np.arange(n + 1)[:, None] * np.array([1.0, 0.0, 0.0])
    frames = np.tile(np.eye(3), (n + 1, 1, 1))
    with pytest.raises(InputError, match="wider than the columns"):
        write_ring_structure(tmp_path / "r.pdb", centres, frames, "A" * n, RISE_A, "open")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["r.pdb", "r.gro", "r.cif", "r.pdb.gz"])
def test_mode_follows_the_umask(name, tmp_path):
    old = os.umask(0o027)
    try:
        written(tmp_path / name, 60)
    finally:
        os.umask(old)
    assert stat.S_IMODE((tmp_path / name).stat().st_mode) == 0o640


@pytest.mark.parametrize("name", ["r.xyz", "absent/r.pdb"])
def test_the_command_refuses_before_it_solves(name, tmp_path, monkeypatch, capsys):
    from dnacheck.equilibria.discrete import search

    def solving(*arguments):
        raise AssertionError("solved before the structure file was checked")

    monkeypatch.setattr(search, "find_rings", solving)
    path = tmp_path / name
    assert main(["ring", "11T15", "--model", "discrete", "--structure", str(path)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1


def test_the_table_comes_even_if_the_file_does_not(tmp_path, monkeypatch, capsys):
    from dnacheck.io import structure

    def full(path, content):
        raise InputError(f"cannot write '{path}': No space left on device")

    monkeypatch.setattr(structure, "atomic_write", full)
    words = ["ring", "11T15", "--model", "discrete", "--structure", str(tmp_path / "r.pdb")]
    assert main(words) == 2
    captured = capsys.readouterr()
    assert captured.out.startswith("11T15: 158 bp")
    assert "No space left" in captured.err
