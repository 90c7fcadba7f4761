"""A run on disk as a `Player`, with a time slider."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array
from palpate.viewer.player import Outcome, Player, Wishes
from palpate.viewer.protocol import Command, box_arrays, encode, finite
from palpate.viewer.recording import STRESS, Recording
from palpate.viewer.surface import deformation

_FIELDS = ("displacement", "deformation", "stress", "depth", "force")


class RecordedPlayer(Player):
    """Plays a recording from its first frame to its last."""

    mode = "recording"

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._index = 0
        self._arrays, self._parts = recording.frame(0)
        self._version = 0
        self._sent = -1

    @property
    def interval(self) -> float:
        times = self._recording.times
        after = min(self._index + 1, len(times) - 1)
        return max(times[after] - times[after - 1], 1e-6) if after else 1.0

    @property
    def time(self) -> float:
        return self._recording.times[self._index]

    @property
    def at_end(self) -> bool:
        return self._index == len(self._recording) - 1

    def hello(self) -> dict[str, Any]:
        return {
            "title": self._recording.title,
            "features": ["reset", "levels"],
            "fields": [each for each in _FIELDS if each != "stress" or STRESS in self._arrays],
            "times": self._recording.times,
        }

    def scene(self) -> bytes:
        self._sent = self._version
        surfaces, arrays = self._parts.surfaces, self._arrays
        rest = self._parts.rest
        points = self._parts.split(arrays["Points"])
        looks = self._recording.looks(self._parts)
        soft = [part for part, look in zip(points, looks, strict=True) if not look.rigid]
        message: dict[str, npt.NDArray[Any]] = {}
        for index, cut in enumerate(self._recording.cut_faces(self._parts)):
            message[f"rest/{index}"] = rest[index][surfaces.nodes[index]].astype(np.float32)
            message[f"triangles/{index}"] = surfaces.triangles[index]
            if cut is not None and cut.any():
                message[f"cut/{index}"] = cut
        bodies = [
            {**asdict(look), "nodes": end - start, "tetrahedra": 0}
            for look, (start, end) in zip(looks, self._parts.ranges, strict=True)
        ]
        bounds = {
            "soft": _corners(np.concatenate(soft or points)),
            "all": _corners(arrays["Points"]),
        }
        header = {
            "version": self._version,
            "bodies": bodies,
            "up": self._recording.up,
            "bounds": bounds,
        }
        return encode("scene", finite(header), message)

    def state(self) -> dict[str, Any]:
        return {"undo": 0, "bodies": []}

    def advance(self) -> Outcome:
        self._show(self._index + 1)
        return Outcome()

    def changed(self) -> bool:
        return self._version != self._sent

    def frame(self, number: int, wishes: Wishes, numbers: dict[str, Any]) -> bytes:
        surfaces = self._parts.surfaces
        points = self._parts.split(self._arrays["Points"])
        message: dict[str, npt.NDArray[Any]] = {"positions": surfaces.stack(points)}
        for name in wishes.fields.intersection(self.hello()["fields"]):
            message[f"field/{name}"] = surfaces.stack_values(self._field(name, points))
        for level in wishes.levels:
            message |= box_arrays(level, self._recording.boxes(self._index, level))
        header = {
            "version": self._version,
            "number": number,
            "frame": self._index,
            "time": self.time,
        }
        return encode("frame", finite(header), message)

    def obey(self, command: Command, client: int) -> Outcome:
        if command["type"] == "seek":
            self._show(command["frame"])
        elif command["type"] == "reset":
            self._show(0)
        else:
            return Outcome()
        return Outcome(scene=self.changed(), frame=True)

    def _show(self, index: int) -> None:
        self._index = min(index, len(self._recording) - 1)
        self._arrays, parts = self._recording.frame(self._index)
        if parts is not self._parts:
            self._parts = parts
            self._version += 1

    def _field(self, name: str, points: list[npt.NDArray[Any]]) -> list[Float64Array]:
        if name == "deformation":
            rest = self._parts.rest
            return [deformation(before, now) for before, now in zip(rest, points, strict=True)]
        if name == "stress":
            return self._parts.node_means(self._arrays[STRESS].astype(np.float64))
        stored = {
            "displacement": "displacement",
            "depth": "contact_depth",
            "force": "contact_force",
        }
        rows = self._arrays[stored[name]].astype(np.float64)
        return self._parts.split(rows if rows.ndim == 1 else np.linalg.norm(rows, axis=1))


def _corners(points: npt.NDArray[Any]) -> list[list[float]]:
    return [points.min(axis=0).tolist(), points.max(axis=0).tolist()]
