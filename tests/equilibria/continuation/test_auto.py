"""The same diagram by AUTO-07p."""

import numpy as np
import pytest
from oracles import auto07p
from rods import molecule_rod

from dnacheck.equilibria.continuation import Bounds, ContinuationOptions
from dnacheck.equilibria.continuation.branch import ring_from
from dnacheck.equilibria.continuation.diagram import start_walker
from dnacheck.equilibria.continuation.follow import follow_branch
from dnacheck.equilibria.continuation.parameters import end_twist
from dnacheck.equilibria.continuum.collocation import discretise
from dnacheck.equilibria.continuum.options import ContinuumOptions
from dnacheck.equilibria.continuum.search import lowest_continuum_ring
from dnacheck.equilibria.continuum.state import new_state, run_newton, transfer


def start_on_uniform_mesh(rod):
    """Walker and spot of the lowest ring on 50 equal intervals with 4 points each."""
    ring = lowest_continuum_ring(rod).lowest
    state = new_state(discretise(rod, ring.curve.mesh, ring.curve.degree))
    curve = ring.curve
    state.slopes[:], state.loads[:], state.centres[:] = curve.slopes, curve.loads, curve.centres
    moved = transfer(state, np.linspace(0.0, 1.0, 51))
    assert run_newton(moved, moved.disc.coefficients(), ring.curve.alpha, ContinuumOptions())
    return start_walker(moved.disc, end_twist(), ContinuationOptions(), ring.curve.alpha, moved)


@pytest.mark.oracle
def test_energies_along_the_branch():
    if not auto07p.installed():
        pytest.skip("skipped: not installed (AUTO-07p with gfortran)")
    rod = molecule_rod("11T15")
    walker, spot = start_on_uniform_mesh(rod)
    ring = ring_from(walker.disc, walker.active, spot.parameter, spot.loads, spot.slopes)
    solution = ring.curve.solution(np.linspace(0.0, 1.0, 201))
    found = auto07p.follow_twist(rod, spot.parameter, solution, points=60, energy=True)
    folded = int(np.argmax(np.diff(found.alpha) < 0.0)) or len(found.alpha)
    compared = 0
    for alpha, energy, moment in zip(
        found.alpha[1:folded],
        found.energy[1:folded],
        found.end_moment[1:folded],
        strict=True,
    ):
        branch = follow_branch(walker, spot, Bounds(-10.0, alpha), both=False)
        assert branch.parameter[-1] == pytest.approx(alpha, abs=1e-12)
        assert branch.energy[-1] == pytest.approx(energy, rel=1e-6)
        assert branch.end_moment[-1] == pytest.approx(moment, rel=1e-5, abs=1e-8)
        compared += 1
    assert compared > 10


def test_absent_auto_is_told(monkeypatch):
    monkeypatch.setenv("AUTO_DIR", "/nowhere")
    monkeypatch.setattr(auto07p, "_FOLDERS", ())
    assert not auto07p.installed()
    with pytest.raises(RuntimeError, match="not installed"):
        auto07p.follow_twist(molecule_rod("11T15"), 0.0, np.zeros((201, 14)))
