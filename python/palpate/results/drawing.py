"""Pictures of moments: how bodies look, what a camera must see, strips and films."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from palpate import pictures
from palpate._arrays import Float64Array
from palpate.model import Body
from palpate.pictures.files import PictureError
from palpate.results.atomic import replacing
from palpate.results.cut_faces import CutFaces
from palpate.simulation import Simulation

#: Milliseconds that a film shows the last frame.
_LAST = 1200
#: Boxes are darker than their bodies by this.
_WIRE = 0.55


@dataclass(frozen=True)
class Look:
    """How a body is drawn; ``color`` is red, green, blue in 0..1."""

    name: str
    color: tuple[float, float, float]
    opacity: float
    rigid: bool


@dataclass(frozen=True, eq=False)
class Moment:
    """A state to draw.

    Per body: ``positions`` [m] (n, 3), ``triangles`` (m, 3), ``touched`` (n,), 1 where a
    contact or spring acts, ``cut`` (m,), 1 for triangles that a blade made, or None, and
    ``boxes`` (k, 2, 3) [m] of its bounding tree; without any boxes, none are drawn.
    """

    time: float
    positions: tuple[Float64Array, ...]
    triangles: tuple[npt.NDArray[np.integer], ...]
    touched: tuple[Float64Array, ...]
    cut: tuple[npt.NDArray[np.uint8] | None, ...]
    boxes: tuple[Float64Array, ...] = ()


def moment_of(simulation: Simulation, faces: CutFaces, level: int | None = None) -> Moment:
    """The present state, with the ``faces`` of cuts and the boxes at a level of the trees."""
    bodies = simulation.model.bodies
    touched = tuple(
        (np.abs(forces).max(axis=1) > 0).astype(np.float64) for forces in simulation.contact_forces
    )
    triangles = tuple(body.mesh.triangles for body in bodies)
    cut = tuple(faces.of_mesh(body.name, body.mesh) for body in bodies)
    boxes = () if level is None else tuple(simulation.boxes(body.name, level) for body in bodies)
    return Moment(simulation.time, simulation.positions, triangles, touched, cut, boxes)


def looks_of(bodies: Iterable[Body]) -> list[Look]:
    """How the bodies of a model are drawn: their own colours, or ours."""
    own = [(body.name, body.color, body.opacity, body.rigid is not None) for body in bodies]
    return chosen_looks(own)


def chosen_looks(
    rows: Iterable[tuple[str, Sequence[float] | None, float, bool]],
) -> list[Look]:
    """Looks from names, colours or None, opacities, and whether rigid."""
    looks, soft = [], 0
    for name, color, opacity, rigid in rows:
        chosen: Sequence[float] = pictures.PALETTE[soft % len(pictures.PALETTE)]
        red, green, blue = color or (pictures.RIGID if rigid else chosen)
        looks.append(Look(name, (red, green, blue), opacity, rigid))
        soft += not rigid
    return looks


def upward(gravity: Sequence[float]) -> tuple[float, float, float]:
    """Unit vector against gravity, z where there is none."""
    vector = -np.asarray(gravity, dtype=np.float64)
    length = float(np.linalg.norm(vector))
    if length == 0:
        return (0.0, 0.0, 1.0)
    x, y, z = (vector / length + 0.0).tolist()
    return (x, y, z)


def shapes(moment: Moment, looks: Sequence[Look]) -> list[pictures.Shape]:
    """What `pictures.render` draws; touched nodes and the faces of cuts are marked."""
    return [
        pictures.Shape(
            positions,
            triangles,
            look.color,
            opacity=look.opacity,
            rigid=look.rigid,
            highlights=None if look.rigid else touched,
            inside=cut,
        )
        for look, positions, triangles, touched, cut in zip(
            looks, moment.positions, moment.triangles, moment.touched, moment.cut, strict=True
        )
    ]


def wires(moment: Moment, looks: Sequence[Look]) -> list[pictures.Wires]:
    """The boxes of a moment in the colours of their bodies."""
    return [
        pictures.box_wires(each, [_WIRE * part for part in look.color])
        for look, each in zip(looks, moment.boxes, strict=False)
    ]


def picture(
    moment: Moment, looks: Sequence[Look], camera: pictures.Camera, size: tuple[int, int]
) -> pictures.Image:
    """A moment drawn."""
    return pictures.render(shapes(moment, looks), camera, size=size, wires=wires(moment, looks))


def framed(
    moments: Sequence[Moment], looks: Sequence[Look], up: Sequence[float]
) -> pictures.Camera:
    """A camera that sees the soft bodies of all moments."""
    soft: list[Float64Array] = []
    rigid: list[Float64Array] = []
    for moment in moments:
        for look, points in zip(looks, moment.positions, strict=True):
            (rigid if look.rigid else soft).append(points)
        for look, each in zip(looks, moment.boxes, strict=False):
            (rigid if look.rigid else soft).append(each.reshape(-1, 3))
    return pictures.frame(soft or rigid, up=up, context=rigid)


def write_strip(
    path: Path, moments: Sequence[Moment], looks: Sequence[Look], up: Sequence[float], width: int
) -> None:
    """Write the moments side by side as PNG; ``width`` is that of one in pixels."""
    camera = framed(moments, looks, up)
    size = camera.size(width)
    images = [picture(moment, looks, camera, size) for moment in moments]
    pictures.save_picture(path, images, [_caption(moment) for moment in moments], camera=camera)


def write_film(
    path: Path, moments: Sequence[Moment], looks: Sequence[Look], up: Sequence[float], width: int
) -> None:
    """Write the moments as an animated GIF in their own time."""
    film = _pillow()
    camera = framed(moments, looks, up)
    size = camera.size(width)
    images = [film.fromarray(picture(moment, looks, camera, size)) for moment in moments]
    # One palette for all frames: colours do not flicker.
    sheet = film.new("RGB", (size[0], 3 * size[1]))
    for place, image in enumerate((images[0], images[len(images) // 2], images[-1])):
        sheet.paste(image, (0, place * size[1]))
    palette = sheet.quantize(255)
    first, *others = (image.quantize(palette=palette, dither=1) for image in images)
    times = [1000 * moment.time for moment in moments]
    # GIF counts hundredths of a second.
    waits = [max(20, round(after - before, -1)) for before, after in pairwise(times)]
    with replacing(path) as temporary:
        first.save(
            temporary,
            "GIF",
            save_all=True,
            append_images=others,
            duration=[*waits, _LAST],
            loop=0,
            optimize=False,
        )


def _caption(moment: Moment) -> str:
    return f"t = {moment.time:.2f} s"


def _pillow() -> Any:
    try:
        from PIL import Image
    except ImportError:
        raise PictureError("a GIF needs Pillow: pip install 'palpate[plot]'") from None
    return Image
