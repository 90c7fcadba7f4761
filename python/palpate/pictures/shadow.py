"""What the surroundings take from a surface's light: creases and a cast shadow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from palpate.pictures.camera import Camera

DepthMap = npt.NDArray[np.float32]

#: Reach of the crease shade and length of the cast shadow, as fractions of the picture's height.
_CREASE_REACH = 0.035
_SHADOW_REACH = 0.5
#: Rise over length, both sides together, that facets of a smooth surface may have.
_FACET = 0.12
#: Share of the light that a full crease and a full shadow leave.
_CREASE_LEFT = 0.45
_SHADOW_LEFT = 0.66


def surroundings_shade(
    depth: DepthMap,
    camera: Camera,
    size: tuple[int, int],
    samples: int,
    light: Sequence[float],
) -> DepthMap:
    """Share of the light, in 0..1, that reaches each pixel.

    Works in the depth map alone and on every ``2 * samples``-th pixel, since the result is smooth.

    Parameters
    ----------
    depth : array, shape (columns * rows,)
        Height towards the eye [m], -inf where there is nothing.
    camera, size, samples
        How the depth map was made; ``size`` counts the samples.
    light : three numbers
        Direction to the light that casts shadows, in camera axes.
    """
    columns, rows = size
    step = 2 * samples if columns % (2 * samples) == 0 and rows % (2 * samples) == 0 else 1
    coarse = depth.reshape(rows, columns)[step // 2 :: step, step // 2 :: step]
    pixel = camera.width / coarse.shape[1]
    left = _crease(coarse, pixel, _CREASE_REACH * camera.height)
    left *= _cast(coarse, pixel, _SHADOW_REACH * camera.height, light)
    left[~np.isfinite(coarse)] = 1
    return _spread(left, coarse, depth.reshape(rows, columns), step, 4 * pixel).reshape(-1)


def _spread(
    left: DepthMap, coarse: DepthMap, depth: DepthMap, step: int, tolerance: float
) -> DepthMap:
    """Values of the coarse map for every pixel.

    Beside an edge a pixel may stand on another surface than the coarse pixel it lies in; it then
    takes the value of that neighbour whose depth is most like its own. Otherwise edges get a seam.
    """
    result = np.repeat(np.repeat(left, step, axis=0), step, axis=1)
    own = np.repeat(np.repeat(coarse, step, axis=0), step, axis=1)
    there = np.isfinite(depth)
    with np.errstate(invalid="ignore"):
        other = there & ~(np.abs(own - depth) <= tolerance)
    y, x = np.nonzero(other)
    if step == 1 or len(y) == 0:
        return result
    best = np.full(len(y), np.inf, dtype=np.float32)
    value = result[y, x]
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            row = np.clip(y // step + down, 0, coarse.shape[0] - 1)
            column = np.clip(x // step + right, 0, coarse.shape[1] - 1)
            difference = np.abs(coarse[row, column] - depth[y, x])
            closer = difference < best
            best = np.where(closer, difference, best)
            value = np.where(closer, left[row, column], value)
    result[y, x] = value
    return result


def _crease(depth: DepthMap, pixel: float, reach: float) -> DepthMap:
    """Ambient occlusion: darker where opposite neighbours together stand nearer to the eye.

    Opposite neighbours of a plane cancel, however it is tilted.
    """
    dark = np.zeros_like(depth)
    directions = 8
    rings = (0.25, 0.6, 1.0)
    known = np.where(np.isfinite(depth), depth, np.float32(-1e30))
    for ring in rings:
        length = max(1.0, ring * reach / pixel)
        for turn in range(directions):
            angle = np.pi * (turn + ring) / directions
            x, y = round(length * np.cos(angle)), round(length * np.sin(angle))
            away = np.float32(length * pixel)
            there = _limited(_shifted(known, x, y) - known, away, reach)
            opposite = _limited(_shifted(known, -x, -y) - known, away, reach)
            dark += np.clip((there + opposite) / away - _FACET, 0, 1)
    dark /= directions * len(rings)
    return np.asarray(1 - (1 - _CREASE_LEFT) * np.clip(2.2 * _blurred(dark), 0, 1), np.float32)


def _limited(rise: DepthMap, away: np.float32, reach: float) -> DepthMap:
    """Rise to a neighbour within a slope of 3; what stands far in front is another object."""
    fade = np.clip(2 - rise / np.float32(3 * reach), 0, 1)
    return np.asarray(np.clip(rise, -3 * away, 3 * away) * fade)


def _cast(depth: DepthMap, pixel: float, reach: float, light: Sequence[float]) -> DepthMap:
    """Shadow by marching in the depth map from each pixel towards the light."""
    toward = np.asarray(light, dtype=np.float64)
    in_plane = float(np.hypot(toward[0], toward[1]))
    if in_plane == 0:
        return np.ones_like(depth)
    direction = toward[:2] / in_plane
    slope = float(toward[2]) / in_plane
    known = np.where(np.isfinite(depth), depth, np.float32(-1e30))
    hidden = np.zeros_like(depth)
    # The softer the farther away the caster is, as under a wide lamp.
    for lamp in (-0.16, -0.08, 0.0, 0.08, 0.16):
        turned = direction + lamp * np.array([-direction[1], direction[0]])
        blocked = np.zeros_like(depth)
        length = 5.0 * pixel
        while length < reach:
            x, y = round(turned[0] * length / pixel), -round(turned[1] * length / pixel)
            ray = known + np.float32(length * slope)
            over = _shifted(known, x, y) - ray
            # A body has some thickness: what is far in front of the ray does not touch it.
            hit = (over > 0.35 * pixel) & (over < 0.25 * reach)
            blocked = np.maximum(blocked, hit * np.float32(1 - (length / reach) ** 2))
            length *= 1.18
            length += 0.5 * pixel
        hidden += blocked / 5
    return np.asarray(1 - (1 - _SHADOW_LEFT) * _blurred(_blurred(hidden)), dtype=np.float32)


def _shifted(image: DepthMap, x: int, y: int) -> DepthMap:
    """The image seen from ``x`` columns to the right and ``y`` rows below; outside is far away."""
    result = np.full_like(image, -1e30)
    rows, columns = image.shape
    if abs(x) >= columns or abs(y) >= rows:
        return result
    to = (slice(max(0, -y), rows - max(0, y)), slice(max(0, -x), columns - max(0, x)))
    source = (slice(max(0, y), rows - max(0, -y)), slice(max(0, x), columns - max(0, -x)))
    result[to] = image[source]
    return result


def _blurred(image: DepthMap) -> DepthMap:
    """Mean over 3 x 3 pixels."""
    padded = np.pad(image, 1, mode="edge")
    rows, columns = image.shape
    total = np.zeros_like(image)
    for y in range(3):
        for x in range(3):
            total += padded[y : y + rows, x : x + columns]
    return np.asarray(total / 9, dtype=np.float32)
