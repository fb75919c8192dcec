"""The discrete solver: derivatives, convergence, growth."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from dnacheck.validation.engine.context import Context
from dnacheck.validation.engine.registry import Check, Findings, Group, Level
from dnacheck.validation.engine.verdict import CheckResult, Rule, judge, must_fail
from dnacheck.validation.reference.published import PAPER
from dnacheck.validation.report.record import Column, Table

if TYPE_CHECKING:
    from dnacheck.model.chain import Chain

DERIVATIVE_TOLERANCE = 1e-6
RESIDUAL = 1e-10
ANGLE_SETS = ("trifonov2", "trifonov", "desantis")

_SEQUENCES = {Level.QUICK: 20, Level.DEFAULT: 150, Level.FULL: 1000}
_BRUTE = {Level.QUICK: 0, Level.DEFAULT: 3, Level.FULL: 50}
_LARGEST = {Level.QUICK: 1000, Level.DEFAULT: 10_000, Level.FULL: 10_000}


def random_chain(
    rng: np.random.Generator, shortest: int, longest: int, angles: str = "trifonov2"
) -> Chain:
    """Chain of a random sequence with independent, equally likely letters."""
    from dnacheck.model.chain import build_chain
    from dnacheck.model.sequence import parse_sequence

    length = int(rng.integers(shortest, longest + 1))
    letters = "".join(rng.choice(list("ACGT"), length))
    return build_chain(parse_sequence(letters, f"random{length}"), angles)


class _Lagrangian:
    """E(q) + multipliers . c(q) of a chain, and its derivatives in closed form."""

    def __init__(self, chain: Chain, angles: Any, multipliers: Any) -> None:
        self.chain, self.angles, self.multipliers = chain, angles, multipliers

    def closure(self, angles: Any) -> Any:
        from dnacheck.equilibria.discrete.kernels.closure import closure_residual
        from dnacheck.model.chain import chain_frames

        centres, frames = chain_frames(angles, self.chain.step_form)
        out = np.empty(6)
        closure_residual(centres, frames, out)
        return out

    def gradient(self, angles: Any) -> Any:
        """Closed form, flat (3N,); valid where the chain is closed."""
        from dnacheck.equilibria.discrete.kernels.closure import (
            closure_jacobian,
            energy_gradient,
            linearise,
        )

        chain, n = self.chain, self.chain.n_steps
        centres, frames = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
        axes, gradient = np.empty((n, 3, 3)), np.empty((n, 3))
        halves = np.empty((n if chain.form_code else 0, 5, 3))
        linearise(angles, chain.form_code, centres, frames, axes, halves)
        energy_gradient(angles, chain.ground, chain.stiffness, gradient)
        jacobian = np.empty((6, 3 * n))
        closure_jacobian(centres, axes, jacobian)
        return gradient.ravel(), jacobian

    def hessian_error(self, rng: np.random.Generator, multipliers: Any = None) -> float:
        """Largest error of (projected H)^-1, applied to random vectors, against differences.

        The closed form may be given other, wrong multipliers. x = P^-1 b must satisfy: along x
        the gradient of the Lagrangian changes by b, up to multiples of the closure constraints.
        """
        from dnacheck.equilibria.discrete.spectrum import ProjectedInverse

        given = self.multipliers if multipliers is None else multipliers
        inverse = ProjectedInverse(self.chain, self.angles, given)
        shape = self.angles.shape
        worst = 0.0
        for _ in range(3):
            b = rng.standard_normal(shape)
            x = inverse(b.copy())
            step = 1e-4 / np.max(np.abs(x))
            change = (
                sum(
                    weight * self._value_gradient(self.angles + times * step * x)
                    for times, weight in ((2, -1 / 12), (1, 8 / 12), (-1, -8 / 12), (-2, 1 / 12))
                )
                / step
            )
            _, jacobian = self.gradient(self.angles)
            rest = change - b.ravel()
            rest -= jacobian.T @ np.linalg.lstsq(jacobian.T, rest, rcond=None)[0]
            worst = max(worst, float(np.max(np.abs(rest)) / np.max(np.abs(b))))
        return worst

    def _value_gradient(self, angles: Any) -> Any:
        """Gradient of E + multipliers . c away from closure, where c's derivative is not just a_k.

        The rotation vector's derivative at end rotation w is J(w)^-1 applied to the axes, with J
        the left Jacobian of the rotation group.
        """
        gradient, jacobian = self.gradient(angles)
        w = self.closure(angles)[3:]
        angle = float(np.linalg.norm(w))
        skew = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        factor = 1.0 / 12.0
        if angle > 1e-3:
            factor = 1.0 / angle**2 - (1.0 + math.cos(angle)) / (2.0 * angle * math.sin(angle))
        inverse = np.eye(3) - 0.5 * skew + factor * skew @ skew
        full = np.concatenate([jacobian[:3], inverse @ jacobian[3:]])
        return gradient + full.T @ self.multipliers


def derivatives(context: Context) -> Findings:
    """Closed-form derivatives against differences."""
    from dnacheck.equilibria.discrete.search import find_rings
    from dnacheck.model.chain import elastic_energy

    rng = context.rng()
    results = []
    for angles in ANGLE_SETS:
        chain = random_chain(rng, 60, 90, angles)
        ring = find_rings(chain).lowest
        lagrangian = _Lagrangian(chain, ring.angles, ring.multipliers)
        gradient, jacobian = lagrangian.gradient(ring.angles)
        worst = 0.0
        step = 1e-5
        for _ in range(3):
            direction = rng.standard_normal(ring.angles.shape)
            plus, minus = ring.angles + step * direction, ring.angles - step * direction
            rate = (elastic_energy(chain, plus) - elastic_energy(chain, minus)) / (2.0 * step)
            slope = gradient @ direction.ravel()
            worst = max(worst, abs(rate - slope) / np.linalg.norm(gradient))
            moved = (lagrangian.closure(plus) - lagrangian.closure(minus)) / (2.0 * step)
            worst = max(
                worst,
                float(np.max(np.abs(moved - jacobian @ direction.ravel())) / np.max(np.abs(moved))),
            )
        results.append(_derivative(f"gradient, {angles}", worst))
        results.append(_derivative(f"Hessian, {angles}", lagrangian.hessian_error(rng)))
    wrong = np.array(ring.multipliers)
    wrong[:3] *= -1.0
    error = lagrangian.hessian_error(rng, wrong)
    results.append(
        must_fail(_derivative("control", error), "the force has the wrong sign in the Hessian")
    )
    return Findings(results)


def _derivative(item: str, error: float) -> CheckResult:
    return judge(
        f"discrete.derivatives[{item}]",
        "largest relative departure of closed-form derivatives from differences",
        error,
        DERIVATIVE_TOLERANCE,
        Rule.AT_MOST,
        "finite differences of energy and closure",
        "differences of second and fourth order in double precision reach 1e-8",
    )


def convergence(context: Context) -> Findings:
    """Random molecules: every one must reach a stable minimum."""
    from dnacheck.equilibria.discrete.search import find_rings, search_minima
    from dnacheck.equilibria.discrete.solve import NewtonOptions

    rng = context.rng()
    count = _SEQUENCES[context.level]
    failures, worst, iterations = [], 0.0, []
    for number in range(count):
        chain = random_chain(rng, 60, 400, ANGLE_SETS[number % 3])
        found = find_rings(chain)
        if not found.equilibria or not found.lowest.stable:
            failures.append(f"{chain.name} ({chain.angle_set})")
            continue
        worst = max(worst, found.lowest.residual)
        iterations.append(found.lowest.iterations)
    lower = []
    brute = _BRUTE[context.level]
    registers = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False, dtype=np.float64)
    for number in range(brute):
        chain = random_chain(rng, 60, 400, ANGLE_SETS[number % 3])
        quick = find_rings(chain).lowest
        middle = round(chain.relaxed_turns)
        links = tuple(range(middle - 2, middle + 3))
        full = search_minima(chain, links, registers, math.inf, NewtonOptions()).lowest
        if full.energy < quick.energy * (1.0 - 1e-9):
            lower.append(f"{chain.name}: {full.energy:.8g} < {quick.energy:.8g}")
    results = [
        _count("random", f"of {count} random molecules without a stable minimum", failures),
        judge(
            "discrete.convergence[residual]",
            "largest residual of these minima",
            worst,
            RESIDUAL,
            Rule.AT_MOST,
            "equations (4.6)",
            "the solver's own tolerance",
        ),
    ]
    if brute:
        words = f"of {brute} brute-force searches (5 links, 32 registers) that found a lower ring"
        results.append(_count("brute", words, lower))
    return Findings(results)


def _count(item: str, words: str, culprits: list[str]) -> CheckResult:
    named = f" ({'; '.join(culprits[:3])})" if culprits else ""
    return judge(
        f"discrete.convergence[{item}]",
        f"number {words}{named}",
        len(culprits),
        0,
        Rule.EQUAL,
        "every closed chain has a lowest ring",
        "none may be missed",
    )


def growth(context: Context) -> Findings:
    """Long chains: convergence and linear cost."""
    from dnacheck.equilibria.discrete.search import SearchOptions, find_rings

    rng = context.rng()
    rows, results = [], []
    for n in (150, 1000, 3000, 10_000):
        if n > _LARGEST[context.level]:
            continue
        chain = random_chain(rng, n, n)
        link = round(chain.relaxed_turns)
        began = time.perf_counter()
        found = find_rings(chain, SearchOptions(links="auto" if n < 5000 else link))
        seconds = time.perf_counter() - began
        ring = found.lowest
        rows.append(
            {
                "n": n,
                "energy": ring.energy_RT,
                "link": ring.link,
                "iterations": ring.iterations,
                "residual": ring.residual,
                "stable": ring.stable,
                "starts": found.starts,
                "seconds": seconds,
            }
        )
        results.append(
            judge(
                f"discrete.growth[{n}]",
                f"residual of the lowest ring of a random {n}-mer",
                ring.residual if ring.stable else math.inf,
                RESIDUAL,
                Rule.AT_MOST,
                "equations (4.6)",
                "the solver's own tolerance, at any length",
            )
        )
    table = Table(
        "growth",
        "Long chains",
        [
            Column("n", "bp", "", "d"),
            Column("energy", "energy", "RT", ".4f"),
            Column("link", "link", "", "d"),
            Column("iterations", "iterations", "", "d"),
            Column("residual", "residual", "", ".0e"),
            Column("stable", "stable"),
            Column("starts", "starts", "", "d"),
            Column("seconds", "time of the search", "s", ".3f"),
        ],
        rows,
        f"Random sequences. The paper could not solve the discrete problem without a continuum "
        f"guess, in 15 to 90 minutes each for 155 base pairs (Section IX of {PAPER}).",
    )
    return Findings(results, [table])


GROUP = Group(
    "discrete",
    "Discrete chain",
    "Newton's method on the closed wedge chain (Section IV A): derivatives, convergence, growth.",
    (
        Check("discrete.derivatives", "derivatives against differences", derivatives, 1.0,
              ("energy",), Level.QUICK),
        Check("discrete.convergence", "random molecules and brute force", convergence, 12.0,
              ("energy",), applies=lambda scene: None if scene.checks.hard_cases
              else "the scene does not ask for hard cases"),
        Check("discrete.growth", "up to 10,000 base pairs", growth, 8.0, ("energy",),
              applies=lambda scene: None if scene.checks.hard_cases
              else "the scene does not ask for hard cases"),
    ),
)  # fmt: skip
