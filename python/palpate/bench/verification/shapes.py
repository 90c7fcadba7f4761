"""Meshes with exact geometry, and integrals over them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from palpate._arrays import Float64Array
from palpate.mesh import Mesh
from palpate.results.measures import signed_volumes

#: Corners of the six tetrahedra of a cell: bit 0 steps along x, bit 1 along y, bit 2 along z.
_PATHS = ((0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7))

#: Places where functions of x are evaluated: nodes [m], shape (n, 3), to values of shape (n, 3).
Field = Callable[[Float64Array], Float64Array]


def grid(
    xs: Sequence[float] | Float64Array,
    ys: Sequence[float] | Float64Array,
    zs: Sequence[float] | Float64Array,
    place: Field | None = None,
) -> Mesh:
    """A box of cells between rising coordinates [m], six tetrahedra each; ``place`` moves nodes."""
    axes = [np.asarray(axis, dtype=np.float64) for axis in (xs, ys, zs)]
    counts = [len(axis) - 1 for axis in axes]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(nodes)).reshape([count + 1 for count in counts])
    corner = [
        number[
            c & 1 : counts[0] + (c & 1),
            c >> 1 & 1 : counts[1] + (c >> 1 & 1),
            c >> 2 : counts[2] + (c >> 2),
        ].ravel()
        for c in range(8)
    ]
    tetrahedra = np.concatenate([np.column_stack([corner[c] for c in path]) for path in _PATHS])
    return Mesh(nodes if place is None else place(nodes), tetrahedra)


def box(cells: Sequence[int], size: Sequence[float], place: Field | None = None) -> Mesh:
    """A box with one corner at the origin, evenly divided; ``size`` [m]."""
    x, y, z = (np.linspace(0.0, s, n + 1) for s, n in zip(size, cells, strict=True))
    return grid(x, y, z, place)


def bumps(amplitude: float) -> Field:
    """Moves the inner nodes of a unit cube about, so that no two tetrahedra are alike."""

    def place(x: Float64Array) -> Float64Array:
        inside = np.sin(np.pi * x).prod(axis=1, keepdims=True)
        waves = np.sin(np.add(x[:, [1, 2, 0]] * [9.0, 7.0, 5.0], [0.0, 1.6, 3.1]))
        return np.asarray(x + amplitude * inside * waves)

    return place


def graded(fine: float, cells: int, growth: float, end: float) -> Float64Array:
    """Coordinates from 0 [m]: ``cells`` of length ``fine``, then growing until ``end``."""
    steps = [fine] * cells
    while sum(steps) < end:
        steps.append(steps[-1] * growth)
    steps = steps[:cells] + list(
        np.array(steps[cells:]) * (end - fine * cells) / max(sum(steps[cells:]), 1e-300)
    )
    return np.concatenate([[0.0], np.cumsum(steps)])


def masses(mesh: Mesh, density: float = 1000.0) -> Float64Array:
    """Lumped masses [kg] of the nodes: a quarter of each tetrahedron around them."""
    quarter = density * signed_volumes(mesh.nodes, mesh.tetrahedra) / 4.0
    corners = mesh.tetrahedra.ravel()
    sums = np.bincount(corners, np.repeat(quarter, 4), minlength=len(mesh.nodes))
    return sums.astype(np.float64)


def gradients(mesh: Mesh, positions: Float64Array) -> Float64Array:
    """Deformation gradient of each tetrahedron, shape (m, 3, 3)."""

    def edges(nodes: Float64Array) -> Float64Array:
        corners = nodes[mesh.tetrahedra]
        return np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)

    return np.asarray(edges(positions) @ np.linalg.inv(edges(mesh.nodes)))


def traction_loads(mesh: Mesh, on: np.ndarray, traction: Field) -> Float64Array:
    """Nodal forces [N] of a traction [Pa] on the surface triangles all of whose nodes are ``on``.

    ``traction`` maps outward unit normals, shape (k, 3), to pressures of the same shape.
    """
    triangles = mesh.triangles[on[mesh.triangles].all(axis=1)]
    a, b, c = (mesh.nodes[corner] for corner in triangles.T)
    doubled = np.cross(b - a, c - a)
    area = np.linalg.norm(doubled, axis=1, keepdims=True)
    third = traction(doubled / area) * area / 6.0
    loads = np.zeros_like(mesh.nodes)
    for corner in triangles.T:
        np.add.at(loads, corner, third)
    return loads


#: Barycentric coordinates and weights of a rule of degree 5 on a tetrahedron (Walkington 2000).
def _rule() -> tuple[Float64Array, Float64Array]:
    points, weights = [], []
    for a, weight in (
        (0.31088591926330060980, 0.11268792571801585080),
        (0.092735250310891226402, 0.073493043116361949544),
    ):
        for corner in range(4):
            place = np.full(4, a)
            place[corner] = 1.0 - 3.0 * a
            points.append(place)
            weights.append(weight)
    a = 0.045503704125649649492
    for first in range(4):
        for second in range(first):
            place = np.full(4, a)
            place[[first, second]] = 0.5 - a
            points.append(place)
            weights.append(0.042546020777081466438)
    return np.array(points), np.array(weights)


RULE_POINTS, RULE_WEIGHTS = _rule()


def body_loads(mesh: Mesh, force: Field) -> Float64Array:
    """Consistent nodal forces [N] of a force density [N/m³] given at rest positions."""
    volume = signed_volumes(mesh.nodes, mesh.tetrahedra)
    corners = mesh.nodes[mesh.tetrahedra]
    loads = np.zeros_like(mesh.nodes)
    for place, weight in zip(RULE_POINTS, RULE_WEIGHTS, strict=True):
        density = force(np.einsum("c,mcd->md", place, corners)) * (weight * volume)[:, None]
        for corner, share in zip(mesh.tetrahedra.T, place, strict=True):
            np.add.at(loads, corner, share * density)
    return loads


def l2_distance(mesh: Mesh, values: Float64Array, exact: Field) -> float:
    """L2 norm over the mesh of nodal values, interpolated, less an exact function of place."""
    volume = signed_volumes(mesh.nodes, mesh.tetrahedra)
    total = 0.0
    for place, weight in zip(RULE_POINTS, RULE_WEIGHTS, strict=True):
        at = np.einsum("c,mcd->md", place, mesh.nodes[mesh.tetrahedra])
        found = np.einsum("c,mcd->md", place, values[mesh.tetrahedra])
        total += float((weight * volume) @ ((found - exact(at)) ** 2).sum(axis=1))
    return float(np.sqrt(total))
