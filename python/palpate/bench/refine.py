"""Tetrahedra split into n³ each: edgewise subdivision (Edelsbrunner and Grayson 2000)."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
import numpy.typing as npt

from palpate.mesh import Mesh

_Integers = npt.NDArray[np.int64]


def refine(mesh: Mesh, divisions: int) -> Mesh:
    """The same body with every edge in ``divisions`` parts; a surface keeps its triangles."""
    if divisions == 1 or not len(mesh.tetrahedra):
        return mesh
    corners = np.sort(mesh.tetrahedra, axis=1).astype(np.int64)
    lattice, children = subdivision(divisions)
    points, owners = _shared_points(corners, lattice)
    nodes = np.einsum("pc,pcx->px", points[:, 4:] / divisions, mesh.nodes[points[:, :4]])
    tetrahedra = owners[:, children].reshape(-1, 4)
    edges = nodes[tetrahedra[:, 1:]] - nodes[tetrahedra[:, :1]]
    inside_out = np.linalg.det(edges) < 0
    tetrahedra[inside_out] = tetrahedra[inside_out][:, [1, 0, 2, 3]]
    return Mesh(nodes, tetrahedra)


def subdivision(divisions: int) -> tuple[_Integers, _Integers]:
    """Points of one tetrahedron as weights of its corners, (p, 4), and its children, (n³, 4).

    A child is an n by 4 table of colours 0 to 3 that never falls when read row by row and whose
    columns differ; a column, a multiset of corners, is a vertex. Colours rise three times, once in
    each of the three gaps between columns: a child is an order of the gaps and a row for each rise.
    """
    index: dict[tuple[int, ...], int] = {}
    children = []
    for gaps in permutations(range(3)):
        for rows in product(range(divisions), repeat=3):
            rises = list(zip(rows, gaps, strict=True))
            if rises != sorted(rises):
                continue
            child = []
            for column in range(4):
                colors = [sum(rise < (row, column) for rise in rises) for row in range(divisions)]
                weights = tuple(colors.count(color) for color in range(4))
                child.append(index.setdefault(weights, len(index)))
            children.append(child)
    return np.array(list(index)), np.array(children)


def _shared_points(corners: _Integers, lattice: _Integers) -> tuple[_Integers, _Integers]:
    """Distinct lattice points of all tetrahedra, and those of each tetrahedron by their row.

    A row is four nodes and their four weights.
    """
    count, size = len(corners), len(lattice)
    weights = np.broadcast_to(lattice, (count, size, 4))
    # A corner without weight must not tell apart a point that two tetrahedra share.
    nodes = np.where(weights > 0, corners[:, None, :], -1)
    order = np.argsort(nodes, axis=2, kind="stable")
    keys = np.concatenate(
        [np.take_along_axis(nodes, order, 2), np.take_along_axis(weights, order, 2)], axis=2
    ).reshape(-1, 8)
    points, inverse = np.unique(keys, axis=0, return_inverse=True)
    points[:, :4] = np.maximum(points[:, :4], 0)
    return points, inverse.reshape(count, size)
