"""Tests of the sampled distributions by the physical-validation package (optional).

Shirts, J. Chem. Theory Comput. 9, 909 (2013); Merz & Shirts, PLoS ONE 13, e0202764 (2018).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dnacheck.md.bead_chain import GAS_CONSTANT_KJ
from dnacheck.md.ensemble import Ensemble
from dnacheck.md.ensemble_statistics import statistical_inefficiency
from dnacheck.numerics.outcome import InputError

Array = NDArray[np.float64]


def kinetic_energy_test(ensemble: Ensemble, seed: int = 0) -> tuple[float, float]:
    """Distance of the kinetic energy's mean and width from Maxwell and Boltzmann's.

    Returns
    -------
    mean, width : float
        In standard deviations of each; above 3 something is wrong.

    Raises
    ------
    InputError
        The package is not installed.
    """
    package = _package()
    mean, width = package.kinetic_energy.distribution(
        _data(package, ensemble),
        strict=False,
        verbosity=0,
        bootstrap_seed=seed,
        data_is_uncorrelated=True,
    )
    return float(abs(mean)), float(abs(width))


def temperature_pair_test(cold: Ensemble, warm: Ensemble) -> float:
    """Whether the potential energies of two temperatures have the ratio of Boltzmann weights.

    Parameters
    ----------
    cold, warm : Ensemble
        Of one chain in the measure "frames" (whose potential does not depend on temperature) and
        with different bath ratios.

    Returns
    -------
    float
        Distance of the measured slope from that of the two temperatures, in its standard
        deviations; above 3 something is wrong.

    Raises
    ------
    InputError
        The package is not installed, or the measure is not "frames".
    """
    package = _package()
    for ensemble in (cold, warm):
        if ensemble.options.measure != "frames":
            raise InputError("two temperatures can be compared only in the measure 'frames'")
    quantiles = package.ensemble.check(
        _data(package, cold), _data(package, warm), verbosity=0, data_is_uncorrelated=True
    )
    return float(abs(quantiles[0]))


def _package() -> Any:
    try:
        import physical_validation
    except ImportError as error:
        raise InputError(
            "these tests need the package physical-validation; install dnacheck[md]"
        ) from error
    return physical_validation


def _data(package: Any, ensemble: Ensemble) -> Any:
    rt = ensemble.beads.rt_kJ
    n_beads = ensemble.replicas[0].positions.shape[1]
    return package.data.SimulationData(
        units=package.data.UnitData(
            kb=GAS_CONSTANT_KJ,
            energy_conversion=1.0,
            length_conversion=1.0,
            volume_conversion=1.0,
            temperature_conversion=1.0,
            pressure_conversion=1.0,
            time_conversion=1.0,
            energy_str="kJ/mol",
            length_str="nm",
            volume_str="nm^3",
            temperature_str="K",
            pressure_str="bar",
            time_str="ps",
        ),
        ensemble=package.data.EnsembleData(
            "NVT",
            natoms=n_beads,
            volume=1.0,
            temperature=ensemble.beads.temperature_K * ensemble.options.bath_ratio,
        ),
        system=package.data.SystemData(
            natoms=n_beads,
            nconstraints=0,
            ndof_reduction_tra=3 * n_beads - ensemble.degrees_of_freedom,
            ndof_reduction_rot=0,
        ),
        observables=package.data.ObservableData(
            kinetic_energy=rt * _thinned(ensemble, "kinetic_RT"),
            potential_energy=rt * _thinned(ensemble, "potential_RT"),
        ),
    )


def _thinned(ensemble: Ensemble, name: str) -> Array:
    """Every so many values that those left count as independent."""
    series = np.stack([getattr(r, name) for r in ensemble.replicas])
    potential = np.stack([r.potential_RT for r in ensemble.replicas])
    kinetic = np.stack([r.kinetic_RT for r in ensemble.replicas])
    gap = max(statistical_inefficiency(potential), statistical_inefficiency(kinetic))
    return np.ascontiguousarray(series[:, :: int(np.ceil(gap))].ravel())
