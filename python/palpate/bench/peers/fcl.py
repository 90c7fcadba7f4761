"""FCL's family: coal, python-fcl, and trimesh's collision manager over python-fcl.

They test bodies against each other and none against itself.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib import metadata
from itertools import combinations
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
)

_MOST = 1_000_000


def coal(setting: Setting) -> list[Contender]:
    """Refitted hierarchies of oriented boxes and swept spheres."""
    try:
        import coal as library
    except ImportError:
        raise MissingError("pip install coal") from None
    models = []
    for mesh, positions in zip(setting.meshes, setting.frames[0], strict=True):
        model = library.BVHModelOBBRSS()
        model.beginModel(len(mesh.triangles), len(positions))
        model.addVertices(positions)
        model.addTriangles(mesh.triangles.astype(np.int64))
        model.endModel()
        models.append(model)
    # Prepared before the clock runs: the library wants its own vectors.
    frames = []
    for frame in setting.frames:
        vectors = []
        for positions in frame:
            vector = library.StdVec_Vec3s()
            vector.extend(list(positions))
            vectors.append(vector)
        frames.append(vectors)
    still = library.Transform3s.Identity()
    request = library.CollisionRequest(library.CollisionRequestFlag.NO_REQUEST, _MOST)

    def update(frame: int) -> None:
        for model, vertices in zip(models, frames[frame], strict=True):
            model.beginReplaceModel()
            model.replaceSubModel(vertices)
            model.endReplaceModel(True, True)
            model.computeLocalAABB()

    def collide() -> list[tuple[int, int, Any]]:
        results = []
        for a, b in combinations(range(len(models)), 2):
            result = library.CollisionResult()
            library.collide(models[a], still, models[b], still, request, result)
            results.append((a, b, result))
        return results

    def found(frame: int) -> PairArray:
        update(frame)
        return _stacked(
            setting,
            [
                (a, contact.b1, b, contact.b2)
                for a, b, result in collide()
                for contact in result.getContacts()
            ],
        )

    return [
        Contender(
            f"coal {metadata.version('coal')}",
            Query.INTERSECTIONS,
            Answer.INTER_PAIRS,
            "OBBRSS trees, refitted; coal's own test; vertices put into its vectors beforehand",
            _passes(len(frames), update, collide),
            found,
        )
    ]


def python_fcl(setting: Setting) -> list[Contender]:
    """Hierarchies built anew: the binding cannot refit them."""
    try:
        import fcl as library
    except ImportError:
        raise MissingError("pip install python-fcl") from None
    objects: list[Any] = []

    def update(frame: int) -> None:
        objects.clear()
        for mesh, positions in zip(setting.meshes, setting.frames[frame], strict=True):
            model = library.BVHModel()
            model.beginModel(len(positions), len(mesh.triangles))
            model.addSubModel(positions, mesh.triangles)
            model.endModel()
            objects.append(library.CollisionObject(model))

    def collide() -> list[tuple[int, int, Any]]:
        results = []
        for a, b in combinations(range(len(objects)), 2):
            result = library.CollisionResult()
            request = library.CollisionRequest(num_max_contacts=_MOST, enable_contact=True)
            library.collide(objects[a], objects[b], request, result)
            results.append((a, b, result))
        return results

    def found(frame: int) -> PairArray:
        update(frame)
        return _stacked(
            setting,
            [
                (a, contact.b1, b, contact.b2)
                for a, b, result in collide()
                for contact in result.contacts
            ],
        )

    return [
        Contender(
            f"python-fcl {metadata.version('python-fcl')}",
            Query.INTERSECTIONS,
            Answer.INTER_PAIRS,
            "trees built anew in every frame (the binding has no refit); FCL's own test",
            _passes(len(setting.frames), update, collide),
            found,
        )
    ]


def trimesh_manager(setting: Setting) -> list[Contender]:
    """The collision manager of trimesh over python-fcl."""
    try:
        import fcl  # noqa: F401
        import trimesh.collision
    except ImportError:
        raise MissingError("pip install trimesh python-fcl") from None
    make_manager: Any = trimesh.collision.CollisionManager
    managers: list[Any] = []

    def update(frame: int) -> None:
        manager = make_manager()
        for index, (mesh, positions) in enumerate(
            zip(setting.meshes, setting.frames[frame], strict=True)
        ):
            surface = trimesh.Trimesh(positions, mesh.triangles, process=False)
            manager.add_object(str(index), surface)
        managers[:] = [manager]

    def collide() -> Any:
        return managers[0].in_collision_internal(return_data=True)[1]

    def found(frame: int) -> PairArray:
        update(frame)
        rows = []
        for contact in collide():
            a, b = sorted(contact.names)
            rows.append((int(a), contact.index(a), int(b), contact.index(b)))
        return _stacked(setting, rows)

    return [
        Contender(
            f"trimesh {metadata.version('trimesh')}",
            Query.INTERSECTIONS,
            Answer.INTER_PAIRS,
            "CollisionManager over python-fcl, made anew in every frame",
            _passes(len(setting.frames), update, collide),
            found,
        )
    ]


def _passes(
    frames: int, update: Callable[[int], None], collide: Callable[[], Any]
) -> Callable[[], Pass]:
    def run() -> Pass:
        updated, wall = [], []
        for frame in range(frames):
            start = time.perf_counter()
            update(frame)
            updated.append(time.perf_counter() - start)
            collide()
            wall.append(time.perf_counter() - start)
        return {"update": updated, "wall": wall}

    return run


def _stacked(setting: Setting, rows: list[tuple[int, int, int, int]]) -> PairArray:
    """Rows body, triangle, body, triangle; a library may name a pair more than once."""
    pairs = np.array(rows, dtype=np.int64).reshape(-1, 4)
    return distinct(setting.triangle_offsets[pairs[:, 0::2]] + pairs[:, 1::2])
