"""Fair timing: contenders take turns, pass by pass; medians and quartiles."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate._arrays import Float64Array
from palpate.contacts import DetectionStats, Intersections, Proximity
from palpate.scene import Scene

#: Seconds per stage and frame of one pass over the motion.
Pass = Mapping[str, Sequence[float]]

#: Stages of one frame of a Scene; ``wall`` is what the caller waits for, Python included.
STAGES = ("update", "objects", "traversal", "polygons", "wall")


@dataclass(frozen=True)
class Spread:
    """Median and quartiles [s] over the passes, each the mean over the frames of the motion."""

    median: float
    low: float
    high: float

    def as_list(self) -> list[float]:
        """Quartile, median, quartile."""
        return [self.low, self.median, self.high]


def spread(times: Float64Array) -> Spread:
    """The spread of times of shape (passes, frames).

    Quantiles are taken frame by frame: the motion's own change of work is no noise.
    """
    low, median, high = np.percentile(times, [25, 50, 75], axis=0).mean(axis=1)
    return Spread(float(median), float(low), float(high))


def measure(
    contenders: Mapping[str, Callable[[], Pass]],
    repeats: int,
    advance: Callable[[], None] = lambda: None,
) -> dict[str, dict[str, Float64Array]]:
    """Times [s] of shape (repeats, frames) per contender and stage.

    A contender is called for one pass over the motion. In every round each contender has one pass,
    the order turning from round to round, so that whatever else the machine does hits all alike;
    within a pass its data stay as warm as in a loop of its own. The first round is not counted.
    """
    names = list(contenders)
    passes: dict[str, list[Pass]] = {name: [] for name in names}
    for round_number in range(repeats + 1):
        turn = round_number % len(names) if names else 0
        for name in names[turn:] + names[:turn]:
            with _no_garbage_collection():
                one = contenders[name]()
            if round_number:
                passes[name].append(one)
            advance()
    return {
        name: {stage: np.array([each[stage] for each in done]) for stage in done[0]}
        for name, done in passes.items()
    }


@contextmanager
def _no_garbage_collection() -> Iterator[None]:
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


#: Asks a scene for what meets or is close.
Find = Callable[[Scene], Intersections | Proximity]


def meeting(**options: Any) -> Find:
    """Ask for `Scene.intersections`."""
    return lambda scene: scene.intersections(**options)


def within(distance: float) -> Find:
    """Ask for `Scene.proximity`."""
    return lambda scene: scene.proximity(distance)


def scene_pass(
    scene: Scene, frames: Sequence[Any], find: Find
) -> Callable[[], dict[str, list[float]]]:
    """One pass of a scene over the motion: update and ask in every frame."""

    def run() -> dict[str, list[float]]:
        times: dict[str, list[float]] = {stage: [] for stage in STAGES}
        for frame in frames:
            start = time.perf_counter()
            scene.update(frame)
            stats = find(scene).stats
            wall = time.perf_counter() - start
            stages = (
                scene.update_time,
                stats.object_time,
                stats.traversal_time,
                stats.polygon_time,
            )
            for stage, seconds in zip(STAGES, (*stages, wall), strict=True):
                times[stage].append(seconds)
        return times

    return run


def count_pass(scene: Scene, frames: Sequence[Any], find: Find) -> list[Intersections | Proximity]:
    """What a scene finds in every frame, untimed."""
    found = []
    for frame in frames:
        scene.update(frame)
        found.append(find(scene))
    return found


def mean_counts(found: Sequence[Intersections | Proximity]) -> dict[str, float]:
    """Mean over the frames of the work that finding took, and of the pairs found."""
    names = ("nodes_visited", "leaf_pairs", "box_tests", "pair_tests")
    stats: list[DetectionStats] = [each.stats for each in found]
    counts = {name: float(np.mean([getattr(each, name) for each in stats])) for name in names}
    return {**counts, "pairs": float(np.mean([len(each) for each in found]))}
