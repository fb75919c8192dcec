"""Gradients, profiles, fits: the figures of docs/mechanics.md.

Run: python validation/benchmarks/mechanics.py NAME
with NAME one of gradient, cost, profile, formula, substitutions, table3, recovery, degeneracy.
"""

from __future__ import annotations

import itertools
import sys
import time

import numpy as np

from dnacheck.cyclization.gradient import closed_draws
from dnacheck.cyclization.methods import Auto, ClosureSampling
from dnacheck.mechanics.fit import FitOptions, fit_mechanics
from dnacheck.mechanics.local_model import local_model
from dnacheck.mechanics.measurements import Measurement
from dnacheck.mechanics.posterior import profile_likelihood
from dnacheck.mechanics.profile import changed_length, length_profile
from dnacheck.mechanics.sensitivity import sensitivity_of
from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import Molecule, embedded, embedded_names
from dnacheck.model.named_parameters import modified_chain, own_value
from dnacheck.model.sequence import parse_sequence
from dnacheck.validation.reference.table3 import published_table
from dnacheck.validation.reference.wormlike_chain import chain_rod_j

WIDTHS = {
    "persistence_length_A": 10.0,
    "twist_ratio": 0.05,
    "twist_offset_deg": 0.03,
    "bend_scale": 0.02,
    "a_tract_twist_deg": 0.05,
    "a_tract_bend_scale": 0.02,
    "tau[AA]": 0.1,
    "theta[AG]": 0.3,
    "phi[CA]": 0.3,
}


def gradient() -> None:
    """Against central differences with common random numbers, the eleven molecules."""
    worst = 0.0
    for name in embedded_names():
        chain = build_chain(embedded(name))
        values = {n: own_value(chain, n) for n in WIDTHS}
        names = [n for n in WIDTHS if np.isfinite(values[n])]
        model = local_model(chain, closed_draws(chain, tolerance=0.004), names, values)
        for i, parameter in enumerate(names):
            h = WIDTHS[parameter]
            ends = [
                closed_draws(
                    modified_chain(chain, {parameter: values[parameter] + s * h}), tolerance=0.004
                ).log_j
                for s in (1.0, -1.0)
            ]
            slope = (ends[0] - ends[1]) / (2.0 * h)
            error = float(np.hypot(model.gradient_stderr[i], 0.5 * 0.004 / h))
            off = (model.gradient[i] - slope) / error
            worst = max(worst, abs(off))
            print(
                f"{name} {parameter:<22} gradient {model.gradient[i]:+9.4f} ± "
                f"{model.gradient_stderr[i]:.4f}, difference {slope:+9.4f}: {off:+.1f} s.e."
            )
    print(f"largest difference {worst:.2f} combined standard errors")


def cost() -> None:
    """J alone and J with all derivatives, interleaved."""
    chain = build_chain(embedded("11T15"))
    names = list(WIDTHS)
    values = {n: own_value(chain, n) for n in names}
    alone, whole = [], []
    for k in range(12):
        began = time.perf_counter()
        ClosureSampling().compute(chain, rng=k, tolerance=0.01)
        middle = time.perf_counter()
        ClosureSampling(gradient=True).compute(chain, rng=k, tolerance=0.01)
        end = time.perf_counter()
        if k > 1:
            alone.append(middle - began)
            whole.append(end - middle)
    ratio = np.array(whole) / np.array(alone)
    print(
        f"J alone {1e3 * np.median(alone):.1f} ms, with the gradient of every step "
        f"{1e3 * np.median(whole):.1f} ms, ratio {np.median(ratio):.2f}"
    )
    draws = closed_draws(chain, tolerance=0.01)
    began = time.perf_counter()
    local_model(chain, draws, names, values)
    print(f"named parameters and their Hessian: {1e3 * (time.perf_counter() - began):.1f} ms more")


def profile() -> None:
    """Twenty-five lengths at 0.02, warm."""
    for _ in range(2):
        began = time.perf_counter()
        found = length_profile(
            embedded("11T15"),
            range(-12, 13),
            lambda m: Auto().compute(build_chain(m), tolerance=0.02),
            place=20,
            threads=2,
        )
        seconds = time.perf_counter() - began
    print(f"25 lengths in {seconds:.2f} s, largest s.e. {found.stderr.max():.4f}")


def formula() -> None:
    """Straight homopolymers beside Shimada and Yamakawa's formula."""
    print("   bp    -ln J   error  formula (coupled)  difference  formula (plain)  difference")
    for n in (126, 131, 147, 152, 200, 205, 252, 300, 400, 500, 700, 1000, 2000, 4000):
        chain = build_chain(Molecule(parse_sequence("A" * n, f"A{n}")), a_tracts="none")
        straight = modified_chain(chain, {"bend_scale": 0.0})
        result = Auto().compute(straight, tolerance=0.05, threads=2)
        rod = chain_rod_j(straight)
        print(
            f"{n:5d} {result.minus_lnJ:8.3f} {result.total_error:7.3f} "
            f"{rod.minus_lnJ_coupled:12.3f} {result.minus_lnJ - rod.minus_lnJ_coupled:+17.3f} "
            f"{rod.minus_lnJ:14.3f} {result.minus_lnJ - rod.minus_lnJ:+14.3f}"
        )


def substitutions() -> None:
    """All single substitutions of 11T15, predicted and computed."""
    from scipy.stats import spearmanr

    molecule = embedded("11T15")

    def rebuild(letters: str):
        return build_chain(Molecule(parse_sequence(letters, "m"), molecule.a_tract_regions))

    found = sensitivity_of(
        build_chain(molecule), rebuild, tolerance=0.01, compute=10_000, threads=2
    )
    predicted = [item.predicted for item in found.substitutions]
    computed = [item.computed for item in found.substitutions]
    off = np.array(predicted) - np.array(computed)
    print(
        f"{len(off)} substitutions: rank correlation "
        f"{spearmanr(predicted, computed).statistic:.4f}, "
        f"difference rms {np.sqrt(np.mean(off**2)):.3f}, largest {np.abs(off).max():.3f}"
    )


def _eleven():
    table = published_table()
    rows = [
        Measurement(embedded(n), float(x), 0.7)
        for n, x in zip(table.names, table.experiment, strict=True)
    ]
    return rows, [build_chain(row.molecule) for row in rows]


def table3() -> None:
    """In-sample and leave-one-out rms of every subset of at most four parameters."""
    rows, chains = _eleven()
    names = (
        "persistence_length_A",
        "twist_ratio",
        "twist_offset_deg",
        "bend_scale",
        "a_tract_twist_deg",
        "offset",
    )
    for size in range(1, 5):
        for free in itertools.combinations(names, size):
            began = time.perf_counter()
            fit = fit_mechanics(rows, chains, free, options=FitOptions(threads=2))
            text = ", ".join(
                f"{p.name} {p.value:.4g}" + ("" if p.stderr is None else f" ± {p.stderr:.2g}")
                for p in fit.parameters
            )
            print(
                f"rms {fit.rms:.3f}, left out {fit.leave_one_out_rms:.3f}, chi2 "
                f"{fit.chi_square:.1f}/{fit.degrees_of_freedom}, "
                f"{'settled' if fit.converged else 'not settled'}, "
                f"{time.perf_counter() - began:.1f} s: {text}",
                flush=True,
            )


def recovery(sets: int = 100) -> None:
    """Coverage of intervals over made-up data: 25 lengths, noise 0.15, four parameters."""
    truth = {
        "persistence_length_A": 500.0,
        "twist_ratio": 1.4,
        "twist_offset_deg": -0.08,
        "bend_scale": 1.1,
    }
    molecules = [changed_length(embedded("11T15"), c, 20, "ACGTTGCATC") for c in range(-12, 13)]
    chains = [build_chain(m) for m in molecules]
    exact = [
        -closed_draws(modified_chain(c, truth), tolerance=0.005, rng=12345).log_j for c in chains
    ]
    inside = {(name, level): 0 for name in truth for level in (0.68, 0.95)}
    for k in range(sets):
        noise = 0.15 * np.random.default_rng(k).standard_normal(len(exact))
        rows = [
            Measurement(m, y + e, 0.15) for m, y, e in zip(molecules, exact, noise, strict=True)
        ]
        fit = fit_mechanics(rows, chains, list(truth), options=FitOptions(seed=k, threads=2))
        for name, true in truth.items():
            intervals = profile_likelihood(fit, name).intervals
            for level in (0.68, 0.95):
                low, high = intervals[level]
                inside[name, level] += low <= true <= high
    for (name, level), count in inside.items():
        error = np.sqrt(level * (1.0 - level) / sets)
        off = (count / sets - level) / error
        print(
            f"{name:<22} {100 * level:.0f} %: {count} of {sets} inside ({off:+.1f} binomial s.e.)"
        )


def degeneracy() -> None:
    """Shape against flexibility: a profile of one molecule, bends and stiffness free."""
    molecules = [changed_length(embedded("11T15"), c, 20, "ACGTTGCATC") for c in range(-12, 13)]
    chains = [build_chain(m) for m in molecules]
    rows = [
        Measurement(m, -closed_draws(c, tolerance=0.01).log_j, 0.15)
        for m, c in zip(molecules, chains, strict=True)
    ]
    free = ["persistence_length_A", "bend_scale", "offset", "twist_offset_deg", "a_tract_twist_deg"]
    fit = fit_mechanics(rows, chains, free, options=FitOptions(threads=2))
    for item in fit.directions:
        parts = ", ".join(f"{v:+.2f} {n}" for n, v in item.parts.items() if abs(v) > 0.15)
        print(f"eigenvalue {item.eigenvalue:10.3f}, error {item.stderr:8.3f} ranges: {parts}")
    print("correlation of persistence length and bend scale:", f"{fit.correlation[0, 1]:+.3f}")


if __name__ == "__main__":
    chosen = {f.__name__: f for f in (
        gradient, cost, profile, formula, substitutions, table3, recovery, degeneracy
    )}  # fmt: skip
    for argument in sys.argv[1:] or list(chosen):
        if argument not in chosen:
            sys.exit(f"choose from {', '.join(chosen)}")
        print(f"== {argument}")
        chosen[argument]()
