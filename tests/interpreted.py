"""Small problems that go through every kernel: run as a program, prints their numbers as JSON.

With NUMBA_DISABLE_JIT=1 the kernels run as plain Python: indices out of bounds raise, warnings of
numpy are errors, and coverage sees their lines. The numbers must be those of the compiled kernels.
"""

from __future__ import annotations

import json
import sys
import time
import warnings

import numpy as np

from dnacheck.model.chain import Chain, build_chain, chain_frames
from dnacheck.model.rod import RodOptions, build_rod
from dnacheck.model.sequence import parse_sequence

LETTERS = "GAAAAAACCGTCTAGGATCCATTTTTTGGCAGCTACGTTAGCAAAAAACGCGGATATCCGTAA"
ROD = RodOptions(filter_width=5, intervals=8, degree=5, padding=15)


def molecule(letters: str = LETTERS, **options) -> Chain:
    """A soft minicircle of some sixty base pairs."""
    options = {"angles": "trifonov", "persistence_length_A": 300.0, **options}
    return build_chain(parse_sequence(letters, "mini"), **options)


def full_chain(n: int = 24) -> Chain:
    """Uneven rest angles, full stiffness matrices, very soft."""
    rng = np.random.default_rng(5)
    ground = np.column_stack([rng.uniform(0.5, 0.7, n), *rng.uniform(-0.2, 0.2, (2, n))])
    root = np.eye(3) + 0.2 * rng.standard_normal((n, 3, 3))
    return Chain("full", ground, root @ root.transpose(0, 2, 1), persistence_length_A=3.4 * 40.0)


def rotations():
    from dnacheck.numerics import rotations as r
    from dnacheck.numerics.trigonometry import arctangents, sines_and_cosines

    out, back, q, v = np.empty((3, 3)), np.empty((3, 3)), np.empty(4), np.empty(3)
    numbers = []
    for angles in ((0.6, 0.1, -0.2), (3.1, 0.0, 0.0), (0.0, 3.0, 0.1), (2.0, 1.5, -3.0),
                   (1e-9, 0.0, 0.0), (np.pi, 0.0, 0.0), (0.3, np.pi, 0.0)):  # fmt: skip
        r.wedge_rotation(*angles, out)
        r.quaternion_from_matrix(out, q)
        r.matrix_from_quaternion(q, back)
        r.rotation_log(out, v)
        numbers += [*r.wedge_angles(out), np.abs(back - out).max(), *np.abs(v)]
        r.rotation_exp(v, back)
        numbers.append(np.abs(back - out).max())
    x = np.array([-9.0, -3.2, -1.5, 0.0, 1e-9, 0.4, 2.3, 7.0, 100.0])
    s, c = np.empty(9), np.empty(9)
    sines_and_cosines(x, s, c)
    numbers += [*s, *c]
    arctangents(s, c, s)
    return [*numbers, *s]


def discrete_rings():
    from dnacheck.equilibria.discrete.search import SearchOptions, find_rings
    from dnacheck.equilibria.discrete.solve import NewtonOptions, solve_ring

    numbers = []
    straight = molecule("A" * 42)
    for chain, links in (
        (molecule(), "auto"), (full_chain(), "auto"), (molecule(step_form="midstep"), "auto"),
        (straight, 4),
    ):  # fmt: skip
        found = find_rings(chain, SearchOptions(links=links))
        lowest = found.lowest
        numbers += [lowest.energy, lowest.link, lowest.writhe, lowest.smallest_eigenvalue]
        numbers.append(len(found.equilibria))
        if chain is not straight:  # its register is free, and its determinant round-off
            numbers.append(lowest.log_abs_det_kkt)
        saddle = solve_ring(chain, lowest.angles + 0.02, NewtonOptions(minima_only=False))
        numbers.append(saddle.energy)
    return numbers


def topology():
    from dnacheck.equilibria.discrete.search import find_rings
    from dnacheck.md.writhe_kernels import fill_writhe
    from dnacheck.numerics.curve_topology import fuller_writhe, polygon_writhe

    ring = find_rings(molecule()).lowest
    out = np.empty(1)
    fill_writhe(ring.centres[None, :-1], out)
    t = np.linspace(0.0, 2.0 * np.pi, 31)
    r = 2.0 + np.cos(3.0 * t)
    knot = np.column_stack([r * np.cos(2.0 * t), r * np.sin(2.0 * t), np.sin(3.0 * t)])
    return [*out, *fuller_writhe(ring.centres, ring.frames), polygon_writhe(knot)]


def continuum_rings():
    from dnacheck.equilibria.bridge.reconstruct import reconstruct
    from dnacheck.equilibria.continuum import ContinuumOptions, lowest_continuum_ring

    rod = build_rod(molecule(), ROD)
    found = lowest_continuum_ring(rod, options=ContinuumOptions(energy_tolerance=1e-5)).lowest
    numbers = [found.energy, found.link, found.writhe, found.curve.end_moment]
    numbers += [*reconstruct(found).angles[3], *found.curve.solution([0.3])[0]]
    return numbers


def families():
    from dnacheck.equilibria.continuation import Bounds, ContinuationOptions
    from dnacheck.equilibria.continuation.diagram import (
        imperfect_component,
        perfect_diagram,
        ratio_branch,
    )
    from dnacheck.equilibria.continuation.parameters import perfect_rod
    from dnacheck.equilibria.continuum import lowest_continuum_ring

    rod = build_rod(molecule(), ROD)
    ring = lowest_continuum_ring(rod).lowest
    coarse = ContinuationOptions(least_intervals=8, longest_step=0.3, max_points=12)
    branch = ratio_branch(rod, ring, Bounds(1.4, 1.6), coarse)
    numbers = [branch.energy[0], branch.energy[-1], len(branch)]
    near = Bounds(ring.curve.alpha - 0.2, ring.curve.alpha + 0.2)
    component = imperfect_component(rod, ring, bounds=near, options=coarse)
    numbers += [component.branches[0].energy[-1], len(component.branches)]
    perfect = perfect_diagram(
        perfect_rod(60, 1.5), 7.0, Bounds(6.9, 7.5),
        ContinuationOptions(least_intervals=16, max_points=12, longest_step=0.3), depth=0,
    )  # fmt: skip
    circle = perfect.branches[0]
    return [*numbers, circle.energy[-1], len(circle.special)]


def sweeps():
    from dnacheck.equilibria.continuation.twist_ratio import sweep_continuum, sweep_discrete

    chain = molecule()
    ratios = np.array([1.4, 1.45, 1.5])
    discrete = sweep_discrete(chain, ratios)
    continuum = sweep_continuum(build_rod(chain, ROD), ratios, corrected_for=chain)
    return [*discrete.energy, *continuum.energy]


def laplace_and_registers():
    from dnacheck.cyclization.closure.sampling import ClosureOptions, ClosureSampler
    from dnacheck.cyclization.laplace.anharmonic import AnharmonicOptions, anharmonic_term
    from dnacheck.cyclization.laplace.isolated import laplace
    from dnacheck.cyclization.laplace.register import (
        RegisterOptions,
        register_laplace,
        register_profile,
    )

    numbers = []
    for chain in (molecule(), full_chain()):
        profile = register_profile(chain, RegisterOptions())
        numbers += [laplace(profile.search).minus_lnJ, register_laplace(profile).minus_lnJ]
        options = ClosureOptions(
            tolerance=10.0, first_batches=4, pairs_per_batch=2, most_draws=1, probe_rate=0.5
        )
        sampled = ClosureSampler(profile, options, np.random.SeedSequence(1)).sample()
        numbers.append(sampled.minus_lnJ)
        term = anharmonic_term(profile, AnharmonicOptions(first_pairs=16, most_pairs=16), seed=2)
        numbers.append(term.value)
    return numbers


def scan():
    from dnacheck.scanning.scan import scan_row

    arguments = {"angles": "trifonov", "persistence_length_A": 300.0}
    rows = [scan_row("a", LETTERS, arguments), scan_row("b", "A" * 42, arguments)]
    return [float(cell) for row in rows for cell in row[2:6] if cell]


def half_chains():
    from dnacheck.cyclization.half_chain.sampling import HalfChainOptions, half_chain
    from dnacheck.equilibria.discrete.search import find_rings

    options = HalfChainOptions(halves=400, batches=4, radius=2.0)
    return [half_chain(find_rings(full_chain()), options, np.random.default_rng(3)).minus_lnJ]


def metropolis():
    from dnacheck.cyclization.ensembles.metropolis import (
        ClosedRingOptions,
        closed_ring_ensemble,
        sample_free_chain,
    )
    from dnacheck.cyclization.umbrella.sampling import UmbrellaOptions, umbrella_estimate
    from dnacheck.equilibria.discrete.search import find_rings

    chain = full_chain(12)
    options = UmbrellaOptions(
        strengths=(0.0, 1.0, 4.0, 12.0), samples=20, thinning=1, burn_in=10, copies=2
    )
    found = umbrella_estimate(find_rings(chain), options, np.random.default_rng(4))
    free = sample_free_chain(chain, 3, 1, np.random.default_rng(5))
    ring = find_rings(chain).lowest
    closed = ClosedRingOptions(samples=20, thinning=1, burn_in=10, copies=2)
    ensemble = closed_ring_ensemble(chain, ring, closed, np.random.default_rng(6))
    midstep = molecule("ACGTAGGATCCA", step_form="midstep")
    other = sample_free_chain(midstep, 2, 1, np.random.default_rng(7))
    return [found.log_j, *free[-1, 3], *other[-1, 3], ensemble.energy_RT.mean]


def frames():
    numbers = []
    for form in ("wedge", "midstep"):
        centres, directors = chain_frames(molecule().ground, form)
        numbers += [*centres[-1], *directors[-1].ravel()]
    return numbers


PROBLEMS = (
    rotations, frames, discrete_rings, topology, continuum_rings, families, sweeps,
    laplace_and_registers, scan, half_chains, metropolis,
)  # fmt: skip


def main() -> None:
    """Print the numbers of the problems named on the command line, or of all."""
    wanted = sys.argv[1:]
    numbers = {}
    for problem in PROBLEMS:
        if wanted and problem.__name__ not in wanted:
            continue
        began = time.process_time()
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            # random numbers are made of 64 bits that overflow
            warnings.filterwarnings("ignore", "overflow encountered in scalar (add|multiply)")
            numbers[problem.__name__] = [float(x) for x in problem()]
        print(f"{problem.__name__}: {time.process_time() - began:.1f} s", file=sys.stderr)
    print(json.dumps(numbers))


if __name__ == "__main__":
    main()
