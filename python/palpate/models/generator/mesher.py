"""From a shape to a mesh of given size: sample, place nodes, tetrahedralise, improve, number."""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from .improve import improve
from .nodes import interior_nodes, sample, surface_area, surface_nodes
from .shapes import Points, Shape
from .tetrahedra import surface_triangles, tetrahedralise

# Samples per edge length: enough for an even spread.
FINENESS = 6.0
# Interior spacing grows by this much per metre of depth.
GROWTH = 0.3


@dataclass
class Mesh:
    """What a `.seg` file holds; `elements` has 4 columns (tetrahedra) or 3 (triangles)."""

    nodes: Points
    elements: np.ndarray
    sets: dict[str, np.ndarray] = field(default_factory=dict)

    def triangles(self) -> np.ndarray:
        """Outward surface triangles."""
        return self.elements if self.elements.shape[1] == 3 else surface_triangles(self.elements)


def make_mesh(
    shape: Shape, extent: tuple[Points, Points], triangles: int, interior: int, seed: int
) -> Mesh:
    """Fills `shape` with `triangles` on its surface (even, genus 0) and `interior` nodes inside.

    `extent` [m] holds the lowest and highest corner of a box around the shape; `seed` is that of
    the first placement.
    """
    rng = np.random.default_rng(seed)
    surface_count = triangles // 2 + 2
    edge = float(np.sqrt(surface_area(shape, *extent) / surface_count * 2.0 / np.sqrt(3.0)))
    samples = sample(shape, *extent, edge / FINENESS)
    surface = surface_nodes(samples, shape, surface_count, rng)
    inner = interior_nodes(samples, surface, interior, edge, GROWTH, rng)
    nodes = np.concatenate([surface, inner])
    tetrahedra = tetrahedralise(shape, nodes, surface_count, edge)
    nodes, tetrahedra = improve(nodes, tetrahedra, surface_count, samples, seed)
    order = breadth_first(tetrahedra, len(nodes), int(nodes[:, 2].argmax()))
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    tetrahedra = rank[tetrahedra]
    tetrahedra = tetrahedra[np.lexsort(np.sort(tetrahedra, axis=1).T[::-1])]
    # Micrometres: short files, and what is checked is what is written.
    return Mesh(np.round(nodes[order], 6) + 0.0, tetrahedra)


def breadth_first(tetrahedra: np.ndarray, count: int, start: int) -> np.ndarray:
    """Order of nodes by distance from `start`: neighbours get near numbers."""
    around: list[set[int]] = [set() for _ in range(count)]
    for tet in tetrahedra.tolist():
        for node in tet:
            around[node].update(tet)
    seen, order, queue = {start}, [], deque([start])
    while queue:
        node = queue.popleft()
        order.append(node)
        for other in sorted(around[node] - seen):
            seen.add(other)
            queue.append(other)
    return np.array(order, dtype=np.int64)


def mean_edge(mesh: Mesh) -> float:
    """Mean length of the surface edges [m]."""
    t = mesh.triangles()
    pairs = np.unique(np.sort(t[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    return float(np.linalg.norm(mesh.nodes[pairs[:, 0]] - mesh.nodes[pairs[:, 1]], axis=1).mean())
