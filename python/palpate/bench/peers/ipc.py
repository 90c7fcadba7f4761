"""IPC Toolkit: broad phase for intersections."""

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
    Setting,
    distinct,
)


def ipctk(setting: Setting) -> list[Contender]:
    """Face-face candidates of its linear hierarchy, which it builds anew in every frame."""
    try:
        import ipctk as library
    except ImportError:
        raise MissingError("pip install ipctk") from None
    library.set_num_threads(1)
    positions, triangles = setting.surface()
    frames = [np.asfortranarray(each) for each in positions]
    faces = np.asfortranarray(triangles.astype(np.int32))
    edges = library.edges(faces)

    def run() -> Pass:
        update, wall = [], []
        for vertices in frames:
            start = time.perf_counter()
            hierarchy = library.LBVH()
            hierarchy.build(vertices, edges, faces, 0.0)
            update.append(time.perf_counter() - start)
            hierarchy.detect_face_face_candidates()
            wall.append(time.perf_counter() - start)
        return {"update": update, "wall": wall}

    def found(frame: int) -> PairArray:
        hierarchy = library.LBVH()
        hierarchy.build(frames[frame], edges, faces, 0.0)
        candidates = hierarchy.detect_face_face_candidates()
        return distinct([(each.face0_id, each.face1_id) for each in candidates])

    return [
        Contender(
            f"ipctk {metadata.version('ipctk')}, LBVH",
            Answer.CANDIDATES,
            "built anew; pairs of faces whose boxes overlap and that share no node; no exact test",
            run,
            found,
        )
    ]
