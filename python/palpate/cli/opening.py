"""Opens what the user named: a model file, a bundled model, or a mesh."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from palpate.contacts import Intersections
from palpate.files import read_mesh
from palpate.model import Body, Model, find_model, read_model

#: Extensions that name a mesh; everything else is a model.
MESH_SUFFIXES = frozenset(
    f".{suffix}"
    for suffix in (
        *("seg", "vtk", "vtu", "vtp", "msh", "node", "ele", "inp", "mesh", "meshb", "xdmf", "bdf"),
        *("nas", "med", "stl", "obj", "ply", "off"),
    )
)


def is_mesh(name: str) -> bool:
    """Whether the extension names a mesh format."""
    return Path(name).suffix.lower() in MESH_SUFFIXES


def open_model(name: str, *, repair: bool = False) -> tuple[Model, Path, tuple[str, ...]]:
    """The model, its path and the notes of reading; a mesh becomes a model of one body."""
    with redirect_stdout(sys.stderr):  # meshio prints while it reads; stdout is for results
        if is_mesh(name):
            mesh = read_mesh(name, repair=repair)
            return Model([Body(mesh, name=Path(name).stem)]), Path(name), mesh.notes
        path = find_model(name)
        model = read_model(path, repair=repair)
        return model, path, model.notes


def pair_counts(found: Intersections, names: list[str]) -> list[dict[str, Any]]:
    """How many triangle pairs meet, per pair of bodies."""
    bodies, counts = np.unique(found.bodies, axis=0, return_counts=True)
    return [
        {"body_a": names[a], "body_b": names[b], "pairs": int(count)}
        for (a, b), count in zip(bodies.tolist(), counts.tolist(), strict=True)
    ]
