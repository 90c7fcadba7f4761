"""Measures of tetrahedra: volume and shape."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array, IndexArray
from palpate.mesh import Mesh


def signed_volumes(nodes: Float64Array, tetrahedra: IndexArray) -> Float64Array:
    """Volume [m³] of each tetrahedron, shape (m,); negative when it is turned inside out."""
    edges = nodes[tetrahedra[:, 1:]] - nodes[tetrahedra[:, :1]]
    return np.asarray(np.einsum("mi,mi->m", np.cross(edges[:, 0], edges[:, 1]), edges[:, 2]) / 6)


def mean_edge(mesh: Mesh) -> float:
    """Mean length [m] of the surface edges at rest."""
    a, b = (mesh.nodes[end] for end in mesh.surface_edges.T)
    return float(np.linalg.norm(b - a, axis=1).mean())


def node_means(values: Float64Array, cells: npt.NDArray[np.integer], count: int) -> Float64Array:
    """Mean of cells' values (m,) around each of ``count`` nodes; 0 where there are none."""
    corners = cells.ravel()
    sums = np.bincount(corners, np.repeat(values, cells.shape[1]), minlength=count)
    return np.asarray(sums / np.maximum(np.bincount(corners, minlength=count), 1))


def mean_ratios(nodes: Float64Array, tetrahedra: IndexArray) -> Float64Array:
    """Shape of each tetrahedron, shape (m,): 1 regular, 0 flat, negative inside out.

    Mean ratio ``12 (3 V)^(2/3) / sum of squared edges`` (Liu and Joe 1994).
    """
    volumes = signed_volumes(nodes, tetrahedra)
    corners = nodes[tetrahedra]
    squares = sum(
        np.sum((corners[:, a] - corners[:, b]) ** 2, axis=1) for a in range(4) for b in range(a)
    )
    return np.asarray(np.sign(volumes) * 12 * np.cbrt(3 * np.abs(volumes)) ** 2 / squares)


def dihedral_angles(nodes: Float64Array, tetrahedra: IndexArray) -> Float64Array:
    """Angle [degrees] between the faces at each edge of each tetrahedron, shape (m, 6).

    A regular tetrahedron has 70.5; small and large ones make a matrix ill-conditioned.
    """
    corners = nodes[tetrahedra]
    columns = []
    for a, b in ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)):
        c, d = (each for each in range(4) if each not in (a, b))
        edge = corners[:, b] - corners[:, a]
        first = np.cross(edge, corners[:, c] - corners[:, a])
        second = np.cross(edge, corners[:, d] - corners[:, a])
        across = np.linalg.norm(np.cross(first, second), axis=1)
        columns.append(np.degrees(np.arctan2(across, np.sum(first * second, axis=1))))
    return np.stack(columns, axis=1)
