"""Discrete rings: derivatives, spectra and equilibria against dense algebra and the paper."""

import csv

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from dnacheck.equilibria.discrete.kernels.closure import closure_jacobian, linearise
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.equilibria.discrete.solve import NewtonOptions, solve_ring
from dnacheck.equilibria.discrete.spectrum import ProjectedInverse
from dnacheck.model.chain import Chain, build_chain, chain_frames, elastic_energy, uniform_stiffness
from dnacheck.model.data_files import data_directory
from dnacheck.model.molecules import embedded, embedded_names
from dnacheck.model.sequence import Sequence
from dnacheck.numerics.outcome import InputError, SolveError, Status

FORMS = ("wedge", "midstep")


def closure(chain, flat):
    """End-to-end vector and end rotation vector by scipy, independent of the kernels' logarithm."""
    centres, frames = chain_frames(flat.reshape(-1, 3), chain.step_form)
    return np.concatenate([centres[-1], Rotation.from_matrix(frames[-1]).as_rotvec()])


def jacobian(chain, angles):
    n = chain.n_steps
    centres, frames, axes = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3)), np.empty((n, 3, 3))
    halves = np.empty((n if chain.form_code else 0, 5, 3))
    linearise(angles, chain.form_code, centres, frames, axes, halves)
    out = np.empty((6, 3 * n))
    closure_jacobian(centres, axes, out)
    return out


def central(function, x, h):
    """Central differences of a vector function, columns by entries of x."""
    columns = []
    for i in range(x.size):
        ahead, behind = x.copy(), x.copy()
        ahead[i] += h
        behind[i] -= h
        columns.append((function(ahead) - function(behind)) / (2.0 * h))
    return np.array(columns).T


def small_ring(form="wedge", n=24, seed=1, coupled=True):
    """A relaxed ring of a short random chain, with full stiffness matrices if coupled."""
    rng = np.random.default_rng(seed)
    letters = "".join(rng.choice(list("ACGT"), n))
    chain = build_chain(Sequence("small", letters), step_form=form)
    stiffness = chain.stiffness
    if coupled:
        root = 0.3 * rng.standard_normal((n, 3, 3))
        stiffness = stiffness + root @ root.transpose(0, 2, 1)
    return find_rings(Chain("small", chain.ground, stiffness, step_form=form)).lowest


def dense_hessian(ring):
    """Hessian of energy + multipliers . closure by differences of closure itself."""
    chain, x = ring.chain, ring.angles.ravel().copy()
    n = x.size
    hessian = np.zeros((n, n))
    for i in range(chain.n_steps):
        hessian[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = chain.stiffness[i]

    def pull(flat):
        return ring.multipliers @ closure(chain, flat)

    h = 2e-4
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for si, sj in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
                y = x.copy()
                y[i] += si * h
                y[j] += sj * h
                total += si * sj * pull(y)
            hessian[i, j] += total / (4.0 * h * h)
            if j < i:
                hessian[j, i] = hessian[i, j]
    return hessian


@settings(max_examples=15)
@given(st.integers(0, 10_000), st.integers(4, 12), st.sampled_from(FORMS))
def test_closure_jacobian_is_the_derivative_at_any_angles(seed, n, form):
    rng = np.random.default_rng(seed)
    chain = Chain("x", np.zeros((n, 3)), uniform_stiffness(n, 1.5), step_form=form)
    angles = rng.uniform(-1.2, 1.2, (n, 3))
    end = chain_frames(angles, form)[1][-1]

    def moved(flat):
        centres, frames = chain_frames(flat.reshape(-1, 3), form)
        turn = Rotation.from_matrix(frames[-1] @ end.T).as_rotvec()
        return np.concatenate([centres[-1], turn])

    expected = central(moved, angles.ravel(), 1e-6)
    found = jacobian(chain, angles)
    assert found == pytest.approx(expected, abs=1e-6)
    # Negative control: one wrong sign in an axis is far outside the same tolerance.
    found[:, 1::3] *= -1.0
    assert not np.allclose(found, expected, atol=1e-3)


@pytest.mark.parametrize("form", FORMS)
def test_ring_satisfies_the_equations_written_down_densely(form):
    ring = small_ring(form)
    x = ring.angles.ravel()
    strain = ring.angles - ring.chain.ground
    gradient = np.einsum("ijk,ik->ij", ring.chain.stiffness, strain).ravel()
    slope = central(lambda y: closure(ring.chain, y), x, 1e-6)
    assert np.abs(closure(ring.chain, x)).max() < 1e-10
    assert gradient + slope.T @ ring.multipliers == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("form", FORMS)
def test_spectrum_is_that_of_dense_algebra(form):
    ring = small_ring(form, n=18, seed=5)
    hessian = dense_hessian(ring)
    rows = jacobian(ring.chain, ring.angles)
    basis = np.linalg.svd(rows)[2][6:].T
    projected = basis.T @ hessian @ basis
    values = np.linalg.eigvalsh(projected)
    kkt = np.block([[hessian, rows.T], [rows, np.zeros((6, 6))]])
    assert ring.stable
    assert ring.smallest_eigenvalue == pytest.approx(values[0], rel=1e-5)
    assert ring.log_abs_det_kkt == pytest.approx(np.linalg.slogdet(kkt)[1], abs=1e-5)
    vector = np.random.default_rng(0).standard_normal((ring.chain.n_steps, 3))
    applied = ProjectedInverse(ring.chain, ring.angles, ring.multipliers)(vector)
    expected = basis @ np.linalg.solve(projected, basis.T @ vector.ravel())
    assert applied.ravel() == pytest.approx(expected, abs=1e-5)


def test_saddle_has_the_inertia_of_dense_algebra():
    """Newton without descent, started half way round from the minimum of a curved molecule."""
    chain = build_chain(embedded("11T15"))
    both = find_rings(chain).lowest
    from dnacheck.equilibria.discrete.kernels.starts import fill_circle

    saddle = None
    for register in np.arange(0.0, 2.0 * np.pi, np.pi / 8):
        start = np.empty((chain.n_steps, 3))
        fill_circle(chain.ground, 0, 15, register, start)
        ring = solve_ring(chain, start, NewtonOptions(minima_only=False), throw=False)
        if ring.status is Status.SADDLE and ring.link == 15:
            saddle = ring
    assert saddle is not None
    assert saddle.stable is False
    assert saddle.energy > both.energy
    assert saddle.smallest_eigenvalue < 0.0
    rows = jacobian(chain, saddle.angles)
    basis = np.linalg.svd(rows)[2][6:].T
    inverse = ProjectedInverse(chain, saddle.angles, saddle.multipliers)
    columns = [basis.T @ inverse(c.reshape(-1, 3)).ravel() for c in basis.T]
    values = np.linalg.eigvalsh(np.array(columns))
    assert int(np.sum(values < 0.0)) == saddle.negative_directions


def test_an_independent_optimiser_ends_at_the_same_ring():
    ring = small_ring(n=20, seed=3)
    chain = ring.chain
    rng = np.random.default_rng(2)

    def gradient(x):
        strain = x.reshape(-1, 3) - chain.ground
        return np.einsum("ijk,ik->ij", chain.stiffness, strain).ravel()

    result = minimize(
        lambda x: elastic_energy(chain, x.reshape(-1, 3)),
        ring.angles.ravel() + 0.02 * rng.standard_normal(ring.angles.size),
        jac=gradient,
        constraints={"type": "eq", "fun": lambda x: closure(chain, x)},
        method="SLSQP",
        options={"maxiter": 500, "ftol": 1e-14},
    )
    assert result.fun == pytest.approx(ring.energy, rel=1e-8)


def test_table_2_discrete_energies():
    """All eleven molecules within 0.05 % of Table II; 1 % more stiffness is outside (control)."""
    with (data_directory() / "published" / "table2_ring_energies.csv").open() as handle:
        published = {r["name"]: float(r["E_discrete_reduced"]) for r in csv.DictReader(handle)}
    for name in embedded_names():
        ring = find_rings(build_chain(embedded(name))).lowest
        assert ring.energy == pytest.approx(published[name], rel=5e-4)
        assert ring.residual < 1e-10
        assert ring.stable
    other = find_rings(build_chain(embedded("09T09"), twist_ratio=1.53)).lowest
    assert other.energy != pytest.approx(published["09T09"], rel=5e-4)


@pytest.mark.parametrize("form", FORMS)
def test_the_first_base_pair_does_not_matter(form):
    chain = build_chain(embedded("08A17"), step_form=form)
    energy = find_rings(chain).lowest.energy
    for shift in (1, 40, 101):
        turned = Chain(
            "turned",
            np.roll(chain.ground, shift, axis=0),
            np.roll(chain.stiffness, shift, axis=0),
            step_form=form,
        )
        assert find_rings(turned).lowest.energy == pytest.approx(energy, rel=1e-9)


def test_the_strand_matters_to_the_wedge_and_not_to_the_midstep_form():
    sequence = embedded("11A17").sequence
    energies = {
        form: [
            find_rings(build_chain(strand, a_tracts="none", step_form=form)).lowest.energy
            for strand in (sequence, sequence.reverse_complement())
        ]
        for form in FORMS
    }
    assert energies["midstep"][0] == pytest.approx(energies["midstep"][1], rel=1e-9)
    assert energies["wedge"][0] != pytest.approx(energies["wedge"][1], rel=1e-4)


def test_a_solve_that_is_cut_short_says_so_and_keeps_what_it_had():
    chain = build_chain(embedded("11T15"))
    with pytest.raises(SolveError, match="raise max_iterations") as caught:
        solve_ring(chain, chain.ground, NewtonOptions(max_iterations=2))
    assert caught.value.partial.iterations == 2
    assert caught.value.partial.status is Status.ITERATION_LIMIT
    assert caught.value.partial.stable is None


@settings(max_examples=12)
@given(st.integers(0, 1000), st.floats(0.1, 3.0))
def test_no_start_diverges_unnoticed(seed, size):
    """Whatever the start, a ring said to be converged is closed, stationary and finite."""
    chain = build_chain(embedded("09T09"))
    start = chain.ground + size * np.random.default_rng(seed).standard_normal((150, 3))
    ring = solve_ring(chain, start, NewtonOptions(max_iterations=200), throw=False)
    if ring.status.ok:
        assert np.abs(closure(chain, ring.angles.ravel())).max() < 1e-9
        strain = ring.angles - chain.ground
        gradient = np.einsum("ijk,ik->ij", chain.stiffness, strain).ravel()
        pull = jacobian(chain, ring.angles).T @ ring.multipliers
        assert np.abs(gradient + pull).max() < 1e-9
    else:
        assert ring.stable is None


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_starts_that_are_not_finite_are_refused(bad):
    chain = build_chain(embedded("11T15"))
    start = chain.ground.copy()
    start[3, 1] = bad
    with pytest.raises(InputError, match="finite"):
        solve_ring(chain, start)
    with pytest.raises(InputError, match="shape"):
        solve_ring(chain, chain.ground[:-1])


@pytest.mark.parametrize("kwargs", [{"tolerance": 0.0}, {"max_iterations": 0}, {"turn_cap": 9.0}])
def test_options_are_checked(kwargs):
    with pytest.raises(InputError):
        NewtonOptions(**kwargs)


def test_a_tiny_pivot_of_the_hessian_does_not_stall_the_iteration():
    """At this ratio a pivot of the unprojected Hessian is tiny by chance."""
    chain = build_chain(embedded("08A17"), "trifonov")
    near = find_rings(chain.with_twist_ratio(0.5 + 7.0 / 15.0)).lowest
    there = chain.with_twist_ratio(0.5 + 8.0 / 15.0)
    ring = solve_ring(there, near.angles)
    assert ring.residual < 1e-10
    assert ring.iterations <= 6
    assert ring.link == near.link == 15
    assert ring.energy == pytest.approx(find_rings(there).lowest.energy, rel=1e-9)
