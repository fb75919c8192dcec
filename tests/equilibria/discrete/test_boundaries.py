"""Chains held by other boundaries than a ring's, against dense algebra written down from poses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dnacheck.equilibria.boundary import HingedRing, Loop, NickedRing, Pull, Ring
from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.equilibria.discrete.solve import NewtonOptions, solve_ring
from dnacheck.model.chain import Chain, build_chain, chain_frames, elastic_energy
from dnacheck.model.molecules import embedded
from dnacheck.model.sequence import Sequence
from dnacheck.numerics.outcome import InputError

TURNED = Rotation.from_euler("xyz", [20.0, -35.0, 50.0], degrees=True).as_matrix()
BOUNDARIES = {
    "ring": Ring(),
    "nicked": NickedRing(),
    "hinged": HingedRing(),
    "loop": Loop(position_A=(14.0, -6.0, 9.0), rotation=TURNED),
    "pull": Pull(force_pN=3.0, torque_pN_nm=6.0),
}


def small_chain(form="wedge", n=20, seed=3):
    """A short, soft chain of random letters with full stiffness matrices."""
    rng = np.random.default_rng(seed)
    letters = "".join(rng.choice(list("ACGT"), n))
    chain = build_chain(Sequence("small", letters), step_form=form)
    root = 0.3 * rng.standard_normal((n, 3, 3))
    stiffness = chain.stiffness + root @ root.transpose(0, 2, 1)
    return Chain("small", chain.ground, stiffness, persistence_length_A=120.0, step_form=form)


def held(chain, boundary):
    """Components that are held, as functions of the flat angles, from plain poses."""
    loop = isinstance(boundary, Loop)
    target = np.array(boundary.rotation) if loop else np.eye(3)
    place = np.array(boundary.position_A) / chain.rise_A if loop else np.zeros(3)

    def components(flat):
        centres, frames = chain_frames(flat.reshape(-1, 3), chain.step_form)
        end = target.T @ frames[-1]
        moved = target.T @ (centres[-1] - place)
        tilt = end[:2, 2]
        if isinstance(boundary, HingedRing):
            return moved
        if isinstance(boundary, NickedRing):
            return np.concatenate([moved, tilt])
        if isinstance(boundary, Pull):
            return tilt
        return np.concatenate([moved, Rotation.from_matrix(end).as_rotvec()])

    return components


def potential(chain, boundary):
    """Reduced energy less the work of the loads."""
    unit = 0.01380649 * 300.0 * chain.energy_scale_RT

    def value(flat):
        energy = elastic_energy(chain, flat.reshape(-1, 3))
        if isinstance(boundary, Pull):
            centres, frames = chain_frames(flat.reshape(-1, 3), chain.step_form)
            q = Rotation.from_matrix(frames[-1]).as_quat()
            energy -= boundary.force_pN * 0.1 * chain.rise_A * centres[-1, 2] / unit
            energy -= boundary.torque_pN_nm * 2.0 * np.arctan2(q[2], q[3]) / unit
        return energy

    return value


def gradient(function, x, h=1e-5):
    rows = []
    for i in range(x.size):
        e = np.zeros(x.size)
        e[i] = h
        rows.append((function(x + e) - function(x - e)) / (2.0 * h))
    return np.array(rows).T


def hessian(function, x, h=3e-4):
    n = x.size
    out = np.empty((n, n))
    e = h * np.eye(n)
    for i in range(n):
        for j in range(i + 1):
            total = function(x + e[i] + e[j]) - function(x + e[i] - e[j])
            total += function(x - e[i] - e[j]) - function(x - e[i] + e[j])
            out[i, j] = out[j, i] = total / (4.0 * h * h)
    return out


def solved(chain, name, **options):
    start = find_rings(chain).lowest.angles if name != "pull" else chain.ground
    return solve_ring(chain, start, NewtonOptions(**options), boundary=BOUNDARIES[name])


@pytest.mark.parametrize("form", ["wedge", "midstep"])
@pytest.mark.parametrize("name", BOUNDARIES)
def test_equilibrium_inertia_and_determinant_are_those_of_dense_algebra(name, form):
    """The dense constraints are another parametrisation of the same surface where they can be."""
    chain, boundary = small_chain(form), BOUNDARIES[name]
    found = solved(chain, name)
    x = found.angles.ravel().copy()
    components, value = held(chain, boundary), potential(chain, boundary)
    rows = gradient(components, x)
    slope = gradient(value, x)
    assert components(x) == pytest.approx(0.0, abs=1e-9)
    multipliers = np.linalg.lstsq(rows.T, -slope, rcond=None)[0]
    assert slope + rows.T @ multipliers == pytest.approx(0.0, abs=1e-7)
    full = hessian(lambda y: value(y) + multipliers @ components(y), x)
    basis = np.linalg.svd(rows)[2][len(rows) :].T
    values = np.linalg.eigvalsh(basis.T @ full @ basis)
    kkt = np.block([[full, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    assert found.stable == bool(values[0] > 0.0)
    assert found.smallest_eigenvalue == pytest.approx(values[0], rel=1e-4)
    assert found.log_abs_det_kkt == pytest.approx(np.linalg.slogdet(kkt)[1], abs=2e-5)
    # Negative control: without the curvature of the constraints the determinant is another one.
    flat = hessian(value, x)
    wrong = np.block([[flat, rows.T], [rows, np.zeros((len(rows), len(rows)))]])
    if name != "pull":
        assert abs(np.linalg.slogdet(wrong)[1] - found.log_abs_det_kkt) > 1e-3


@pytest.mark.parametrize("name", ["nicked", "hinged", "pull"])
def test_free_components_carry_their_load_and_no_more(name):
    found = solved(small_chain(), name)
    loads = BOUNDARIES[name].for_chain(found.chain)
    free = ~loads.fixed
    assert found.multipliers[free] == pytest.approx(-loads.loads[free], abs=1e-15)
    assert np.abs(found.multipliers[loads.fixed]).max() > 1e-6
    assert found.ring_link is None
    with pytest.raises(InputError, match="no link"):
        _ = found.link


def test_a_loop_onto_the_start_is_the_ring():
    ring = find_rings(build_chain(embedded("11T15"))).lowest
    rng = np.random.default_rng(0)
    start = ring.angles + 0.01 * rng.standard_normal(ring.angles.shape)
    loop = solve_ring(ring.chain, start, boundary=Loop())
    assert loop.energy_RT == pytest.approx(ring.energy_RT, rel=1e-12)
    assert loop.angles == pytest.approx(ring.angles, abs=1e-9)
    assert loop.log_abs_det_kkt == pytest.approx(ring.log_abs_det_kkt, abs=1e-8)
    # Negative control: half a degree beside the start is another equilibrium.
    beside = Loop(rotation=Rotation.from_euler("z", 0.5, degrees=True).as_matrix())
    other = solve_ring(ring.chain, start, boundary=beside)
    assert abs(other.energy_RT - ring.energy_RT) > 1e-3


def test_releasing_components_lowers_the_energy():
    ring = find_rings(build_chain(embedded("11T15"))).lowest
    nicked = solve_ring(ring.chain, ring.angles, boundary=NickedRing())
    hinged = solve_ring(ring.chain, nicked.angles, boundary=HingedRing())
    assert ring.energy_RT > nicked.energy_RT + 0.1
    assert nicked.energy_RT > hinged.energy_RT + 0.1
    # A nick takes the torque away: the ring's derivative by the end's turn is its multiplier.
    assert nicked.multipliers[5] == 0.0


def test_the_nick_is_the_lowest_loop_over_the_turn_of_its_end():
    """The minimum over chi of the energy of loops with the end turned by chi about d3."""
    ring = find_rings(small_chain(n=36, seed=2)).lowest
    nicked = solve_ring(ring.chain, ring.angles, boundary=NickedRing())
    end = nicked.frames[-1]
    chi = np.arctan2(end[1, 0], end[0, 0])

    def loop(turn):
        target = Loop(rotation=Rotation.from_rotvec([0.0, 0.0, turn]).as_matrix())
        return solve_ring(ring.chain, nicked.angles, boundary=target)

    here, ahead, behind = loop(chi), loop(chi + 0.05), loop(chi - 0.05)
    assert here.energy == pytest.approx(nicked.energy, rel=1e-12)
    assert min(ahead.energy, behind.energy) > here.energy
    assert (ahead.energy - behind.energy) / 0.1 == pytest.approx(0.0, abs=1e-4)
    assert ahead.multipliers[5] == pytest.approx(
        -(loop(chi + 0.051).energy - loop(chi + 0.049).energy) / 0.002, rel=1e-5
    )


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Loop(position_A=(1.0, 2.0)), "three numbers"),
        (lambda: Loop(position_A="here"), "three numbers"),
        (lambda: Loop(rotation=np.diag([1.0, 1.0, -1.0])), "no rotation"),
        (lambda: Loop(rotation=1.01 * np.eye(3)), "no rotation"),
        (lambda: Loop(position_A=(1e4, 0.0, 0.0)).for_chain(small_chain()), "closer"),
        (lambda: Pull(force_pN=float("nan")), "finite"),
        (lambda: Pull(force_pN="2"), "number"),
        (lambda: Pull(1.0, temperature_K=0.0), "positive"),
    ],
)
def test_impossible_boundaries_are_named_in_one_line(make, words):
    with pytest.raises(InputError, match=words) as error:
        make()
    assert "\n" not in str(error.value)
