"""palpate beside other libraries: same scenes, same motion, complete pair lists compared."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from palpate.bench import machine, measure, motion, plots
from palpate.bench.output import (
    markdown_table,
    milliseconds,
    whole,
    write_csv,
    write_json,
    write_text,
)
from palpate.bench.peers import fcl, ipc, libigl, native, ours
from palpate.bench.peers.contender import Answer, Contender, MissingError, Query, Setting
from palpate.model import Model

#: What makes the contenders of each library, by its name.
PEERS: Mapping[str, Callable[[Setting], list[Contender]]] = {
    "palpate": ours.contenders,
    "parry3d": native.parry,
    "Embree": native.embree,
    "ipctk": ipc.ipctk,
    "coal": fcl.coal,
    "python-fcl": fcl.python_fcl,
    "trimesh": fcl.trimesh_manager,
    "libigl": libigl.libigl,
}


@dataclass(frozen=True)
class Outcome:
    """One contender on one model; ``times`` [s] per stage: quartile, median, quartile."""

    model: str
    query: str
    contender: str
    finds: str
    how: str
    answer: str
    times: dict[str, list[float]]

    @property
    def wall(self) -> float:
        """Median time of a frame [s]."""
        return self.times["wall"][1]


def run(
    models: Sequence[tuple[str, Model]],
    folder: Path,
    *,
    peers: Sequence[str] | None = None,
    frames: int = 24,
    repeats: int = 7,
    drawn: bool = True,
    advance: Callable[[], None] = lambda: None,
) -> tuple[list[Outcome], dict[str, str]]:
    """Measure, then write results.json, peers.csv, report.md and the plot into the folder.

    Returns the outcomes and, by name, the libraries that are missing and how to get them.
    """
    outcomes: list[Outcome] = []
    missing: dict[str, str] = {}
    scenes = []
    with one_core() as pinned:
        for name, model in models:
            setting = Setting(name, model, frames)
            made, lacking = _measure(setting, peers or list(PEERS), repeats, advance)
            outcomes += made
            missing |= lacking
            scenes.append(
                {
                    "model": name,
                    "triangles": len(setting.triangles),
                    "intersections": float(np.mean([len(pairs) for pairs in setting.true_pairs])),
                    "proximity": float(np.mean([len(pairs) for pairs in setting.near_pairs])),
                    "distance": setting.distance,
                }
            )
    folder.mkdir(parents=True, exist_ok=True)
    options = {"peers": list(peers or PEERS), "frames": frames, "repeats": repeats}
    write_json(
        folder / "results.json",
        "bench peers",
        options,
        motion=motion.DESCRIPTION,
        one_core=pinned,
        scenes=scenes,
        outcomes=[asdict(each) for each in outcomes],
        missing=missing,
    )
    write_csv(folder / "peers.csv", [_flat(each) for each in outcomes])
    if drawn:
        _draw(outcomes, folder / "peers.png")
    write_text(
        folder / "report.md", *_report(outcomes, scenes, missing, options, pinned, drawn=drawn)
    )
    return outcomes, missing


@contextlib.contextmanager
def one_core() -> Iterator[bool]:
    """Hold this process and its children on one core; yields whether the system can."""
    if not hasattr(os, "sched_setaffinity"):
        yield False
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield True
    finally:
        os.sched_setaffinity(0, before)


def _measure(
    setting: Setting, peers: Sequence[str], repeats: int, advance: Callable[[], None]
) -> tuple[list[Outcome], dict[str, str]]:
    contenders: list[Contender] = []
    missing: dict[str, str] = {}
    for peer in peers:
        try:
            contenders += PEERS[peer](setting)
        except MissingError as error:
            missing[peer] = str(error)
    keyed = {f"{each.query.value}: {each.name}": each for each in contenders}
    timed = measure.measure({key: each.run for key, each in keyed.items()}, repeats, advance)
    return [
        Outcome(
            model=setting.name,
            query=each.query.value,
            contender=each.name,
            finds=each.answer.value,
            how=each.how,
            answer=setting.check(each),
            times={stage: measure.spread(times).as_list() for stage, times in timed[key].items()},
        )
        for key, each in keyed.items()
    ], missing


def _flat(each: Outcome) -> dict[str, Any]:
    flat: dict[str, Any] = {
        "model": each.model,
        "query": each.query,
        "contender": each.contender,
        "finds": each.finds,
        "answer": each.answer,
    }
    for stage in ("update", "wall"):
        low, median, high = each.times.get(stage, ["", "", ""])
        flat |= {f"{stage}_q1": low, f"{stage}_median": median, f"{stage}_q3": high}
    return flat


def _draw(outcomes: Sequence[Outcome], path: Path) -> None:
    groups = list(dict.fromkeys((each.model, each.query) for each in outcomes))
    most = max(sum((each.model, each.query) == group for each in outcomes) for group in groups)
    columns = 2 if len(groups) > 1 else 1
    lines = -(-len(groups) // columns)
    made, axes = plots.figure(lines, columns, width=6.2, height=0.9 + 0.28 * most)
    for one in list(axes.flat)[len(groups) :]:
        one.set_visible(False)
    for one, group in zip(axes.flat, groups, strict=False):
        shown = sorted(
            (each for each in outcomes if (each.model, each.query) == group),
            key=lambda each: -each.wall,
        )
        low, median, high = (np.array([each.times["wall"] for each in shown]) * 1e3).T
        color = [
            plots.COLORS[1] if each.contender.startswith("palpate") else plots.COLORS[0]
            for each in shown
        ]
        # Dots, not bars: a logarithmic axis has no zero for a bar to stand on.
        one.hlines(range(len(shown)), median.min() / 3, median, color=color, lw=1.2, alpha=0.35)
        for index, each in enumerate(color):
            error = [[median[index] - low[index]], [high[index] - median[index]]]
            one.errorbar(
                median[index], index, xerr=error, fmt="o", ms=6, color=each, ecolor=plots.INK
            )
        marks = {Answer.CANDIDATES.value: " *", Answer.INTER_PAIRS.value: " †"}
        names = [each.contender + marks.get(each.finds, "") for each in shown]
        one.set_yticks(range(len(shown)), names, fontsize=7.5)
        for index, value in enumerate(median):
            one.annotate(
                milliseconds(value / 1e3),
                (high[index], index),
                xytext=(6, 0),
                textcoords="offset points",
                va="center",
                fontsize=7,
                color=plots.INK,
            )
        plots.label(one, f"{group[0]}: {group[1]}", "ms per frame", "")
        plots.logarithmic(one, "x")
        one.set_xlim(float(median.min()) / 3, float(high.max()) * 3)
        one.grid(visible=False, axis="y")
    plots.save(made, path)


def _report(
    outcomes: Sequence[Outcome],
    scenes: Sequence[Mapping[str, Any]],
    missing: Mapping[str, str],
    options: Mapping[str, Any],
    pinned: bool,
    *,
    drawn: bool,
) -> Iterator[str]:
    yield "# Beside other libraries"
    yield f"Machine: {machine.sentence(machine.describe())}."
    yield (
        f"Every contender has the same bodies in the same motion: {motion.DESCRIPTION}. A frame is "
        f"an update and a query. {options['frames']} frames, {options['repeats']} passes, the "
        f"contenders taking turns pass by pass, one thread each"
        + (", all on one core. " if pinned else ". ")
        + "A time is the median over the passes, averaged over the frames; quartiles are in "
        "`peers.csv`. palpate and the Python packages are timed from Python, parry and Embree "
        "inside a Rust program. Taking pairs out of a library's own containers is not counted."
    )
    if drawn:
        yield "![Time per frame of every library](peers.png)"
        yield "\\* candidates only; † only pairs of different bodies."
    for scene in scenes:
        for query in Query:
            yield from _table(outcomes, scene, query)
    yield "## How each is used"
    yield "\n".join(
        f"- **{name}** ({query}): {how}."
        for name, query, how in dict.fromkeys(
            (each.contender, each.query, each.how) for each in outcomes
        )
    )
    yield (
        "Answers are compared as complete lists in every frame. Two triangles of one body that "
        "share a node do not count, for anyone. Libraries that only test bodies against each other "
        "are compared on those pairs; one that only gives candidates must contain every pair. "
        "Where a library's own test works in floating point it may differ on pairs that barely "
        "touch."
    )
    if missing:
        yield "## Missing here"
        yield "\n".join(f"- {name}: {how}" for name, how in missing.items())


def _table(outcomes: Sequence[Outcome], scene: Mapping[str, Any], query: Query) -> Iterator[str]:
    name = scene["model"]
    shown = sorted(
        (each for each in outcomes if (each.model, each.query) == (name, query.value)),
        key=lambda each: each.wall,
    )
    if not shown:
        return
    yield f"## {name}: {query.value}"
    if query is Query.INTERSECTIONS:
        yield (
            f"{whole(scene['triangles'])} surface triangles; {whole(scene['intersections'])} pairs "
            f"meet in the mean frame."
        )
    else:
        yield (
            f"Vertex-triangle and edge-edge pairs closer than {scene['distance'] * 1e3:.3g} mm, "
            f"1e-3 of the scene's diagonal: {whole(scene['proximity'])} in the mean frame."
        )
    ours_wall = [each.wall for each in shown if each.contender.startswith("palpate")]
    fastest = min(ours_wall, default=shown[0].wall)
    yield markdown_table(
        "contender<|update [ms]|frame [ms]|quartiles|times ours|finds<|answer<",
        [
            [
                each.contender,
                milliseconds(each.times["update"][1]) if "update" in each.times else "-",
                milliseconds(each.wall),
                " to ".join(milliseconds(each.times["wall"][quartile]) for quartile in (0, 2)),
                f"{each.wall / fastest:.1f}",
                each.finds,
                each.answer,
            ]
            for each in shown
        ],
    )
