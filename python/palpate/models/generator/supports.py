"""Rigid supports: closed surfaces of revolution with even triangles."""

import numpy as np

from .mesher import Mesh


def hexagonal_disk(rings: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ring and angle of each node (ring k has 6k nodes), and triangles, counter-clockwise from above."""
    ring = [0] + [k for k in range(1, rings + 1) for _ in range(6 * k)]
    angle = [0.0] + [np.pi * j / (3 * k) for k in range(1, rings + 1) for j in range(6 * k)]

    def node(k: int, j: int) -> int:
        return 0 if k == 0 else 1 + 3 * k * (k - 1) + j % (6 * k)

    triangles = []
    for k in range(1, rings + 1):
        for side in range(6):
            for j in range(k):
                outer, inner = side * k + j, side * (k - 1) + j
                triangles.append((node(k, outer), node(k, outer + 1), node(k - 1, inner)))
                if j < k - 1:
                    triangles.append(
                        (node(k - 1, inner), node(k, outer + 1), node(k - 1, inner + 1))
                    )
    return np.array(ring), np.array(angle), np.array(triangles)


def revolve(upper: np.ndarray, lower: np.ndarray) -> Mesh:
    """Closed body between two profiles (radius, height) [m] that start on the axis and end in one point.

    Point k of a profile becomes a ring of 6k nodes; both have the same number of points.
    """
    rings = len(upper) - 1
    ring, angle, triangles = hexagonal_disk(rings)
    parts = [
        np.stack([p[ring, 0] * np.cos(angle), p[ring, 0] * np.sin(angle), p[ring, 1]], axis=1)
        for p in (upper, lower)
    ]
    # The outermost ring belongs to both.
    inner = len(ring) - 6 * rings
    below = np.where(
        np.arange(len(ring)) < inner, np.arange(len(ring)) + len(ring), np.arange(len(ring))
    )
    nodes = np.concatenate([parts[0], parts[1][:inner]])
    return Mesh(np.round(nodes, 6) + 0.0, np.concatenate([triangles, below[triangles[:, ::-1]]]))


def resample(corners: list[tuple[float, float]], count: int) -> np.ndarray:
    """`count` + 1 points at even distances along a polyline."""
    line = np.array(corners)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], count + 1)
    return np.stack([np.interp(at, length, line[:, k]) for k in range(2)], axis=1)


def bowl() -> Mesh:
    """A shallow bowl, 30 cm across and 6 cm deep, its inner bottom at the origin."""
    radius = np.linspace(0.0, 0.140, 29)
    inside = [(r, 0.060 * (r / 0.140) ** 2) for r in radius.tolist()]
    rim = [(0.145, 0.0625), (0.150, 0.0600)]
    return revolve(
        resample([*inside, *rim], 15),
        resample([(0.0, -0.015), (0.120, -0.015), (0.150, 0.0600)], 15),
    )


def plate() -> Mesh:
    """A round plate, 24 cm across and 2 cm thick, its top at height 0."""
    return revolve(
        resample([(0.0, 0.0), (0.120, 0.0)], 8),
        resample([(0.0, -0.020), (0.115, -0.020), (0.120, 0.0)], 8),
    )
