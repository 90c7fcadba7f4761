"""Which triangle each pixel sees: a depth buffer filled with numpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array

#: Candidate pixels that are worked on at a time; bounds the memory.
_CHUNK = 3_000_000


@dataclass(frozen=True, eq=False)
class Fragments:
    """What the visible pixels show.

    ``pixels`` (k,) are flat pixel indices in ascending order, ``triangles`` (k,) the triangle in
    front, ``weights`` (k, 3) the barycentric weights there, ``depths`` (k,) the height towards the
    eye.
    """

    pixels: npt.NDArray[np.int64]
    triangles: npt.NDArray[np.int64]
    weights: npt.NDArray[np.float32]
    depths: npt.NDArray[np.float32]


def rasterize(
    points: Float64Array, triangles: npt.NDArray[np.integer], size: tuple[int, int]
) -> Fragments:
    """The nearest triangle at each pixel center.

    Parameters
    ----------
    points : array, shape (n, 3)
        Column and row in pixels, and height towards the eye (larger is nearer).
    triangles : array of int, shape (t, 3)
        Both sides are visible.
    size : two ints
        Columns and rows of the picture.
    """
    columns, rows = size
    corners = points[triangles]
    low = np.ceil(corners[:, :, :2].min(axis=1) - 0.5).astype(np.int64)
    high = np.floor(corners[:, :, :2].max(axis=1) - 0.5).astype(np.int64)
    low = np.maximum(low, 0)
    high = np.minimum(high, np.array([columns - 1, rows - 1]))
    extent = np.maximum(high - low + 1, 0)
    candidates = extent[:, 0] * extent[:, 1]
    (kept,) = np.nonzero(candidates)
    depth_buffer = np.full(columns * rows, -np.inf, dtype=np.float32)
    found: list[tuple[npt.NDArray[np.int64], ...]] = []
    ends = np.cumsum(candidates[kept])
    start = 0
    while start < len(kept):
        done = ends[start - 1] if start else 0
        stop = max(start + 1, int(np.searchsorted(ends, done + _CHUNK, side="right")))
        part = kept[start:stop]
        found.append(_fill(corners[part], part, low[part], extent[part], columns, depth_buffer))
        start = stop
    if not found:
        return Fragments(
            np.empty(0, np.int64),
            np.empty(0, np.int64),
            np.empty((0, 3), np.float32),
            np.empty(0, np.float32),
        )
    pixels = np.concatenate([each[0] for each in found])
    owners = np.concatenate([each[1] for each in found])
    depths = np.concatenate([each[2] for each in found])
    # Of what passed in its own chunk, the nearest over all; of equal ones the last triangle.
    nearest = depths == depth_buffer[pixels]
    front = np.full(columns * rows, -1, dtype=np.int64)
    front[pixels[nearest]] = owners[nearest]
    (seen,) = np.nonzero(front >= 0)
    return Fragments(
        seen,
        front[seen],
        _weights(corners[front[seen]], seen, columns).astype(np.float32),
        depth_buffer[seen],
    )


def _fill(
    corners: Float64Array,
    owners: npt.NDArray[np.int64],
    low: npt.NDArray[np.int64],
    extent: npt.NDArray[np.int64],
    columns: int,
    depth_buffer: npt.NDArray[np.float32],
) -> tuple[npt.NDArray[np.int64], ...]:
    """Pixels inside each triangle that are the nearest so far; raises the depth buffer."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    area = _cross(b - a, c - a)
    # Per triangle, the weights of corners b and c and the depth are linear in column and row.
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(area == 0, np.nan, 1.0 / area)
    beta = np.column_stack([(c - a)[:, 1] * inverse, -(c - a)[:, 0] * inverse])
    gamma = np.column_stack([-(b - a)[:, 1] * inverse, (b - a)[:, 0] * inverse])
    counts = extent[:, 0] * extent[:, 1]
    local = np.repeat(np.arange(len(owners)), counts)
    within = np.arange(len(local)) - np.repeat(np.cumsum(counts) - counts, counts)
    row, column = np.divmod(within, extent[local, 0])
    column += low[local, 0]
    row += low[local, 1]
    x = (column + 0.5) - a[local, 0]
    y = (row + 0.5) - a[local, 1]
    weight_b = beta[local, 0] * x + beta[local, 1] * y
    weight_c = gamma[local, 0] * x + gamma[local, 1] * y
    (inside,) = np.nonzero((weight_b >= 0) & (weight_c >= 0) & (weight_b + weight_c <= 1))
    local = local[inside]
    pixels = row[inside] * columns + column[inside]
    slope_b, slope_c = (b - a)[local, 2], (c - a)[local, 2]
    depth = a[local, 2] + weight_b[inside] * slope_b + weight_c[inside] * slope_c
    depth = depth.astype(np.float32)
    np.maximum.at(depth_buffer, pixels, depth)
    nearest = depth == depth_buffer[pixels]
    return pixels[nearest], owners[local[nearest]], depth[nearest]


def _weights(corners: Float64Array, pixels: npt.NDArray[np.int64], columns: int) -> Float64Array:
    row, column = np.divmod(pixels, columns)
    at = np.column_stack([column + 0.5, row + 0.5])
    a, b, c = corners[:, 0, :2], corners[:, 1, :2], corners[:, 2, :2]
    area = _cross(b - a, c - a)
    weight_b = _cross(at - a, c - a) / area
    weight_c = _cross(b - a, at - a) / area
    return np.column_stack([1 - weight_b - weight_c, weight_b, weight_c])


def _cross(u: Float64Array, v: Float64Array) -> Float64Array:
    return np.asarray(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
