"""Lines in a picture: bright where they are in front, faint where a body hides them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array
from palpate.pictures.camera import Camera

#: How much of a line is seen over what is behind it, and through a body in front of it.
_OVER = 0.85
_THROUGH = 0.22
#: Samples of lines that are worked on at a time; bounds the memory.
_CHUNK = 2_000_000
#: The 12 edges between the corners of a box; bit i of a corner says which end of axis i.
_EDGES = [[a, a | 1 << axis] for axis in range(3) for a in range(8) if not a >> axis & 1]


@dataclass(frozen=True, eq=False)
class Wires:
    """Straight lines from end to end, ``ends`` (k, 2, 3) [m], in one ``color``, linear in 0..1."""

    ends: Float64Array
    color: Sequence[float]


def box_wires(boxes: Float64Array, color: Sequence[float]) -> Wires:
    """The edges of boxes (k, 2, 3) with axes along x, y, z: low and high corner [m]."""
    corners = np.stack(
        [boxes[:, [c & 1, c >> 1 & 1, c >> 2 & 1], [0, 1, 2]] for c in range(8)], axis=1
    )
    return Wires(corners[:, _EDGES].reshape(-1, 2, 3), color)


def draw_wires(
    image: npt.NDArray[np.float32],
    depths: npt.NDArray[np.float32],
    wires: Sequence[Wires],
    camera: Camera,
    size: tuple[int, int],
    width: int,
) -> None:
    """Draw into an image of shape (columns * rows, 3).

    Parameters
    ----------
    depths : array, shape (columns * rows,)
        Height towards the eye [m] of what is drawn already, -inf where nothing is.
    size : two ints
        Columns and rows of the image.
    width : int
        Of the lines, in pixels of it.
    """
    shown = [each for each in wires if len(each.ends)]
    if not shown:
        return
    ends = camera.project(np.concatenate([each.ends for each in shown]).reshape(-1, 3), size)
    ends = ends.reshape(-1, 2, 3)
    colors = np.repeat(
        np.asarray([each.color for each in shown], dtype=np.float32),
        [len(each.ends) for each in shown],
        axis=0,
    )
    # One sample per pixel along the axis in which the line is longer.
    counts = np.ceil(np.abs(ends[:, 1, :2] - ends[:, 0, :2]).max(axis=1)).astype(np.int64) + 1
    nearest = np.full(size[0] * size[1], -np.inf, dtype=np.float32)
    owner = np.full(size[0] * size[1], -1, dtype=np.int64)
    for part in _parts(counts):
        _nearest(ends[part], part, counts[part], size, width, nearest, owner)
    (drawn,) = np.nonzero(owner >= 0)
    strength = np.where(nearest[drawn] >= depths[drawn], _OVER, _THROUGH)[:, None]
    image[drawn] = (1 - strength) * image[drawn] + strength * colors[owner[drawn]]


def _parts(counts: npt.NDArray[np.int64]) -> list[npt.NDArray[np.int64]]:
    """Numbers of lines in groups of at most ``_CHUNK`` samples, or of one line."""
    group = np.cumsum(counts) // _CHUNK
    return np.split(np.arange(len(counts)), np.flatnonzero(np.diff(group)) + 1)


def _nearest(
    ends: Float64Array,
    numbers: npt.NDArray[np.int64],
    counts: npt.NDArray[np.int64],
    size: tuple[int, int],
    width: int,
    nearest: npt.NDArray[np.float32],
    owner: npt.NDArray[np.int64],
) -> None:
    """Note at each pixel of these lines which of them is nearest to the eye, and how near."""
    line = np.repeat(np.arange(len(counts)), counts)
    step = np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)
    along = (step / np.maximum(counts - 1, 1)[line])[:, None]
    places = (1 - along) * ends[line, 0] + along * ends[line, 1]
    for down in range(width):
        for right in range(width):
            columns = np.floor(places[:, 0] + right - (width - 1) / 2).astype(np.int64)
            rows = np.floor(places[:, 1] + down - (width - 1) / 2).astype(np.int64)
            (inside,) = np.nonzero(
                (columns >= 0) & (columns < size[0]) & (rows >= 0) & (rows < size[1])
            )
            pixels = rows[inside] * size[0] + columns[inside]
            heights = places[inside, 2].astype(np.float32)
            np.maximum.at(nearest, pixels, heights)
            front = heights == nearest[pixels]
            owner[pixels[front]] = numbers[line[inside[front]]]
