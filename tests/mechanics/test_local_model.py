"""ln J's gradient and Hessian from closed draws, against numbers that do not share them."""

from dataclasses import replace

import numpy as np
import pytest

from dnacheck.cyclization.gradient import closed_draws
from dnacheck.cyclization.methods import Laplace
from dnacheck.mechanics.local_model import local_model
from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import Molecule, embedded
from dnacheck.model.named_parameters import modified_chain, own_value
from dnacheck.model.sequence import parse_sequence

WIDTHS = {
    "persistence_length_A": 10.0,
    "twist_ratio": 0.05,
    "twist_offset_deg": 0.03,
    "bend_scale": 0.02,
    "a_tract_twist_deg": 0.05,
    "theta[AG]": 0.3,
    "phi[CA]": 0.3,
}


def molecule(seed, n):
    letters = "".join(np.random.default_rng(seed).choice(list("ACGT"), size=n))
    return Molecule(parse_sequence(letters, f"random {seed}"))


@pytest.mark.parametrize("target", [embedded("11T15"), molecule(5, 131)])
def test_gradient_against_differences_with_common_random_numbers(target):
    chain = build_chain(target)
    names = [n for n in WIDTHS if chain.a_tract_regions or not n.startswith("a_tract")]
    values = {name: own_value(chain, name) for name in names}
    draws = closed_draws(chain, tolerance=0.005, rng=3)
    model = local_model(chain, draws, names, values)
    for i, name in enumerate(names):
        h = WIDTHS[name]
        ends = [
            closed_draws(
                modified_chain(chain, {**values, name: values[name] + s * h}),
                tolerance=0.005,
                rng=3,
            )
            for s in (1.0, -1.0)
        ]
        slope = (ends[0].log_j - ends[1].log_j) / (2.0 * h)
        # what common random numbers leave of the two errors, and the cubic term of the difference
        error = np.hypot(model.gradient_stderr[i], 0.5 * 0.005 / h)
        assert abs(model.gradient[i] - slope) < 3.5 * error, name


def test_gradient_of_a_stiff_molecule_is_that_of_laplace():
    """Ten times stiffer, Laplace's approximation holds: a deterministic, independent number."""
    chain = replace(build_chain(embedded("09T09")), persistence_length_A=4630.0)
    names = ["twist_offset_deg", "bend_scale", "twist_ratio"]
    values = {name: own_value(chain, name) for name in names}
    model = local_model(chain, closed_draws(chain, tolerance=0.005), names, values)

    def log_j(name, change):
        made = modified_chain(chain, {name: values[name] + change})
        return -Laplace().compute(made).minus_lnJ

    for i, name in enumerate(names):
        h = 1e-3
        slope = (log_j(name, h) - log_j(name, -h)) / (2.0 * h)
        error = np.hypot(model.gradient_stderr[i], 0.01 * abs(slope))
        assert abs(model.gradient[i] - slope) < 3.5 * error, name
        wrong = -slope  # the control: a wrong sign is far outside
        assert abs(model.gradient[i] - wrong) > 3.5 * error, name


def test_hessian_in_the_twist_offset_against_second_differences():
    chain = build_chain(embedded("11T15"))
    values = {"twist_offset_deg": 0.0}
    middle = closed_draws(chain, tolerance=0.005)
    model = local_model(chain, middle, ["twist_offset_deg"], values)
    h = 0.1
    ends = [
        closed_draws(modified_chain(chain, {"twist_offset_deg": s * h}), tolerance=0.005)
        for s in (1.0, -1.0)
    ]
    second = (ends[0].log_j + ends[1].log_j - 2.0 * middle.log_j) / h**2
    assert model.hessian[0, 0] == pytest.approx(second, rel=0.15)
