"""Tetrahedra of a wanted size inside a closed surface."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from palpate import _arrays
from palpate._arrays import Float64Array, IndexArray
from palpate.errors import MeshError
from palpate.mesh import Mesh, as_mesh
from palpate.meshing import ftetwild
from palpate.meshing.ftetwild import Progress
from palpate.results.measures import signed_volumes

#: Nodes of a body that steps in real time, beside others, on one core.
DEFAULT_NODES = 2500
#: The new surface may lie this part of an edge from the given one.
TOLERANCE = 0.05
#: Points nearer than this part of the surface's size are one, where the surface is open.
WELD = 1e-6
#: How near to the wanted number of nodes is near enough, and how often to try.
NEAR, TRIES = 0.1, 4
#: So many times more nodes than the length alone asks for make the surface follow the given one.
TOLERANCE_ADDS = 1.9


def mesh_surface(
    surface: Mesh,
    *,
    edge_length: float | None = None,
    nodes: int | None = None,
    tolerance: float | None = None,
    fill_holes: bool = False,
    largest: bool = False,
    progress: Progress | None = None,
) -> Mesh:
    """Fill a closed surface with tetrahedra (fTetWild; needs ``pip install palpate[mesh]``).

    The surface is made anew: its triangles may be many, long and thin, cross each other or touch.
    Two runs give meshes that differ a little.

    Parameters
    ----------
    surface : Mesh
        Closed, its triangles facing outward; of a mesh with tetrahedra its surface is taken.
    edge_length : float, optional
        Length of edges [m] to aim at. Thin or curved parts get shorter ones.
    nodes : int, optional
        Instead: about how many nodes the mesh shall have (2,500), within 10 % where four tries
        suffice.
    tolerance : float, optional
        How far the new surface may lie from the given one [m]: a twentieth of an edge.
    fill_holes : bool
        Take an open surface too, and close it where it is half around a place.
    largest : bool
        Keep only the largest of several parts.
    progress : callable, optional
        Called with what is being done, a few words.

    Returns
    -------
    Mesh
        Its ``notes`` say what was mended.

    Raises
    ------
    MeshError
        If the surface is open or encloses nothing, or the mesher is not installed.
    """
    as_mesh(surface, "surface")
    wanted = _wanted(edge_length, nodes)
    tolerance = None if tolerance is None else _positive(tolerance, "tolerance")
    ftetwild.require()
    tell = progress or (lambda _: None)
    points, triangles, notes = _closed(surface, fill_holes)
    volume = _enclosed(points, triangles)
    if volume < 0:
        triangles, volume = triangles[:, ::-1], -volume
        notes.append("the surface faced inward: turned")
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    if volume <= 1e-9 * extent**3:
        raise MeshError("the surface encloses no volume")

    def fill(length: float, tell: Progress) -> Mesh:
        if length > extent:
            raise MeshError(
                f"edges of {length:.3g} m in a body of {extent:.3g} m: make them shorter"
            )
        made = ftetwild.tetrahedralise(
            points, triangles, length, tolerance or TOLERANCE * length, tell
        )
        return _checked(*made, largest)

    if wanted is None:
        assert edge_length is not None
        mesh = fill(float(edge_length), tell)
    else:
        area = float(np.linalg.norm(_area_vectors(points, triangles), axis=1).sum())
        mesh = _with_nodes(fill, wanted, volume, area, tell)
        if abs(len(mesh.nodes) / wanted - 1) > NEAR:
            notes.append(f"{len(mesh.nodes):,} nodes; the shape or the tolerance asks for them")
    return Mesh._from_core(mesh._core, [*notes, *mesh.notes])


def _wanted(edge_length: float | None, nodes: int | None) -> int | None:
    """The number of nodes to aim at, or None for an edge length."""
    if edge_length is not None and nodes is not None:
        raise ValueError("edge_length, nodes: give one of them")
    if edge_length is not None:
        _positive(edge_length, "edge_length")
        return None
    return _arrays.count(DEFAULT_NODES if nodes is None else nodes, "nodes", minimum=4)


def _positive(value: Any, name: str) -> float:
    number = _arrays.scalar(value, name)
    if number <= 0:
        raise ValueError(f"{name}: expected a positive length [m], got {number}")
    return number


def _with_nodes(fill: Any, wanted: int, volume: float, area: float, tell: Progress) -> Mesh:
    """The mesh that comes nearest to a number of nodes: estimate a length, make, correct it."""
    length = _length_for(wanted / TOLERANCE_ADDS, volume, area)
    tried: list[tuple[float, float]] = []  # logarithms of lengths and of nodes
    best: Mesh | None = None
    for attempt in range(TRIES):

        def telling(text: str, attempt: int = attempt, length: float = length) -> None:
            tell(f"try {attempt + 1}, edges of {1e3 * length:.3g} mm: {text}")

        telling("starting")
        mesh: Mesh = fill(length, telling)
        if best is None or _miss(mesh, wanted) < _miss(best, wanted):
            best = mesh
        if abs(len(mesh.nodes) / wanted - 1) <= NEAR:
            break
        tried.append((math.log(length), math.log(len(mesh.nodes))))
        length = math.exp(_corrected(tried, math.log(wanted)))
    assert best is not None
    return best


def _corrected(tried: list[tuple[float, float]], wanted: float) -> float:
    """The next length: along a power law through the last two tries, or a typical one."""
    (last_length, last_nodes), power = tried[-1], -1.8
    if len(tried) > 1 and tried[-2][0] != last_length:
        power = (last_nodes - tried[-2][1]) / (last_length - tried[-2][0])
        power = min(max(power, -3.0), -0.8)  # two runs differ by chance too
    return last_length + (wanted - last_nodes) / power


def _miss(mesh: Mesh, wanted: int) -> float:
    return abs(math.log(len(mesh.nodes) / wanted))


def _node_count(length: float, volume: float, area: float) -> float:
    """About how many nodes edges of a length make: those inside, and a layer at the surface."""
    return volume / (0.65 * length**3) + 0.6 * area / (0.87 * length**2)


def _length_for(count: float, volume: float, area: float) -> float:
    """Edge length [m] that makes about ``count`` nodes."""
    low, high = 0.0, 10 * math.pow(volume / count, 1 / 3) + 10 * math.sqrt(area / count)
    for _ in range(60):
        middle = (low + high) / 2
        if _node_count(middle, volume, area) > count:
            low = middle
        else:
            high = middle
    return high


def _closed(surface: Mesh, fill_holes: bool) -> tuple[Float64Array, IndexArray, list[str]]:
    """Points and triangles of a closed surface, and what was mended."""
    points, triangles = surface.nodes, surface.triangles
    notes: list[str] = []
    open_edges, turned = _unmatched_edges(triangles)
    if len(open_edges):
        extent = float(np.linalg.norm(np.ptp(points, axis=0)))
        points, triangles, merged = _weld(points, triangles, WELD * extent)
        if merged:
            notes.append(f"{merged} points within {WELD * extent:.2g} m of another merged")
            open_edges, turned = _unmatched_edges(triangles)
    if fill_holes:
        if len(open_edges):
            notes.append(f"{len(open_edges)} open edges: holes filled")
    elif len(open_edges):
        x, y, z = points[open_edges[0]].mean(axis=0)
        raise MeshError(
            f"the surface is not closed: {len(open_edges)} open edges, the first near "
            f"{x:.4g},{y:.4g},{z:.4g}; close it, or let holes be filled (--fill-holes, "
            "fill_holes=True)"
        )
    if len(turned):
        x, y, z = points[turned[0]].mean(axis=0)
        raise MeshError(
            f"{len(turned)} edges between triangles that face opposite ways, the first near "
            f"{x:.4g},{y:.4g},{z:.4g}: orient the surface outward"
        )
    return points, triangles, notes


def _unmatched_edges(triangles: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Edges of an odd number of triangles, and others not run through equally often both ways."""
    edges = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    sense = np.where(edges[:, 0] < edges[:, 1], 1, -1)
    unique, inverse, counts = np.unique(
        np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    balance = np.bincount(inverse.reshape(-1), sense, len(unique))
    odd = counts % 2 == 1
    return unique[odd], unique[~odd & (balance != 0)]


def _weld(
    points: Float64Array, triangles: IndexArray, reach: float
) -> tuple[Float64Array, IndexArray, int]:
    """Join points that fall into the same cell of a grid, or of one shifted by half a cell."""
    total = len(points)
    for shift in (0.0, 0.5):
        cells = np.floor((points - points.min(axis=0)) / reach + shift).astype(np.int64)
        _, first, inverse = np.unique(cells, axis=0, return_index=True, return_inverse=True)
        points, triangles = points[first], inverse.reshape(-1)[triangles].astype(np.int32)
    a, b, c = triangles.T
    flat = (a == b) | (b == c) | (c == a)
    return points, triangles[~flat], total - len(points)


def _area_vectors(points: Float64Array, triangles: IndexArray) -> Float64Array:
    """Area vector [m²] of each triangle, shape (t, 3), outward."""
    a, b, c = (points[corner] for corner in triangles.T)
    return np.asarray(np.cross(b - a, c - a) / 2)


def _enclosed(points: Float64Array, triangles: IndexArray) -> float:
    """Volume [m³] inside a closed surface, negative if it faces inward."""
    centred = points - points.mean(axis=0)
    return float(np.sum(centred[triangles].mean(axis=1) * _area_vectors(centred, triangles)) / 3)


def _checked(nodes: Float64Array, tetrahedra: IndexArray, largest: bool) -> Mesh:
    """The mesh, its notes, and on request only its largest part."""
    if len(tetrahedra) == 0:
        raise MeshError(
            "no tetrahedron inside the surface: make edges shorter, or mend the surface"
        )
    notes = []
    if largest:
        part = _parts(len(nodes), tetrahedra)[tetrahedra[:, 0]]
        volumes = np.bincount(part, np.abs(signed_volumes(nodes, tetrahedra)))
        parts = int(np.count_nonzero(volumes))
        if parts > 1:
            tetrahedra = tetrahedra[part == volumes.argmax()]
            notes.append(f"the largest of {parts} parts kept")
    used, numbers = np.unique(tetrahedra, return_inverse=True)
    mesh = Mesh(nodes[used], numbers.reshape(-1, 4), repair=True)
    return Mesh._from_core(mesh._core, [*notes, *mesh.notes])


def _parts(count: int, tetrahedra: IndexArray) -> IndexArray:
    """For each node the lowest node it hangs together with."""
    lowest = np.arange(count, dtype=np.int32)
    while True:
        least = lowest[tetrahedra].min(axis=1)
        after = lowest.copy()
        for corner in range(4):
            np.minimum.at(after, tetrahedra[:, corner], least)
        after = after[after]
        if np.array_equal(after, lowest):
            return lowest
        lowest = after


__all__ = ["mesh_surface"]
