"""Makes the example meshes beside this file and refuses to write a bad one.

Needs Python 3.10+, numpy and scipy (``pip install palpate[test]`` brings both), and about ten minutes,
most of them spent on improving elements. With the same versions of the two the files come out the same
bit for bit. Run it as ``python make_models.py``, with names to make some (``python make_models.py aorta
tray``), or with ``--check`` to measure the files that are there. The ``.bml`` files are written by hand.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from generator import shapes, supports
from generator.checks import BadMeshError, check_mesh, describe
from generator.files import read_seg, write_seg
from generator.mesher import Mesh, make_mesh, mean_edge

FOLDER = Path(__file__).parent
# A box around every organ [m].
EXTENT = np.array([-0.070, -0.065, -0.135]), np.array([0.125, 0.045, 0.130])
# Largest deviation from the paper's nodes, tetrahedra and surface triangles.
TOLERANCE = np.array([0.05, 0.10, 0.05])

NodeSets = Callable[[Mesh], dict[str, np.ndarray]]


@dataclass(frozen=True)
class Organ:
    """A shape and the mesh it shall have; ``paper`` holds the paper's nodes, tetrahedra, triangles."""

    title: str
    shape: shapes.Shape
    triangles: int
    interior: int
    sets: NodeSets
    paper: tuple[int, int, int] | None = None
    seed: int = 2007


def vessel_sets(vessel: shapes.Vessel) -> NodeSets:
    """The nodes at each cut end by its name, and those of all ends but the top together."""

    def sets(mesh: Mesh) -> dict[str, np.ndarray]:
        ends = vessel.ends(mesh.nodes, 1.5 * mean_edge(mesh))
        others = np.unique(np.concatenate([v for k, v in ends.items() if k != "top"]))
        return {**ends, "outlets": others}

    return sets


def kidney_sets(kidney: shapes.Kidney) -> NodeSets:
    """The hollow of the hilum and the two poles."""

    def sets(mesh: Mesh) -> dict[str, np.ndarray]:
        local = kidney.local(mesh.nodes)
        surface = np.isin(np.arange(len(mesh.nodes)), mesh.triangles())
        hollow = np.linalg.norm((local - (-0.0225, 0.0, 0.0)) / (0.0155, 0.0105, 0.0165), axis=1)
        return {
            "hilum": np.flatnonzero(surface & (hollow < 1.0)),
            "upper_pole": np.flatnonzero(local[:, 2] > 0.040),
            "lower_pole": np.flatnonzero(local[:, 2] < -0.040),
        }

    return sets


def small_sets(mesh: Mesh) -> dict[str, np.ndarray]:
    """The two ends of the small body."""
    x = mesh.nodes[:, 0]
    return {"left": np.flatnonzero(x < -0.022), "right": np.flatnonzero(x > 0.022)}


def organs() -> dict[str, Organ]:
    """The paper's three organs, and a small body for tests and documents."""
    aorta, kidney, vena_cava = shapes.aorta(), shapes.Kidney(), shapes.vena_cava()
    return {
        "aorta": Organ(
            "abdominal aorta with its branches, filled",
            aorta,
            triangles=2316,
            interior=437,
            sets=vessel_sets(aorta),
            paper=(1597, 5607, 2316),
        ),
        "kidney": Organ(
            "left kidney",
            kidney,
            triangles=3202,
            interior=834,
            sets=kidney_sets(kidney),
            paper=(2397, 9527, 3202),
        ),
        "vena_cava": Organ(
            "inferior vena cava with its branches, filled",
            vena_cava,
            triangles=3958,
            interior=723,
            sets=vessel_sets(vena_cava),
            paper=(2659, 9780, 3958),
        ),
        "small": Organ(
            "small soft body, for tests and documents",
            shapes.small,
            triangles=400,
            interior=98,
            sets=small_sets,
        ),
    }


def supports_made() -> dict[str, tuple[str, Callable[[], Mesh]]]:
    """The rigid bodies that organs fall on."""
    return {
        "plate": ("round plate, its top at height 0", supports.plate),
        "tray": ("round bowl, the lowest point of its inside at the origin", supports.bowl),
    }


def check(name: str, mesh: Mesh, paper: tuple[int, int, int] | None) -> None:
    """Refuse a mesh that breaks a promise; print its figures."""
    check_mesh(name, mesh)
    line = describe(mesh)
    if paper is not None:
        counts = np.array([len(mesh.nodes), len(mesh.elements), len(mesh.triangles())])
        deviation = counts / np.array(paper) - 1.0
        if (np.abs(deviation) > TOLERANCE).any():
            raise BadMeshError(f"{name}: counts {counts.tolist()}, the paper has {list(paper)}")
        line += "; against the paper " + ", ".join(f"{100.0 * d:+.1f} %" for d in deviation)
    print(f"{name}: {line}", flush=True)


def main() -> None:
    """Make or check the meshes that are named, or all."""
    everything, rigid = organs(), supports_made()
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="meshes to make (default: all)")
    parser.add_argument("--check", action="store_true", help="only check the files")
    options = parser.parse_args()
    unknown = set(options.names) - {*everything, *rigid}
    if unknown:
        parser.error(
            f"unknown: {', '.join(sorted(unknown))}; known: {', '.join([*everything, *rigid])}"
        )
    for name in options.names or [*everything, *rigid]:
        organ = everything.get(name)
        path = FOLDER / f"{name}.seg"
        if options.check:
            mesh = read_seg(path)
        elif organ is None:
            mesh = rigid[name][1]()
        else:
            mesh = make_mesh(organ.shape, EXTENT, organ.triangles, organ.interior, organ.seed)
            mesh.sets = organ.sets(mesh)
        check(name, mesh, organ.paper if organ else None)
        if not options.check:
            title = organ.title if organ else rigid[name][0]
            write_seg(path, mesh, [f"{name}: {title}; metres; made by make_models.py"])


if __name__ == "__main__":
    main()
