"""The check as the report calls it, and its negative controls."""

import numpy as np
import pytest
from bead_chains import ring_chain
from rods import molecule_chain

from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.md.bead_chain import sabotaged
from dnacheck.md.check import MdOptions, run_md_check
from dnacheck.md.ensemble import EnsembleOptions
from dnacheck.md.findings import Finding
from dnacheck.numerics.outcome import InputError, Status

ENERGIES_ONLY = MdOptions(minimise=None, ensemble=None)


@pytest.fixture(scope="module")
def ring(chain):
    return find_rings(chain).lowest


def test_energies_alone(chain, ring):
    check = run_md_check(chain, ring.angles, ENERGIES_ONLY)
    assert check.passed
    assert check.energy_RT == pytest.approx(ring.energy_RT, rel=1e-10)
    assert abs(check.rings[0].openmm_difference) < 1e-10
    assert [f.verdict for f in check.findings] == ["pass"] * 4
    assert check.ensemble is None
    assert check.minima == ()


@pytest.mark.parametrize("kind", ["sign", "stiffness"])
def test_a_faulty_bead_chain_fails(chain, ring, kind):
    check = run_md_check(chain, ring.angles, ENERGIES_ONLY, built_from=sabotaged(chain, kind, 11))
    assert not check.passed
    assert all(f.verdict == "fail" for f in check.findings)


def test_verdicts():
    assert Finding("x", 0.5, 1.0).verdict == "pass"
    assert Finding("x", -1.5, 1.0).verdict == "fail"
    assert Finding("x", float("nan"), 1.0).verdict == "fail"
    assert Finding("x", 0.5, 1.0, 0.4).verdict == "pass"
    assert Finding("x", 0.5, 1.0, 0.6).verdict == "inconclusive"
    assert Finding("x", 2.5, 1.0, 0.6).verdict == "fail"


def test_bad_rings_are_refused(chain, ring):
    with pytest.raises(InputError, match=r"needs \(42, 3\)"):
        run_md_check(chain, ring.angles[:-1], ENERGIES_ONLY)
    with pytest.raises(InputError, match="does not close"):
        run_md_check(chain, chain.ground, ENERGIES_ONLY)
    with pytest.raises(InputError, match="not a number"):
        run_md_check(chain, np.full_like(ring.angles, np.nan), ENERGIES_ONLY)
    with pytest.raises(InputError, match="rms_tolerance_A"):
        MdOptions(rms_tolerance_A=0.0)


@pytest.mark.md
def test_everything_at_once_and_a_blow_up_that_keeps_the_rest(chain, ring):
    options = MdOptions(ensemble=EnsembleOptions(samples=60, burn_in=40), threads=2)
    check = run_md_check(chain, ring.angles, options)
    assert check.passed, [f for f in check.findings if f.verdict == "fail"]
    assert check.statistics.frames == 120
    assert check.statistics.fluctuation_A.shape == (42,)
    assert check.harmonic_fluctuation_A.mean() == pytest.approx(
        check.statistics.fluctuation_A.mean(), rel=0.25
    )
    broken = MdOptions(ensemble=EnsembleOptions(samples=60, step_fraction=1.3))
    check = run_md_check(chain, ring.angles, broken)
    assert check.status is Status.NOT_FINITE
    assert not check.passed
    assert "blew up" in check.trouble
    assert check.minima[0].energy_RT == pytest.approx(ring.energy_RT, rel=1e-5)


@pytest.mark.md
@pytest.mark.parametrize("kind", ["sign", "stiffness"])
def test_controls_at_full_size(kind):
    chain = molecule_chain("08T15")
    ring = find_rings(chain).lowest
    for step in (0, 80):
        bad = run_md_check(
            chain, ring.angles, ENERGIES_ONLY, built_from=sabotaged(chain, kind, step)
        )
        assert not bad.passed


def test_without_rings_there_is_still_a_check():
    check = run_md_check(ring_chain(12, "tiny"), None, ENERGIES_ONLY)
    assert check.findings == ()
    assert np.isnan(check.energy_RT)
