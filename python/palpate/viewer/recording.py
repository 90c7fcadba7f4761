"""A run on disk: what `palpate simulate` wrote, frame by frame."""

from __future__ import annotations

from collections import OrderedDict
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array
from palpate.mesh import Mesh
from palpate.results.cut_faces import CutFaces
from palpate.results.drawing import Look, Moment, chosen_looks
from palpate.results.measures import node_means
from palpate.results.reading import RecordingError, read_frame, read_report, read_series
from palpate.scene import Scene
from palpate.viewer.surface import Surfaces

#: Stress of each cell; older runs do not have it.
STRESS = "von_mises"

#: Frames kept in memory, so that the slider answers at once where it was before.
_KEPT = 48
_NAMES = ("Points", "displacement", "contact_force", "contact_depth", STRESS)
_CELLS = ("connectivity", "offsets", "body")
#: Displacements are written in single precision.
_SINGLE = float(np.finfo(np.float32).eps)


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
        self._leaf_size: int | None = (report.get("options") or {}).get("leaf_size")
        self._first: _Parts | None = None
        self._parts: _Parts | None = None

    def __len__(self) -> int:
        return len(self._frames)

    def frame(self, index: int) -> tuple[dict[str, npt.NDArray[Any]], _Parts]:
        """The arrays of a frame, and its bodies' parts of them."""
        if index not in self._read:
            self._read[index] = read_frame(self._frames[index][1], (*_NAMES, *_CELLS))
            if "Points" not in self._read[index]:
                raise RecordingError(f"{self._frames[index][1]}: no points in it")
            while len(self._read) > _KEPT:
                self._read.popitem(last=False)
        self._read.move_to_end(index)
        arrays = self._read[index]
        if self._first is None:
            if index > 0:
                self.frame(0)
            else:
                self._first = _Parts(arrays)
        for known in (self._parts, self._first):
            if known is not None and known.fit(arrays):
                self._parts = known
                return arrays, known
        self._parts = _Parts(arrays)
        return arrays, self._parts

    def cut_faces(self, parts: _Parts) -> list[npt.NDArray[np.uint8] | None]:
        """1 for the surface triangles of each body that a blade made since the first frame."""
        if parts is self._first:
            return [None] * len(parts.ranges)
        return [
            self._faces.of_triangles(str(index), nodes, triangles, rounding=parts.rounding)
            for index, (nodes, triangles) in enumerate(
                zip(parts.rest, parts.triangles, strict=True)
            )
        ]

    @cached_property
    def _faces(self) -> CutFaces:
        first = self.frame(0)[1]
        return CutFaces({str(index): mesh for index, mesh in enumerate(first.meshes)})

    def boxes(self, index: int, level: int) -> list[Float64Array]:
        """Boxes (k, 2, 3) [m] of each body in a frame, at a level of trees made of its rest."""
        arrays, parts = self.frame(index)
        trees = parts.trees(self._leaf_size)
        trees.update(parts.split(arrays["Points"]))
        return [trees.boxes(body, level) for body in range(len(parts.ranges))]

    def looks(self, parts: _Parts) -> list[Look]:
        """How the bodies look; the run's report knows, once it has ended."""
        rows = self._rows or []
        if len(rows) != len(parts.ranges):
            rows = [{"name": f"body_{index + 1}"} for index in range(len(parts.ranges))]
        return chosen_looks(
            (row["name"], row.get("color"), row.get("opacity", 1.0), row.get("rigid", False))
            for row in rows
        )

    def moment(self, index: int, level: int | None = None) -> Moment:
        """A frame as our pictures draw it, with the boxes at a level of the trees."""
        arrays, parts = self.frame(index)
        forces = np.abs(arrays["contact_force"]).max(axis=1) > 0
        return Moment(
            self.times[index],
            tuple(parts.split(arrays["Points"])),
            tuple(parts.triangles),
            tuple(parts.split(forces.astype(np.float64))),
            tuple(self.cut_faces(parts)),
            () if level is None else tuple(self.boxes(index, level)),
        )


class _Parts:
    """Which rows of a frame belong to which body, and what the bodies are made of.

    Per body: ``ranges`` of rows, ``triangles`` of the surface (m, 3), ``rest`` positions (n, 3) [m]
    that are known to ``rounding``.
    """

    def __init__(self, arrays: dict[str, npt.NDArray[Any]]) -> None:
        self._connectivity = arrays["connectivity"]
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
        self.triangles: list[npt.NDArray[np.int64]] = []
        for index, (start, _) in enumerate(self.ranges):
            solid = (sizes[self._of_body[index]] == 4).all()
            cells = nodes[owners == index].reshape(-1, 4 if solid else 3) - start
            self._cells.append(cells)
            self.triangles.append(boundary(cells) if solid else cells)
        self._counts = [end - start for start, end in self.ranges]
        self.surfaces = Surfaces.of_triangles(self.triangles, self._counts)
        points = arrays["Points"]
        displacement = arrays.get("displacement", np.zeros_like(points))
        self.rest = self.split(points - displacement)
        self.rounding = _SINGLE * float(np.abs(displacement).max(initial=0.0))
        self._trees: Scene | None = None

    def fit(self, arrays: dict[str, npt.NDArray[Any]]) -> bool:
        """Whether a frame has the same bodies in the same state of being cut."""
        return np.array_equal(arrays["connectivity"], self._connectivity)

    @property
    def meshes(self) -> list[Mesh]:
        """The bodies at rest."""
        return [
            Mesh(rest, cells) if cells.shape[1] == 4 else Mesh(rest, triangles=cells)
            for rest, cells in zip(self.rest, self._cells, strict=True)
        ]

    def trees(self, leaf_size: int | None) -> Scene:
        """The bodies' bounding trees."""
        if self._trees is None:
            self._trees = Scene(self.meshes, leaf_size=leaf_size)
        return self._trees

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
