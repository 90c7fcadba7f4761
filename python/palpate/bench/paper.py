"""The paper's evaluation (its section 4) on our models: time of each stage over the tree's size."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from palpate.bench import measure, motion
from palpate.bench.fit import Fit, fit_cost_model
from palpate.bench.output import write_csv, write_json, write_text
from palpate.model import Model
from palpate.scene import Scene

#: Leaf sizes K by default.
LEAF_SIZES = (1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100, 150, 200, 300, 500, 1000, 2000, 5000)

#: Stages of a row: the paper's three, its traversal in its two levels.
_STAGES = ("update", "objects", "traversal", "polygons", "total", "wall")


@dataclass(frozen=True)
class Printed:
    """What the paper prints for a case: best total [s] at P nodes, K as printed and as P says."""

    case: int
    organs: str
    total: float
    nodes: int
    leaf_size: int
    leaf_size_of_nodes: int
    tetrahedra: int
    triangles: int


#: By our model's name; P = 68,878 is printed beside K = 5 but belongs to K = 1, see the report.
PRINTED = {
    name: printed
    for names, printed in (
        (("paper1", "case1"), Printed(1, "A + B", 5e-3, 19_392, 2, 2, 15_134, 5_518)),
        (("paper2", "case2"), Printed(2, "A + C + 2 B", 6e-3, 68_878, 5, 1, 34_441, 12_678)),
    )
    for name in names
}
#: Of all pairs of polygons the paper tests one in so many.
PRINTED_FRACTIONS = (1 / 40_000, 1 / 5_000)


@dataclass(frozen=True)
class Row:
    """One leaf size: tree, spread [s] of every stage (quartile, median, quartile), mean counts."""

    leaf_size: int
    nodes: int
    times: dict[str, list[float]]
    counts: dict[str, float]
    #: Pairs in the motion that go unnoticed, since polygons in one leaf are not tested.
    missed: int


@dataclass(frozen=True)
class Case:
    """One model."""

    name: str
    bodies: list[str]
    tetrahedra: int
    triangles: int
    all_pairs: int
    frames: int
    rows: list[Row]
    wide: dict[str, list[float]]
    #: Seconds of one frame with every pair tested, or None where that would take too long.
    all_pairs_time: float | None
    fits: list[Fit]
    printed: Printed | None

    @property
    def best(self) -> Row:
        """The leaf size with the least total."""
        return min(self.rows, key=lambda row: row.times["total"][1])

    @property
    def best_complete(self) -> Row | None:
        """The leaf size with the least total among those that miss nothing."""
        complete = [row for row in self.rows if not row.missed]
        return min(complete, key=lambda row: row.times["total"][1], default=None)


def run(
    models: Sequence[tuple[str, Model]],
    folder: Path,
    *,
    leaf_sizes: Sequence[int] = LEAF_SIZES,
    frames: int = 24,
    repeats: int = 7,
    plots: bool = True,
    advance: Callable[[], None] = lambda: None,
) -> list[Case]:
    """Measure, then write results.json, paper.csv, report.md and the plots into the folder."""
    cases = [
        measure_case(name, model, leaf_sizes, frames, repeats, advance) for name, model in models
    ]
    folder.mkdir(parents=True, exist_ok=True)
    options = {"leaf_sizes": list(leaf_sizes), "frames": frames, "repeats": repeats}
    write_json(
        folder / "results.json",
        "bench paper",
        options,
        motion=motion.DESCRIPTION,
        cases=[{**asdict(case), "best_leaf_size": case.best.leaf_size} for case in cases],
    )
    write_csv(folder / "paper.csv", [_flat(case, row) for case in cases for row in case.rows])
    if plots:
        from palpate.bench import paper_plots

        paper_plots.draw(cases, folder)
    from palpate.bench.paper_report import report

    write_text(folder / "report.md", *report(cases, options, plots=plots))
    return cases


def rounds(models: int, leaf_sizes: Sequence[int], repeats: int) -> int:
    """How often `run` calls ``advance``."""
    return models * (len(leaf_sizes) + 1) * (repeats + 1)


def measure_case(
    name: str,
    model: Model,
    leaf_sizes: Sequence[int],
    frames: int,
    repeats: int,
    advance: Callable[[], None],
) -> Case:
    """Every leaf size, and the wide method beside it, over the recorded motion."""
    recorded = motion.record(motion.fields(model), [body.mesh for body in model.bodies], frames)
    wide = Scene(model)
    # As the paper does it: polygons in one leaf are not tested against each other.
    literal, everything = measure.meeting(same_leaf=False), measure.meeting()
    scenes = {k: Scene(model, leaf_size=k, method="paper", split="middle") for k in leaf_sizes}
    contenders = {
        f"K={k}": measure.scene_pass(scene, recorded, literal) for k, scene in scenes.items()
    }
    contenders["wide"] = measure.scene_pass(wide, recorded, everything)
    times = {
        each: _spreads(stages)
        for each, stages in measure.measure(contenders, repeats, advance).items()
    }
    complete = measure.count_pass(wide, recorded, everything)
    rows = []
    for k, scene in scenes.items():
        found = measure.count_pass(scene, recorded, literal)
        rows.append(
            Row(
                leaf_size=k,
                nodes=sum(scene.tree_stats(body)["nodes"] for body in range(len(scene))),
                times=times[f"K={k}"],
                counts=measure.mean_counts(found),
                missed=sum(map(len, complete)) - sum(map(len, found)),
            )
        )
    triangles = sum(len(mesh.triangles) for mesh in wide.meshes)
    return Case(
        name=name,
        bodies=list(wide.names),
        tetrahedra=sum(len(mesh.tetrahedra) for mesh in wide.meshes),
        triangles=triangles,
        all_pairs=complete[0].stats.all_pairs,
        frames=frames,
        rows=rows,
        wide=times["wide"],
        all_pairs_time=_all_pairs_time(model, recorded[0], triangles),
        fits=_fits(rows, triangles),
        printed=PRINTED.get(name),
    )


def _fits(rows: Sequence[Row], triangles: int) -> list[Fit]:
    if len({row.nodes for row in rows}) < 3:
        return []
    return fit_cost_model(
        [row.nodes for row in rows],
        triangles,
        {stage: [row.times[stage][1] for row in rows] for stage in _STAGES},
    )


def _spreads(stages: dict[str, Any]) -> dict[str, list[float]]:
    total = sum(stages[stage] for stage in ("update", "objects", "traversal", "polygons"))
    return {
        stage: measure.spread(seconds).as_list()
        for stage, seconds in {**stages, "total": total}.items()
    }


def _all_pairs_time(model: Model, frame: Any, triangles: int) -> float | None:
    if triangles > 20_000:
        return None
    scene = Scene(model, method="all-pairs")
    scene.update(frame)
    return scene.intersections().stats.polygon_time


def _flat(case: Case, row: Row) -> dict[str, Any]:
    flat: dict[str, Any] = {"model": case.name, "K": row.leaf_size, "P": row.nodes}
    for stage in _STAGES:
        low, median, high = row.times[stage]
        flat |= {f"{stage}_q1": low, f"{stage}_median": median, f"{stage}_q3": high}
    return flat | row.counts | {"all_pairs": case.all_pairs, "missed_pairs": row.missed}
