"""What every library is asked: the scene, its motion, and what to hand back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array, IndexArray
from palpate.bench import motion
from palpate.bench.measure import Pass
from palpate.contacts import Proximity
from palpate.mesh import Mesh
from palpate.model import Model
from palpate.scene import Scene

#: What is found, one row each, distinct. Intersections: two stacked triangle indices, the smaller
#: first. Proximity: 0, a node and a triangle's nodes, or 1 and the nodes of two edges, in rising
#: order. Closest features: up to three nodes of either side, falling, padded with -1.
PairArray = npt.NDArray[np.int64]


#: Distance of close pairs, in diagonals of the scene.
CLOSE = 1e-3


class MissingError(Exception):
    """A library that is not there; the message says how to get it."""


class Query(Enum):
    """What is asked."""

    INTERSECTIONS = "intersections"
    PROXIMITY = "proximity"


class Answer(Enum):
    """What a contender finds."""

    PAIRS = "all pairs"
    FEATURES = "closest features"
    INTER_PAIRS = "pairs of different bodies"
    CANDIDATES = "candidates only"


@dataclass(frozen=True)
class Contender:
    """A library with a way to use it; ``run`` is one timed pass, ``found`` a frame's pairs."""

    name: str
    query: Query
    answer: Answer
    how: str
    run: Callable[[], Pass]
    found: Callable[[int], PairArray]


class Setting:
    """A model's bodies, their motion, and the true pairs of every frame."""

    def __init__(self, name: str, model: Model, frames: int) -> None:
        self.name = name
        self.model = model
        self.meshes: list[Mesh] = [body.mesh for body in model.bodies]
        self.frames: list[list[Float64Array]] = motion.record(
            motion.fields(model), self.meshes, frames
        )
        self.node_offsets = _offsets([len(mesh.nodes) for mesh in self.meshes])
        self.triangle_offsets = _offsets([len(mesh.triangles) for mesh in self.meshes])
        #: Triangles of all bodies over stacked nodes, shape (t, 3).
        self.triangles = np.concatenate(
            [
                mesh.triangles.astype(np.int64) + first
                for mesh, first in zip(self.meshes, self.node_offsets, strict=False)
            ]
        )
        self.body_of_triangle = np.repeat(
            np.arange(len(self.meshes)), [len(mesh.triangles) for mesh in self.meshes]
        )
        #: Nodes of any triangle, stacked indices.
        self.surface_nodes = np.unique(self.triangles)
        #: Pairs closer than this [m] are near.
        self.distance = CLOSE * motion.diagonal(self.meshes)
        self.true_pairs: list[PairArray] = []
        self.near_pairs: list[PairArray] = []
        self.near_features: list[PairArray] = []
        scene = Scene(model)
        for frame in self.frames:
            scene.update(frame)
            self.true_pairs.append(self.stacked(scene.intersections().pairs))
            near = scene.proximity(self.distance)
            self.near_pairs.append(self.stacked_near(near))
            self.near_features.append(self.stacked_features(near))

    def truth(self, contender: Contender) -> list[PairArray]:
        """What a contender should find in every frame."""
        if contender.query is Query.PROXIMITY:
            features = contender.answer is Answer.FEATURES
            return self.near_features if features else self.near_pairs
        if contender.answer is Answer.INTER_PAIRS:
            return [self.inter(pairs) for pairs in self.true_pairs]
        return self.true_pairs

    def stacked(self, pairs: IndexArray) -> PairArray:
        """Rows body_a, triangle_a, body_b, triangle_b as stacked triangle indices."""
        rows = np.asarray(pairs, dtype=np.int64).reshape(-1, 4)
        first = self.triangle_offsets[rows[:, 0::2]] + rows[:, 1::2]
        return distinct(first)

    def stacked_near(self, near: Proximity) -> PairArray:
        """Close pairs by kind and stacked nodes."""
        nodes = self._near_nodes(near)
        corners, edges = near.kind == near.VERTEX_TRIANGLE, near.kind == near.EDGE_EDGE
        nodes[corners, 1:] = np.sort(nodes[corners, 1:], axis=1)
        return np.unique(
            np.concatenate(
                [
                    np.insert(nodes[corners], 0, 0, axis=1),
                    np.insert(sorted_sides(nodes[edges]), 0, 1, axis=1),
                ]
            ),
            axis=0,
        )

    def stacked_features(self, near: Proximity) -> PairArray:
        """Close pairs reduced to the nodes that bear weight: the closest features."""
        nodes = np.where(near.weights != 0, self._near_nodes(near), -1)
        sides = np.full((2, len(nodes), 3), -1, dtype=np.int64)
        for side, positive in enumerate((True, False)):
            mine = near.weights > 0 if positive else near.weights < 0
            sides[side] = -np.sort(-np.where(mine, nodes, -1), axis=1)[:, :3]
        return sorted_features(sides[0], sides[1])

    def _near_nodes(self, near: Proximity) -> PairArray:
        nodes = near.nodes.astype(np.int64)
        side_b = np.where(near.kind == near.VERTEX_TRIANGLE, 1, 2)
        of_b = np.arange(4) >= side_b[:, None]
        bodies = np.where(of_b, near.bodies[:, 1:], near.bodies[:, :1])
        return np.asarray(nodes + self.node_offsets[bodies])

    def _near_edges(self, frame: int) -> set[tuple[int, ...]]:
        """Close pairs of edges as features not reduced: what IPC lists for nearly parallel ones."""
        near = self.near_pairs[frame]
        edges = -np.sort(-near[near[:, 0] == 1][:, 1:].reshape(-1, 2, 2), axis=2)
        sides = np.pad(edges, ((0, 0), (0, 0), (0, 1)), constant_values=-1)
        return set(map(tuple, sorted_features(sides[:, 0], sides[:, 1]).tolist()))

    def surface(self) -> tuple[list[Float64Array], npt.NDArray[np.int64]]:
        """Positions of the surface nodes, stacked, in every frame, and triangles over them."""
        number = np.full(self.node_offsets[-1], -1)
        number[self.surface_nodes] = np.arange(len(self.surface_nodes))
        return [np.concatenate(frame)[self.surface_nodes] for frame in self.frames], number[
            self.triangles
        ]

    def without_neighbours(self, pairs: PairArray) -> PairArray:
        """Pairs that share no node."""
        a, b = self.triangles[pairs[:, 0]], self.triangles[pairs[:, 1]]
        shared = (a[:, :, None] == b[:, None, :]).any(axis=(1, 2))
        return np.asarray(pairs[~shared])

    def inter(self, pairs: PairArray) -> PairArray:
        """Pairs of different bodies."""
        bodies = self.body_of_triangle[pairs]
        return np.asarray(pairs[bodies[:, 0] != bodies[:, 1]])

    def check(self, contender: Contender) -> str:
        """How a contender's pairs compare with the true ones, over all frames."""
        missed = extra = total = 0
        for frame, expected in enumerate(self.truth(contender)):
            found = set(map(tuple, contender.found(frame).tolist()))
            wanted = set(map(tuple, expected.tolist()))
            missed += len(wanted - found)
            surplus = found - wanted
            if contender.answer is Answer.FEATURES:
                surplus -= self._near_edges(frame)
            extra += len(surplus)
            total += len(wanted)
        if contender.answer is Answer.CANDIDATES:
            held = "contain every pair" if not missed else f"miss {missed:,} of {total:,} pairs"
            return (
                f"{(extra + total - missed) / len(self.frames):,.0f} candidates per frame, {held}"
            )
        if missed or extra:
            return f"misses {missed:,} and invents {extra:,} of {total:,}"
        return f"identical ({total:,} pairs)"


def sorted_sides(nodes: PairArray) -> PairArray:
    """Nodes of two edges, (k, 4): each edge's in rising order, the smaller edge first."""
    edges = np.sort(nodes.reshape(-1, 2, 2), axis=2)
    swapped = (edges[:, 0, 0] > edges[:, 1, 0]) | (
        (edges[:, 0, 0] == edges[:, 1, 0]) & (edges[:, 0, 1] > edges[:, 1, 1])
    )
    edges[swapped] = edges[swapped][:, ::-1]
    return edges.reshape(-1, 4)


def sorted_features(side_a: PairArray, side_b: PairArray) -> PairArray:
    """Distinct rows of two features, each (k, 3) nodes falling and padded with -1, in one order."""
    sides = np.stack([side_a, side_b], axis=1)
    flat = [tuple(sorted(map(tuple, row))) for row in sides.tolist()]
    return np.array(sorted(set(flat)), dtype=np.int64).reshape(-1, 6)


def distinct(pairs: npt.ArrayLike) -> PairArray:
    """Rows with the smaller index first, sorted, each once."""
    rows = np.sort(np.asarray(pairs, dtype=np.int64).reshape(-1, 2), axis=1)
    return np.unique(rows, axis=0)


def _offsets(counts: Sequence[int]) -> npt.NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
