"""A run on disk as a `Player`: what `palpate simulate` wrote, with a time slider."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array
from palpate.results.drawing import Look, Moment, chosen_looks
from palpate.results.measures import node_means
from palpate.results.reading import RecordingError, read_frame, read_report, read_series
from palpate.viewer.player import Outcome, Player, Wishes
from palpate.viewer.protocol import Command, encode, finite
from palpate.viewer.surface import Surfaces, deformation

#: Frames kept in memory, so that the slider answers at once where it was before.
_KEPT = 48
_NAMES = ("Points", "displacement", "contact_force", "contact_depth")
_CELLS = ("connectivity", "offsets", "body")
#: Of each frame's cells; older runs do not have it.
_STRESS = "von_mises"
_FIELDS = ("displacement", "deformation", "stress", "depth", "force")


class Recording:
    """The frames of a folder, and what their bodies look like.

    Raises
    ------
    RecordingError
        If the folder is none that `palpate simulate` wrote.
    """

    def __init__(self, folder: Path) -> None:
        if not (folder / "simulation.pvd").exists():
            raise RecordingError(f"{folder}: no simulation.pvd in it; give the folder of a run")
        self._frames = read_series(folder)
        report = read_report(folder)
        shown = report.get("scene") or {}
        self._rows = shown.get("bodies")
        self.up = shown.get("up", [0.0, 0.0, 1.0])
        self.title = str(report.get("model") or folder.name)
        self.times = [time for time, _ in self._frames]
        self._read: OrderedDict[int, dict[str, npt.NDArray[Any]]] = OrderedDict()
        self._cells: bytes | None = None
        self._parts: _Parts | None = None

    def __len__(self) -> int:
        return len(self._frames)

    def frame(self, index: int) -> tuple[dict[str, npt.NDArray[Any]], _Parts]:
        """The arrays of a frame, and its bodies' parts of them."""
        if index not in self._read:
            self._read[index] = read_frame(self._frames[index][1], (*_NAMES, *_CELLS, _STRESS))
            if "Points" not in self._read[index]:
                raise RecordingError(f"{self._frames[index][1]}: no points in it")
            while len(self._read) > _KEPT:
                self._read.popitem(last=False)
        self._read.move_to_end(index)
        arrays = self._read[index]
        cells = arrays["connectivity"].tobytes()
        if self._parts is None or cells != self._cells:
            self._cells = cells
            self._parts = _Parts(arrays)
        return arrays, self._parts

    def looks(self, parts: _Parts) -> list[Look]:
        """How the bodies look; the run's report knows, once it has ended."""
        rows = self._rows or []
        if len(rows) != len(parts.ranges):
            rows = [{"name": f"body_{index + 1}"} for index in range(len(parts.ranges))]
        return chosen_looks(
            (row["name"], row.get("color"), row.get("opacity", 1.0), row.get("rigid", False))
            for row in rows
        )

    def moment(self, index: int) -> Moment:
        """A frame as our pictures draw it."""
        arrays, parts = self.frame(index)
        forces = np.abs(arrays["contact_force"]).max(axis=1) > 0
        return Moment(
            self.times[index],
            tuple(parts.split(arrays["Points"])),
            tuple(parts.surfaces.local_triangles()),
            tuple(parts.split(forces.astype(np.float64))),
        )


class _Parts:
    """Which rows of a frame belong to which body, and the bodies' surfaces."""

    def __init__(self, arrays: dict[str, npt.NDArray[Any]]) -> None:
        ends = arrays["offsets"].astype(np.int64)
        sizes = np.diff(ends, prepend=0)
        body = arrays["body"].astype(np.int64)
        nodes = arrays["connectivity"].astype(np.int64)
        owners = np.repeat(body, sizes)
        count = int(body.max()) + 1
        last = np.zeros(count, dtype=np.int64)
        np.maximum.at(last, owners, nodes + 1)
        self.ranges = list(pairwise([0, *last[:-1].tolist(), len(arrays["Points"])]))
        self._of_body = [body == index for index in range(count)]
        self._cells: list[npt.NDArray[np.int64]] = []
        triangles = []
        for index, (start, _) in enumerate(self.ranges):
            solid = (sizes[self._of_body[index]] == 4).all()
            cells = nodes[owners == index].reshape(-1, 4 if solid else 3) - start
            self._cells.append(cells)
            triangles.append(boundary(cells) if solid else cells)
        self._counts = [end - start for start, end in self.ranges]
        self.surfaces = Surfaces.of_triangles(triangles, self._counts)

    def node_means(self, values: npt.NDArray[np.float64]) -> list[Float64Array]:
        """Per body the mean of the cells around each node, from one number per cell."""
        return [
            node_means(values[own], cells, count)
            for own, cells, count in zip(self._of_body, self._cells, self._counts, strict=True)
        ]

    def split(self, rows: npt.NDArray[Any]) -> list[npt.NDArray[Any]]:
        """One array per body."""
        return [rows[start:end] for start, end in self.ranges]


def boundary(tetrahedra: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Faces of exactly one tetrahedron, (m, 3), turned outward for positive volumes."""
    faces = tetrahedra[:, [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]].reshape(-1, 3)
    _, first, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
    )
    return np.asarray(faces[np.sort(first[count == 1])])


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
            "features": ["reset"],
            "fields": [each for each in _FIELDS if each != "stress" or _STRESS in self._arrays],
            "times": self._recording.times,
        }

    def scene(self) -> bytes:
        self._sent = self._version
        surfaces, arrays = self._parts.surfaces, self._arrays
        rest = self._parts.split(self._rest())
        points = self._parts.split(arrays["Points"])
        looks = self._recording.looks(self._parts)
        soft = [part for part, look in zip(points, looks, strict=True) if not look.rigid]
        message: dict[str, npt.NDArray[Any]] = {}
        for index, nodes in enumerate(surfaces.nodes):
            message[f"rest/{index}"] = rest[index][nodes].astype(np.float32)
            message[f"triangles/{index}"] = surfaces.triangles[index]
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

    def advance(self) -> None:
        self._show(self._index + 1)

    def changed(self) -> bool:
        return self._version != self._sent

    def frame(self, number: int, wishes: Wishes, numbers: dict[str, Any]) -> bytes:
        surfaces = self._parts.surfaces
        points = self._parts.split(self._arrays["Points"])
        message: dict[str, npt.NDArray[Any]] = {"positions": surfaces.stack(points)}
        for name in wishes.fields.intersection(self.hello()["fields"]):
            message[f"field/{name}"] = surfaces.stack_values(self._field(name, points))
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

    def _rest(self) -> Float64Array:
        points = self._arrays["Points"]
        rest: Float64Array = points - self._arrays.get("displacement", np.zeros_like(points))
        return rest

    def _field(self, name: str, points: list[npt.NDArray[Any]]) -> list[Float64Array]:
        if name == "deformation":
            rest = self._parts.split(self._rest())
            return [deformation(before, now) for before, now in zip(rest, points, strict=True)]
        if name == "stress":
            return self._parts.node_means(self._arrays[_STRESS].astype(np.float64))
        stored = {
            "displacement": "displacement",
            "depth": "contact_depth",
            "force": "contact_force",
        }
        rows = self._arrays[stored[name]].astype(np.float64)
        return self._parts.split(rows if rows.ndim == 1 else np.linalg.norm(rows, axis=1))


def _corners(points: npt.NDArray[Any]) -> list[list[float]]:
    return [points.min(axis=0).tolist(), points.max(axis=0).tolist()]
