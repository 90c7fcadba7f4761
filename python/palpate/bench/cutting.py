"""A long cut through a kidney of case 2 at rest: how long each frame takes, and where it goes.

A scalpel moves on by a little before every frame; a frame is the cut and the step of 1/60 s. The
frames before the cut are the usual ones. The same cut is made twice: live, beside the steps, with
frames that begin 1/60 s apart as a simulator's do (or later, where one takes longer), and at once,
before each step. Afterwards detection with the trees that were kept is compared with that of the
same simulation loaded from a checkpoint, whose trees are new.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from palpate._arrays import Float64Array
from palpate.bench.output import markdown_table, milliseconds, write_csv, write_json, write_text
from palpate.cutting import Blade
from palpate.model import Model
from palpate.simulation import Simulation

#: Frames until the bodies are at rest.
SETTLE = 240

#: Frames before the cut that are measured as the usual ones.
USUAL = 60

#: Steps until a live cut opens.
DELAY = 5

#: How long the frames and their stages took, by row of the report: cut at once, and live.
STAGES = ("cutting", "detection", "mechanics", "step", "frame")
LIVE_STAGES = ("opening", "step", "frame")


@dataclass(frozen=True)
class Spread:
    """Seconds: median, 99th percentile and worst."""

    median: float
    p99: float
    worst: float

    @classmethod
    def of(cls, seconds: list[float]) -> Spread:
        """The spread of a list that is not empty."""
        low, high, worst = np.percentile(seconds, [50, 99, 100]).tolist()
        return cls(low, high, worst)


@dataclass(frozen=True)
class Outcome:
    """What a cut of so many frames cost."""

    model: str
    body: str
    threads: int
    frames: int
    #: Frames in which something came apart.
    opened: int
    tetrahedra: tuple[int, int]
    usual: Spread
    #: By stage; ``frame`` is all of it. Cut at once, and live.
    while_cutting: dict[str, Spread]
    while_cutting_live: dict[str, Spread]
    #: Live frames in which something came apart, and steps until it does.
    opened_live: int
    delay: int
    #: Median seconds of refit and traversal after the cuts, by method: with the trees that were
    #: kept, and with new ones.
    kept_and_new: dict[str, tuple[float, float]]


def run(
    model: Model,
    name: str,
    body: str,
    *,
    frames: int,
    threads: int,
    output: Path | None,
    advance: Callable[[], None] = lambda: None,
) -> Outcome:
    """Measure, and write results.json, cutting.csv and report.md into ``output``."""
    simulation = Simulation(model, threads=threads)
    index = model.body_index(body)
    usual: list[float] = []
    for frame in range(SETTLE):
        report = simulation.step()
        if frame >= SETTLE - USUAL:
            usual.append(report.times["total"])
        advance()
    before = len(simulation.model.bodies[index].mesh.tetrahedra)
    edges = _edges(simulation.positions[index], frames)
    strokes = [Blade.stroke(edges[frame : frame + 2]) for frame in range(frames)]
    paper = Simulation(model, threads=threads, method="paper")
    paper.restore(simulation.snapshot())
    opened_live, live = _cut_live(simulation, strokes, advance)
    seconds: dict[str, list[float]] = {stage: [] for stage in STAGES}
    opened = 0
    for stroke in strokes:
        cut = simulation.cut(stroke)
        step = simulation.step().times["total"]
        opened += len(cut) > 0
        for stage in STAGES[:3]:
            seconds[stage].append(cut.times[stage])
        seconds["step"].append(step)
        seconds["frame"].append(cut.times["total"] + step)
        advance()
    after = len(simulation.model.bodies[index].mesh.tetrahedra)
    for stroke in strokes:
        paper.cut(stroke)
        paper.step()
    kept_and_new = {
        "wide": _detection(simulation, threads),
        "paper": _detection(paper, threads),
    }
    outcome = Outcome(
        model=name,
        body=body,
        threads=threads,
        frames=frames,
        opened=opened,
        tetrahedra=(before, after),
        usual=Spread.of(usual),
        while_cutting={stage: Spread.of(values) for stage, values in seconds.items()},
        while_cutting_live={stage: Spread.of(values) for stage, values in live.items()},
        opened_live=opened_live,
        delay=DELAY,
        kept_and_new=kept_and_new,
    )
    if output is not None:
        output.mkdir(parents=True, exist_ok=True)
        options = {"model": name, "body": body, "frames": frames, "threads": threads}
        write_json(
            output / "results.json",
            "cutting",
            options,
            **asdict(outcome),
            seconds=seconds,
            seconds_live=live,
        )
        lines: list[dict[str, Any]] = [
            {stage: seconds[stage][frame] for stage in STAGES}
            | {f"live {stage}": live[stage][frame] for stage in LIVE_STAGES}
            for frame in range(frames)
        ]
        write_csv(output / "cutting.csv", lines)
        write_text(output / "report.md", *_report(outcome))
    return outcome


def _cut_live(
    simulation: Simulation, strokes: list[Blade], advance: Callable[[], None]
) -> tuple[int, dict[str, list[float]]]:
    """Cut beside the steps and go back: frames that open something, and the seconds by stage."""
    before = simulation.snapshot()
    seconds: dict[str, list[float]] = {stage: [] for stage in LIVE_STAGES}
    opened = 0
    start = time.perf_counter()
    for frame, stroke in enumerate(strokes):
        time.sleep(max(0.0, start + frame * simulation.time_step - time.perf_counter()))
        begin = time.perf_counter()
        simulation.cut_live(stroke, delay=DELAY)
        report = simulation.step()
        seconds["frame"].append(time.perf_counter() - begin)
        opening = report.stages["change"]
        seconds["opening"].append(opening)
        seconds["step"].append(report.times["total"] - opening)
        opened += any(len(cut) > 0 for cut in report.cuts)
        advance()
    simulation.restore(before)
    return opened, seconds


def _detection(simulation: Simulation, threads: int) -> tuple[float, float]:
    """Median seconds of refit and traversal in the next steps, with the trees kept and new ones."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cut.palpate"
        simulation.save(path)
        new = Simulation.load(path, threads=threads)
    seconds: tuple[list[float], list[float]] = ([], [])
    for _ in range(60):
        for each, own in zip((simulation, new), seconds, strict=True):
            times = each.step().times
            own.append(times["update"] + times["proximity"] + times["penetration"])
    return float(np.median(seconds[0])), float(np.median(seconds[1]))


def trees(outcome: Outcome) -> list[list[str]]:
    """Method, refit and traversal with the kept trees and with new ones, their ratio, in words."""
    return [
        [name, milliseconds(kept), milliseconds(new), f"{kept / new:.2f}"]
        for name, (kept, new) in outcome.kept_and_new.items()
    ]


def rows(outcome: Outcome) -> list[list[str]]:
    """Stage, median, 99th percentile and worst in words."""
    named = {"a usual step": outcome.usual}
    named |= {f"live: {stage}": spread for stage, spread in outcome.while_cutting_live.items()}
    named |= {f"at once: {stage}": spread for stage, spread in outcome.while_cutting.items()}
    return [
        [name, milliseconds(s.median), milliseconds(s.p99), milliseconds(s.worst)]
        for name, s in named.items()
    ]


#: Of the rows.
HEADINGS = "stage<|median ms|99 %|worst"

#: Of the trees.
TREES = "detection after the cuts<|kept trees ms|new trees|ratio"


def _report(outcome: Outcome) -> tuple[str, ...]:
    before, after = outcome.tetrahedra
    return (
        f"# A long cut through {outcome.body} of {outcome.model}",
        f"{outcome.frames} frames of 1/60 s, {outcome.opened} of them open something; {before} "
        f"tetrahedra become {after}; {outcome.threads} threads. Live, the same strokes open "
        f"in {outcome.opened_live} frames, {outcome.delay} steps later or more; one more thread "
        "prepares them.",
        markdown_table(HEADINGS, rows(outcome)),
        markdown_table(TREES, trees(outcome)),
    )


def _edges(points: Float64Array, frames: int) -> Float64Array:
    """Places of the scalpel's edge: along the middle of the body, down to its middle."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, size = (low + high) / 2, high - low
    along = 0 if size[0] > size[1] else 1
    s = np.linspace(-0.45, 0.45, frames + 1)
    edges = np.tile(middle, (frames + 1, 2, 1))
    edges[:, :, along] += (s * size[along])[:, None]
    edges[:, :, 1 - along] += (0.06 * size[1 - along] * np.sin(5 * s))[:, None]
    edges[:, 0, 2] = high[2] + 0.2 * size[2]
    edges[:, 1, 2] = middle[2]
    return edges
