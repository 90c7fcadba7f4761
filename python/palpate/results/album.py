"""Pictures of the first, middle and last moment of a simulation."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from palpate import pictures
from palpate.results.cut_faces import CutFaces
from palpate.results.drawing import Moment, framed, looks_of, moment_of, shapes, upward
from palpate.simulation import Simulation

#: Names of the files that an album writes.
PICTURES = ("first", "middle", "last", "strip")

#: Moments kept in memory at most.
_KEPT = 33


class Album:
    """Keeps moments, spread evenly over a run of unknown length, and draws three of them."""

    def __init__(self, simulation: Simulation) -> None:
        model = simulation.model
        self._looks = looks_of(model.bodies)
        self._up = upward(model.gravity)
        self._faces = CutFaces.since_the_start(simulation)
        self._moments: list[Moment] = []
        self._stride = 1
        self._seen = 0
        self._last: Moment | None = None

    def add(self, simulation: Simulation) -> None:
        """Look at the present state; kept if it is the stride's turn."""
        self._last = moment_of(simulation, self._faces)
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
        camera = framed(moments, self._looks, self._up)
        images = [pictures.render(shapes(moment, self._looks), camera) for moment in moments]
        captions = [f"t = {moment.time:.2f} s" for moment in moments]
        files = []
        for name, image, caption in zip(PICTURES[:3], images, captions, strict=True):
            files.append(folder / f"{name}.png")
            pictures.save_picture(files[-1], [image], [caption], camera=camera)
        files.append(folder / f"{PICTURES[3]}.png")
        pictures.save_picture(
            files[-1], [_half(image) for image in images], captions, camera=camera
        )
        return files

    def _three(self) -> tuple[Moment, Moment, Moment]:
        if self._last is None:
            raise ValueError("no moment was added")
        first, last = self._moments[0], self._last
        half = (first.time + last.time) / 2
        return first, min(self._moments, key=lambda moment: abs(moment.time - half)), last


def _half(image: pictures.Image) -> pictures.Image:
    """The image at half its size."""
    rows, columns = image.shape[0] // 2, image.shape[1] // 2
    pixels = image[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2, 3)
    half: pictures.Image = pixels.mean(axis=(1, 3)).astype(np.uint8)
    return half
