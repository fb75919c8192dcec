"""Rings of rigid base-pair steps: another program's energies, strands, limits, bad starts."""

import csv

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from dnacheck.equilibria.discrete.kernels.search import fill_start
from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
from dnacheck.equilibria.discrete.solve import solve_ring
from dnacheck.equilibria.discrete.spectrum import ProjectedInverse
from dnacheck.model.chain import Chain, build_chain, chain_frames, elastic_energy
from dnacheck.model.data_files import data_directory
from dnacheck.model.sequence import Sequence
from dnacheck.numerics.curve_topology import edge_frames, polygon_writhe, total_twist


def published():
    with (data_directory() / "published" / "rigid_base_pair_rings.csv").open() as handle:
        return [
            (int(row["link"]), float(row["energy_kT"]), row["sequence"])
            for row in csv.DictReader(handle)
        ]


def olson(letters, name="ring"):
    return build_chain(Sequence(name, letters), "olson1998")


def random_letters(seed, n):
    return "".join(np.random.default_rng(seed).choice(list("ACGT"), n))


@pytest.mark.parametrize(("link", "energy", "letters"), published())
def test_minima_of_another_program(link, energy, letters):
    """That program's gradient norm is about 1e-4; its energies are printed to 1e-6 kT."""
    found = find_rings(olson(letters)).equilibria
    gaps = [abs(ring.energy_RT - energy) for ring in found if ring.link == link and ring.stable]
    assert min(gaps) < 2e-6


def test_the_unreversed_set_of_that_program_gives_other_energies():
    """Negative control: with complements unreversed the energies are off by whole kT."""
    link, energy, letters = published()[-1]
    chain = olson(letters)
    table = {step: (chain.ground[i], chain.stiffness[i]) for i, step in _steps(letters)}
    signs = np.array([1.0, -1.0, 1.0, -1.0, 1.0, 1.0])
    ground, stiffness = chain.ground.copy(), chain.stiffness.copy()
    for i, step in _steps(letters):
        if step in ("CT", "GT", "TC", "TG"):
            wrong = table[step.translate(str.maketrans("ACGT", "TGCA"))]
            ground[i], stiffness[i] = wrong[0] * signs, wrong[1] * np.outer(signs, signs)
    other = Chain("wrong", ground, stiffness, step_form="rigid", rise_A=chain.rise_A,
                  persistence_length_A=chain.rise_A)  # fmt: skip
    assert abs(find_rings(other).lowest.energy_RT - energy) > 0.1
    assert find_rings(chain).lowest.link == link


def _steps(letters):
    return [(i, letters[i] + letters[(i + 1) % len(letters)]) for i in range(len(letters))]


@settings(max_examples=15, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.integers(60, 200))
def test_both_strands_and_every_cut_are_one_ring(seed, n):
    letters = random_letters(seed, n)
    sequence = Sequence("ring", letters)
    here = find_rings(olson(letters))
    lowest = here.lowest
    assert lowest.stable
    assert lowest.residual < 1e-10
    assert here.failed_starts == 0
    for other in (sequence.reverse_complement().letters, letters[n // 3 :] + letters[: n // 3]):
        found = find_rings(olson(other)).lowest
        assert found.energy_RT == pytest.approx(lowest.energy_RT, rel=1e-9)
        assert found.link == lowest.link
        assert found.log_abs_det_kkt == pytest.approx(lowest.log_abs_det_kkt, abs=1e-6)


def test_a_ring_is_closed_balanced_and_its_own_energy():
    ring = find_rings(olson(random_letters(3, 90))).lowest
    centres, frames = chain_frames(ring.angles, "rigid")
    assert np.abs(centres[-1] - centres[0]).max() < 1e-10
    assert frames[-1] == pytest.approx(np.eye(3), abs=1e-10)
    assert elastic_energy(ring.chain, ring.angles) == pytest.approx(ring.energy, rel=1e-13)
    assert ring.parts[0] + ring.parts[1] == pytest.approx(ring.energy, rel=1e-13)


def dense_projected_hessian(ring):
    """Hessian of the Lagrangian on the tangent space of closure, by differences of closure."""
    chain, x = ring.chain, ring.angles.ravel().copy()
    n = x.size

    def closure(flat):
        centres, frames = chain_frames(flat.reshape(-1, 6), "rigid")
        return np.concatenate([centres[-1], Rotation.from_matrix(frames[-1]).as_rotvec()])

    hessian = np.zeros((n, n))
    for s in range(chain.n_steps):
        hessian[6 * s : 6 * s + 6, 6 * s : 6 * s + 6] = chain.stiffness[s]
    unit, h = np.eye(n), 1e-3
    for i in range(n):
        for j in range(i + 1):
            total = sum(
                a * b * (ring.multipliers @ closure(x + h * (a * unit[i] + b * unit[j])))
                for a in (1, -1) for b in (1, -1)
            )  # fmt: skip
            hessian[i, j] += total / (4.0 * h * h)
            hessian[j, i] = hessian[i, j]
    rows = np.array([(closure(x + h * e) - closure(x - h * e)) / (2.0 * h) for e in unit]).T
    null = np.linalg.svd(rows)[2][6:].T
    return hessian, rows, null


def test_spectrum_and_determinant_against_dense_algebra():
    chain = olson(random_letters(5, 20))
    # Short rings are strongly bent; soften them so that a minimum exists.
    soft = Chain("soft", chain.ground, 0.05 * chain.stiffness, step_form="rigid",
                 rise_A=chain.rise_A, persistence_length_A=chain.rise_A)  # fmt: skip
    ring = find_rings(soft).lowest
    hessian, rows, null = dense_projected_hessian(ring)
    projected = np.linalg.eigvalsh(null.T @ hessian @ null)
    assert ring.smallest_eigenvalue == pytest.approx(projected[0], rel=1e-4)
    kkt = np.block([[hessian, rows.T], [rows, np.zeros((6, 6))]])
    assert ring.log_abs_det_kkt == pytest.approx(np.linalg.slogdet(kkt)[1], abs=1e-3)
    x = np.random.default_rng(0).standard_normal((20, 6))
    expected = null @ np.linalg.solve(null.T @ hessian @ null, null.T @ x.ravel())
    assert ProjectedInverse(soft, ring.angles, ring.multipliers)(x).ravel() == pytest.approx(
        expected, rel=1e-3, abs=1e-4 * np.abs(expected).max()
    )


@pytest.mark.parametrize("link", [13, 15, 16])
def test_starts_have_the_link_they_are_asked_for(link):
    chain = olson(random_letters(8, 158))
    angles = np.empty((158, 6))
    fill_start(chain.arrays, link, 0.7, angles)
    centres, frames = chain_frames(angles, "rigid")
    assert np.abs(centres[-1] - centres[0]).max() < 1e-10
    along = np.empty_like(frames)
    edge_frames(centres, frames, along)
    exact = total_twist(along) + polygon_writhe(centres[:-1])
    assert exact == pytest.approx(link, abs=1e-9)


def test_straight_homopolymers_and_stiff_translations():
    """A poly(A) ring has a soft register; translations 1e8 stiffer leave a chain of hinges."""
    found = find_rings(olson("A" * 105), SearchOptions(links=10))
    assert found.lowest.residual < 1e-10
    chain = build_chain(Sequence("mid", random_letters(2, 150)), step_form="midstep")
    ground = np.zeros((150, 6))
    ground[:, [0, 2, 1]], ground[:, 5] = chain.ground, 1.0
    energies = []
    for factor in (1e7, 1e8):
        stiffness = np.zeros((150, 6, 6))
        for j, k in enumerate((0, 2, 1)):
            stiffness[:, k, k] = chain.stiffness[:, j, j]
        stiffness[:, [3, 4, 5], [3, 4, 5]] = factor
        rigid = Chain("limit", ground, stiffness, step_form="rigid")
        energies.append(find_rings(rigid).lowest.energy)
    assert energies[0] == pytest.approx(energies[1], rel=1e-8)
    # The two differ in second order of a step's bend: other product, other edge.
    assert energies[1] == pytest.approx(find_rings(chain).lowest.energy, rel=2e-4)


def test_a_start_far_from_closed_still_ends_in_a_minimum():
    chain = olson(random_letters(11, 120))
    lowest = find_rings(chain).lowest
    rng = np.random.default_rng(0)
    start = lowest.angles + 0.05 * rng.standard_normal(lowest.angles.shape)
    ring = solve_ring(chain, start)
    assert ring.stable
    assert ring.energy >= lowest.energy * (1.0 - 1e-9)
