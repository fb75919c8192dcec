"""Continuation: Figures 6 and 7, and time per point beside AUTO-07p.

Both programs follow the lowest ring of 11T15 in the end twist, on 50 equal intervals with 4
collocation points, tolerance 1e-7, one run each; times are processor times of one core, which
other work on the machine disturbs least.
"""

from __future__ import annotations

import resource
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from oracles import auto07p

from dnacheck.equilibria.bridge.reconstruct import reconstruct
from dnacheck.equilibria.continuation import (
    ContinuationOptions,
    Kind,
    lowest_component,
    perfect_diagram,
)
from dnacheck.equilibria.continuation.branch import ring_from
from dnacheck.equilibria.continuation.diagram import start_walker
from dnacheck.equilibria.continuation.figures import marked_rings
from dnacheck.equilibria.continuation.follow import Bounds, follow_branch
from dnacheck.equilibria.continuation.parameters import end_twist, perfect_rod
from dnacheck.equilibria.continuum import ContinuumOptions
from dnacheck.equilibria.continuum.collocation import discretise
from dnacheck.equilibria.continuum.search import lowest_continuum_ring
from dnacheck.equilibria.continuum.state import new_state, run_newton, transfer
from dnacheck.equilibria.discrete.solve import NewtonOptions, solve_ring
from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import embedded
from dnacheck.model.rod import build_rod


def figure_six() -> None:
    """Energy and branch points of the twisted circle against their closed forms."""
    rod = perfect_rod(158, 1.5)
    circle = perfect_diagram(rod, depth=0).branches[0]
    exact = 0.5 * rod.bend_stiffness * (2 * np.pi) ** 2
    exact = exact + 0.5 * rod.twist_stiffness * circle.parameter**2
    error = np.abs(circle.energy / exact - 1).max()
    print(f"circle: largest relative error of the energy {error:.1e}")
    right = [p for p in circle.of_kind(Kind.BRANCH_POINT) if p.parameter > 0]
    for mode, point in zip((2, 3, 4), right, strict=True):
        error = point.parameter - 2 * np.pi * np.sqrt(mode**2 - 1) / 1.5
        print(f"branch point n = {mode}: alpha {point.parameter:.9f}, error {error:.1e}")
    diagram = perfect_diagram(rod)
    print(f"connected family: {len(diagram.branches)} branches, {diagram.status}")


def figure_seven(rod, chain) -> None:
    """Marked rings and their discrete counterparts."""
    for ring in marked_rings(lowest_component(rod)):
        discrete = solve_ring(chain, reconstruct(ring).angles, NewtonOptions(minima_only=False))
        print(
            f"marked ring, link {ring.link}: {ring.energy_RT:.4f} RT, discrete "
            f"{discrete.energy_RT:.4f} RT ({100 * (ring.energy / discrete.energy - 1):+.3f} %), "
            f"negative directions {ring.negative_directions} and {discrete.negative_directions}"
        )


def beside_auto(rod) -> None:
    """Energies and time per point."""
    ring = lowest_continuum_ring(rod).lowest
    state = new_state(discretise(rod, ring.curve.mesh, ring.curve.degree))
    curve = ring.curve
    state.slopes[:], state.loads[:], state.centres[:] = curve.slopes, curve.loads, curve.centres
    moved = transfer(state, np.linspace(0.0, 1.0, 51))
    run_newton(moved, moved.disc.coefficients(), ring.curve.alpha, ContinuumOptions())
    options = ContinuationOptions(tolerance=1e-7)
    walker, spot = start_walker(moved.disc, end_twist(), options, ring.curve.alpha, moved)
    times = []
    for _ in range(5):
        began = time.process_time()
        branch = follow_branch(walker, spot, Bounds(), both=False)
        times.append((time.process_time() - began) / len(branch))
    ours = float(np.median(times))
    print(f"dnacheck: {len(branch)} points, {1e3 * ours:.2f} ms per point (median of 5 runs)")
    if not auto07p.installed():
        print("AUTO-07p: skipped: not installed")
        return
    start = ring_from(walker.disc, walker.active, spot.parameter, spot.loads, spot.slopes)
    solution = start.curve.solution(np.linspace(0.0, 1.0, 201))
    exact = auto07p.follow_twist(rod, ring.curve.alpha, solution, points=25, energy=True)
    fine, first = start_walker(
        moved.disc, end_twist(), ContinuationOptions(), ring.curve.alpha, moved
    )
    worst = 0.0
    for alpha, energy in zip(exact.alpha[1:], exact.energy[1:], strict=True):
        if alpha < exact.alpha.max():
            end = follow_branch(fine, first, Bounds(-10.0, alpha), both=False)
            worst = max(worst, abs(end.energy[-1] / energy - 1.0))
        else:
            break
    print(f"AUTO-07p: largest relative difference of energies {worst:.1e}")
    auto = auto07p.follow_twist(rod, ring.curve.alpha, solution, points=115)
    print(f"AUTO-07p: {len(auto.alpha)} points, {1e3 * auto.seconds_per_point:.2f} ms per point")
    print(f"ratio of times per point, AUTO-07p / dnacheck: {auto.seconds_per_point / ours:.1f}")


def main() -> None:
    """Print the figures."""
    chain = build_chain(embedded("11T15"))
    rod = build_rod(chain)
    figure_six()
    figure_seven(rod, chain)
    beside_auto(rod)
    print(f"memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


if __name__ == "__main__":
    main()
