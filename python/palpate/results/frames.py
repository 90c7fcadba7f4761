"""The frames of a simulation as a series that ParaView opens."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from palpate._arrays import Float64Array
from palpate.model import Model
from palpate.results.atomic import remove_leftovers
from palpate.results.stress import VonMises
from palpate.results.vtu import Grid, write_series
from palpate.simulation import Simulation

#: Seconds between two writings of the index while the simulation runs.
_INDEX_INTERVAL = 1.0


class FrameSeries:
    """Writes ``simulation.pvd`` and ``frames/frame_00000.vtu`` and so on into a folder.

    Every frame holds all bodies: tetrahedra of soft ones, triangles of surfaces.
    """

    def __init__(self, folder: Path, simulation: Simulation) -> None:
        self._folder = folder
        self._look_at(simulation)
        self._frames: list[tuple[float, str]] = []
        self._indexed = time.monotonic()
        (folder / "frames").mkdir(parents=True, exist_ok=True)
        for old in [folder / "simulation.pvd", *(folder / "frames").glob("frame_*.vtu")]:
            old.unlink(missing_ok=True)
        remove_leftovers(folder, "simulation.pvd")
        remove_leftovers(folder / "frames", "frame_*.vtu")

    def _look_at(self, simulation: Simulation) -> None:
        self._model = model = simulation.model
        self._von_mises = VonMises(simulation)
        self._rest = np.concatenate([body.mesh.nodes for body in model.bodies])
        counts = [len(body.mesh.nodes) for body in model.bodies]
        self._offsets = np.concatenate([[0], np.cumsum(counts)])
        self._grid = _grid(model, self._offsets)

    def __len__(self) -> int:
        return len(self._frames)

    @property
    def index(self) -> Path:
        """The file to open."""
        return self._folder / "simulation.pvd"

    def add(self, simulation: Simulation) -> None:
        """Write the present state."""
        if simulation.model is not self._model:  # it was cut
            self._look_at(simulation)
        name = f"frames/frame_{len(self._frames):05d}.vtu"
        points = np.concatenate(simulation.positions)
        data = {
            "displacement": points - self._rest,
            "velocity": np.concatenate(simulation.velocities),
            "contact_force": np.concatenate(simulation.contact_forces),
            "contact_depth": contact_depths(simulation, self._offsets),
        }
        with np.errstate(over="ignore"):  # a run that fails gets large first
            shown = {key: values.astype(np.float32) for key, values in data.items()}
            stress = np.concatenate(
                [
                    self._von_mises.of(index)
                    if len(body.mesh.tetrahedra)
                    else np.zeros(len(body.mesh.triangles))
                    for index, body in enumerate(self._model.bodies)
                ]
            )
            cells = {"von_mises": stress.astype(np.float32)}
        self._grid.write(self._folder / name, points, shown, cells)
        self._frames.append((simulation.time, name))
        if time.monotonic() - self._indexed > _INDEX_INTERVAL:
            self.finish()

    def finish(self) -> None:
        """Write the index of all frames so far."""
        write_series(self.index, self._frames)
        self._indexed = time.monotonic()


def contact_depths(simulation: Simulation, offsets: Float64Array) -> Float64Array:
    """Deepest overlap [m] of the contacts at each node of all bodies; 0 where none is."""
    contacts = simulation.contacts
    result = np.zeros(int(offsets[-1]))
    if len(contacts) == 0:
        return result
    # One node of side a in a vertex-triangle contact, two in an edge-edge contact.
    first = np.where(contacts.kinds == 0, 1, 2)[:, None]
    body = np.where(np.arange(4) < first, contacts.bodies[:, :1], contacts.bodies[:, 1:])
    nodes = contacts.nodes + offsets[body]
    depths = np.repeat(np.maximum(0.0, -contacts.gaps)[:, None], 4, axis=1)
    touched = contacts.weights != 0
    np.maximum.at(result, nodes[touched].astype(np.int64), depths[touched])
    return result


def _grid(model: Model, offsets: Float64Array) -> Grid:
    cells, body_numbers, regions = [], [], []
    for index, body in enumerate(model.bodies):
        mesh = body.mesh
        solid = len(mesh.tetrahedra) > 0
        block = (mesh.tetrahedra if solid else mesh.triangles).astype(np.int64)
        cells.append(block + int(offsets[index]))
        body_numbers.append(np.full(len(block), index, dtype=np.int32))
        known = mesh.regions if solid else None
        regions.append(np.zeros(len(block), dtype=np.int32) if known is None else known)
    return Grid(
        int(offsets[-1]),
        cells,
        {
            "body": np.concatenate(body_numbers),
            "region": np.concatenate(regions).astype(np.int32),
        },
    )
