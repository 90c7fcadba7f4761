"""Independent checks of meshes and placements; everything is measured anew from nodes and elements."""

from collections import Counter, defaultdict, deque

import numpy as np
from scipy.spatial import cKDTree

from .mesher import Mesh, mean_edge
from .shapes import Points


class BadMeshError(Exception):
    """A generated mesh or scene breaks a promise."""


def dihedral_angles(mesh: Mesh) -> np.ndarray:
    """(m, 6) [degrees], by the angle between the planes at each edge."""
    x = mesh.nodes[mesh.elements]
    columns = []
    for i, j, k, m in (
        (0, 1, 2, 3), (0, 2, 1, 3), (0, 3, 1, 2), (1, 2, 0, 3), (1, 3, 0, 2), (2, 3, 0, 1),
    ):  # fmt: skip
        edge = x[:, j] - x[:, i]
        first, second = np.cross(edge, x[:, k] - x[:, i]), np.cross(edge, x[:, m] - x[:, i])
        across = np.linalg.norm(np.cross(first, second), axis=1)
        columns.append(np.degrees(np.arctan2(across, (first * second).sum(1))))
    return np.stack(columns, axis=1)


def volumes(mesh: Mesh) -> np.ndarray:
    """Signed volume of each tetrahedron [m^3]."""
    x = mesh.nodes[mesh.elements]
    return np.linalg.det(x[:, 1:] - x[:, :1]) / 6.0


def check_surface(name: str, mesh: Mesh) -> None:
    """Refuses anything but one closed, oriented manifold of genus 0."""
    triangles = mesh.triangles().tolist()
    directed = Counter((t[i], t[(i + 1) % 3]) for t in triangles for i in range(3))
    if any(count != 1 or directed[b, a] != 1 for (a, b), count in directed.items()):
        raise BadMeshError(f"{name}: a surface edge is not in exactly two triangles that agree")
    links: defaultdict[int, dict[int, int]] = defaultdict(dict)
    for t in triangles:
        for i in range(3):
            links[t[i]][t[(i + 1) % 3]] = t[(i + 2) % 3]
    for node, link in links.items():
        start = current = next(iter(link))
        steps = 0
        while steps == 0 or current != start:
            current, steps = link[current], steps + 1
        if steps != len(link):
            raise BadMeshError(f"{name}: surface node {node} is not manifold")
    seen, queue = {triangles[0][0]}, deque([triangles[0][0]])
    while queue:
        for other in links[queue.popleft()]:
            if other not in seen:
                seen.add(other)
                queue.append(other)
    if len(seen) != len(links):
        raise BadMeshError(f"{name}: the surface has several parts")
    if len(links) - len(directed) // 2 + len(triangles) != 2:
        raise BadMeshError(f"{name}: the surface has handles")


def close_boxes(low_a: Points, high_a: Points, low_b: Points, high_b: Points) -> np.ndarray:
    """(k, 2) indices of overlapping boxes, all against all in blocks."""
    found = []
    for start in range(0, len(low_a), 256):
        rows = slice(start, start + 256)
        hit = (low_a[rows, None] <= high_b[None]).all(2) & (low_b[None] <= high_a[rows, None]).all(
            2
        )
        i, j = np.nonzero(hit)
        found.append(np.stack([i + start, j], axis=1))
    return np.concatenate(found)


def segments_cross(p: Points, q: Points, triangle: Points) -> np.ndarray:
    """Whether segment p-q meets the triangle (n, 3, 3), by signs of volumes; coplanar ones do not count."""
    a, b, c = (triangle[:, k] for k in range(3))

    def side(u: Points, v: Points, w: Points, x: Points) -> np.ndarray:
        return np.sign((np.cross(v - u, w - u) * (x - u)).sum(1))

    apart = side(a, b, c, p) * side(a, b, c, q) <= 0
    turns = np.stack([side(p, q, a, b), side(p, q, b, c), side(p, q, c, a)])
    through = (turns >= 0).all(0) | (turns <= 0).all(0)
    return apart & through & (np.abs(turns).sum(0) > 0)


def crossing_pairs(x: Points, a: np.ndarray, y: Points, b: np.ndarray, same: bool) -> int:
    """Number of triangle pairs of surfaces (x, a) and (y, b) that cross; of one surface if `same`.

    Pairs of one surface that share nodes are tested by the edges that do not share.
    """
    first, second = x[a], y[b]
    pairs = close_boxes(first.min(1), first.max(1), second.min(1), second.max(1))
    if same:
        pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    crossing = np.zeros(len(pairs), dtype=bool)
    for own, other, tri, swap in ((a, b, second, 0), (b, a, first, 1)):
        mine, theirs = pairs[:, swap], pairs[:, 1 - swap]
        positions = x if swap == 0 else y
        for i in range(3):
            p, q = own[mine, i], own[mine, (i + 1) % 3]
            hit = segments_cross(positions[p], positions[q], tri[theirs])
            if same:
                target = other[theirs]
                hit &= ~((target == p[:, None]) | (target == q[:, None])).any(1)
            crossing |= hit
    return int(crossing.sum())


def close_parts(mesh: Mesh, reach: float, far: int) -> tuple[int, float]:
    """Pairs of surface nodes nearer than `reach` edges in space but over `far` edges apart on the surface.

    Returns their number and the smallest distance in edges (inf if none).
    """
    edge = mean_edge(mesh)
    around: defaultdict[int, set[int]] = defaultdict(set)
    for t in mesh.triangles().tolist():
        for i in range(3):
            around[t[i]].update(t)
    nodes = np.array(sorted(around))
    count, least = 0, np.inf
    for i, j in sorted(cKDTree(mesh.nodes[nodes]).query_pairs(reach * edge)):
        a, b = int(nodes[i]), int(nodes[j])
        front = {a}
        for _ in range(far):
            front = set().union(*(around[n] for n in front))
        if b not in front:
            count += 1
            least = min(least, float(np.linalg.norm(mesh.nodes[a] - mesh.nodes[b])) / edge)
    return count, least


def check_mesh(name: str, mesh: Mesh, least_angle: float = 12.0, most_angle: float = 160.0) -> None:
    """Refuses a mesh that is not what the models promise."""
    if len(np.unique(mesh.elements)) != len(mesh.nodes):
        raise BadMeshError(f"{name}: unused nodes")
    check_surface(name, mesh)
    triangles = mesh.triangles()
    if crossing_pairs(mesh.nodes, triangles, mesh.nodes, triangles, same=True):
        raise BadMeshError(f"{name}: the surface crosses itself")
    if mesh.elements.shape[1] == 3:
        return
    if volumes(mesh).min() <= 0.0:
        raise BadMeshError(f"{name}: inverted tetrahedra")
    faces = Counter(
        tuple(sorted((t[i], t[j], t[k])))
        for t in mesh.elements.tolist()
        for i, j, k in ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3))
    )
    if max(faces.values()) > 2:
        raise BadMeshError(f"{name}: a face of three tetrahedra")
    angles = dihedral_angles(mesh)
    if angles.min() < least_angle or angles.max() > most_angle:
        raise BadMeshError(
            f"{name}: dihedral angles {angles.min():.1f} to {angles.max():.1f} degrees"
        )
    count, least = close_parts(mesh, reach=0.9, far=4)
    if count:
        raise BadMeshError(
            f"{name}: {count} node pairs of separate parts, down to {least:.2f} edges"
        )


def describe(mesh: Mesh) -> str:
    """Counts and figures of quality in one line."""
    triangles = mesh.triangles()
    x = mesh.nodes[triangles]
    sides = np.linalg.norm(x - x[:, [1, 2, 0]], axis=2)
    areas = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1) / 2.0
    shape = 4.0 * np.sqrt(3.0) * areas / (sides**2).sum(1)
    text = f"{len(mesh.nodes)} nodes, {len(triangles)} surface triangles"
    text += f" of edge {1e3 * mean_edge(mesh):.2f} mm and quality {shape.min():.2f} to 1"
    if mesh.elements.shape[1] == 4:
        angles = dihedral_angles(mesh)
        text += f", {len(mesh.elements)} tetrahedra, {1e6 * volumes(mesh).sum():.1f} ml"
        text += f", dihedral angles {angles.min():.1f} to {angles.max():.1f} degrees"
    return text
