"""Straight molecules, whose register is free, beside the wormlike rod."""

from __future__ import annotations

import math

import numpy as np

from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Findings, Level
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge
from dnacheck.validation.report.record import Column, Table
from dnacheck.validation.scene.scene import Scene

_BASE_PAIRS_PER_TURN = 10.5
_TOLERANCE = 0.05


def only_homopolymers(scene: Scene) -> str | None:
    """Why there is nothing to do, if a molecule has more than one letter."""
    if any(len(set(letters)) > 1 for _, letters, _ in scene.resolved):
        return "a molecule is no homopolymer"
    return None


def straight(context: Context) -> Findings:
    """Rods without bends, as long as the scene's molecules, by four methods and in closed form."""
    from dnacheck.cyclization.closure.sampling import ClosureOptions, sample_closure
    from dnacheck.cyclization.half_chain.sampling import HalfChainOptions, half_chain
    from dnacheck.cyclization.laplace.anharmonic import AnharmonicOptions, corrected_laplace
    from dnacheck.cyclization.laplace.register import register_profile
    from dnacheck.equilibria.discrete.search import find_rings
    from dnacheck.model.chain import Chain, uniform_stiffness
    from dnacheck.validation.reference.wormlike_chain import chain_rod_j

    full = context.level is Level.FULL
    model = context.scene.model
    results: list[CheckResult] = []
    rows = []
    lengths = sorted({len(letters) for _, letters, _ in context.scene.resolved})
    for index, n in enumerate(lengths):
        ground = np.tile([2.0 * math.pi / _BASE_PAIRS_PER_TURN, 0.0, 0.0], (n, 1))
        ratio = model.twist_ratios[0]
        chain = Chain(
            f"straight {n}",
            ground,
            uniform_stiffness(n, ratio),
            persistence_length_A=model.persistence_length_A,
            rise_A=model.rise_A,
            twist_ratio=ratio,
        )
        seed = context.seed + 10 * index
        search = find_rings(chain)
        profile = register_profile(search)
        term = corrected_laplace(profile, AnharmonicOptions(tolerance=0.01), seed)
        exact = sample_closure(profile, ClosureOptions(tolerance=0.01), seed + 1)
        count = 240_000 if full else 120_000 if n <= 200 else 80_000
        halves = half_chain(search, HalfChainOptions(halves=count), seed + 2)
        rod = chain_rod_j(chain)
        rows.append(
            {
                "n_bp": n,
                "register": -profile.log_j,
                "term": term.minus_lnJ,
                "term_error": term.total_error,
                "closure": exact.minus_lnJ,
                "closure_error": exact.stderr,
                "halves": halves.minus_lnJ,
                "halves_error": halves.stderr,
                "rod": rod.minus_lnJ,
                "coupled": rod.minus_lnJ_coupled,
            }
        )
        for item, value, sigma in (
            ("half chains", halves.minus_lnJ, halves.stderr),
            ("exact closure", exact.minus_lnJ, exact.stderr),
        ):
            results.append(
                judge(
                    f"jfactor.straight[{n}, {item}]",
                    f"−ln J of a straight molecule by {item}",
                    value,
                    term.minus_lnJ,
                    Rule.ABSOLUTE,
                    "register-integrated Laplace with its first anharmonic term",
                    "methods that share nothing but the chain",
                    _TOLERANCE,
                    "RT",
                    got_sigma=sigma,
                    expected_sigma=term.stderr,
                )
            )
    table = Table(
        "straight",
        "Straight molecules beside the rod of Shimada and Yamakawa",
        [
            Column("n_bp", "length", "bp"),
            Column("register", "alone", "", ".3f", "", "Register Laplace"),
            Column("term", "with first term", "", ".3f", "", "Register Laplace"),
            Column("term_error", "±", "", ".3f", "", "Register Laplace"),
            Column("closure", "−ln J", "", ".3f", "", "Exact closure"),
            Column("closure_error", "±", "", ".3f", "", "Exact closure"),
            Column("halves", "−ln J", "", ".3f", "", "Half chains"),
            Column("halves_error", "±", "", ".3f", "", "Half chains"),
            Column("rod", "twist alone", "", ".3f", "", "Shimada–Yamakawa"),
            Column("coupled", "with the writhe", "", ".3f", "", "Shimada–Yamakawa"),
        ],
        rows,
        f"−ln J of rods without bends, {_BASE_PAIRS_PER_TURN} base pairs a turn. Laplace alone "
        "lacks the first anharmonic term, 0.514 L/2P to Shimada and Yamakawa. Their Gaussian of "
        "the twist ignores that a ring writhes; with the writhe's variance to lowest order in L/P "
        "most of the difference goes. Shorter steps change −ln J by less than 0.01.",
        summary=True,
    )
    return Findings(results, [table])
