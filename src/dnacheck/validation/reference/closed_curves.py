"""Framed closed polygons with a writhe, and their link by counting crossings."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_OFFSET = 0.05
"""Distance of the second strand from the polygon, in steps: nearer than any two parts of it."""
_ROUNDS = 60


def coiled_frames(n: int, radius: float, turns: int) -> Array:
    """Frames (n+1, 3, 3), d3 along the equal edges of a ring that coils twice about a circle.

    The curve ((1 + a cos 2t) cos t, (1 + a cos 2t) sin t, a sin 2t), a = ``radius``, has a writhe
    that falls with a. ``turns`` full turns of d1 are spread evenly over parallel transport, whose
    own closing angle is taken out.
    """
    fine = np.linspace(0.0, 2.0 * math.pi, 20 * n + 1)
    wide = 1.0 + radius * np.cos(2.0 * fine)
    curve = np.stack(
        [wide * np.cos(fine), wide * np.sin(fine), radius * np.sin(2.0 * fine)], axis=1
    )
    parameter = np.linspace(0.0, 2.0 * math.pi, n + 1)
    for _ in range(_ROUNDS):  # until all edges are equally long
        points = np.stack([np.interp(parameter, fine, curve[:, i]) for i in range(3)], axis=1)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        parameter = np.interp(np.linspace(0.0, along[-1], n + 1), along, parameter)
    edges = np.diff(points, axis=0)
    tangents = edges / np.linalg.norm(edges, axis=1)[:, None]
    tangents = np.concatenate([tangents, tangents[:1]])
    normals = [np.cross(tangents[0], [0.0, 0.0, 1.0])]
    for tangent in tangents[1:]:
        normal = normals[-1] - (normals[-1] @ tangent) * tangent
        normals.append(normal / np.linalg.norm(normal))
    d1 = np.array(normals)
    d1[0] /= np.linalg.norm(d1[0])
    sine = np.cross(d1[0], d1[-1]) @ tangents[0]
    left = math.atan2(float(sine), float(d1[0] @ d1[-1]))
    angle = (2.0 * math.pi * turns - left) * np.arange(n + 1) / n
    d1 = np.cos(angle)[:, None] * d1 + np.sin(angle)[:, None] * np.cross(tangents, d1)
    frames: Array = np.stack([d1, np.cross(tangents, d1), tangents], axis=2)
    frames[-1] = frames[0]
    return frames


def crossing_link(centres: Array, d1: Array, direction: Array) -> int:
    """Linking number of a closed polygon (N, 3) with that displaced along ``d1`` (N, 3).

    Half the signed crossings of the two, seen along ``direction`` (3,): a count, without twist,
    writhe or any angle.
    """
    view = direction / np.linalg.norm(direction)
    side = np.cross(view, [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    basis = np.stack([side, np.cross(view, side), view])
    a = centres @ basis.T
    c = (centres + _OFFSET * d1) @ basis.T
    b, d = np.roll(a, -1, axis=0), np.roll(c, -1, axis=0)
    u, v = (b - a)[:, None, :], (d - c)[None, :, :]
    w = c[None, :, :] - a[:, None, :]
    cross = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    s = (w[..., 0] * v[..., 1] - w[..., 1] * v[..., 0]) / cross
    t = (w[..., 0] * u[..., 1] - w[..., 1] * u[..., 0]) / cross
    met = (s >= 0.0) & (s < 1.0) & (t >= 0.0) & (t < 1.0)
    above = w[..., 2] + t * v[..., 2] - s * u[..., 2]  # second strand over the first
    signs = np.sign(cross) * -np.sign(above)
    return round(float(np.sum(signs[met])) / 2.0)
