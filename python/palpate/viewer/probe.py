"""The rigid tool of the viewer: a rod with a round tip."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array
from palpate.mesh import Mesh

#: Name of the body that the viewer adds to a model.
NAME = "viewer probe"

_AROUND = 24
_RINGS = 7


def probe_mesh(radius: float, length: float) -> Mesh:
    """A closed surface around the z axis: a half ball that touches the origin, and a rod."""
    angles = 2 * np.pi * np.arange(_AROUND) / _AROUND
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    polar = 0.5 * np.pi * np.arange(1, _RINGS + 1) / _RINGS
    profile = [(radius * np.sin(p), radius * (1 - np.cos(p))) for p in polar]
    # Edges of the rod about as long as those of the ball: long thin triangles make poor contacts.
    steps = max(2, int(length / (4 * radius)))
    profile += [(radius, radius + (length - radius) * k / steps) for k in range(1, steps + 1)]
    rings = [np.column_stack([r * circle, np.full(_AROUND, z)]) for r, z in profile]
    nodes = np.concatenate([[[0.0, 0.0, 0.0]], *rings, [[0.0, 0.0, length]]])
    triangles = []
    last = len(nodes) - 1
    top = 1 + (len(rings) - 1) * _AROUND
    for k in range(_AROUND):
        after = (k + 1) % _AROUND
        triangles.append((0, 1 + after, 1 + k))
        triangles.append((last, top + k, top + after))
        for ring in range(len(rings) - 1):
            low = 1 + ring * _AROUND
            high = low + _AROUND
            triangles.append((low + k, low + after, high + after))
            triangles.append((low + k, high + after, high + k))
    return Mesh(nodes, triangles=np.array(triangles))


def aim(direction: npt.ArrayLike) -> Float64Array:
    """Rotation (3, 3) that turns the probe so that its tip points along ``direction``."""
    axis = -np.asarray(direction, dtype=np.float64)
    length = np.linalg.norm(axis)
    axis = np.array([0.0, 0.0, 1.0]) if length == 0 else axis / length
    helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    side = np.cross(helper, axis)
    side /= np.linalg.norm(side)
    rotation: Float64Array = np.column_stack([side, np.cross(axis, side), axis])
    return rotation
