"""`palpate simulate`: run a model, write what happened."""

from __future__ import annotations

import math
import sys
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from palpate import pictures
from palpate.cli.detect import METHOD_NAMES, parse_method
from palpate.cli.opening import open_model
from palpate.cli.output import (
    INTERRUPTED,
    JsonOption,
    LeafSizeOption,
    ThreadsOption,
    console,
    parse_seconds,
    print_json,
)
from palpate.cli.run import Run, RunOptions
from palpate.cli.summary import print_profile, print_summary
from palpate.cutting import read_blades
from palpate.model import Model
from palpate.simulation import Simulation


class Substeps(Enum):
    """What to do about a step that fails."""

    ONE = "1"
    AUTO = "auto"


def command(
    model: Annotated[
        str | None,
        typer.Argument(
            metavar="MODEL",
            help="A .bml file or the name of a bundled model; not needed with --resume.",
            show_default=False,
        ),
    ] = None,
    duration: Annotated[
        float, typer.Option(parser=parse_seconds, metavar="SECONDS", help="Simulated time.")
    ] = 2.0,
    time_step: Annotated[
        float | None,
        typer.Option(
            parser=parse_seconds,
            metavar="SECONDS",
            help="Length of a step; 1/60 unless given.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[Path, typer.Option(help="Folder of the results.")] = Path("out"),
    every: Annotated[int, typer.Option(min=1, help="Write a frame every so many steps.")] = 1,
    threads: ThreadsOption = 1,
    leaf_size: LeafSizeOption = None,
    method: Annotated[
        str | None,
        typer.Option(
            parser=parse_method,
            metavar=METHOD_NAMES,
            help="How touching triangles are found; wide unless given.",
        ),
    ] = None,
    cut: Annotated[
        Path | None,
        typer.Option(help="Cut as this file of blade strokes says.", show_default=False),
    ] = None,
    substeps: Annotated[
        Substeps,
        typer.Option(help="auto: try a step that fails again as 2, 4, ... up to 64 smaller ones."),
    ] = Substeps.ONE,
    checkpoint: Annotated[
        bool,
        typer.Option(
            "--checkpoint", help="Save OUTPUT/checkpoint.palpate, at the end and every minute."
        ),
    ] = False,
    resume: Annotated[
        Path | None, typer.Option(help="Continue from a checkpoint, bit for bit.")
    ] = None,
    profile: Annotated[
        bool, typer.Option("--profile", help="Print where the time of the steps went.")
    ] = False,
    no_pictures: Annotated[bool, typer.Option("--no-pictures", help="Draw none.")] = False,
    json_output: JsonOption = False,
) -> None:
    """Simulate a model: soft bodies fall, touch, deform and come to rest.

    Writes a series that ParaView opens, report.json and pictures. Ctrl-C stops after the step
    under way and leaves complete files.

    Example: palpate simulate case1 --duration 3 --output out

    Example: palpate simulate scene.bml --time-step 1/120 --every 2 --checkpoint

    Example: palpate simulate case2 --cut strokes.blade

    Example: palpate simulate --resume out/checkpoint.palpate --output more
    """
    if model is None and resume is None:
        raise typer.BadParameter("give a MODEL, or a checkpoint with --resume")
    own = (time_step, leaf_size, method, None if substeps is Substeps.ONE else substeps)
    if resume is not None and any(each is not None for each in own):
        raise typer.BadParameter(
            "a checkpoint has its own: leave out --time-step, --leaf-size, --method and --substeps"
        )
    strokes = [] if cut is None else read_blades(cut)
    simulation, notes = _start(
        model, resume, time_step or 1 / 60, threads, leaf_size, method, substeps
    )
    steps = max(1, math.ceil(duration / simulation.time_step - 1e-9))
    options = RunOptions(
        model=model if resume is None else str(resume),
        steps=steps,
        every=every,
        threads=threads,
        leaf_size=leaf_size,
        method=method,
        checkpoint=checkpoint,
        pictures=not no_pictures and pictures.available(),
        cut=None if cut is None else str(cut),
        substeps=substeps.value,
    )
    run = Run(simulation, output, options, quiet=json_output, strokes=strokes)
    if not no_pictures and not options.pictures:
        notes = (*notes, "no pictures without matplotlib: pip install 'palpate[plot]'")
    for note in notes:
        console(error=True).print(f"note: {note}")
    report = run.go()
    if json_output:
        print_json(report)
    elif report["step_count"]:
        print_summary(report, run.files)
        if profile:
            print_profile(report)
    if report["failure"]:
        at = report["end_time"]
        print(f"error: at t = {at:.4g} s: {report['failure']}", file=sys.stderr)
        print(f"  = note: results up to then are in {output}", file=sys.stderr)
        raise typer.Exit(1)
    if report["interrupted"]:
        raise typer.Exit(INTERRUPTED)


def _start(
    model: str | None,
    resume: Path | None,
    time_step: float,
    threads: int,
    leaf_size: int | None,
    method: str | None,
    substeps: Substeps,
) -> tuple[Simulation, tuple[str, ...]]:
    opened: Model | None = None
    notes: tuple[str, ...] = ()
    if model is not None:
        opened, _, notes = open_model(model)
    if resume is None:
        assert opened is not None
        simulation = Simulation(
            opened,
            time_step=time_step,
            threads=threads,
            leaf_size=leaf_size,
            method=method or "wide",
            substeps="auto" if substeps is Substeps.AUTO else 1,
        )
        return simulation, notes
    simulation = Simulation.load(resume, threads=threads)
    if opened is not None:
        there, here = (
            [(body.name, len(body.mesh.nodes)) for body in each.bodies]
            for each in (simulation.model, opened)
        )
        if there != here:
            raise ValueError(
                f"{resume} is not a checkpoint of {model}: it holds "
                + ", ".join(f"{name} ({nodes} nodes)" for name, nodes in there)
            )
    return simulation, notes
