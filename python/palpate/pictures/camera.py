"""Where a picture is taken from: an orthographic camera that frames a whole run."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from palpate._arrays import Float64Array


@dataclass(frozen=True, eq=False)
class Camera:
    """Orthographic camera.

    The rows of ``axes`` (3, 3) point right, up and towards the eye; ``center`` [m] is the middle
    of the picture along right and up, ``width`` and ``height`` [m] what it shows.
    """

    axes: Float64Array
    center: tuple[float, float]
    width: float
    height: float

    def size(self, columns: int) -> tuple[int, int]:
        """Columns and rows of a picture with square pixels, both divisible by 8."""
        columns = max(8, columns // 8 * 8)
        return columns, max(8, round(columns * self.height / self.width / 8) * 8)

    def fitted(self, size: tuple[int, int]) -> Camera:
        """The same view, widened or heightened so that a picture of that size is not distorted."""
        aspect = size[0] / size[1]
        width, height = max(self.width, self.height * aspect), max(self.height, self.width / aspect)
        return Camera(self.axes, self.center, width, height)

    def project(self, points: Float64Array, size: tuple[int, int]) -> Float64Array:
        """Pixel coordinates (column, row from the top) and height towards the eye [m], (n, 3)."""
        columns, rows = size
        seen = points @ self.axes.T
        result: Float64Array = np.empty(seen.shape)
        result[:, 0] = (seen[:, 0] - self.center[0] + self.width / 2) * (columns / self.width)
        result[:, 1] = (self.center[1] + self.height / 2 - seen[:, 1]) * (rows / self.height)
        result[:, 2] = seen[:, 2]
        return result


def view_axes(up: Sequence[float], *, azimuth: float, elevation: float) -> Float64Array:
    """Axes (right, up, towards the eye) of a camera above the horizon; angles in degrees.

    ``azimuth`` turns around ``up``; 0 looks along the first horizontal axis of `horizontal_axes`.
    """
    vertical = np.asarray(up, dtype=np.float64)
    vertical = vertical / np.linalg.norm(vertical)
    first, second = horizontal_axes(vertical)
    a, e = math.radians(azimuth), math.radians(elevation)
    level = -(math.cos(a) * first + math.sin(a) * second)
    toward = math.cos(e) * level + math.sin(e) * vertical
    right = np.cross(vertical, toward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(toward, right), toward])


def horizontal_axes(vertical: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Two horizontal unit vectors; for z up they are x and y."""
    start = np.array([1.0, 0.0, 0.0]) if abs(vertical[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = start - vertical * (start @ vertical)
    first /= np.linalg.norm(first)
    return first, np.cross(vertical, first)


def frame(
    points: Iterable[Float64Array],
    *,
    up: Sequence[float] = (0.0, 0.0, 1.0),
    context: Iterable[Float64Array] = (),
    aspect: float | None = None,
    elevation: float = 24.0,
    margin: float = 0.07,
) -> Camera:
    """A camera that sees all ``points`` from the side on which they are widest.

    Parameters
    ----------
    points : iterable of arrays of shape (n, 3)
        Positions [m] that must be in the picture, of every moment it shall serve.
    up : three numbers
        The direction that is up in the picture, usually against gravity.
    context : iterable of arrays of shape (n, 3)
        Positions that are shown as far as they widen the picture by at most a quarter: a table.
    aspect : float, optional
        Width of the picture over its height; by default what suits the scene, from 1 to 1.8.
    elevation : float
        Degrees above the horizon.
    margin : float
        Free border on each side, as a fraction of the picture.
    """
    parts = [np.asarray(part, dtype=np.float64).reshape(-1, 3) for part in points]
    if sum(map(len, parts)) == 0:
        raise ValueError("points: expected at least one point to frame")
    cloud = np.concatenate(parts)
    axes = view_axes(up, azimuth=_widest_azimuth(cloud, up), elevation=elevation)
    seen = cloud @ axes.T
    low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    size = high - low
    size[size == 0] = size.max() or 1.0
    around = [np.asarray(part, dtype=np.float64).reshape(-1, 3) for part in context]
    if around and sum(map(len, around)):
        other = np.concatenate(around) @ axes.T
        spare = 0.25 * size.max()
        low = np.maximum(np.minimum(low, other[:, :2].min(axis=0)), low - spare)
        high = np.minimum(np.maximum(high, other[:, :2].max(axis=0)), high + spare)
        size = np.maximum(high - low, size)
    width, height = size / (1 - 2 * margin)
    if aspect is None:
        aspect = float(np.clip(width / height, 1.0, 1.8))
    width, height = max(width, height * aspect), max(height, width / aspect)
    middle = (low + high) / 2
    return Camera(axes, (float(middle[0]), float(middle[1])), float(width), float(height))


def _widest_azimuth(cloud: Float64Array, up: Sequence[float]) -> float:
    """Angle of the view, of 24, along which the cloud is shallowest, turned a little for depth."""
    vertical = np.asarray(up, dtype=np.float64)
    first, second = horizontal_axes(vertical / np.linalg.norm(vertical))
    flat = np.column_stack([cloud @ first, cloud @ second])
    angles = np.arange(0.0, 180.0, 7.5)
    depths = []
    for angle in np.radians(angles):
        along = flat @ np.array([math.cos(angle), math.sin(angle)])
        depths.append(along.max() - along.min())
    shallow = float(angles[int(np.argmin(depths))])
    # Seen exactly along an axis, boxes look flat; prefer the side that looks along +y at z up.
    return shallow + 20.0
