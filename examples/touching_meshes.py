"""Contact detection alone, with your own arrays: two boxes, one of them moving."""

import numpy as np

import palpate


def box(
    cells: tuple[int, int, int], size: float, origin: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and tetrahedra of a box, six tetrahedra per cell."""
    grid = np.stack(np.meshgrid(*[np.arange(n + 1) for n in cells], indexing="ij"), axis=-1)
    nodes = grid.reshape(-1, 3) * (size / np.array(cells)) + origin
    number = np.arange(len(nodes)).reshape([n + 1 for n in cells])
    corner = {
        c: number[
            c & 1 : cells[0] + (c & 1),
            c >> 1 & 1 : cells[1] + (c >> 1 & 1),
            c >> 2 : cells[2] + (c >> 2),
        ].ravel()
        for c in range(8)
    }
    paths = [(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)]
    tetrahedra = np.concatenate([np.column_stack([corner[c] for c in path]) for path in paths])
    return nodes, tetrahedra


left = palpate.Mesh(*box((4, 4, 4), 0.1, (0.0, 0.0, 0.0)))
right = palpate.Mesh(*box((4, 4, 4), 0.1, (0.12, 0.01, 0.02)))
scene = palpate.Scene([left, right])

for step in range(6):
    shift = np.array([-0.006 * step, 0.0, 0.0])
    scene.update([left.nodes, right.nodes + shift])  # your own positions, every step
    touching = scene.intersections()
    print(f"moved {-1e3 * shift[0]:4.0f} mm: {len(touching):3d} pairs of triangles meet")

assert len(touching) > 0
