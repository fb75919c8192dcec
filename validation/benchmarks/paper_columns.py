"""Which few changes of its tables would explain Table III's Trifonov and De Santis columns?

The paper's eleven model values (experiment less the printed residual, one shift free) are compared
with the discrete rings' energies. The derivative of a ring's energy by a ground value is
-K (q - q^) (envelope theorem), so every table entry, the twist as a whole, the bend scale and the
A-tract twist give a column; all subsets of up to three or four columns are fitted by least squares
and the best are put into the tables and computed anew, because the changes may be large.

Run: python validation/benchmarks/paper_columns.py
"""

from __future__ import annotations

import itertools

import numpy as np

from dnacheck.equilibria.discrete.search import find_rings
from dnacheck.model.chain import build_chain
from dnacheck.model.molecules import embedded
from dnacheck.model.named_parameters import chain_derivatives, modified_chain, own_value
from dnacheck.model.sequence import STEP_NAMES, reverse_complement
from dnacheck.validation.reference.table3 import published_table

ROUNDING = 0.1 / np.sqrt(12.0)
"""Standard deviation of a value printed to one decimal, RT; two such per difference."""
PRIOR = {"tau": 2.0, "theta": 5.0, "phi": 5.0}
"""Largest change of an entry, in degrees, that could be a misprint or another reading."""


def entries() -> list[str]:
    """Table entries, one of each strand pair; phi of the self-complementary steps is zero."""
    names = []
    for step in STEP_NAMES:
        other = reverse_complement(step)
        if other < step:
            continue
        for angle in ("tau", "theta", "phi"):
            if not (angle == "phi" and other == step):
                names.append(f"{angle}[{step}]")
    return names


def energy(chain) -> float:
    return find_rings(chain).lowest.energy_RT


def study(angles: str, most: int = 3) -> None:
    table = published_table()
    paper = table.experiment - table.residuals[angles]
    chains = [build_chain(embedded(name), angles) for name in table.names]
    names = ["twist_offset_deg", "bend_scale", *entries()]
    if angles == "trifonov2":
        names.append("a_tract_twist_deg")
    values = {name: own_value(chains[0], name) for name in names}
    names = [name for name in names if np.isfinite(values[name])]
    ours, slopes = [], []
    for chain in chains:
        ring = find_rings(chain).lowest
        ours.append(ring.energy_RT)
        derivatives = chain_derivatives(chain, names, values)
        pull = chain.energy_scale_RT * np.einsum(
            "nij,nj->ni", chain.stiffness, ring.angles - chain.ground
        )
        slopes.append(-np.einsum("ni,pni->p", pull, derivatives.ground))
    ours, slopes = np.array(ours), np.array(slopes)
    difference = paper - ours
    centred = difference - difference.mean()
    print(f"{angles}: shift {difference.mean():.2f} RT, rms {np.sqrt(np.mean(centred**2)):.2f} RT")
    columns = slopes - slopes.mean(axis=0)
    scale = np.array([PRIOR.get(name.split("[")[0], 1.0) for name in names])
    for size in range(1, most + 1):
        found = []
        for chosen in itertools.combinations(range(len(names)), size):
            part = columns[:, chosen]
            change, *_ = np.linalg.lstsq(part, centred, rcond=None)
            rms = float(np.sqrt(np.mean((centred - part @ change) ** 2)))
            found.append((rms, chosen, change))
        found.sort(key=lambda item: item[0])
        plausible = [f for f in found if (np.abs(f[2]) <= scale[list(f[1])]).all()]
        for label, best in (("best", found[:2]), ("best of plausible size", plausible[:2])):
            for rms, chosen, change in best:
                picked = [names[i] for i in chosen]
                moved = {n: values[n] + c for n, c in zip(picked, change, strict=True)}
                again = np.array([energy(modified_chain(c, moved)) for c in chains])
                left = paper - again
                text = ", ".join(f"{n} {c:+.2f}" for n, c in zip(picked, change, strict=True))
                print(
                    f"  {size} changed, {label}: {text}: rms {rms:.2f} linear, "
                    f"{np.std(left):.2f} computed anew (shift {left.mean():.2f})"
                )
    print(f"  within rounding would be {ROUNDING * np.sqrt(2):.2f} RT")


if __name__ == "__main__":
    for name in ("trifonov2", "trifonov", "desantis"):
        study(name)
