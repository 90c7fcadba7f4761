"""The smooth surface of a set of voxels: constrained elastic surface nets (after Gibson 1998).

One node in every cell of eight voxel centres that are not all alike. Nodes are relaxed, but never
leave their cell, so thin parts stay. Gibson relaxes a membrane, which ends as flat terraces with
kinks between slices; here a thin plate follows, and the volume is given back.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array, IndexArray

#: Rounds as a membrane, which undo the steps of voxels, and as a plate, which undo terraces.
MEMBRANE_ROUNDS, PLATE_ROUNDS = 15, 150
#: Step of a plate's round; stable below 1/2.
PLATE_STEP = 0.4
#: Most rounds that give back the volume that relaxation took, and what part of it may be missing.
GROWTH_ROUNDS, GROWTH_ERROR = 20, 1e-7


def surface_net(
    inside: npt.NDArray[np.bool_], axes: Float64Array
) -> tuple[Float64Array, IndexArray]:
    """Nodes (n, 3) in voxels and triangles (t, 3), outward, of the voxels that are True.

    Coordinates count voxels from the centre of the first. ``axes`` (3, 3), whose columns are the
    steps from voxel to voxel [m], serves to keep the volume.
    """
    padded = np.pad(inside, 1)
    cells, number = _cells(padded)
    quads = _quads(padded, number)
    if np.linalg.det(axes) < 0:
        quads = quads[:, ::-1]
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    neighbours = _neighbours(padded, cells, number)
    centres: Float64Array = cells + np.float64(0.5)
    nodes = _relaxed(centres, neighbours)
    wanted = float(np.count_nonzero(inside)) * abs(float(np.linalg.det(axes)))
    nodes = _grown(nodes, centres, triangles, axes, wanted)
    return nodes - 1.0, triangles.astype(np.int32)


def _cells(padded: npt.NDArray[np.bool_]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Cells with voxels of both kinds at their corners (n, 3), and their number on the grid."""
    any_in = padded[:-1, :-1, :-1].copy()
    all_in = any_in.copy()
    for corner in range(1, 8):
        window = padded[
            tuple(slice(1, None) if corner >> axis & 1 else slice(-1) for axis in range(3))
        ]
        any_in |= window
        all_in &= window
    cells = np.argwhere(any_in & ~all_in)
    number = np.full(any_in.shape, -1, dtype=np.int64)
    number[tuple(cells.T)] = np.arange(len(cells))
    return cells, number


def _quads(padded: npt.NDArray[np.bool_], number: npt.NDArray[np.int64]) -> Any:
    """The four cells around each pair of neighbour voxels of which one is inside, (q, 4)."""
    found = []
    for axis in range(3):
        low = tuple(slice(-1) if each == axis else slice(None) for each in range(3))
        high = tuple(slice(1, None) if each == axis else slice(None) for each in range(3))
        at = np.argwhere(padded[low] != padded[high])
        first, second = np.eye(3, dtype=np.int64)[[(axis + 1) % 3, (axis + 2) % 3]]
        ring = [at - first - second, at - second, at, at - first]
        quads = np.stack([number[tuple(cell.T)] for cell in ring], axis=1)
        leaves = padded[tuple(at.T)]  # from inside to outside along the axis
        quads[~leaves] = quads[~leaves][:, ::-1]
        found.append(quads)
    return np.concatenate(found)


def _neighbours(
    padded: npt.NDArray[np.bool_], cells: npt.NDArray[np.int64], number: npt.NDArray[np.int64]
) -> npt.NDArray[np.int64]:
    """Cells beyond those of the six faces that have voxels of both kinds, (n, 6); -1 for none."""
    result = np.full((len(cells), 6), -1, dtype=np.int64)
    for axis in range(3):
        first, second = np.eye(3, dtype=np.int64)[[(axis + 1) % 3, (axis + 2) % 3]]
        for side in range(2):
            step = np.eye(3, dtype=np.int64)[axis]
            corner = cells + side * step
            face = np.stack(
                [
                    padded[tuple((corner + i * first + j * second).T)]
                    for i in range(2)
                    for j in range(2)
                ]
            )
            mixed = face.any(axis=0) & ~face.all(axis=0)
            beyond = cells[mixed] + (2 * side - 1) * step
            result[mixed, 2 * axis + side] = number[tuple(beyond.T)]
    return result


def _relaxed(centres: Float64Array, neighbours: npt.NDArray[np.int64]) -> Float64Array:
    """Nodes of a membrane, then of a plate, that may move within their cells."""
    low, high = centres - 0.5, centres + 0.5
    share = 1.0 / (neighbours >= 0).sum(axis=1)[:, None]
    columns = np.ascontiguousarray(neighbours.T)

    def to_neighbours(values: Float64Array) -> Float64Array:
        # What is no neighbour, -1, is the row of zeros at the end.
        padded = np.concatenate([values, np.zeros((1, 3))])
        total = np.zeros_like(values)
        for column in columns:
            total += padded.take(column, axis=0)
        return np.asarray(total * share - values)

    nodes = centres
    for _ in range(MEMBRANE_ROUNDS):
        nodes = np.clip(nodes + to_neighbours(nodes), low, high)
    for _ in range(PLATE_ROUNDS):
        nodes = np.clip(nodes - PLATE_STEP * to_neighbours(to_neighbours(nodes)), low, high)
    return nodes


def _grown(
    nodes: Float64Array,
    centres: Float64Array,
    triangles: IndexArray,
    axes: Float64Array,
    wanted: float,
) -> Float64Array:
    """Nodes moved outward all alike, within their cells, until ``wanted`` m³ are enclosed."""
    back = np.linalg.inv(axes).T
    for _ in range(GROWTH_ROUNDS):
        places = nodes @ axes.T
        a, b, c = (places[corner] for corner in triangles.T)
        vectors = np.cross(b - a, c - a) / 2
        volume = float(np.sum((a + b + c) * vectors) / 9)
        if abs(wanted - volume) <= GROWTH_ERROR * wanted:
            break
        area = float(np.linalg.norm(vectors, axis=1).sum())
        normals = np.zeros_like(places)
        for corner in triangles.T:
            for axis in range(3):
                normals[:, axis] += np.bincount(corner, vectors[:, axis], len(places))
        lengths = np.linalg.norm(normals, axis=1)[:, None]
        normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
        moved = nodes + (wanted - volume) / area * normals @ back
        nodes = np.clip(moved, centres - 0.5, centres + 0.5)
    return nodes
