"""Pictures of the first, middle and last moment of a simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from palpate import pictures
from palpate._arrays import Float64Array
from palpate.model import Body, Model
from palpate.simulation import Simulation

#: Names of the files that an album writes.
PICTURES = ("first", "middle", "last", "strip")

#: Moments kept in memory at most.
_KEPT = 33

_Moment = tuple[float, tuple[Float64Array, ...], tuple[Float64Array, ...]]


class Album:
    """Keeps moments, spread evenly over a run of unknown length, and draws three of them."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._moments: list[_Moment] = []
        self._stride = 1
        self._seen = 0
        self._last: _Moment | None = None

    def add(self, simulation: Simulation) -> None:
        """Look at the present state; kept if it is the stride's turn."""
        touched = tuple(
            (np.abs(forces).max(axis=1) > 0).astype(np.float64)
            for forces in simulation.contact_forces
        )
        self._last = (simulation.time, simulation.positions, touched)
        if self._seen % self._stride == 0:
            self._moments.append(self._last)
            if len(self._moments) > _KEPT:
                self._moments = self._moments[::2]
                self._stride *= 2
        self._seen += 1

    def write(self, folder: Path) -> list[Path]:
        """Draw first, middle and last, and the three side by side; returns the files."""
        folder.mkdir(parents=True, exist_ok=True)
        moments = self._three()
        soft: list[Float64Array] = []
        rigid: list[Float64Array] = []
        for _, positions, _ in moments:
            for body, points in zip(self._model.bodies, positions, strict=True):
                (soft if body.rigid is None else rigid).append(points)
        camera = pictures.frame(soft or rigid, up=self._up(), context=rigid)
        images = [
            pictures.render(self._shapes(positions, touched), camera)
            for _, positions, touched in moments
        ]
        captions = [f"t = {time:.2f} s" for time, _, _ in moments]
        files = []
        for name, image, caption in zip(PICTURES[:3], images, captions, strict=True):
            files.append(folder / f"{name}.png")
            pictures.save_picture(files[-1], [image], [caption], camera=camera)
        files.append(folder / f"{PICTURES[3]}.png")
        pictures.save_picture(
            files[-1], [_half(image) for image in images], captions, camera=camera
        )
        return files

    def _three(self) -> tuple[_Moment, _Moment, _Moment]:
        if self._last is None:
            raise ValueError("no moment was added")
        first, last = self._moments[0], self._last
        half = (first[0] + last[0]) / 2
        return first, min(self._moments, key=lambda moment: abs(moment[0] - half)), last

    def _up(self) -> tuple[float, float, float]:
        x, y, z = self._model.gravity
        return (-x, -y, -z) if any(self._model.gravity) else (0.0, 0.0, 1.0)

    def _shapes(self, positions: Any, touched: Any) -> list[pictures.Shape]:
        colors = iter(range(len(self._model.bodies)))
        return [
            _shape(body, points, marks, colors)
            for body, points, marks in zip(self._model.bodies, positions, touched, strict=True)
        ]


def _half(image: pictures.Image) -> pictures.Image:
    """The image at half its size."""
    rows, columns = image.shape[0] // 2, image.shape[1] // 2
    pixels = image[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2, 3)
    half: pictures.Image = pixels.mean(axis=(1, 3)).astype(np.uint8)
    return half


def _shape(body: Body, points: Float64Array, marks: Float64Array, colors: Any) -> pictures.Shape:
    rigid = body.rigid is not None
    chosen = pictures.RIGID if rigid else pictures.PALETTE[next(colors) % len(pictures.PALETTE)]
    return pictures.Shape(
        points,
        body.mesh.triangles,
        body.color or chosen,
        opacity=body.opacity,
        rigid=rigid,
        highlights=None if rigid else marks,
    )
