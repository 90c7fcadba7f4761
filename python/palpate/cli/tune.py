"""`palpate tune`: the leaf size, split and method that are fastest for a model on this machine."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer
from rich.text import Text

from palpate.bench import tune as tuning
from palpate.bench.output import milliseconds
from palpate.cli.bench import progress
from palpate.cli.opening import open_model
from palpate.cli.output import (
    JsonOption,
    ModelArgument,
    ThreadsOption,
    console,
    print_json,
    table,
)


def command(
    model: ModelArgument,
    threads: ThreadsOption = 1,
    frames: Annotated[int, typer.Option(min=2, help="Frames of the motion tried.")] = 6,
    repeats: Annotated[
        int, typer.Option(min=1, help="Passes over the motion for the fastest.")
    ] = 9,
    show: Annotated[int, typer.Option(min=1, help="Rows to show.")] = 10,
    json_output: JsonOption = False,
) -> None:
    """Find the fastest leaf size, split and method for a model on this machine, in seconds.

    The bodies go through a short motion in which they touch, bend and leave.

    Example: palpate tune case2

    Example: palpate tune scene.bml --threads 2
    """
    opened, path, _ = open_model(model)
    total = len(tuning.METHODS) * len(tuning.LEAF_SIZES) * 12
    with progress(total, quiet=json_output) as advance:
        choices, default = tuning.tune(
            opened, threads=threads, frames=frames, repeats=repeats, advance=advance
        )
    best = choices[0]
    if json_output:
        print_json(
            {
                "model": str(path),
                "threads": threads,
                "best": asdict(best),
                "default": asdict(default),
                "choices": [asdict(each) for each in choices],
            }
        )
        return
    out = console()
    out.print(
        table(
            f"Time of a frame, the fastest {min(show, len(choices))} of {len(choices)}",
            "method<|leaf size|split<|median [ms]|quartiles",
            [
                (
                    each.method,
                    each.leaf_size,
                    each.split,
                    milliseconds(each.median),
                    f"{milliseconds(each.low)} to {milliseconds(each.high)}",
                )
                for each in choices[:show]
            ],
        )
    )
    taken = f"The defaults take {milliseconds(default.median)} ms"
    if default.median <= best.high:
        out.print(Text(f"{taken}, within the spread of the best: nothing needs to be set."))
        return
    out.print(Text(f"{taken}. To use the best:"))
    out.print(Text(f"  palpate.Scene(model, {best.arguments()})"))
    out.print(Text(f"  palpate detect {model} --method {best.method} --leaf-size {best.leaf_size}"))
