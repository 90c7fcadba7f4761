"""libigl with CGAL: exact intersections of one mesh with itself, built anew each time."""

from __future__ import annotations

import time
from importlib import metadata

import numpy as np

from palpate.bench.measure import Pass
from palpate.bench.peers.contender import (
    Answer,
    Contender,
    MissingError,
    PairArray,
    Query,
    Setting,
    distinct,
)


def libigl(setting: Setting) -> list[Contender]:
    """``remesh_self_intersections`` in detect-only mode on all bodies as one mesh."""
    try:
        from igl.copyleft.cgal import remesh_self_intersections
    except ImportError:
        raise MissingError("pip install libigl") from None
    frames, triangles = setting.surface()

    def run() -> Pass:
        times = []
        for positions in frames:
            start = time.perf_counter()
            remesh_self_intersections(positions, triangles, detect_only=True)
            times.append(time.perf_counter() - start)
        return {"wall": times}

    def found(frame: int) -> PairArray:
        pairs = remesh_self_intersections(frames[frame], triangles, detect_only=True)[2]
        return setting.without_neighbours(distinct(np.asarray(pairs)))

    return [
        Contender(
            f"libigl {metadata.version('libigl')} with CGAL",
            Query.INTERSECTIONS,
            Answer.PAIRS,
            "remesh_self_intersections, detect only, exact; folds of neighbours not counted",
            run,
            found,
        )
    ]
