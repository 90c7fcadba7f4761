"""`palpate tree`: the upper tree drawn, and the bounding tree of each body in numbers."""

from __future__ import annotations

from enum import Enum
from typing import Annotated, Any

import typer
from rich.text import Text
from rich.tree import Tree

from palpate.cli.opening import open_model
from palpate.cli.output import (
    JsonOption,
    LeafSizeOption,
    ModelArgument,
    console,
    print_json,
    table,
    whole,
)
from palpate.model import Model, TreeElement
from palpate.scene import Scene


class Split(Enum):
    """Where a node of the bounding tree is split."""

    MIDDLE = "middle"
    COUNT = "count"


def command(
    model: ModelArgument,
    leaf_size: LeafSizeOption = None,
    split: Annotated[
        Split, typer.Option(help="Split in the middle of the box, or into equal counts.")
    ] = Split.MIDDLE,
    json_output: JsonOption = False,
) -> None:
    """Show the trees of a model: how bodies are joined, and the bounding tree of each.

    S tetrahedra with at most K in a leaf need about 2S/K - 1 nodes.

    Example: palpate tree case1 --leaf-size 4
    """
    opened, path, _ = open_model(model)
    scene = Scene(opened, leaf_size=leaf_size, split=split.value)
    rows = [{"body": name, **scene.tree_stats(name)} for name in scene.names]
    if json_output:
        structure = _structure(opened.tree, opened)
        print_json({"model": str(path), "split": split.value, "tree": structure, "bodies": rows})
        return
    out = console()
    out.print(_drawn(opened.tree, opened))
    out.print(
        table(
            f"Bounding trees, K = {rows[0]['leaf_size']}, split by {split.value}",
            "body<|tetrahedra S|triangles|nodes P|2S/K-1|P/(2S/K-1)|leaves|depth max|mean",
            [*(_row(each["body"], each) for each in rows), *_total(rows)],
        )
    )
    size = max(len(each["leaf_fill"]) for each in rows)
    out.print(
        table(
            "Leaves by the number of tetrahedra in them",
            "|".join(["body<", *map(str, range(size))]),
            [(each["body"], *(whole(count) for count in each["leaf_fill"])) for each in rows],
        )
    )


def _row(name: str, stats: dict[str, Any]) -> tuple[str, ...]:
    expected = stats["expected_nodes"]
    return (
        name,
        whole(stats["elements"]),
        whole(stats["triangles"]),
        whole(stats["nodes"]),
        f"{expected:,.0f}",
        f"{stats['nodes'] / expected:.3f}" if expected > 0 else "-",
        whole(stats["leaves"]),
        str(stats["depth_max"]) if stats["depth_max"] is not None else "",
        f"{stats['depth_mean']:.1f}" if stats["depth_mean"] is not None else "",
    )


def _total(rows: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    if len(rows) < 2:
        return []
    summed = {
        key: sum(each[key] for each in rows)
        for key in ("elements", "triangles", "nodes", "expected_nodes", "leaves")
    }
    return [_row("total", {**summed, "depth_max": None, "depth_mean": None})]


def _label(element: TreeElement, model: Model) -> Text:
    if element.body is None:
        return Text("CE", style="bold")
    body = model.bodies[element.body]
    processor = "auto" if body.processor is None else str(body.processor)
    kind = "" if body.rigid is None else ", rigid"
    return Text.assemble(("NE ", "bold"), (body.name, "cyan"), f"  PE {processor}{kind}")


def _drawn(element: TreeElement, model: Model) -> Tree:
    root = Tree(_label(element, model))
    # A loop, not recursion: ten thousand bodies make a chain that deep.
    pending = [(root, element)]
    while pending:
        branch, parent = pending.pop()
        for child in parent.children:
            pending.append((branch.add(_label(child, model)), child))
    return root


def _structure(element: TreeElement, model: Model) -> dict[str, Any]:
    if element.body is not None:
        body = model.bodies[element.body]
        return {"kind": "NE", "body": body.name, "processor": body.processor}
    return {"kind": "CE", "children": [_structure(child, model) for child in element.children]}
