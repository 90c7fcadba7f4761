"""Organs under rough handling: squeezed flat and let go, dropped in a heap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate._arrays import Float64Array
from palpate.files import read_mesh
from palpate.mesh import Mesh
from palpate.model import Body, Contact, Material, Model, RigidKey, read_model
from palpate.results.measures import mean_edge, signed_volumes
from palpate.simulation import Simulation


def plate(half: float, height: float, *, down: bool = False) -> Mesh:
    """A square of two triangles at a height [m], facing up, or down."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * half + [0, 0, height]
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(corners, triangles=triangles[:, ::-1] if down else triangles)


def misfit(mesh: Mesh, positions: Float64Array) -> float:
    """Largest distance of a node from the rest shape, best fitted, over the mesh's size."""
    rest = mesh.nodes - mesh.nodes.mean(axis=0)
    now = positions - positions.mean(axis=0)
    u, _, v = np.linalg.svd(rest.T @ now)
    u[:, 2] *= np.sign(np.linalg.det(u @ v))
    return float(np.linalg.norm(rest @ (u @ v) - now, axis=1).max() / np.ptp(rest, axis=0).max())


@dataclass(frozen=True)
class Squeeze:
    """An organ pressed flat between two plates and let go.

    Over time [s]: the distance of the plates over the organ's rest thickness, the largest distance
    of a node from the rest shape over the organ's size, how far a node is beyond a plate over the
    thickness, and inverted tetrahedra. At the end: pairs of surface triangles that intersect, and
    the fastest node [m/s].
    """

    times: Float64Array
    gaps: Float64Array
    misfits: Float64Array
    beyond: Float64Array
    inverted: Float64Array
    intersections: int
    speed: float


def squeeze(
    mesh: Mesh, material: Material, flat: float, *, rest: float = 2.0, time_step: float = 1 / 60
) -> Squeeze:
    """Press to the part ``flat`` of the thickness within a second, hold, let go, wait ``rest``."""
    nodes = mesh.nodes - (mesh.nodes.min(axis=0) + mesh.nodes.max(axis=0)) / 2
    # The thinnest direction up.
    _, axes = np.linalg.eigh(np.cov(nodes.T))
    nodes = nodes @ axes[:, [2, 1, 0]]
    if np.linalg.det(axes[:, [2, 1, 0]]) < 0:
        nodes = nodes * [1, -1, 1]
    organ = Mesh(nodes, mesh.tetrahedra)
    low, high = nodes[:, 2].min(), nodes[:, 2].max()
    thickness, half = high - low, 3 * np.abs(nodes).max()
    clear = 0.05 * thickness
    way = 0.5 * (1 - flat) * thickness + clear
    contact = Contact(friction=0.3)

    def keys(sign: float) -> tuple[RigidKey, ...]:
        pressed, open_ = (0.0, 0.0, sign * way), (0.0, 0.0, 0.0)
        return (
            RigidKey(0.0, open_),
            RigidKey(1.0, pressed),
            RigidKey(1.2, pressed),
            RigidKey(1.5, open_),
        )

    bodies = [
        Body(organ, name="organ", material=material, contact=contact),
        Body(plate(half, low - clear), name="below", rigid=keys(1.0), contact=contact),
        Body(plate(half, high + clear, down=True), name="above", rigid=keys(-1.0), contact=contact),
    ]
    simulation = Simulation(Model(bodies, gravity=(0, 0, 0)), time_step=time_step)
    rows = []
    for _ in range(round((1.5 + rest) / simulation.time_step)):
        simulation.step()
        x, below, above = simulation.positions
        rows.append(
            (
                simulation.time,
                (above[0, 2] - below[0, 2]) / thickness,
                misfit(organ, x),
                max(below[0, 2] - x[:, 2].min(), x[:, 2].max() - above[0, 2], 0.0) / thickness,
                (signed_volumes(x, organ.tetrahedra) <= 0).sum(),
            )
        )
    times, gaps, misfits, beyond, inverted = np.array(rows).T
    return Squeeze(
        times,
        gaps,
        misfits,
        beyond,
        inverted,
        len(simulation.intersections()),
        float(np.linalg.norm(simulation.velocities[0], axis=1).max()),
    )


@dataclass(frozen=True)
class Heap:
    """Bodies that fall onto a floor and each other.

    Over time [s]: inverted tetrahedra, intersecting pairs of triangles, deepest node inside another
    body over the mean edge, the fastest node [m/s] and the volume over that at rest.
    """

    times: Float64Array
    inverted: Float64Array
    intersections: Float64Array
    depths: Float64Array
    speeds: Float64Array
    volumes: Float64Array
    seconds: float


def heap(
    meshes: Sequence[Mesh],
    materials: Sequence[Material],
    *,
    height: float = 0.05,
    duration: float = 2.0,
) -> Heap:
    """Organs as they lie to each other, the lowest node ``height`` [m] above a rigid floor."""
    stacked = np.concatenate([mesh.nodes for mesh in meshes])
    shift = -np.append((stacked.min(axis=0) + stacked.max(axis=0))[:2] / 2, stacked[:, 2].min())
    placed = [Mesh(mesh.nodes + shift + [0, 0, height], mesh.tetrahedra) for mesh in meshes]
    contact = Contact(friction=0.3)
    bodies = [
        Body(mesh, name=f"organ {index}", material=material, contact=contact)
        for index, (mesh, material) in enumerate(zip(placed, materials, strict=True))
    ]
    bodies.append(Body(plate(1.0, 0.0), name="floor", rigid=(), contact=contact))
    simulation = Simulation(Model(bodies))
    edge = float(np.mean([mean_edge(mesh) for mesh in placed]))
    rest = sum(mesh.volume for mesh in placed)
    rows, seconds = [], 0.0
    for _ in range(round(duration / simulation.time_step)):
        report = simulation.step()
        seconds += report.times["total"]
        each = [
            signed_volumes(x, mesh.tetrahedra)
            for x, mesh in zip(simulation.positions, placed, strict=False)
        ]
        speeds = [np.linalg.norm(v, axis=1).max() for v in simulation.velocities[:-1]]
        rows.append(
            (
                simulation.time,
                sum((v <= 0).sum() for v in each),
                len(simulation.intersections()),
                report.max_depth / edge,
                max(speeds),
                sum(v.sum() for v in each) / rest,
            )
        )
    times, inverted, pairs, depths, fastest, parts = np.array(rows, dtype=np.float64).T
    return Heap(times, inverted, pairs, depths, fastest, parts, seconds)


def real_organs(folder: Path, names: Sequence[str]) -> list[Mesh]:
    """Meshes of a folder with ``organs/*.vtk``."""
    return [read_mesh(folder / "organs" / f"{name}.vtk") for name in names]


def kidney() -> Mesh:
    """The kidney of the bundled models."""
    bodies = read_model("case1").bodies
    return next(body.mesh for body in bodies if "kidney" in body.name)
