"""The paper's tables, from the data files."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache

from dnacheck.model.data_files import data_directory

PAPER = "Manning, Maddocks & Kahn, J. Chem. Phys. 105, 5626 (1996)"

ENERGY_ROUNDING = 0.5e-5 / 3.0**0.5
"""Standard deviation of the rounding of Table II's energies to five decimals."""


@dataclass(frozen=True)
class PublishedRing:
    """A row of Table II: reduced energies, rms distance in Å."""

    number: int
    name: str
    discrete: float
    continuum: float
    gap_percent: float
    rms_A: float


@dataclass(frozen=True)
class PublishedFreeEnergy:
    """A row of Table III; energies in RT."""

    number: int
    name: str
    torsional_phasing: float
    bend_phasing: float
    experiment: float
    minus_monte_carlo: float
    minus_trifonov2: float
    minus_trifonov: float
    minus_desantis: float

    @property
    def monte_carlo(self) -> float:
        """The Monte Carlo free energy itself."""
        return self.experiment - self.minus_monte_carlo


RIGID_RINGS_SOURCE = (
    "minima by an independent program: El Hassan–Calladine steps, gradient descent, two starting "
    "registers a sequence; Olson et al., PNAS 95, 11163 (1998), made strand-symmetric"
)


@dataclass(frozen=True)
class PublishedRigidRing:
    """A closed ring of rigid base-pair steps, the last pair held on the first."""

    link: int
    energy_kT: float
    letters: str


def _rows(file: str) -> list[dict[str, str]]:
    with (data_directory() / "published" / file).open(encoding="utf-8", newline="") as handle:
        return list(csv.DictReader(line for line in handle if not line.startswith("#")))


@cache
def cap_ring_binding() -> tuple[float, float]:
    """Binding constant of CAP on C-shaped rings over that on linear molecules, and ln's error."""
    (row,) = _rows("cap_ring_binding.csv")
    return float(row["ratio"]), float(row["ln_sigma"])


@cache
def rigid_rings() -> tuple[PublishedRigidRing, ...]:
    """Rings of random sequences by another program; see ``RIGID_RINGS_SOURCE``."""
    return tuple(
        PublishedRigidRing(int(row["link"]), float(row["energy_kT"]), row["sequence"])
        for row in _rows("rigid_base_pair_rings.csv")
    )


@cache
def table2() -> dict[str, PublishedRing]:
    """Table II by molecule, in the paper's order."""
    return {
        row["name"]: PublishedRing(
            int(row["number"]),
            row["name"],
            float(row["E_discrete_reduced"]),
            float(row["E_continuum_reduced"]),
            float(row["difference_percent"]),
            float(row["rms_configuration_difference_angstrom"]),
        )
        for row in _rows("table2_ring_energies.csv")
    }


@cache
def table3() -> dict[str, PublishedFreeEnergy]:
    """Table III by molecule, in the paper's order."""
    return {
        row["name"]: PublishedFreeEnergy(
            int(row["number"]),
            row["name"],
            float(row["torsional_phasing_turns"]),
            float(row["bend_phasing_turns"]),
            float(row["dG_experiment_RT"]),
            float(row["experiment_minus_monte_carlo_RT"]),
            float(row["experiment_minus_trifonov2_RT"]),
            float(row["experiment_minus_trifonov_RT"]),
            float(row["experiment_minus_desantis_RT"]),
        )
        for row in _rows("table3_free_energies.csv")
    }
