"""IPC Toolkit: its broad phase for intersections, its collision set for proximity."""

from __future__ import annotations

import time
from importlib import metadata
from typing import Any

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
    sorted_features,
)


def ipctk(setting: Setting) -> list[Contender]:
    """With its linear hierarchy, which it builds anew in every frame."""
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
            Query.INTERSECTIONS,
            Answer.CANDIDATES,
            "built anew; pairs of faces whose boxes overlap and that share no node; no exact test",
            run,
            found,
        ),
        _near(setting, library, frames, faces, edges),
    ]


def _near(setting: Setting, library: Any, frames: Any, faces: Any, edges: Any) -> Contender:
    mesh = library.CollisionMesh(frames[0], edges, faces)

    def build(vertices: Any) -> Any:
        near = library.NormalCollisions()
        near.build(mesh, vertices, setting.distance, 0.0, library.LBVH())
        return near

    def run() -> Pass:
        wall = []
        for vertices in frames:
            start = time.perf_counter()
            build(vertices)
            wall.append(time.perf_counter() - start)
        return {"wall": wall}

    def found(frame: int) -> PairArray:
        near = build(frames[frame])
        rows = [((each.vertex0_id,), (each.vertex1_id,)) for each in near.vv_collisions]
        rows += [((each.vertex_id,), tuple(edges[each.edge_id])) for each in near.ev_collisions]
        rows += [
            (tuple(edges[each.edge0_id]), tuple(edges[each.edge1_id]))
            for each in near.ee_collisions
        ]
        rows += [((each.vertex_id,), tuple(faces[each.face_id])) for each in near.fv_collisions]
        sides = np.full((len(rows), 2, 3), -1, dtype=np.int64)
        for row, pair in enumerate(rows):
            for side, nodes in enumerate(pair):
                stacked = setting.surface_nodes[list(nodes)]
                sides[row, side, : len(nodes)] = -np.sort(-stacked)
        return sorted_features(sides[:, 0], sides[:, 1])

    return Contender(
        f"ipctk {metadata.version('ipctk')}, LBVH",
        Query.PROXIMITY,
        Answer.FEATURES,
        "NormalCollisions built anew: pairs reduced to their closest features",
        run,
        found,
    )
