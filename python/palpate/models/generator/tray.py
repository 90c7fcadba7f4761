"""A shallow round bowl with a flat bottom: the rigid support the organs fall into."""

from __future__ import annotations

import numpy as np


def bowl(
    radius: float = 0.16,
    depth: float = 0.05,
    thickness: float = 0.02,
    rings: int = 8,
    sectors: int = 32,
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n, 3) [m] and outward triangles (t, 3); the lowest point of the inside is the origin."""
    angle = 2.0 * np.pi * np.arange(sectors) / sectors
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(sectors)])
    points = [np.zeros((1, 3))]
    for ring in range(1, rings + 1):
        r = ring / rings
        points.append(radius * r * circle + [0.0, 0.0, depth * r**3])
    for ring in range(rings, 0, -1):
        points.append(radius * ring / rings * circle + [0.0, 0.0, -thickness])
    points.append(np.array([[0.0, 0.0, -thickness]]))
    x = np.round(np.concatenate(points), 6)
    rows = 1 + np.arange(2 * rings)[:, None] * sectors + np.arange(sectors)[None, :]
    triangles = []
    for k in range(sectors):
        following = (k + 1) % sectors
        triangles.append((0, rows[0, k], rows[0, following]))
        for inner, outer in zip(rows[:-1], rows[1:], strict=True):
            triangles.append((inner[k], outer[k], outer[following]))
            triangles.append((inner[k], outer[following], inner[following]))
        triangles.append((len(x) - 1, rows[-1, following], rows[-1, k]))
    return x, np.array(triangles, dtype=np.int64)
