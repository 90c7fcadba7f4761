"""Independent checks of a mesh: nothing is written that fails one."""

from __future__ import annotations

import numpy as np

from .tetrahedra import signed_volumes, surface_triangles


def dihedral_angles(x: np.ndarray, elements: np.ndarray) -> np.ndarray:
    """All dihedral angles [degrees], shape (6 m,), from the normals of the faces."""
    a, b, c, d = (x[elements[:, k]] for k in range(4))
    faces = [np.cross(c - b, d - b), np.cross(d - a, c - a), np.cross(b - a, d - a)]
    faces.append(np.cross(c - a, b - a))
    unit = [face / np.linalg.norm(face, axis=1)[:, None] for face in faces]
    pairs = [(i, j) for i in range(4) for j in range(i)]
    cosines = np.concatenate([-(unit[i] * unit[j]).sum(1) for i, j in pairs])
    return np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))


def check_surface(x: np.ndarray, triangles: np.ndarray, genus: int = 0) -> None:
    """Closed, oriented, one piece, of the given genus; every node of a single fan."""
    directed = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    _, counts = np.unique(directed, axis=0, return_counts=True)
    assert (counts == 1).all(), "an edge runs twice in the same direction"
    backward = {tuple(edge) for edge in directed[:, ::-1].tolist()}
    assert all(tuple(edge) in backward for edge in directed.tolist()), "the surface is open"
    used = np.unique(triangles)
    characteristic = len(used) - len(directed) // 2 + len(triangles)
    assert characteristic == 2 - 2 * genus, f"Euler characteristic {characteristic}"
    following: dict[int, dict[int, int]] = {}
    for a, b, c in triangles.tolist():
        for node, start, end in ((a, b, c), (b, c, a), (c, a, b)):
            following.setdefault(node, {})[start] = end
    for node, fan in following.items():
        start = at = next(iter(fan))
        steps = 0
        while steps == 0 or at != start:
            at, steps = fan[at], steps + 1
        assert steps == len(fan), f"two sheets touch in node {node}"
    reached, front = {int(used[0])}, [int(used[0])]
    while front:
        for other in following[front.pop()]:
            if other not in reached:
                reached.add(other)
                front.append(other)
    assert len(reached) == len(used), "the surface is in several pieces"


def check_solid(x: np.ndarray, elements: np.ndarray) -> str:
    """Positive volumes, good angles, a clean surface, every node used; a line of figures."""
    volumes = signed_volumes(x[elements])
    assert (volumes > 0).all(), "inverted tetrahedra"
    assert len(np.unique(elements)) == len(x), "unused nodes"
    angles = dihedral_angles(x, elements)
    assert angles.min() > 12.0, f"smallest dihedral angle {angles.min():.1f}"
    assert angles.max() < 160.0, f"largest dihedral angle {angles.max():.1f}"
    triangles = surface_triangles(elements)
    check_surface(x, triangles)
    return (
        f"{len(x)} nodes, {len(elements)} tetrahedra, {len(triangles)} surface triangles, "
        f"dihedral angles {angles.min():.1f} to {angles.max():.1f} degrees, "
        f"{1e6 * volumes.sum():.1f} ml"
    )
