"""The best leaf size, split and method for a model on this machine, in seconds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from palpate.bench import measure, motion
from palpate.model import Model
from palpate.scene import SPLITS, Scene

#: Leaf sizes to try; those above the size of the largest body are left out.
LEAF_SIZES = (1, 2, 4, 8, 16, 32, 64, 128, 256)

#: Methods with a bounding tree.
METHODS = ("wide", "paper")


@dataclass(frozen=True)
class Choice:
    """One way to make a Scene, and the spread of its frame's time [s]."""

    method: str
    leaf_size: int
    split: str
    low: float
    median: float
    high: float

    def arguments(self) -> str:
        """As keyword arguments of `Scene`."""
        return f'method="{self.method}", leaf_size={self.leaf_size}, split="{self.split}"'


def tune(
    model: Model,
    *,
    methods: Sequence[str] = METHODS,
    leaf_sizes: Sequence[int] = LEAF_SIZES,
    threads: int = 1,
    frames: int = 6,
    repeats: int = 9,
    advance: Callable[[], None] = lambda: None,
) -> tuple[list[Choice], measure.Spread]:
    """Every choice, the fastest first, and what the defaults take in the same run.

    By elimination: all choices have a few passes over the motion, the faster half of them more, and
    so on until few are left, which have ``repeats`` passes.
    """
    recorded = motion.record(motion.fields(model), [body.mesh for body in model.bodies], frames)
    largest = max(len(body.mesh.triangles) for body in model.bodies)
    left = {
        (method, leaf_size, split): measure.scene_pass(
            Scene(model, method=method, leaf_size=leaf_size, split=split, threads=threads),
            recorded,
            measure.meeting(),
        )
        for method in methods
        for leaf_size in leaf_sizes
        if leaf_size <= largest
        for split in SPLITS
    }
    default = measure.scene_pass(Scene(model, threads=threads), recorded, measure.meeting())
    choices: dict[tuple[str, int, str], Choice] = {}
    passes = min(2, repeats)
    while True:
        contenders = {str(key): run for key, run in left.items()} | {"default": default}
        timed = measure.measure(contenders, passes, advance)
        for key in left:
            spread = measure.spread(timed[str(key)]["wall"])
            choices[key] = Choice(*key, spread.low, spread.median, spread.high)
        if passes >= repeats:
            ranked = sorted(choices.values(), key=lambda each: each.median)
            return ranked, measure.spread(timed["default"]["wall"])
        kept = sorted(left, key=lambda key: choices[key].median)[: max(4, len(left) // 2)]
        passes = repeats if len(kept) <= 4 else min(2 * passes, repeats)
        left = {key: left[key] for key in kept}
