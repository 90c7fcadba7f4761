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
from palpate.mesh import Mesh
from palpate.model import Model
from palpate.scene import Scene

#: Pairs of stacked triangle indices, shape (k, 2), sorted within a row.
PairArray = npt.NDArray[np.int64]


class MissingError(Exception):
    """A library that is not there; the message says how to get it."""


class Answer(Enum):
    """What a contender finds."""

    PAIRS = "all pairs"
    INTER_PAIRS = "pairs of different bodies"
    CANDIDATES = "candidates only"


@dataclass(frozen=True)
class Contender:
    """A library with a way to use it; ``run`` is one timed pass, ``found`` a frame's pairs."""

    name: str
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
        self.true_pairs: list[PairArray] = []
        scene = Scene(model)
        for frame in self.frames:
            scene.update(frame)
            self.true_pairs.append(self.stacked(scene.intersections().pairs))

    def stacked(self, pairs: IndexArray) -> PairArray:
        """Rows body_a, triangle_a, body_b, triangle_b as stacked triangle indices."""
        rows = np.asarray(pairs, dtype=np.int64).reshape(-1, 4)
        first = self.triangle_offsets[rows[:, 0::2]] + rows[:, 1::2]
        return distinct(first)

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
        for frame, truth in enumerate(self.true_pairs):
            expected = self.inter(truth) if contender.answer is Answer.INTER_PAIRS else truth
            found = set(map(tuple, contender.found(frame).tolist()))
            wanted = set(map(tuple, expected.tolist()))
            missed += len(wanted - found)
            extra += len(found - wanted)
            total += len(wanted)
        if contender.answer is Answer.CANDIDATES:
            held = "contain every pair" if not missed else f"miss {missed:,} of {total:,} pairs"
            return (
                f"{(extra + total - missed) / len(self.frames):,.0f} candidates per frame, {held}"
            )
        if missed or extra:
            return f"misses {missed:,} and invents {extra:,} of {total:,}"
        return f"identical ({total:,} pairs)"


def distinct(pairs: npt.ArrayLike) -> PairArray:
    """Rows with the smaller index first, sorted, each once."""
    rows = np.sort(np.asarray(pairs, dtype=np.int64).reshape(-1, 2), axis=1)
    return np.unique(rows, axis=0)


def _offsets(counts: Sequence[int]) -> npt.NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
