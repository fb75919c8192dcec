"""The paper's equations (4.8)-(4.12), and that the solver's fewer unknowns solve the same ones."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rods import molecule_rod

from dnacheck.equilibria.continuum import ContinuumOptions, solve_continuum_ring
from dnacheck.equilibria.continuum.equations import (
    directors,
    end_conditions,
    moments,
    perfect_energy,
    perfect_ring,
    rates,
)

K1, K3 = 1.0 / 158, 1.5 / 158


def _printed_ring(s, alpha):
    """mu of (4.12) as printed: sin(alpha s), cos(alpha s) and a wrong first term in row 4."""
    state = perfect_ring(s, alpha, K1, K3)
    sp, cp = np.sin(np.pi * s), np.cos(np.pi * s)
    sa, ca = np.sin(alpha * s / 2), np.cos(alpha * s / 2)
    k1, k3 = 4 * np.pi * K1, 2 * alpha * K3
    state[:, 10] = k1 * cp * ca - k3 * np.sin(alpha * s) * sa
    state[:, 11] = -k1 * cp * sa - k3 * np.sin(alpha * s) * ca
    state[:, 12] = -k1 * sp * sa + k3 * np.cos(alpha * s) * ca
    state[:, 13] = -k1 * sp * sa - k3 * np.cos(alpha * s) * sa
    return state


def _defect(ring, s, alpha):
    """|d/ds ring - rates|, the derivative by central differences."""
    slope = _slope(ring, s, alpha)
    stiffness = np.array([K1, K1, K3])
    return np.abs(slope - rates(ring(s, alpha), np.zeros((s.size, 3)), stiffness))


def _slope(ring, s, alpha):
    """Sixth-order central differences."""
    h = 1e-2
    weights = {1: 45.0, 2: -9.0, 3: 1.0}
    return sum(
        c * (ring(s + j * h, alpha) - ring(s - j * h, alpha)) for j, c in weights.items()
    ) / (60.0 * h)


@pytest.mark.parametrize("alpha", [0.0, 0.7, -2.0, 3.1])
def test_corrected_ring_satisfies_the_equations(alpha):
    """Residual of (4.9) with the derivative of (4.12) taken by hand."""
    s = np.linspace(0.0, 1.0, 101)
    state = perfect_ring(s, alpha, K1, K3)
    got = rates(state, np.zeros((101, 3)), np.array([K1, K1, K3]))
    assert np.max(np.abs(got - _derivative(s, alpha))) < 1e-12


def _derivative(s, alpha):
    """Derivative of the corrected (4.12), by the product rule."""
    sp, cp = np.sin(np.pi * s), np.cos(np.pi * s)
    sa, ca = np.sin(alpha * s / 2), np.cos(alpha * s / 2)
    p, a = np.pi, alpha / 2
    k1, k3 = 4 * np.pi * K1, 2 * alpha * K3
    zero = np.zeros_like(s)
    cc = -p * sp * ca - a * cp * sa  # (cos cos)'
    ss = p * cp * sa + a * sp * ca  # (sin sin)'
    cs = -p * sp * sa + a * cp * ca  # (cos sin)'
    sc = p * cp * ca - a * sp * sa  # (sin cos)'
    return np.stack(
        [
            zero,
            -np.sin(2 * p * s),
            np.cos(2 * p * s),
            sc,
            -ss,
            cs,
            cc,
            zero,
            zero,
            zero,
            k1 * cc - k3 * ss,
            -k1 * cs - k3 * sc,
            -k1 * ss + k3 * cc,
            -k1 * sc - k3 * cs,
        ],
        axis=1,
    )


@pytest.mark.parametrize("alpha", [0.7, -2.0, 3.1])
def test_printed_ring_does_not(alpha):
    s = np.linspace(0.0, 1.0, 101)
    printed = _defect(_printed_ring, s, alpha)
    corrected = _defect(lambda x, a: perfect_ring(x, a, K1, K3), s, alpha)
    assert corrected.max() < 1e-9
    assert printed[:, 10:].max() > 1e-3
    assert printed[:, :3].max() < 1e-9  # r as printed is right


@pytest.mark.parametrize("alpha", [0.0, 1.3, -2.9])
def test_corrected_ring_satisfies_the_end_conditions(alpha):
    ends = perfect_ring(np.array([0.0, 1.0]), alpha, K1, K3)
    assert np.max(np.abs(end_conditions(ends[0], ends[1], alpha))) < 1e-15
    assert np.max(np.abs(end_conditions(ends[0], ends[1], alpha + 0.1))) > 0.01


@given(st.lists(st.floats(-1, 1), min_size=14, max_size=14), st.floats(-5, 5), st.floats(-5, 5))
def test_rates_are_the_hamiltonian_flow(values, w1, w2):
    """r' = dH/dn, q' = dH/dmu, n' = -dH/dr, mu' = -dH/dq, by central differences of H."""
    state = np.array(values)
    strains, stiffness = np.array([w1, w2, 0.3]), np.array([1.0, 1.2, 1.7])

    def hamiltonian(x):
        m = moments(x[3:7], x[10:14])
        d3 = directors(x[3:7])[:, 2]
        return float(np.sum(m**2 / (2 * stiffness) + strains * m) + x[7:10] @ d3)

    step = 1e-5
    gradient = np.array(
        [
            (hamiltonian(state + step * e) - hamiltonian(state - step * e)) / (2 * step)
            for e in np.eye(14)
        ]
    )
    flow = np.concatenate([gradient[7:10], gradient[10:14], -gradient[:3], -gradient[3:7]])
    assert np.allclose(rates(state, strains, stiffness), flow, atol=1e-7)


def test_directors_are_orthonormal_for_unit_quaternions():
    q = np.random.default_rng(0).normal(size=(20, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    d = directors(q)
    assert np.allclose(np.swapaxes(d, 1, 2) @ d, np.eye(3), atol=1e-14)
    assert np.allclose(np.linalg.det(d), 1.0)


@given(st.floats(-3, 3).filter(lambda x: abs(x) > 1e-3))
@settings(max_examples=10)
def test_energy_of_the_perfect_ring(alpha):
    x, w = np.polynomial.legendre.leggauss(20)
    state = perfect_ring(0.5 * (x + 1.0), alpha, K1, K3)
    m = moments(state[:, 3:7], state[:, 10:14])
    density = 0.5 * (m[:, 0] ** 2 + m[:, 1] ** 2) / K1 + 0.5 * m[:, 2] ** 2 / K3
    assert 0.5 * w @ density == pytest.approx(perfect_energy(alpha, K1, K3), rel=1e-13)


def test_published_variables_solve_the_papers_problem():
    """(r, q, n, mu) of a computed ring satisfies (4.9) and (4.11)."""
    rod = molecule_rod("09T15")
    ring = solve_continuum_ring(rod, 15, options=ContinuumOptions(intervals=160, degree=6))
    ends = ring.curve.solution([0.0, 1.0])
    assert np.max(np.abs(end_conditions(ends[0], ends[1], ring.curve.alpha))) < 1e-9
    # compare with central differences inside a piece, where the strains are smooth
    middle = 0.5 * (rod.breaks[1:] + rod.breaks[:-1])
    h = 1e-3 * np.min(np.diff(rod.breaks)[1:-1])
    slope = (ring.curve.solution(middle + h) - ring.curve.solution(middle - h)) / (2 * h)
    strains = np.column_stack([rod.strains(middle), np.zeros(middle.size)])
    stiffness = np.array([rod.bend_stiffness, rod.bend_stiffness, rod.twist_stiffness])
    expected = rates(ring.curve.solution(middle), strains, stiffness)
    assert np.max(np.abs(slope - expected)) < 1e-5
    # a rod with other strains is not solved by it
    wrong = rates(ring.curve.solution(middle), 1.01 * strains, stiffness)
    assert np.max(np.abs(slope - wrong)) > 1e-3
