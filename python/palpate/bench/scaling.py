"""Growth with size: refined models, every method where it is bearable, one thread and two."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from palpate._arrays import Float64Array
from palpate.bench import machine, measure, motion, plots
from palpate.bench.output import (
    markdown_table,
    milliseconds,
    whole,
    write_csv,
    write_json,
    write_text,
)
from palpate.bench.peers.contender import CLOSE
from palpate.bench.refine import refine
from palpate.mesh import Mesh
from palpate.model import Model
from palpate.scene import METHODS, Scene

#: Markers of the models in plots, and as text.
_SIGNS = {"o": "○", "s": "□", "d": "◇", "^": "△", "v": "▽"}

#: Label of the pass that only streams the data.
FLOOR = "memory floor"

#: What is asked. A fixed distance spans more elements the finer the mesh is, and its pairs
#: outgrow the triangles; a distance that shrinks with the edges keeps about as many per triangle.
INTERSECTIONS = "intersections"
PROXIMITY = "proximity, 1e-3 of the diagonal"
PROXIMITY_BY_EDGE = "proximity, 1e-3 of the diagonal / n"

#: Leaf size of the paper's method: near its best at every size of the default models.
_PAPER_LEAF_SIZE = 50


@dataclass(frozen=True)
class Measurement:
    """One contender on one refined model: spread [s] (quartile, median, quartile) per stage."""

    model: str
    divisions: int
    nodes: int
    triangles: int
    contender: str
    query: str
    times: dict[str, list[float]]
    #: Mean number of pairs found per frame.
    pairs: float

    @property
    def wall(self) -> float:
        """Median time of a frame [s]."""
        return self.times["wall"][1]


def run(
    models: Sequence[tuple[str, Model]],
    folder: Path,
    *,
    divisions: Sequence[int] = (1, 2, 3),
    threads: Sequence[int] = (1, 2),
    frames: int = 12,
    repeats: int = 5,
    bearable: float = 0.5,
    drawn: bool = True,
    advance: Callable[[], None] = lambda: None,
) -> list[Measurement]:
    """Measure, then write results.json, scaling.csv, report.md and the plot into the folder.

    A method that takes longer than ``bearable`` [s] for one frame is left out there.
    """
    results: list[Measurement] = []
    left_out: list[str] = []
    for name, model in models:
        for parts in divisions:
            made, slow = _measure(name, model, parts, threads, frames, repeats, bearable)
            results += made
            left_out += slow
            advance()
    gain = parallel_gain()
    growth = [
        {"model": name, "contender": contender, "query": query, "factor_per_decade": factor}
        for (name, query, contender), factor in growth_per_decade(results).items()
    ]
    folder.mkdir(parents=True, exist_ok=True)
    options = {
        "divisions": list(divisions),
        "threads": list(threads),
        "frames": frames,
        "repeats": repeats,
        "bearable": bearable,
    }
    write_json(
        folder / "results.json",
        "bench scaling",
        options,
        motion=motion.DESCRIPTION,
        measurements=[asdict(each) for each in results],
        left_out=left_out,
        growth=growth,
        parallel_gain=gain,
    )
    write_csv(folder / "scaling.csv", [_flat(each) for each in results])
    if drawn:
        _draw(results, folder / "scaling.png")
    write_text(folder / "report.md", *_report(results, left_out, gain, options, drawn=drawn))
    return results


def growth_per_decade(results: Sequence[Measurement]) -> dict[tuple[str, str, str], float]:
    """Growth of the time per triangle by a decade of triangles, by (model, query, contender).

    From the smallest to the largest; 1 is linear growth.
    """
    groups: dict[tuple[str, str, str], list[Measurement]] = {}
    for each in results:
        groups.setdefault((each.model, each.query, each.contender), []).append(each)
    factors = {}
    for key, group in groups.items():
        first = min(group, key=lambda each: each.triangles)
        last = max(group, key=lambda each: each.triangles)
        decades = np.log10(last.triangles / first.triangles)
        if decades > 0:
            per_triangle = (last.wall / last.triangles) / (first.wall / first.triangles)
            factors[key] = float(per_triangle ** (1 / decades))
    return factors


def parallel_gain(threads: int = 2) -> float:
    """How much faster ``threads`` threads do work that shares nothing: the machine's own limit."""
    data = [np.linspace(0.0, 1.0, 1 << 15) for _ in range(threads)]
    outputs = [np.empty_like(each) for each in data]

    def work(index: int) -> None:
        for _ in range(40):
            np.sin(data[index], out=outputs[index])

    gains = []
    for _ in range(9):
        start = time.perf_counter()
        for index in range(threads):
            work(index)
        middle = time.perf_counter()
        workers = [threading.Thread(target=work, args=(index,)) for index in range(threads)]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
        gains.append((middle - start) / (time.perf_counter() - middle))
    return float(np.median(gains))


def _measure(
    name: str,
    model: Model,
    parts: int,
    threads: Sequence[int],
    frames: int,
    repeats: int,
    bearable: float,
) -> tuple[list[Measurement], list[str]]:
    meshes = [refine(body.mesh, parts) for body in model.bodies]
    recorded = motion.record(motion.fields(model), meshes, frames)
    distance = CLOSE * motion.diagonal([body.mesh for body in model.bodies])
    queries = {
        INTERSECTIONS: measure.meeting(),
        PROXIMITY: measure.within(distance),
        PROXIMITY_BY_EDGE: measure.within(distance / parts),
    }
    if parts == 1:
        # The same distance; measured once, told twice.
        del queries[PROXIMITY_BY_EDGE]
    contenders: dict[tuple[str, str], Callable[[], measure.Pass]] = {}
    pairs: dict[tuple[str, str], float] = {}
    left_out = []
    for query, find in queries.items():
        for method in METHODS:
            leaf_size = _PAPER_LEAF_SIZE if method == "paper" else None
            for count in threads if method in ("wide", "paper") else (1,):
                scene = Scene(meshes, method=method, leaf_size=leaf_size, threads=count)
                hopeless = method == "all-pairs" and _all_pairs_time(query, meshes) > bearable
                if hopeless or _first_frame(scene, recorded[0], find) > bearable:
                    left_out.append(f"{method} on {name} in {parts} parts ({query})")
                    break
                key = f"{method}, {count} {'thread' if count == 1 else 'threads'}", query
                contenders[key] = measure.scene_pass(scene, recorded, find)
                counts = measure.mean_counts(measure.count_pass(scene, recorded, find))
                pairs[key] = counts["pairs"]
        contenders[FLOOR, query] = _floor_pass(meshes, recorded)
    triangles = sum(len(mesh.triangles) for mesh in meshes)
    nodes = sum(len(mesh.nodes) for mesh in meshes)
    named = {f"{query}: {label}": (label, query) for label, query in contenders}
    timed = measure.measure({key: contenders[named[key]] for key in named}, repeats)
    made = [
        Measurement(
            model=name,
            divisions=parts,
            nodes=nodes,
            triangles=triangles,
            contender=label,
            query=query,
            times={stage: measure.spread(times).as_list() for stage, times in timed[key].items()},
            pairs=pairs.get((label, query), 0.0),
        )
        for key, (label, query) in named.items()
    ]
    if parts == 1:
        same = [each for each in made if each.query == PROXIMITY]
        made += [replace(each, query=PROXIMITY_BY_EDGE) for each in same]
    return made, left_out


def _all_pairs_time(query: str, meshes: Sequence[Mesh]) -> float:
    """A low estimate [s] of a frame of the double loop, so that hopeless ones are not tried."""
    triangles = sum(len(mesh.triangles) for mesh in meshes)
    return (5e-9 if query == INTERSECTIONS else 5e-8) * triangles**2


def _first_frame(scene: Scene, frame: Any, find: measure.Find) -> float:
    start = time.perf_counter()
    scene.update(frame)
    find(scene)
    return time.perf_counter() - start


def _floor_pass(
    meshes: Sequence[Mesh], recorded: Sequence[Sequence[Float64Array]]
) -> Callable[[], dict[str, list[float]]]:
    """One pass that only copies what any method must read: surface nodes and triangles."""
    surfaces = [mesh.surface_nodes for mesh in meshes]
    sources = [
        np.concatenate([part[nodes].ravel() for part, nodes in zip(frame, surfaces, strict=True)])
        for frame in recorded
    ]
    indices = np.concatenate([mesh.triangles.ravel() for mesh in meshes])
    positions_out, indices_out = np.empty_like(sources[0]), np.empty_like(indices)

    def run() -> dict[str, list[float]]:
        times = []
        for source in sources:
            start = time.perf_counter()
            np.copyto(positions_out, source)
            np.copyto(indices_out, indices)
            times.append(time.perf_counter() - start)
        return {"wall": times}

    return run


def _flat(each: Measurement) -> dict[str, Any]:
    flat: dict[str, Any] = {
        "model": each.model,
        "divisions": each.divisions,
        "nodes": each.nodes,
        "triangles": each.triangles,
        "query": each.query,
        "contender": each.contender,
        "pairs": each.pairs,
    }
    for stage in measure.STAGES:
        low, median, high = each.times.get(stage, ["", "", ""])
        flat |= {f"{stage}_q1": low, f"{stage}_median": median, f"{stage}_q3": high}
    return flat


def _draw(results: Sequence[Measurement], path: Path) -> None:
    queries = list(dict.fromkeys(each.query for each in results))
    made, axes = plots.figure(1, len(queries), width=5.6, height=4.2)
    contenders = list(dict.fromkeys(each.contender for each in results))
    styles = {contender: plots.COLORS[i % 7] for i, contender in enumerate(contenders)}
    markers = dict(zip(dict.fromkeys(each.model for each in results), _SIGNS, strict=False))
    for one, query in zip(axes[0], queries, strict=True):
        shown = [each for each in results if each.query == query]
        for model, marker in markers.items():
            for contender in contenders:
                line = [
                    each for each in shown if (each.model, each.contender) == (model, contender)
                ]
                if not line:
                    continue
                triangles = [each.triangles for each in line]
                low, median, high = (np.array([each.times["wall"] for each in line]) * 1e3).T
                color = styles[contender]
                style = {"linestyle": "--"} if contender == FLOOR else {}
                name = contender if model == next(iter(markers)) else None
                one.plot(
                    triangles, median, marker=marker, ms=4, lw=1.3, color=color, label=name, **style
                )
                one.fill_between(triangles, low, high, color=color, alpha=0.2, linewidth=0)
        drawn = ", ".join(f"{_SIGNS[marker]} {model}" for model, marker in markers.items())
        plots.label(one, f"{query}    {drawn}", "surface triangles", "ms per frame")
        plots.logarithmic(one)
        one.legend(fontsize=7, frameon=False)
    plots.save(made, path)


def _report(
    results: Sequence[Measurement],
    left_out: Sequence[str],
    gain: float,
    options: Mapping[str, Any],
    *,
    drawn: bool,
) -> Iterator[str]:
    yield "# Growth with size"
    yield f"Machine: {machine.sentence(machine.describe())}."
    yield (
        f"The models with every edge in n parts (edgewise subdivision: each tetrahedron becomes "
        f"n³), in one motion: {motion.DESCRIPTION}. Every frame is a refit and a query, as a "
        f"caller in Python sees it; {options['frames']} frames, {options['repeats']} passes, "
        f"contenders taking turns; the median, with quartiles in `scaling.csv`."
    )
    yield (
        "The memory floor is the time to copy once what any method must read: 24 bytes per "
        "surface node, 12 bytes per triangle."
    )
    yield (
        "Proximity is asked twice: within a fixed distance, which spans more elements the finer "
        "the mesh is, so that the pairs outgrow the triangles; and within a distance that shrinks "
        "with the edges."
    )
    if drawn:
        yield "![Time per frame over the number of triangles](scaling.png)"
    factors = growth_per_decade(results)
    for query in dict.fromkeys(each.query for each in results):
        contenders = list(dict.fromkeys(each.contender for each in results if each.query == query))
        yield f"## {query[0].upper() + query[1:]} [ms per frame]"
        rows = []
        for model, parts in dict.fromkeys((each.model, each.divisions) for each in results):
            line = {
                each.contender: each
                for each in results
                if (each.model, each.divisions, each.query) == (model, parts, query)
            }
            any_one = next(iter(line.values()))
            rows.append(
                [
                    model,
                    parts,
                    whole(any_one.nodes),
                    whole(any_one.triangles),
                    whole(max(each.pairs for each in line.values())),
                    *(
                        milliseconds(line[each].wall) if each in line else "-"
                        for each in contenders
                    ),
                ]
            )
        yield markdown_table("model<|n|nodes|triangles|pairs|" + "|".join(contenders), rows)
        yield "Time per triangle, factor per decade of triangles (1 is linear growth):"
        yield markdown_table(
            "model<|" + "|".join(contenders),
            [
                [
                    model,
                    *(
                        f"{factors[model, query, each]:.2f}"
                        if (model, query, each) in factors
                        else "-"
                        for each in contenders
                    ),
                ]
                for model in dict.fromkeys(each.model for each in results)
            ],
        )
    if left_out:
        yield f"Left out, over {options['bearable']:g} s per frame: {_joined(left_out)}."
    yield "## Threads"
    yield (
        f"Two threads gain {gain:.2f} x on work that shares nothing (sines in cache) in the same "
        f"run; the wide method's gain beside it:"
    )
    yield markdown_table(
        "model<|n|triangles|query<|1 thread [ms]|2 threads [ms]|gain|of the machine's own gain",
        _gains(results, gain),
    )


def _gains(results: Sequence[Measurement], gain: float) -> Iterator[list[Any]]:
    by_key = {(each.model, each.divisions, each.query, each.contender): each for each in results}
    for (model, parts, query, contender), one in by_key.items():
        two = by_key.get((model, parts, query, "wide, 2 threads"))
        if contender == "wide, 1 thread" and two is not None:
            ratio = one.wall / two.wall
            yield [
                model,
                parts,
                whole(one.triangles),
                query,
                milliseconds(one.wall),
                milliseconds(two.wall),
                f"{ratio:.2f} x",
                f"{ratio / gain:.0%}",
            ]


def _joined(left_out: Sequence[str]) -> str:
    """Names of what is left out; a method that is left out everywhere stands once."""
    methods = dict.fromkeys(each.split(" on ")[0] for each in left_out)
    return "; ".join(
        f"{method} ({sum(each.startswith(method + ' on ') for each in left_out)} times)"
        for method in methods
    )
