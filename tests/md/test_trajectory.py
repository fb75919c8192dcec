"""Files that MDAnalysis reads, and the analysis that recovers angles from any of them."""

import warnings

import MDAnalysis
import numpy as np
import pytest
from bead_chains import ring_chain

from dnacheck.md.geometry import (
    beads_of_angles,
    elastic_energies_RT,
    frames_of_beads,
    per_base_pair_fluctuation,
    planar_ring,
    step_angles,
)
from dnacheck.md.trajectory import (
    bead_universe,
    missing_frames,
    open_trajectory,
    write_topology,
    write_trajectory,
)
from dnacheck.md.wedge_analysis import WedgeAngles
from dnacheck.model.chain import Chain, build_chain, uniform_stiffness
from dnacheck.model.molecules import embedded
from dnacheck.numerics.outcome import InputError, SolveError


def shaken(chain, frames=5, seed=0):
    beads = planar_ring(chain, 4, 0.3, 10.0)
    noise = np.random.default_rng(seed).standard_normal((frames, *beads.shape))
    return beads + 0.3 * noise + [40.0, -10.0, 0.0]


def memory_angles(positions, closed=True):
    return step_angles(frames_of_beads(positions, closed)[1])


@pytest.fixture
def files(tmp_path):
    chain = ring_chain(158, "long")
    positions = shaken(chain)
    write_topology(tmp_path / "ring.pdb", chain, positions[0])
    return chain, positions, tmp_path


@pytest.mark.parametrize("suffix", ["dcd", "xtc"])
def test_angles_come_back_from_files(files, suffix):
    chain, positions, path = files
    write_trajectory(path / f"ring.{suffix}", chain, positions, interval_ps=2.5)
    universe = open_trajectory(path / f"ring.{suffix}", path / "ring.pdb")
    analysis = WedgeAngles(universe, chain).run()
    expected = memory_angles(positions)
    assert analysis.closed
    # DCD holds single precision, XTC multiples of 1e-5 Å.
    tolerance = 1e-5 if suffix == "dcd" else 3e-5
    assert np.abs(analysis.results.angles - expected).max() < tolerance
    assert analysis.results.elastic_RT == pytest.approx(
        elastic_energies_RT(chain, expected), rel=1e-4
    )
    assert analysis.results.frames.shape == (5, 159, 3, 3)
    assert analysis.times == pytest.approx(2.5 * np.arange(5), rel=1e-5)
    part = WedgeAngles(universe).run(start=1, stop=5, step=2)
    assert np.array_equal(part.results.angles, analysis.results.angles[1:5:2])


def test_a_pdb_alone_is_a_trajectory_of_one_frame(files):
    chain, positions, path = files
    analysis = WedgeAngles(open_trajectory(path / "ring.pdb"), chain).run()
    # Three decimals of an Å in the file.
    assert np.abs(analysis.results.angles - memory_angles(positions[:1])).max() < 2e-3


def test_topology_reads_without_a_warning_and_names_the_base_pairs(tmp_path):
    chain = build_chain(embedded("11T15"))
    positions = planar_ring(chain, 15, 0.0, 10.0)
    write_topology(tmp_path / "ring.pdb", chain, positions)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        universe = MDAnalysis.Universe(str(tmp_path / "ring.pdb"), dt=1.0)
        centres = universe.select_atoms("name CEN").positions
    assert "".join(name[1] for name in universe.residues.resnames) == chain.letters
    assert len(universe.bonds) == 2 * chain.n_steps
    assert centres == pytest.approx(positions[0::2], abs=1e-3)


def test_an_open_chain_has_a_bare_last_centre(tmp_path):
    angles = np.tile([0.6, 0.1, -0.1], (9, 1))
    chain = Chain("open", angles, uniform_stiffness(9, 1.5))
    positions = beads_of_angles(chain, angles, False, 10.0)[None]
    write_topology(tmp_path / "open.pdb", chain, positions[0], closed=False)
    write_trajectory(tmp_path / "open.dcd", chain, positions, closed=False)
    universe = open_trajectory(tmp_path / "open.dcd", tmp_path / "open.pdb")
    analysis = WedgeAngles(universe, chain).run()
    assert not analysis.closed
    assert np.abs(analysis.results.angles[0] - angles).max() < 1e-5


def test_mdanalysis_measures_the_same_shape(files):
    from MDAnalysis.analysis.align import AlignTraj
    from MDAnalysis.analysis.rms import RMSF

    chain, positions, path = files
    write_trajectory(path / "ring.dcd", chain, positions)
    universe = open_trajectory(path / "ring.dcd", path / "ring.pdb")
    reference = bead_universe(chain)
    reference.atoms.positions = positions[0]
    centres = positions[:, 0::2]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of MDAnalysis, on masses and copies in memory
        universe.atoms.masses = np.ones(len(universe.atoms))
        group = universe.select_atoms("name CEN")
        radii = [group.radius_of_gyration() for _ in universe.trajectory]
        AlignTraj(universe, reference, select="name CEN", in_memory=True).run()
        fluctuation = RMSF(group).run().results.rmsf
    about = centres - centres.mean(axis=1, keepdims=True)
    assert radii == pytest.approx(np.sqrt(np.mean(np.sum(about**2, axis=2), axis=1)), rel=1e-5)
    own = per_base_pair_fluctuation(centres, positions[0, 0::2])
    assert own == pytest.approx(fluctuation, rel=1e-4)


def test_other_bead_names_can_be_selected(files):
    chain, _, path = files
    text = (path / "ring.pdb").read_text().replace(" CEN ", " C1  ").replace(" GRV ", " M1  ")
    (path / "other.pdb").write_text(text)
    universe = open_trajectory(path / "other.pdb")
    analysis = WedgeAngles(universe, chain, centres="name C1", grooves="name M1").run()
    assert analysis.results.angles.shape == (1, 158, 3)
    with pytest.raises(InputError, match="0 centres and 0 groove beads make no chain"):
        WedgeAngles(universe, chain)
    with pytest.raises(InputError, match="selection 'name'"):
        WedgeAngles(universe, chain, centres="name")


def test_not_a_number_names_the_frame_and_keeps_what_came_before(files):
    chain, positions, path = files
    positions[3, 7, 1] = np.nan
    universe = bead_universe(chain)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # no unit cell
        with MDAnalysis.Writer(str(path / "bad.dcd"), len(universe.atoms)) as writer:
            for frame in positions:
                universe.atoms.positions = frame
                writer.write(universe.atoms)
    analysis = WedgeAngles(open_trajectory(path / "bad.dcd", path / "ring.pdb"), chain)
    with pytest.raises(SolveError, match="frame 3: the position of bead 7") as caught:
        analysis.run()
    assert caught.value.partial.angles.shape == (3, 158, 3)
    assert len(analysis.results.elastic_RT) == 3


def test_coinciding_beads_are_named(files):
    chain, positions, path = files
    positions[0, 4] = positions[0, 2]
    write_topology(path / "bad.pdb", chain, positions[0])
    with pytest.raises(SolveError, match="base pair 1 has no frame"):
        WedgeAngles(open_trajectory(path / "bad.pdb"), chain).run()


def test_bad_files_are_named(files, tmp_path):
    chain, positions, path = files
    write_trajectory(path / "ring.dcd", chain, positions)
    short = ring_chain(42)
    write_topology(path / "short.pdb", short, shaken(short)[0])
    with pytest.raises(InputError, match="--topology"):
        open_trajectory(path / "ring.dcd")
    with pytest.raises(InputError, match="no file"):
        open_trajectory(path / "none.dcd", path / "ring.pdb")
    with pytest.raises(InputError, match="cannot read"):
        open_trajectory(path / "ring.dcd", path / "short.pdb")
    (path / "text.dcd").write_text("not a trajectory")
    with pytest.raises(InputError, match="cannot read"):
        open_trajectory(path / "text.dcd", path / "ring.pdb")
    with pytest.raises(InputError, match="beads of 42 steps, 'long' has 158"):
        WedgeAngles(open_trajectory(path / "short.pdb"), chain)
    with pytest.raises(InputError, match=r"\.dcd or \.xtc"):
        write_trajectory(path / "ring.trr", chain, positions)
    with pytest.raises(InputError, match=r"\.pdb"):
        write_topology(path / "ring.gro", chain, positions[0])
    with pytest.raises(InputError, match="cannot write"):
        write_trajectory(path / "nowhere" / "ring.dcd", chain, positions)
    assert not [p for p in path.iterdir() if p.name.startswith(".")]


def test_frames_wrapped_into_a_box_are_refused(files):
    """Positions taken modulo a box, as simulation programs write them; unwrapped they pass."""
    chain, positions, path = files
    box = 300.0
    wrapped = positions.copy()
    wrapped[2:] = np.mod(positions[2:] - positions.mean(), box)
    assert np.abs(np.diff(wrapped[2, 0::2], axis=0)).max() > 100.0
    write = {"whole": positions, "wrapped": wrapped}
    for name, frames in write.items():
        universe = bead_universe(chain)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with MDAnalysis.Writer(str(path / f"{name}.dcd"), len(universe.atoms)) as writer:
                for frame in frames:
                    universe.atoms.positions = frame
                    writer.write(universe.atoms)
    for given in (chain, None):
        whole = WedgeAngles(open_trajectory(path / "whole.dcd", path / "ring.pdb"), given).run()
        assert len(whole.results.angles) == 5
        analysis = WedgeAngles(open_trajectory(path / "wrapped.dcd", path / "ring.pdb"), given)
        with pytest.raises(SolveError, match=r"frame 2: .* unwrap the trajectory"):
            analysis.run()
        assert len(analysis.results.angles) == 2


def test_a_truncated_dcd_says_how_many_frames_it_promised(files):
    chain, positions, path = files
    write_trajectory(path / "ring.dcd", chain, positions)
    data = (path / "ring.dcd").read_bytes()
    (path / "half.dcd").write_bytes(data[: len(data) // 2])
    for name, kept in (("ring", 5), ("half", 2)):
        universe = open_trajectory(path / f"{name}.dcd", path / "ring.pdb")
        assert len(universe.trajectory) == kept
        assert missing_frames(path / f"{name}.dcd", kept) == 5 - kept
    assert missing_frames(path / "ring.pdb", 1) == 0
