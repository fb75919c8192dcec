"""Bond vectors and groove arms as coordinates of the bead chain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dnacheck.md.bead_chain import BeadChain

Array = NDArray[np.float64]


class BondCoordinates:
    """Bond vectors r(i+1) - r(i) and groove arms, scaled to unit mass and a unit of time.

    The unit of time is sqrt(mass / (mean bending stiffness / rise²)); in it the fastest bending,
    stretching and twisting waves of a uniform chain all have a frequency near 2. The bond vectors
    of a ring add up to zero; vectors of coordinates are kept in that subspace by
    :meth:`projected`.

    Attributes
    ----------
    size : int
        Number of coordinates, six for each frame of the chain.
    degrees_of_freedom : int
        Coordinates less the three that closure ties. Translation is not among them.
    unit_ps : float
        The unit of time.
    slowest_frequency : float
        Of bending, estimated as for a uniform rod: the first inextensible mode of a circle, or
        the first mode of a free rod.
    """

    def __init__(self, beads: BeadChain) -> None:
        chain, options = beads.chain, beads.options
        self.closed = beads.closed
        self._bonds = chain.n_steps + (0 if beads.closed else 1)
        twist_RT = chain.energy_scale_RT * float(np.mean(chain.stiffness[:, 0, 0]))
        self._bond_scale = chain.rise_A / float(np.sqrt(beads.bend_RT))
        self._arm_scale = options.groove_distance_A / float(np.sqrt(twist_RT))
        self.size = 6 * self._bonds
        self.degrees_of_freedom = self.size - (3 if self.closed else 0)
        # One kJ/mol per dalton and nm² is one ps^-2.
        rate = beads.bend_RT * options.rt_kJ / (options.centre_mass * (0.1 * chain.rise_A) ** 2)
        self.unit_ps = float(1.0 / np.sqrt(rate))
        if self.closed:
            self.slowest_frequency = float(np.sqrt(9.0 / 5.0) * 2.0 * np.pi / self._bonds)
        else:
            self.slowest_frequency = float(np.pi / self._bonds)

    def of_beads(self, positions: Array) -> Array:
        """Coordinates (size,) of bead positions (n_beads, 3) in Å."""
        centres, grooves = positions[0::2], positions[1::2]
        start = centres[: self._bonds]
        following = np.roll(centres, -1, axis=0)[: self._bonds]
        bonds = (following - start) / self._bond_scale
        return np.concatenate([bonds, (grooves - start) / self._arm_scale]).ravel()

    def beads(self, coordinates: Array) -> Array:
        """Bead positions (n_beads, 3) in Å; the first centre is at the origin."""
        bonds, arms = coordinates.reshape(2, self._bonds, 3)
        centres = np.zeros((self._bonds + 1, 3))
        np.cumsum(self._bond_scale * bonds, axis=0, out=centres[1:])
        positions = np.empty((2 * self._bonds + (0 if self.closed else 1), 3))
        positions[0::2] = centres[: len(positions[0::2])]
        positions[1::2] = centres[: self._bonds] + self._arm_scale * arms
        return positions

    def forces(self, bead_forces: Array) -> Array:
        """Forces (size,) on the coordinates from forces (n_beads, 3) on the beads, RT/Å."""
        out = np.empty((2, self._bonds, 3))
        out[1] = bead_forces[1::2]
        pulls = bead_forces[0::2].copy()
        pulls[: self._bonds] += out[1]
        # A bond vector moves all beads beyond it.
        beyond = np.cumsum(pulls[::-1], axis=0)[::-1]
        if self.closed:
            out[0, :-1] = beyond[1:]
            out[0, -1] = 0.0
        else:
            out[0] = beyond[1:]
        out[0] *= self._bond_scale
        out[1] *= self._arm_scale
        return self.projected(out.reshape(-1))

    def projected(self, vector: Array) -> Array:
        """Take out, in place, what would open a ring."""
        if self.closed:
            bonds = vector[: 3 * self._bonds].reshape(-1, 3)
            bonds -= bonds.mean(axis=0)
        return vector
