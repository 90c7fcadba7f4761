"""From bodies to an image: visible pixels, then light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array
from palpate.pictures.camera import Camera
from palpate.pictures.raster import Fragments, rasterize
from palpate.pictures.shadow import surroundings_shade
from palpate.pictures.wires import Wires, draw_wires

FloatImage = npt.NDArray[np.float32]
Image = npt.NDArray[np.uint8]

#: Colours of bodies that have none, linear in 0..1: muted, and told apart by colour-blind eyes.
PALETTE = (
    (0.78, 0.35, 0.30),
    (0.33, 0.52, 0.73),
    (0.87, 0.64, 0.36),
    (0.44, 0.62, 0.48),
    (0.60, 0.46, 0.66),
    (0.80, 0.56, 0.60),
    (0.42, 0.62, 0.66),
    (0.66, 0.58, 0.42),
)
RIGID = (0.80, 0.81, 0.83)
HIGHLIGHT = (1.0, 0.86, 0.20)
#: What is seen inside of a body, and how much of it a face has that was cut.
_FLESH = (0.96, 0.80, 0.74)
_RAW = 0.6
#: Top and bottom of the background.
BACKGROUND = ((0.985, 0.988, 0.992), (0.90, 0.915, 0.935))

#: Directions to the lights in camera axes (right, up, towards the eye), and their strength; the
#: first casts shadows.
_LIGHTS = (((-0.45, 0.75, 0.65), 0.58), ((0.85, 0.10, 0.50), 0.20), ((0.0, -0.6, 0.4), 0.12))
_AMBIENT = 0.36
#: Cosine of the angle from which an edge is drawn sharp.
_CREASE = 0.7
#: How much of a rigid body's surface is seen where it stands before a deformable one.
_VEIL = 0.28


@dataclass(frozen=True, eq=False)
class Shape:
    """What is drawn: node positions [m], shape (n, 3), surface triangles (t, 3), and their look.

    ``highlights`` (n,) in 0..1 says how strongly each node is marked; None: not at all. ``inside``
    (t,), not 0 for triangles that a blade laid open, paler than the others; None: there are none.
    """

    positions: Float64Array
    triangles: npt.NDArray[np.integer]
    color: Sequence[float]
    opacity: float = 1.0
    rigid: bool = False
    highlights: Float64Array | None = None
    inside: npt.NDArray[np.integer] | None = None


def render(
    shapes: Sequence[Shape],
    camera: Camera,
    *,
    size: tuple[int, int] | None = None,
    samples: int = 2,
    wires: Sequence[Wires] = (),
) -> Image:
    """Draw shapes; returns an image of shape (rows, columns, 3).

    Parameters
    ----------
    shapes : sequence of Shape
        Rigid ones are drawn as a veil where they stand before a deformable one.
    camera : Camera
        Shows a little more where ``size`` has another aspect.
    size : two ints, optional
        Columns and rows of the image; by default 1280 columns, and the rows that suit the camera.
    samples : int
        Each pixel is the mean of ``samples`` squared.
    wires : sequence of Wires
        Lines, a pixel wide.
    """
    size = camera.size(1280) if size is None else size
    camera = camera.fitted(size)
    fine = (size[0] * samples, size[1] * samples)
    solid = [shape for shape in shapes if not shape.rigid and shape.opacity >= 1]
    clear = [shape for shape in shapes if not shape.rigid and shape.opacity < 1]
    rigid = [shape for shape in shapes if shape.rigid]
    image = _background(fine)
    front = np.full(fine[0] * fine[1], -np.inf, dtype=np.float32)
    layers = [(_layer(group, camera, fine), group) for group in (rigid, solid, clear) if group]
    # Depth of everything opaque darkens the creases, whichever shape it belongs to.
    opaque = front.copy()
    for layer, group in layers:
        if group is not clear:
            seen = layer.fragments.pixels
            opaque[seen] = np.maximum(opaque[seen], layer.fragments.depths)
    shade = surroundings_shade(opaque, camera, fine, samples, _LIGHTS[0][0])
    for layer, group in layers:
        seen, depths = layer.fragments.pixels, layer.fragments.depths
        if group is rigid:
            image[seen] = layer.shaded(shade)
            front[seen] = depths
        elif group is solid:
            behind = depths < front[seen]
            color = layer.shaded(shade)
            before = image[seen]
            veil = _VEIL * before + (1 - _VEIL) * color
            image[seen] = np.where(behind[:, None], veil, color)
            front[seen] = np.maximum(front[seen], depths)
        else:
            visible = depths >= front[seen]
            at = seen[visible]
            alpha = layer.opacity[visible, None]
            image[at] = (1 - alpha) * image[at] + alpha * layer.shaded(None)[visible]
    draw_wires(image, front, wires, camera, fine, samples)
    coarse = image.reshape(size[1], samples, size[0], samples, 3).mean(axis=(1, 3))
    return np.asarray(np.clip(coarse * 255 + 0.5, 0, 255), dtype=np.uint8)


@dataclass(frozen=True, eq=False)
class _Layer:
    fragments: Fragments
    color: FloatImage
    opacity: npt.NDArray[np.float32]

    def shaded(self, shade: npt.NDArray[np.float32] | None) -> FloatImage:
        if shade is None:
            return self.color
        return np.asarray(self.color * shade[self.fragments.pixels, None])


def _layer(shapes: Sequence[Shape], camera: Camera, size: tuple[int, int]) -> _Layer:
    """The nearest surface of some shapes at each pixel, lit."""
    offsets = np.concatenate([[0], np.cumsum([len(shape.positions) for shape in shapes])])
    points = np.concatenate([shape.positions for shape in shapes])
    triangles = np.concatenate(
        [
            np.asarray(shape.triangles, dtype=np.int64) + start
            for shape, start in zip(shapes, offsets, strict=False)
        ]
    )
    normals = (_corner_normals(points, triangles) @ camera.axes.T).astype(np.float32)
    marks = np.concatenate(
        [
            np.zeros(len(shape.positions)) if shape.highlights is None else shape.highlights
            for shape in shapes
        ]
    ).astype(np.float32)
    fragments = rasterize(camera.project(points, size), triangles, size)
    corners = triangles[fragments.triangles]
    weights = fragments.weights
    owner = np.searchsorted(offsets, corners[:, 0], side="right") - 1
    base = np.asarray([shape.color for shape in shapes], dtype=np.float32)[owner]
    inside = np.concatenate(
        [
            np.zeros(len(shape.triangles), dtype=bool)
            if shape.inside is None
            else np.asarray(shape.inside) != 0
            for shape in shapes
        ]
    )[fragments.triangles, None]
    base = np.where(inside, (1 - _RAW) * base + _RAW * np.asarray(_FLESH, np.float32), base)
    mark = (marks[corners] * weights).sum(axis=1)
    # A steep ramp: the marked zone has a clear border.
    mark = np.clip(1.6 * mark - 0.3, 0, 1)[:, None]
    base = base * (1 - 0.85 * mark) + np.asarray(HIGHLIGHT, dtype=np.float32) * (0.85 * mark)
    normal = np.einsum("kcx,kc->kx", normals[fragments.triangles], weights)
    opacity = np.asarray([shape.opacity for shape in shapes], dtype=np.float32)[owner]
    return _Layer(fragments, _lit(base, normal), opacity)


def _lit(base: FloatImage, normal: FloatImage) -> FloatImage:
    """Lambert with soft terminators, a small highlight and a bright rim."""
    length = np.sqrt(np.einsum("kx,kx->k", normal, normal))
    normal = normal / np.maximum(length, 1e-12)[:, None]
    normal = np.where(normal[:, 2:] < 0, -normal, normal)  # both sides are lit
    light = np.full(len(normal), _AMBIENT, dtype=np.float32)
    for direction, strength in _LIGHTS:
        toward = np.asarray(direction, dtype=np.float32)
        toward /= np.linalg.norm(toward)
        # Wrapped a little around the edge, as light that scatters in tissue is.
        light += np.float32(strength) * np.clip((normal @ toward + 0.25) / 1.25, 0, 1)
    half = np.asarray(_LIGHTS[0][0], dtype=np.float32)
    half /= np.linalg.norm(half)
    half += np.array([0, 0, 1], dtype=np.float32)
    half /= np.linalg.norm(half)
    gloss = np.clip(normal @ half, 0, 1) ** 40
    rim = (1 - normal[:, 2]) ** 3
    color = base * (light * 1.12)[:, None]
    color += (0.16 * gloss)[:, None] + (0.13 * rim)[:, None]
    return np.asarray(color, dtype=np.float32)


def _corner_normals(points: Float64Array, triangles: npt.NDArray[np.int64]) -> Float64Array:
    """Normals at the three corners of each triangle, (t, 3, 3).

    The mean around the node, by area; the triangle's own where it is off that by more than
    ``_CREASE``, so that the edges of a box stay sharp.
    """
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    face = np.cross(b - a, c - a)
    normals = np.zeros_like(points)
    for corner in range(3):
        for axis in range(3):
            normals[:, axis] += np.bincount(
                triangles[:, corner], weights=face[:, axis], minlength=len(points)
            )
    own = _normalized(face)[:, None, :]
    mean = _normalized(normals)[triangles]
    smooth = (own * mean).sum(axis=2, keepdims=True) > _CREASE
    return np.where(smooth, mean, own)


def _normalized(vectors: Float64Array) -> Float64Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)[:, None])


def _background(size: tuple[int, int]) -> FloatImage:
    columns, rows = size
    blend = np.linspace(0, 1, rows, dtype=np.float32)[:, None]
    top, bottom = (np.asarray(color, dtype=np.float32) for color in BACKGROUND)
    return np.repeat(top * (1 - blend) + bottom * blend, columns, axis=0)
