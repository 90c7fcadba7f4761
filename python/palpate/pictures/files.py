"""Images with captions and a scale bar, as PNG files, by matplotlib."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from palpate.errors import PalpateError
from palpate.pictures.camera import Camera
from palpate.pictures.render import Image
from palpate.results.atomic import replacing

_INK = "#30363d"
_DPI = 200


class PictureError(PalpateError):
    """Pictures were asked for and matplotlib is not installed."""


def save_picture(
    path: str | os.PathLike[str],
    images: Sequence[Image],
    captions: Sequence[str],
    *,
    camera: Camera | None = None,
    title: str = "",
) -> None:
    """Write images of one size side by side as a PNG file that is complete or absent.

    Parameters
    ----------
    path : path-like
        Ends in ``.png``.
    images : sequence of arrays of shape (rows, columns, 3)
        From `render`.
    captions : sequence of str
        One per image, drawn at its lower left.
    camera : Camera, optional
        Adds a scale bar to the last image.
    title : str
        Drawn at the upper left.

    Raises
    ------
    PictureError
        Without matplotlib.
    """
    figure_class, canvas_class = _matplotlib()
    gap = 8
    rows, columns = images[0].shape[:2]
    total = columns * len(images) + gap * (len(images) - 1)
    figure = figure_class(figsize=(total / _DPI, rows / _DPI), dpi=_DPI, facecolor="white")
    canvas = canvas_class(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    sheet = np.full((rows, total, 3), 255, dtype=np.uint8)
    for index, image in enumerate(images):
        start = index * (columns + gap)
        sheet[:, start : start + columns] = image
    axes.imshow(sheet, interpolation="none", aspect="equal", extent=(0, total, rows, 0))
    # Text keeps its height in pixels when several images share the sheet.
    points = rows / _DPI * 72 * 0.026
    pad = 0.03 * rows
    for index, caption in enumerate(captions):
        left = index * (columns + gap) + pad
        axes.text(left, rows - pad, caption, color=_INK, fontsize=points, va="bottom")
    if title:
        axes.text(pad, pad, title, color=_INK, fontsize=points * 1.15, va="top", weight="bold")
    if camera is not None:
        _scale_bar(
            axes, camera.fitted((columns, rows)), (total - columns, columns, rows), pad, points
        )
    with replacing(path) as temporary:
        canvas.print_png(str(temporary))


def _scale_bar(
    axes: Any, camera: Camera, place: tuple[int, int, int], pad: float, points: float
) -> None:
    left, columns, rows = place
    length = nice_length(camera.width / 5)
    pixels = length / camera.width * columns
    right, bottom = left + columns - pad, rows - pad
    axes.plot([right - pixels, right], [bottom, bottom], color=_INK, linewidth=points * 0.18)
    axes.text(
        right - pixels / 2,
        bottom - 0.012 * rows,
        length_text(length),
        color=_INK,
        fontsize=points,
        ha="center",
        va="bottom",
    )


def nice_length(length: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above ``length``."""
    power = 10.0 ** math.floor(math.log10(length))
    return max(power * factor for factor in (1, 2, 5) if power * factor <= length * (1 + 1e-12))


def length_text(length: float) -> str:
    """A length [m] in the unit that suits it."""
    for unit, size in (("km", 1e3), ("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("µm", 1e-6)):
        if length >= size * (1 - 1e-9):
            return f"{length / size:.3g} {unit}"
    return f"{length:.3g} m"


def available() -> bool:
    """Whether matplotlib is installed."""
    try:
        _matplotlib()
    except PictureError:
        return False
    return True


def _matplotlib() -> tuple[Any, Any]:
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise PictureError("pictures need matplotlib: pip install 'palpate[plot]'") from None
    return Figure, FigureCanvasAgg
