"""`palpate detect`: which triangles meet in the model's pose, and what finding them costs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.text import Text

from palpate.cli.opening import open_model, pair_counts
from palpate.cli.output import (
    JsonOption,
    LeafSizeOption,
    ModelArgument,
    ThreadsOption,
    console,
    duration_text,
    percent_text,
    print_json,
    table,
    whole,
)
from palpate.contacts import Intersections
from palpate.results.atomic import replacing
from palpate.scene import METHODS, Scene


def parse_method(text: str) -> str:
    """The name of a detection method."""
    if text not in METHODS:
        raise typer.BadParameter(f"expected one of {', '.join(METHODS)}; got {text!r}")
    return text


METHOD_NAMES = f"<{'|'.join(METHODS)}>"
MethodOption = Annotated[
    str,
    typer.Option(
        parser=parse_method, metavar=METHOD_NAMES, help="How touching triangles are found."
    ),
]


def command(
    model: ModelArgument,
    method: MethodOption = "wide",
    leaf_size: LeafSizeOption = None,
    threads: ThreadsOption = 1,
    repeat: Annotated[int, typer.Option(min=1, help="Repeats that the times are of.")] = 20,
    no_self: Annotated[bool, typer.Option("--no-self", help="Leave self-contact out.")] = False,
    output: Annotated[
        Path | None, typer.Option(help="Write the pairs to a .csv or .npy file.")
    ] = None,
    json_output: JsonOption = False,
) -> None:
    """Find the triangles that meet in the model's pose, and time every stage.

    Example: palpate detect case1 --repeat 50 --output pairs.csv

    Example: palpate detect case1 --method hash --json
    """
    if output is not None and output.suffix not in (".csv", ".npy"):
        raise typer.BadParameter(f"expected a .csv or .npy file, got {output}")
    opened, path, _ = open_model(model)
    scene = Scene(opened, leaf_size=leaf_size, method=method, threads=threads)
    found, times = _measure(scene, repeat, not no_self)
    if output is not None:
        write_pairs(output, found)
    stats = found.stats
    report = {
        "model": str(path),
        "method": method,
        "threads": threads,
        "repeats": repeat,
        "self_contact": not no_self,
        "pairs": len(found),
        "body_pairs": pair_counts(found, list(scene.names)),
        "times": {stage: _spread(values) for stage, values in times.items()},
        "object_pairs": stats.object_pairs,
        "nodes_visited": stats.nodes_visited,
        "leaf_pairs": stats.leaf_pairs,
        "box_tests": stats.box_tests,
        "pair_tests": stats.pair_tests,
        "all_pairs": stats.all_pairs,
        "fraction_tested": stats.fraction,
    }
    if json_output:
        print_json(report)
    else:
        _print_report(report)
        if output is not None:
            console().print(Text(f"{whole(len(found))} pairs written to {output}"))


def _measure(
    scene: Scene, repeat: int, self_contact: bool
) -> tuple[Intersections, dict[str, list[float]]]:
    positions = [mesh.nodes for mesh in scene.meshes]
    times: dict[str, list[float]] = {
        stage: [] for stage in ("update", "objects", "traversal", "polygons", "total")
    }
    for _ in range(repeat):
        scene.update(positions)
        found = scene.intersections(self_contact=self_contact)
        stats = found.stats
        stages = (scene.update_time, stats.object_time, stats.traversal_time, stats.polygon_time)
        for stage, seconds in zip(times, (*stages, sum(stages)), strict=True):
            times[stage].append(seconds)
    return found, times


def _spread(values: list[float]) -> dict[str, float]:
    low, median, high = np.percentile(values, [0, 50, 100]).tolist()
    return {"min": low, "median": median, "max": high}


def write_pairs(path: Path, found: Intersections) -> None:
    """Write the pairs, shape (k, 4), as text with a heading or as a numpy array."""
    with replacing(path) as temporary, temporary.open("wb") as file:
        if path.suffix == ".npy":
            np.save(file, found.pairs)
        else:
            heading = "body_a,triangle_a,body_b,triangle_b"
            np.savetxt(file, found.pairs, fmt="%d", delimiter=",", header=heading, comments="")


def _print_report(report: dict[str, Any]) -> None:
    out = console()
    if report["body_pairs"]:
        out.print(
            table(
                "Triangles that meet",
                "body<|with<|triangle pairs",
                [
                    (
                        each["body_a"],
                        "itself" if each["body_a"] == each["body_b"] else each["body_b"],
                        whole(each["pairs"]),
                    )
                    for each in report["body_pairs"]
                ],
            )
        )
    else:
        out.print(Text("No triangles meet."))
    out.print(
        table(
            f"Time per stage, {report['repeats']} repeats, method {report['method']}",
            "stage<|median|min|max",
            [
                (stage, *(duration_text(spread[key]) for key in ("median", "min", "max")))
                for stage, spread in report["times"].items()
            ],
        )
    )
    out.print(
        Text(
            f"{whole(report['pair_tests'])} of {whole(report['all_pairs'])} triangle pairs tested "
            f"({percent_text(report['fraction_tested'])}), {whole(report['nodes_visited'])} tree "
            f"nodes visited, {whole(report['box_tests'])} box tests"
        )
    )
