"""Figures of the bead-chain check: energies, minima, ensemble, beside Monte Carlo.

Run with molecule names (default: two); ``--ensemble N`` samples N configurations per replica,
``--halve`` repeats that at half the time step, ``--metropolis N`` adds a Metropolis run.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from dnacheck.md.bead_chain import sabotaged
from dnacheck.md.check import MdCheck, MdOptions, run_md_check
from dnacheck.md.ensemble import EnsembleOptions
from dnacheck.md.geometry import per_base_pair_fluctuation
from dnacheck.model.chain import Chain, build_chain
from dnacheck.model.molecules import embedded
from dnacheck.ring.discrete import DiscreteRing
from dnacheck.ring.search import find_rings


def energies(chain: Chain, rings: list[DiscreteRing]) -> MdCheck:
    options = MdOptions(ensemble=None)
    links = tuple(sorted({ring.link for ring in rings}))
    options = replace(options, minimise=replace(options.minimise, links=links))
    check = run_md_check(chain, np.stack([ring.angles for ring in rings]), options)
    for match in check.rings:
        print(
            f"  ring {match.energy_RT:10.5f} RT: evaluated {match.openmm_difference:8.1e}, "
            f"from noise {match.perturbed_difference:8.1e} ({match.perturbed_rms_A:.1e} Å), "
            f"own start {match.own_difference:8.1e} ({match.own_rms_A:.1e} Å)"
        )
    print(
        f"  seconds: energy {check.energy_seconds:.1f}, minima {check.minimise_seconds:.1f}; "
        f"passed {check.passed}"
    )
    only = MdOptions(ensemble=None, minimise=None)
    for kind in ("sign", "stiffness"):
        bad = run_md_check(chain, rings[0].angles, only, built_from=sabotaged(chain, kind, 40))
        worst = max(abs(f.difference) for f in bad.findings)
        print(f"  control, one {kind}: caught {not bad.passed}, worst difference {worst:.1e}")
    return check


def ensemble(chain: Chain, ring: DiscreteRing, samples: int, fraction: float) -> MdCheck:
    options = MdOptions(
        ensemble=EnsembleOptions(samples=samples, step_fraction=fraction), threads=2
    )
    links = replace(options.minimise, links=(ring.link,), registers=1)
    check = run_md_check(chain, ring.angles, replace(options, minimise=links))
    s = check.statistics
    assert s is not None
    print(
        f"  MD, step fraction {fraction:g}: energy {s.elastic_RT.mean:.2f} ± "
        f"{s.elastic_RT.stderr:.2f} RT (equipartition {s.equipartition_RT:.2f}), "
        f"T {s.temperature_K.mean:.2f} ± {s.temperature_K.stderr:.2f} K, "
        f"Rg {s.radius_of_gyration_A.mean:.3f} ± {s.radius_of_gyration_A.stderr:.3f} Å, "
        f"writhe {s.writhe.mean:.4f} ± {s.writhe.stderr:.4f}, {check.ensemble_seconds:.0f} s, "
        f"{s.elastic_RT.effective_samples:.0f} effective samples"
    )
    return check


def metropolis(chain: Chain, ring: DiscreteRing, samples: int, check: MdCheck) -> None:
    from dnacheck.jfactor.metropolis import ClosedRingOptions, closed_ring_ensemble

    begin = time.perf_counter()
    other = closed_ring_ensemble(chain, ring, ClosedRingOptions(samples=samples, threads=2), 1)
    assert check.statistics is not None
    reference = check.minima[0].centres_A
    theirs = per_base_pair_fluctuation(other.centres_A.astype(float), reference)
    ours = check.statistics.fluctuation_A
    laplace = check.harmonic_fluctuation_A
    assert laplace is not None
    print(
        f"  Metropolis: energy {other.energy_RT.mean:.2f} ± {other.energy_RT.stderr:.2f} RT, "
        f"{time.perf_counter() - begin:.0f} s"
    )
    print(
        f"  fluctuation, MD against Metropolis: correlation {np.corrcoef(ours, theirs)[0, 1]:.4f}, "
        f"mean ratio {np.mean(ours) / np.mean(theirs):.4f}; against Laplace "
        f"{np.corrcoef(ours, laplace)[0, 1]:.4f}, {np.mean(ours) / np.mean(laplace):.4f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("molecules", nargs="*", default=["11T15", "09T15"])
    parser.add_argument("--ensemble", type=int, default=0)
    parser.add_argument("--halve", action="store_true")
    parser.add_argument("--metropolis", type=int, default=0)
    arguments = parser.parse_args()
    for name in arguments.molecules:
        chain = build_chain(embedded(name))
        rings = [ring for ring in find_rings(chain).equilibria if ring.stable]
        print(f"{name}  {chain.n_steps} bp")
        energies(chain, rings)
        if arguments.ensemble:
            check = ensemble(chain, rings[0], arguments.ensemble, 0.45)
            if arguments.halve:
                ensemble(chain, rings[0], arguments.ensemble, 0.225)
            if arguments.metropolis:
                metropolis(chain, rings[0], arguments.metropolis, check)


if __name__ == "__main__":
    main()
