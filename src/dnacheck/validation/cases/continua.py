"""Choices and molecules on which continuum solvers break."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from dnacheck.equilibria.continuum import lowest_continuum_ring
from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.molecules import embedded
from dnacheck.model.rod import RodOptions, build_rod
from dnacheck.model.sequence import parse_sequence
from dnacheck.numerics.outcome import DnaCheckError, InputError
from dnacheck.validation.cases.case import HardCase, hard_case
from dnacheck.validation.engine.verdict import Rule

GROUP = "continuum"


def _refusal(
    title: str, must: str, attempt: Callable[[], object], error: type[DnaCheckError]
) -> HardCase:
    """A case that must be refused with an error of the given kind and a message."""
    did, refused = "accepted in silence", False
    try:
        attempt()
    except error as refusal:
        did, refused = f"refused: {refusal}", True
    return hard_case(
        GROUP, title, must, did, refused, True, Rule.EQUAL, "a wrong answer in silence is worse"
    )


def zero_twist(rng: np.random.Generator) -> HardCase:
    """End twist exactly 0: the start that the paper calls degenerate."""
    del rng
    from dnacheck.equilibria.continuation.branch import BranchError
    from dnacheck.equilibria.continuation.diagram import imperfect_component
    from dnacheck.equilibria.continuation.parameters import perfect_rod

    return _refusal(
        "end twist exactly 0",
        "a straight rod at α = 0 is a degenerate start (its register is free): said so, not "
        "followed along a wrong branch",
        lambda: imperfect_component(perfect_rod(158, 1.5), 0.0),
        BranchError,
    )


def at_bifurcation(rng: np.random.Generator) -> HardCase:
    """α exactly at a branch point of the perfect diagram."""
    del rng
    from dnacheck.equilibria.continuation.branch import BranchError
    from dnacheck.equilibria.continuation.diagram import perfect_diagram
    from dnacheck.equilibria.continuation.parameters import perfect_rod

    alpha = 2.0 * math.pi * math.sqrt(3.0) / 1.5
    return _refusal(
        "α at a bifurcation",
        "a start exactly at the first branch point is refused with what to change",
        lambda: perfect_diagram(perfect_rod(158, 1.5), start=alpha),
        BranchError,
    )


def wide_filter(rng: np.random.Generator) -> HardCase:
    """A filter that reaches beyond the padding."""
    del rng
    return _refusal(
        "filter wider than the padding",
        "w = 60 with 50 bp of padding is refused with the mend",
        lambda: RodOptions(filter_width=60),
        InputError,
    )


def singular_fit(rng: np.random.Generator) -> HardCase:
    """More spline coefficients than points."""
    del rng
    chain = build_chain(embedded("11T15"))
    return _refusal(
        "singular fit",
        "k = 150 pieces of degree 6 for 260 points are refused with the mend",
        lambda: build_rod(chain, RodOptions(intervals=150)),
        InputError,
    )


def quaternions_along_the_rod(rng: np.random.Generator) -> HardCase:
    """Quaternions of a ring stay continuous although they end with the other sign."""
    del rng
    chain = build_chain(embedded("09T15"))
    ring = lowest_continuum_ring(build_rod(chain)).lowest
    neighbours = np.sum(ring.curve.quaternions[1:] * ring.curve.quaternions[:-1], axis=1)
    return hard_case(
        GROUP,
        "quaternion signs along a ring",
        "q(s) is continuous along the rod: neighbouring mesh points never have opposite signs",
        f"smallest product of neighbours {neighbours.min():.4f}",
        float(neighbours.min()),
        0.5,
        Rule.AT_LEAST,
        "neighbours differ by a few degrees; a sign flip gives −1",
    )


def straight_rod(rng: np.random.Generator) -> HardCase:
    """A straight molecule's continuum ring is the twisted circle, in closed form."""
    del rng
    chain = build_chain(parse_sequence("A" * 200, "A200"), a_tracts="none")
    rod = build_rod(chain)
    ring = lowest_continuum_ring(rod).lowest
    alpha = ring.curve.alpha
    exact = 0.5 * rod.bend_stiffness * (2.0 * np.pi) ** 2 + 0.5 * rod.twist_stiffness * alpha**2
    return hard_case(
        GROUP,
        "straight homopolymer",
        "the ring of poly(A) is a twisted circle, ½K1(2π)² + ½K3α², whatever its register",
        f"relative difference {abs(ring.energy / exact - 1.0):.1e}, status "
        f"{ring.status.name.lower()}",
        ring.energy,
        exact,
        Rule.RELATIVE,
        "the filter leaves ripples of the helix in the curvature, whose square counts",
        1e-3,
    )


def first_base_pair(rng: np.random.Generator) -> HardCase:
    """Continuum energies for other first base pairs."""
    chain = build_chain(embedded("11T15"))
    energies = []
    for shift in [0, *sorted(int(x) for x in rng.integers(1, chain.n_steps, 5))]:
        rolled = Chain(
            "relabelled",
            np.roll(chain.ground, -shift, axis=0),
            np.roll(chain.stiffness, -shift, axis=0),
        )
        energies.append(lowest_continuum_ring(build_rod(rolled)).lowest.energy)
    spread = (max(energies) - min(energies)) / energies[0]
    return hard_case(
        GROUP,
        "another first base pair",
        "the continuum energy of 11T15 moves by no more than the fit's own error",
        f"spread over 6 choices {100.0 * spread:.2f} %",
        spread,
        5e-3,
        Rule.AT_MOST,
        "the spline's knots and the rod's ends move along the sequence; the gap to the discrete "
        "model, 0.5 %, bounds the effect",
    )


CASES = (
    zero_twist,
    at_bifurcation,
    wide_filter,
    singular_fit,
    quaternions_along_the_rod,
    straight_rod,
    first_base_pair,
)
