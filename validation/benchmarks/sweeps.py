"""Sweeps: eleven molecules, three angle sets, sixteen ratios, both models; and Figure 10."""

from __future__ import annotations

import time

import numpy as np

from dnacheck.equilibria.continuation.figures import RATIOS, robustness
from dnacheck.equilibria.continuation.twist_ratio import sweep_continuum, sweep_discrete
from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import embedded, embedded_names
from dnacheck.model.rod import build_rod

ANGLE_SETS = ("trifonov2", "trifonov", "desantis")


def everything() -> None:
    """Time and residual of all sweeps, warm."""
    chains = [build_chain(embedded(n), angles=a) for a in ANGLE_SETS for n in embedded_names()]
    for _ in range(2):  # the second round is warm
        began, wall = time.process_time(), time.perf_counter()
        sweeps, gaps, corrected = [], [], []
        for chain in chains:
            rod = build_rod(chain)
            continuum, discrete = sweep_continuum(rod, RATIOS), sweep_discrete(chain, RATIOS)
            sweeps += [continuum, discrete]
            gaps.append(np.abs(continuum.energy / discrete.energy - 1.0).max())
        seconds, wall = time.process_time() - began, time.perf_counter() - wall
    for chain, discrete in zip(chains, sweeps[1::2], strict=True):
        better = sweep_continuum(build_rod(chain), RATIOS, corrected_for=chain)
        corrected.append(np.abs(better.energy / discrete.energy - 1.0).max())
    points = sum(len(sweep.ratios) - len(sweep.missing) for sweep in sweeps)
    print(f"{points} lowest rings in {seconds:.1f} s of one core, {wall:.1f} s by the clock")
    print(f"largest residual {max(s.residual.max() for s in sweeps):.1e}")
    print(
        f"largest gap continuum - discrete {100 * max(gaps):.3f} %, "
        f"with the steps' compliance {100 * max(corrected):.3f} %"
    )
    for sweep in sweeps:
        for crossing in sweep.crossings:
            print(
                f"crossing: {sweep.name} {sweep.model} link {crossing.links[0]} to "
                f"{crossing.links[1]} at K3/K1 = {crossing.ratio:.6f} +- {crossing.precision:.0e}"
            )


def figure_ten() -> None:
    """Spread of ring energies, RT: pieces over the padded molecule, and over the molecule."""
    print("molecule  pieces    (k,m)>=(12,5)  w 10-25   all  farthest from (15,20,6)")
    for name in embedded_names():
        chain = build_chain(embedded(name))
        for span in ("padded", "molecule"):
            data = robustness(chain, RATIOS, span=span)
            print(
                f"{name:9} {span:9} {data['spread_fit']:12.4f} {data['spread_width']:9.4f} "
                f"{data['spread_all']:7.4f} {data['farthest']:9.4f}"
            )


if __name__ == "__main__":
    everything()
    figure_ten()
