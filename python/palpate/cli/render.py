"""`palpate render`: pictures and films without a browser or a screen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from palpate.cli.opening import open_model
from palpate.cli.output import ThreadsOption, console, parse_seconds
from palpate.results.cut_faces import CutFaces
from palpate.results.drawing import (
    Look,
    Moment,
    looks_of,
    moment_of,
    upward,
    write_film,
    write_strip,
)
from palpate.simulation import Simulation


def command(
    target: Annotated[
        str,
        typer.Argument(
            metavar="MODEL",
            help="A .bml file, a bundled model, a mesh, a checkpoint, or the folder of a run.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="A .png picture, or a .gif film.")
    ] = Path("picture.png"),
    duration: Annotated[
        float | None,
        typer.Option(
            parser=parse_seconds,
            metavar="SECONDS",
            help="Simulate so long; the picture shows the end.",
            show_default=False,
        ),
    ] = None,
    frames: Annotated[
        int | None,
        typer.Option(
            min=2,
            help="So many moments from start to end: side by side, or as a film.",
            show_default=False,
        ),
    ] = None,
    boxes: Annotated[
        int | None,
        typer.Option(
            min=0,
            metavar="LEVEL",
            help="Draw the boxes so many splits below the box of each body, 0.",
            show_default=False,
        ),
    ] = None,
    width: Annotated[int, typer.Option(min=64, max=8192, help="Pixels of one picture.")] = 1280,
    time_step: Annotated[
        float,
        typer.Option(
            parser=parse_seconds, metavar="SECONDS", help="Length of a step.", show_default="1/60"
        ),
    ] = 1 / 60,
    threads: ThreadsOption = 1,
) -> None:
    """Draw a model as it is placed, after some time, or as a film.

    Example: palpate render small -o small.png

    Example: palpate render case1 --duration 1.5 --frames 3 -o strip.png

    Example: palpate render case2 --boxes 6 -o boxes.png

    Example: palpate render out --frames 60 --width 640 -o film.gif
    """
    suffix = output.suffix.lower()
    if suffix not in (".png", ".gif"):
        raise typer.BadParameter(f"--output: expected a .png or .gif file, got {output}")
    if suffix == ".gif" and frames is None:
        frames = 30
    if Path(target).is_dir():
        if duration is not None:
            raise typer.BadParameter("--duration: a run on disk has its own")
        moments, looks, up = _recorded(Path(target), frames, boxes)
    else:
        if frames is not None and duration is None:
            raise typer.BadParameter("--frames: say with --duration how long to simulate")
        moments, looks, up = _simulated(target, duration or 0.0, frames, time_step, threads, boxes)
    write = write_film if suffix == ".gif" else write_strip
    write(output, moments, looks, up, width)
    console().print(f"{output}: {len(moments)} moments" if frames else str(output))


def _recorded(
    folder: Path, frames: int | None, level: int | None
) -> tuple[list[Moment], list[Look], Sequence[float]]:
    from palpate.viewer.recording import Recording

    recording = Recording(folder)
    last = len(recording) - 1
    picked = [last] if frames is None else _spread(last, frames)
    _, parts = recording.frame(last)
    moments = [recording.moment(index, level) for index in picked]
    return moments, recording.looks(parts), recording.up


def _simulated(
    target: str,
    duration: float,
    frames: int | None,
    time_step: float,
    threads: int,
    level: int | None,
) -> tuple[list[Moment], list[Look], Sequence[float]]:
    if Path(target).suffix == ".palpate":
        simulation = Simulation.load(target, threads=threads)
    else:
        model, _, _ = open_model(target)
        simulation = Simulation(model, time_step=time_step, threads=threads)
    steps = math.ceil(duration / simulation.time_step - 1e-9)
    picked = [steps] if frames is None else _spread(steps, frames)
    faces = CutFaces.since_the_start(simulation)
    moments = []
    for step in range(steps + 1):
        if step > 0:
            simulation.step()
        if step in picked:
            moments.append(moment_of(simulation, faces, level))
    return moments, looks_of(simulation.model.bodies), upward(simulation.model.gravity)


def _spread(last: int, count: int) -> list[int]:
    """At most ``count`` different numbers, evenly from 0 to ``last``."""
    count = min(count, last + 1)
    return sorted({round(last * k / max(count - 1, 1)) for k in range(count)})
