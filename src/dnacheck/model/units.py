"""Physical units that turn reduced quantities into what is measured."""

BOLTZMANN_PN_NM_PER_K = 0.01380649
"""Boltzmann's constant, 1.380649e-23 J/K exactly."""
TEMPERATURE_K = 300.0
"""Temperature at which RT is turned into pN nm and of the bead chain's bath. Energies in RT and
shapes do not depend on it."""


def thermal_energy_pN_nm(temperature_K: float = TEMPERATURE_K) -> float:
    """k_B T of one molecule in pN nm; 4.142 at 300 K."""
    return BOLTZMANN_PN_NM_PER_K * temperature_K
