"""Pulled chains against the worm-like chain, linear buckling and the twist-stretch theory."""

import json
import math

import numpy as np
import pytest
from scipy.optimize import brentq

from dnacheck import cli
from dnacheck.cyclization.ensembles.pulled import marko_siggia_extension, pulled_mean
from dnacheck.equilibria.boundary import Pull
from dnacheck.equilibria.discrete.solve import NewtonOptions, solve_ring
from dnacheck.model.chain import Chain
from dnacheck.numerics.outcome import InputError

KT = 0.01380649 * 300.0
PERSISTENCE_A, RISE_A = 463.0, 3.4


def straight(n, twist=2.0 * np.pi / 10.45, form="wedge"):
    ground = np.tile([twist, 0.0, 0.0], (n, 1))
    stiffness = np.tile(np.diag([1.5, 1.0, 1.0]), (n, 1, 1))
    return Chain("straight", ground, stiffness, step_form=form)


def worm_like_chain(length_A, force_pN, top=40):
    """Extension of a worm-like chain clamped along the force at one end, by diagonalisation.

    exp(-L H) between the clamped tangent and all tangents, H = l (l + 1) / 2 P - f cos(theta) in
    Legendre functions; its logarithm's derivative by the force.
    """
    level = np.arange(top)
    coupling = (level[:-1] + 1) / np.sqrt((2 * level[:-1] + 1) * (2 * level[:-1] + 3))
    cosine = np.diag(coupling, 1) + np.diag(coupling, -1)
    kinetic = np.diag(level * (level + 1) / (2.0 * PERSISTENCE_A))

    def log_partition(force):
        energies, modes = np.linalg.eigh(kinetic - 0.1 * force / KT * cosine)
        decays = np.exp(-length_A * (energies - energies[0]))
        amplitude = np.sum(modes[0] * decays * (np.sqrt(2 * level + 1) @ modes))
        return math.log(amplitude) - length_A * energies[0]

    h = 1e-4 * force_pN
    slope = (log_partition(force_pN + h) - log_partition(force_pN - h)) / (2.0 * h)
    return 10.0 * KT * slope


@pytest.mark.parametrize("force", [0.1, 1.0, 10.0])
def test_extension_is_that_of_the_exact_worm_like_chain(force):
    n = 1000
    mean = pulled_mean(straight(n), Pull(force), populations=12, chains=600, rng=4)
    exact = worm_like_chain(n * RISE_A, force)
    assert mean.extension_stderr_A < (0.01 if force < 0.5 else 0.002) * exact
    assert abs(mean.extension_A - exact) < 3.0 * mean.extension_stderr_A + 0.001 * exact
    # Marko and Siggia interpolate, and know no ends.
    interpolated = marko_siggia_extension(n * RISE_A, PERSISTENCE_A, Pull(force))
    assert 1e-5 < abs(interpolated / exact - 1.0) < 0.2


def test_the_mean_turn_under_a_torque_is_moroz_and_nelsons():
    """Torsional compliance 1/C + 1/(4 A K), K^2 = A f - torque^2 / 4 in units of kT (1997)."""
    n, force, torque = 1000, 10.0, 25.0
    mean = pulled_mean(straight(n), Pull(force, torque), populations=12, chains=1000, rng=5)
    bend = 0.1 * PERSISTENCE_A
    tension = math.sqrt(bend * force / KT - 0.25 * (torque / KT) ** 2)
    softness = 1.0 / (1.5 * bend) + 1.0 / (4.0 * bend * tension)
    expected = 0.1 * n * RISE_A * torque / KT * softness / (2.0 * math.pi)
    error = 3.0 * mean.turns_stderr + 0.01 * expected
    assert abs(mean.excess_turns - expected) < error
    # Negative control: with C = A the end turns half as far again.
    assert abs(1.5 * expected - mean.excess_turns) > error


def buckling_torque(n, force_pN):
    """Torque (pN nm) at which the straight shape of N hinges first loses its stability."""
    chain = straight(n, twist=0.0, form="midstep")
    options = NewtonOptions(minima_only=False)

    def softest(torque):
        start = np.zeros((n, 3))
        start[:, 0] = torque / (KT * chain.energy_scale_RT * 1.5)
        found = solve_ring(chain, start, options, boundary=Pull(force_pN, torque), throw=False)
        return found.smallest_eigenvalue

    guess = rod_buckling(n * RISE_A, force_pN)
    return brentq(softest, 0.9 * guess, 1.05 * guess, xtol=1e-9 * guess, rtol=1e-12)


def rod_buckling(length_A, force_pN):
    """2 sqrt(A f + (pi A / L)^2): tangents clamped along the force at both ends."""
    bend = KT * 0.1 * PERSISTENCE_A
    return 2.0 * math.sqrt(bend * force_pN + (math.pi * bend / (0.1 * length_A)) ** 2)


@pytest.mark.parametrize("force", [0.0, 1.0])
def test_a_clamped_straight_rod_buckles_at_the_closed_form(force):
    """A rod of one length in ever more hinges, its length and force scaled with them."""
    sizes = np.array([25, 50, 100])
    values = []
    for n in sizes:
        # The same rod: bending stiffness over step length, force in units of the rod's own.
        scale = 100.0 / n
        values.append(buckling_torque(int(n), force * scale**2) / scale)
    exact = rod_buckling(100 * RISE_A, force)
    extrapolated = np.polynomial.polynomial.polyfit(1.0 / sizes**2, values, 2)[0]
    assert extrapolated == pytest.approx(exact, rel=1e-6)
    # Negative control: not at the largest N.
    assert abs(values[-1] / exact - 1.0) > 1e-5


def test_command_prints_and_gives_json(capsys):
    assert cli.main(["pull", "11T15", "--force-pN", "2", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["equilibrium"]["stable"]
    assert 0.0 < record["thermal"]["extension_A"] < record["n_bp"] * RISE_A
    assert record["thermal"]["extension_stderr_A"] > 0.0
    assert cli.main(["pull", "11T15", "--force-pN", "2"]) == 0
    assert "thermal mean" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--force-pN", "1", "--torque-pN-nm", "-300"], "no stable shape"),
        (["--force-pN", "0.5", "--torque-pN-nm", "200"], "no stable shape"),
        (["--force-pN", "nan"], "give a number"),
    ],
)
def test_a_pull_without_a_minimum_is_one_line_and_exit_code_2(capsys, arguments, words):
    code = cli.main(["pull", "11T15", *arguments])
    captured = capsys.readouterr()
    assert code == 2
    assert captured.out == ""
    assert words in captured.err
    assert len(captured.err.strip().splitlines()) == 1


def test_a_torque_that_winds_the_chain_up_is_said(capsys):
    assert cli.main(["pull", "11T15", "--force-pN", "1", "--torque-pN-nm", "5"]) == 0
    assert "does not last" in capsys.readouterr().err
    # Negative control: at ten times the force the same torque turns the stretched chain.
    assert cli.main(["pull", "11T15", "--force-pN", "10", "--torque-pN-nm", "5"]) == 0
    assert "does not last" not in capsys.readouterr().err


def test_too_few_chains_are_refused():
    with pytest.raises(InputError, match="two populations"):
        pulled_mean(straight(20), Pull(1.0), populations=1)
