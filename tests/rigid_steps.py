"""Rigid base-pair steps in sixty digits, in the textbook form with the angle of the bend's axis.

An independent reference: nothing of the package is used, and no series.
"""

import mpmath as mp
import numpy as np

DIGITS = 60


def _z(angle):
    c, s = mp.cos(angle), mp.sin(angle)
    return mp.matrix([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def _y(angle):
    c, s = mp.cos(angle), mp.sin(angle)
    return mp.matrix([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def step_in_many_digits(coordinates):
    """Rotation and next centre of a step (twist, tilt, roll, shift, slide, rise)."""
    with mp.workdps(DIGITS):
        twist, tilt, roll = (mp.mpf(x) for x in coordinates[:3])
        bend, phase = mp.hypot(tilt, roll), mp.atan2(tilt, roll)
        rotation = _z(twist / 2 - phase) * _y(bend) * _z(twist / 2 + phase)
        middle = _z(twist / 2 - phase) * _y(bend / 2) * _z(phase)
        return rotation, middle * mp.matrix([mp.mpf(x) for x in coordinates[3:]])


class LagrangianInManyDigits:
    """force . end + moment . (rotation of the end since the given coordinates)."""

    def __init__(self, coordinates, multipliers):
        self.x = [mp.mpf(float(v)) for v in np.ravel(coordinates)]
        self.multipliers = [mp.mpf(float(v)) for v in multipliers]
        self.start = mp.eye(3)
        with mp.workdps(DIGITS):
            self.start = self.end(self.x)[1].T

    def end(self, x):
        rotation, centre = mp.eye(3), mp.zeros(3, 1)
        for s in range(0, len(x), 6):
            turn, move = step_in_many_digits(x[s : s + 6])
            centre += rotation * move
            rotation = rotation * turn
        return centre, rotation

    def value(self, x):
        centre, rotation = self.end(x)
        r = rotation * self.start
        # The rotation vector of a rotation by a small angle, from its antisymmetric part.
        v = mp.matrix([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / 2
        sine = mp.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
        factor = mp.asin(sine) / sine if sine > 0 else mp.mpf(1)
        total = mp.mpf(0)
        for i in range(3):
            total += self.multipliers[i] * centre[i] + self.multipliers[3 + i] * factor * v[i]
        return total

    def _moved(self, *changes):
        x = list(self.x)
        for index, change in changes:
            x[index] += change
        return self.value(x)

    def gradient(self):
        """Central differences, error 1e-36 relative to the bend's own scale."""
        with mp.workdps(DIGITS):
            h = mp.mpf(10) ** -24
            return np.array(
                [float((self._moved((i, h)) - self._moved((i, -h))) / (2 * h))
                 for i in range(len(self.x))]
            )  # fmt: skip

    def hessian(self):
        with mp.workdps(DIGITS):
            h, n = mp.mpf(10) ** -18, len(self.x)
            out = np.empty((n, n))
            for i in range(n):
                for j in range(i + 1):
                    total = (
                        self._moved((i, h), (j, h)) - self._moved((i, h), (j, -h))
                        - self._moved((i, -h), (j, h)) + self._moved((i, -h), (j, -h))
                    )  # fmt: skip
                    out[i, j] = out[j, i] = float(total / (4 * h * h))
            return out
