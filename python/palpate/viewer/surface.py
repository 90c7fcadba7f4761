"""The part of the bodies that is seen: surface nodes, and the values on them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array
from palpate.mesh import Mesh


class Surfaces:
    """Surface nodes of several bodies, stacked; made once per topology.

    ``nodes[i]`` are the mesh nodes of body i that are seen, ``triangles[i]`` (m, 3) rows of them,
    ``triangle_offsets[i]`` the number of body i's first triangle among all.
    """

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        self._set([mesh.triangles for mesh in meshes], [len(mesh.nodes) for mesh in meshes])

    @classmethod
    def of_triangles(
        cls, triangles: Sequence[npt.NDArray[np.integer]], node_counts: Sequence[int]
    ) -> Surfaces:
        """From the surface triangles of bodies with so many nodes."""
        surfaces = cls.__new__(cls)
        surfaces._set(triangles, node_counts)
        return surfaces

    def _set(
        self, triangles: Sequence[npt.NDArray[np.integer]], node_counts: Sequence[int]
    ) -> None:
        self.nodes = [np.unique(each).astype(np.int64) for each in triangles]
        self.triangles = [
            np.searchsorted(nodes, each).astype(np.uint32)
            for nodes, each in zip(self.nodes, triangles, strict=True)
        ]
        self.node_counts = list(node_counts)
        self.offsets = _starts(self.nodes)
        self.triangle_offsets = _starts(self.triangles)
        self._stacked = np.empty((int(self.offsets[-1]), 3), dtype=np.float32)

    def fits(self, positions: Sequence[Float64Array]) -> bool:
        """Whether the bodies still have as many nodes."""
        return [len(each) for each in positions] == self.node_counts

    def stack(self, positions: Sequence[Float64Array]) -> npt.NDArray[np.float32]:
        """Positions of all surface nodes, (N, 3); valid until the next call."""
        for index, (nodes, points) in enumerate(zip(self.nodes, positions, strict=True)):
            part = self._stacked[self.offsets[index] : self.offsets[index + 1]]
            part[:] = points[nodes]
        return self._stacked

    def stack_values(self, values: Sequence[npt.NDArray[np.float64]]) -> npt.NDArray[np.float32]:
        """A number per surface node, (N,), from one per node of each body."""
        return np.concatenate(
            [each[nodes] for nodes, each in zip(self.nodes, values, strict=True)]
        ).astype(np.float32)

    def triangle_numbers(self, pairs: npt.NDArray[np.integer]) -> npt.NDArray[np.uint32]:
        """Numbers among all triangles of rows of body_a, triangle_a, body_b, triangle_b."""
        sides = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
        return np.unique(self.triangle_offsets[sides[:, 0]] + sides[:, 1]).astype(np.uint32)


def _starts(parts: Sequence[npt.NDArray[np.generic]]) -> npt.NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum([len(each) for each in parts], dtype=np.int64)])


def deformation(rest: Float64Array, positions: Float64Array) -> Float64Array:
    """How far each node is [m] from where the best rigid motion of the body would put it, (n,)."""
    from_center, to_center = rest.mean(axis=0), positions.mean(axis=0)
    before, after = rest - from_center, positions - to_center
    left, _, right = np.linalg.svd(before.T @ after)
    turn = np.sign(np.linalg.det(left @ right))
    rotation = (left * np.array([1.0, 1.0, turn])) @ right
    off: Float64Array = np.linalg.norm(after - before @ rotation, axis=1)
    return off
