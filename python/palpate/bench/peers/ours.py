"""palpate's own methods, called as a Python user calls them."""

from __future__ import annotations

from palpate._core import __version__
from palpate.bench import tune
from palpate.bench.measure import meeting, scene_pass, within
from palpate.bench.peers.contender import Answer, Contender, PairArray, Query, Setting
from palpate.scene import Scene


def contenders(setting: Setting) -> list[Contender]:
    """The wide method, the paper's at its best leaf size, and spatial hashing, one thread each."""
    best = tune.tune(setting.model, methods=["paper"], frames=4, repeats=3)[0][0]
    return [
        _contender(setting, query, method, leaf_size, how)
        for query in Query
        for method, leaf_size, how in (
            ("wide", None, "refitted; exact"),
            ("paper", best.leaf_size, "refitted, its best leaf size; exact"),
            ("hash", None, "spatial hashing (Teschner et al. 2003); exact"),
        )
    ]


def _contender(
    setting: Setting, query: Query, method: str, leaf_size: int | None, how: str
) -> Contender:
    scene = Scene(setting.model, method=method, leaf_size=leaf_size)

    def found(frame: int) -> PairArray:
        scene.update(setting.frames[frame])
        if query is Query.PROXIMITY:
            return setting.stacked_near(scene.proximity(setting.distance))
        return setting.stacked(scene.intersections().pairs)

    find = within(setting.distance) if query is Query.PROXIMITY else meeting()

    name = f"palpate {__version__}, {method}" + (f", K = {leaf_size}" if leaf_size else "")
    return Contender(name, query, Answer.PAIRS, how, scene_pass(scene, setting.frames, find), found)
