"""Tetrahedra over placed nodes: Delaunay, cut to the shape, with a manifold surface."""

import numpy as np
from scipy.spatial import Delaunay

from .shapes import Points, Shape

# Faces opposite node 0, 1, 2, 3 of a positive tetrahedron, outward.
FACES = np.array([(1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)])
EDGES = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])
# The two nodes off each edge: the faces opposite them share the edge.
OFF_EDGES = np.array([(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)])


def signed_volumes(corners: np.ndarray) -> np.ndarray:
    """(..., 4, 3) -> (...): volume [m^3], positive when (b-a)x(c-a).(d-a) > 0."""
    a = corners[..., 0, :]
    return (
        np.cross(corners[..., 1, :] - a, corners[..., 2, :] - a) * (corners[..., 3, :] - a)
    ).sum(-1) / 6.0


def quality(corners: np.ndarray) -> np.ndarray:
    """(..., 4, 3) -> (...): the smallest sine of the six dihedral angles, negative when inverted."""
    a, b, c, d = (corners[..., k, :] for k in range(4))
    volume = (np.cross(b - a, c - a) * (d - a)).sum(-1) / 6.0
    areas = np.stack(
        [
            0.5 * np.sqrt((np.cross(q - p, r - p) ** 2).sum(-1))
            for p, q, r in ((b, c, d), (a, d, c), (a, b, d), (a, c, b))
        ],
        axis=-1,
    )
    lengths = np.sqrt(((corners[..., EDGES[:, 0], :] - corners[..., EDGES[:, 1], :]) ** 2).sum(-1))
    products = areas[..., OFF_EDGES[:, 0]] * areas[..., OFF_EDGES[:, 1]]
    return (1.5 * volume[..., None] * lengths / np.maximum(products, 1e-30)).min(-1)


def surface_triangles(tetrahedra: np.ndarray) -> np.ndarray:
    """Faces of exactly one tetrahedron, outward, in the order of their tetrahedra."""
    faces = tetrahedra[:, FACES].reshape(-1, 3)
    _, inverse, counts = np.unique(
        np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    return faces[counts[inverse.ravel()] == 1]


def tetrahedralise(shape: Shape, nodes: Points, surface_count: int, edge: float) -> np.ndarray:
    """Delaunay tetrahedra of `nodes` inside `shape`; the first `surface_count` nodes lie on it."""
    tetrahedra = Delaunay(nodes).simplices.astype(np.int64)
    flip = signed_volumes(nodes[tetrahedra]) < 0.0
    tetrahedra[flip] = tetrahedra[flip][:, [1, 0, 2, 3]]
    corners = nodes[tetrahedra]
    value = shape(corners.mean(1))
    all_surface = (tetrahedra < surface_count).all(1)
    keep = np.where(all_surface, value < -0.02 * edge, True) & (value < 0.25 * edge)
    return tetrahedra[keep]
