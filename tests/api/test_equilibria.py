"""One ring: the same names and units for chains and rods."""

import json

import numpy as np
import pytest
from rods import molecule_chain

import dnacheck as dc
from dnacheck.model.units import thermal_energy_pN_nm


@pytest.fixture(scope="module")
def chain():
    return dc.chain("11T15")


@pytest.fixture(scope="module")
def discrete(chain):
    return dc.rings(chain)


@pytest.fixture(scope="module")
def continuum(chain):
    return dc.rings(dc.rod(chain))


def test_every_attribute_of_the_design_in_both_models(discrete, continuum):
    for found in (discrete, continuum):
        ring = found.lowest
        assert ring.bend_RT + ring.twist_RT == pytest.approx(ring.energy_RT, rel=1e-12)
        assert ring.twist_turns + ring.writhe == pytest.approx(ring.link, abs=1e-9)
        assert ring.stable is True
        assert ring.force_pN.shape == ring.moment_pN_nm.shape == (3,)
        assert ring.coordinates_A.shape == (159, 3)
        assert ring.frames.shape == (159, 3, 3)
        assert ring.angles_deg.shape == (158, 3)
        np.testing.assert_allclose(ring.coordinates_A[0], 0.0, atol=1e-12)
        np.testing.assert_allclose(ring.coordinates_A[-1], 0.0, atol=1e-6)
        np.testing.assert_allclose(ring.frames[0], np.eye(3), atol=1e-12)
        with pytest.raises(ValueError, match="read-only"):
            ring.coordinates_A[0] = 1.0


def test_rings_are_a_sequence_lowest_first(discrete, continuum):
    for found in (discrete, continuum):
        energies = [ring.energy_RT for ring in found]
        assert energies == sorted(energies)
        assert found[0] is next(iter(found))
        assert len(found[:1]) == 1
        assert found.lowest in found.minima


def test_loads_of_chain_and_rod_are_the_same_vectors(discrete, continuum):
    """Two independent solvers, one frame, one end, one sign (measured: 3 % apart)."""
    one, two = discrete.lowest, continuum.lowest
    assert one.link == two.link
    for name in ("force_pN", "moment_pN_nm"):
        a, b = getattr(one, name), getattr(two, name)
        assert np.linalg.norm(a - b) < 0.08 * np.linalg.norm(a)
        # Negative controls: the other end's load, or another frame's, would be seen.
        assert np.linalg.norm(a + b) > np.linalg.norm(a)
        assert np.linalg.norm(a - b[[1, 0, 2]]) > 0.08 * np.linalg.norm(a)


def test_force_is_the_gradient_of_the_energy_with_respect_to_the_gap(chain, discrete):
    """dE = F . dr: loops whose ends are a little apart have energies that F predicts, pN Å."""
    ring, step = discrete.lowest, 0.05
    per_RT = 10.0 * thermal_energy_pN_nm()
    for i in range(3):
        gap = np.zeros(3)
        gap[i] = step
        energies = [
            min(
                (loop.energy_RT for loop in dc.rings(chain, ends=dc.Loop(tuple(sign * gap)))),
                key=lambda energy: abs(energy - ring.energy_RT),
            )
            for sign in (1.0, -1.0)
        ]
        slope = (energies[0] - energies[1]) / (2.0 * step) * per_RT
        assert slope == pytest.approx(ring.force_pN[i], abs=2e-3 * np.linalg.norm(ring.force_pN))


def test_dictionary_is_json_of_plain_values(discrete, continuum):
    for found in (discrete, continuum):
        text = json.dumps(found.to_dict())
        assert json.loads(text)["equilibria"][0]["energy_RT"] == found.lowest.energy_RT
        frame = found.to_frame()
        assert list(frame.columns) == list(found.lowest.to_dict())
        assert len(frame) == len(found)


def test_results_print_well(discrete, continuum):
    for found in (discrete, continuum):
        assert "11T15, 158 bp" in repr(found)
        assert "11T15" in found._repr_html_()
        assert "energy_RT" in found.lowest._repr_html_()
        assert "link 15" in repr(found.lowest)


def test_other_ends(chain):
    nicked = dc.rings(chain, ends=dc.NickedRing())
    assert nicked.lowest.energy_RT < dc.rings(chain).lowest.energy_RT
    assert dc.rings(chain, ends="nicked").lowest.energy_RT == nicked.lowest.energy_RT
    assert nicked.lowest.to_dict()["link"] is None
    assert "nicked" in repr(nicked.lowest)
    # The end is free to turn about its axis: no moment about it.
    assert abs(nicked.lowest.moment_pN_nm[2]) < 1e-6
    pulled = dc.rings(chain, ends=dc.Pull(force_pN=1.0)).lowest
    assert pulled.force_pN == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)


def test_written_and_drawn(tmp_path, discrete, continuum):
    from matplotlib.figure import Figure

    for found in (discrete, continuum):
        path = tmp_path / f"{found.model}.pdb"
        found.lowest.write(path)
        assert path.read_text().count("\nATOM") == 3 * 158
        ax = Figure().add_subplot()
        assert found.lowest.plot(ax) is ax
        assert len(ax.lines) == 3


def test_rigid_steps_have_six_numbers():
    ring = dc.rings(dc.chain("11T15", parameters="olson1998", a_tracts="none")).lowest
    assert ring.angles_deg.shape == (158, 6)
    # Mean twist near 34 degrees and mean rise near 3.4 Å, as in every crystal of B-DNA.
    assert 30.0 < ring.angles_deg[:, 0].mean() < 38.0
    assert 3.1 < ring.angles_deg[:, 5].mean() < 3.6


def test_a_link_without_a_ring_is_a_solve_error_that_holds_the_search(chain):
    with pytest.raises(dc.SolveError, match="no stable ring of link 40") as error:
        dc.rings(chain, link=40)
    assert error.value.partial.links_searched == (40,)
    kept = dc.rings(chain, link=40, throw=False)
    assert len(kept) == 0
    with pytest.raises(dc.SolveError):
        _ = kept.lowest


def test_ratios_and_diagram_as_tables(chain):
    table = dc.twist_ratio_scan(chain, [0.8, 1.5]).to_frame()
    ring = dc.rings(chain).lowest
    assert table["energy_RT"].iloc[1] == pytest.approx(ring.energy_RT, rel=1e-8)
    assert list(table["link"]) == [15, 15]
    rod = dc.rod(molecule_chain("11T15"))
    alpha = dc.rings(rod).lowest.curve.alpha / (2.0 * np.pi)
    found = dc.diagram(rod, bounds=(alpha - 0.05, alpha + 0.05))
    points = found.to_frame()
    assert points["alpha"].between(alpha - 0.06, alpha + 0.06).all()
    assert points["energy"].min() <= dc.rings(rod).lowest.energy_RT
