"""What several files of tests share."""

import os
from pathlib import Path

import hypothesis
import numpy as np
import pytest

import palpate
from palpate.viewer import NullViewer

hypothesis.settings.register_profile("fixed", derandomize=True)
hypothesis.settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "default"))

#: A cube of unit edge: five tetrahedra around an inner one.
CUBE_NODES = np.array(
    [[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)], dtype=np.float64
)
CUBE_TETRAHEDRA = np.array(
    [[0, 4, 2, 1], [6, 2, 4, 7], [5, 4, 1, 7], [3, 1, 2, 7], [1, 4, 2, 7]], dtype=np.int64
)


def box(cells, size=1.0, origin=(0.0, 0.0, 0.0)):
    """A box of cells (i, j, k), six tetrahedra each."""
    nx, ny, nz = cells
    grid = np.stack(np.meshgrid(*[np.arange(n + 1) for n in cells], indexing="ij"), axis=-1)
    nodes = grid.reshape(-1, 3) * (np.broadcast_to(size, 3) / np.array(cells)) + np.array(origin)
    paths = [(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)]
    tetrahedra = []
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                corner = [
                    ((i + (c & 1)) * (ny + 1) + j + (c >> 1 & 1)) * (nz + 1) + k + (c >> 2)
                    for c in range(8)
                ]
                tetrahedra += [[corner[c] for c in path] for path in paths]
    return palpate.Mesh(nodes, np.array(tetrahedra), repair=True)


@pytest.fixture
def cube():
    return palpate.Mesh(CUBE_NODES, CUBE_TETRAHEDRA)


@pytest.fixture
def make_box():
    return box


@pytest.fixture
def organs():
    """Folder of real organ meshes, or None where there are none."""
    folder = os.environ.get("PALPATE_DATA")
    return Path(folder) / "organs" if folder else None


@pytest.fixture
def viewer():
    """The session of the small model, without a browser."""
    return NullViewer(palpate.Simulation("small"))
