"""Runs fTetWild on arrays in a file: a process of its own, so that it can be stopped and watched.

Started by its path with two files, input and output, as ``.npz``; imports nothing of palpate.
"""

import os
import sys

del sys.path[0]  # this folder, whose names are not for importing

import numpy as np  # noqa: E402
import wildmeshing  # noqa: E402

#: Level of fTetWild's log that shows its passes.
_PASSES = 2
#: It goes on until no tetrahedron has a higher energy than this (3 is regular): angles above 15°.
_ENERGY = 7.0


def _run(source: str, target: str) -> None:
    with np.load(source) as given:
        nodes, triangles = given["nodes"], given["triangles"]
        edge_length, tolerance = float(given["edge_length"]), float(given["tolerance"])
    diagonal = float(np.linalg.norm(np.ptp(nodes, axis=0)))
    mesher = wildmeshing.Tetrahedralizer(
        edge_length_r=edge_length / diagonal,
        epsilon=tolerance / diagonal,
        stop_quality=_ENERGY,
        max_threads=1,
        coarsen=False,
    )
    mesher.set_log_level(_PASSES)
    mesher.set_mesh(nodes, triangles.astype(np.int32))
    mesher.tetrahedralize()  # leaves files in the working folder
    made = mesher.get_tet_mesh(manifold_surface=True)
    np.savez(target, nodes=made[0], tetrahedra=made[1])


os.chdir(os.path.dirname(sys.argv[2]))  # noqa: PTH120
_run(*sys.argv[1:])
