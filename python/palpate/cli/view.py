"""`palpate view`: a model in the browser, to look at and to touch."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from palpate.cli.opening import open_model
from palpate.cli.output import LeafSizeOption, ThreadsOption, console, parse_seconds
from palpate.simulation import Simulation
from palpate.viewer import Player, Viewer
from palpate.viewer.live import LivePlayer
from palpate.viewer.viewer import DEFAULT_PORT


def view(
    target: Annotated[
        str,
        typer.Argument(
            metavar="MODEL",
            help="A .bml file, the name of a bundled model, a mesh file, or a checkpoint.",
            show_default=False,
        ),
    ],
    host: Annotated[
        str, typer.Option(help="Address to listen on; other machines reach only their own.")
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Another one is taken when this is in use.")
    ] = DEFAULT_PORT,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address only.")
    ] = False,
    paused: Annotated[bool, typer.Option("--paused", help="Wait for the play button.")] = False,
    time_step: Annotated[
        float, typer.Option(parser=parse_seconds, metavar="SECONDS", help="Length of a step.")
    ] = 1 / 60,
    threads: ThreadsOption = 1,
    leaf_size: LeafSizeOption = None,
) -> None:
    """Show a model in the browser: play it, pull at it, change it.

    The page needs nothing from the internet. Ctrl-C ends it.

    Example: palpate view case2

    Example: palpate view scene.bml --no-browser --port 8080
    """

    def open_live() -> Player:
        if Path(target).suffix == ".palpate":
            return LivePlayer(Simulation.load(target, threads=threads))
        model, _, _ = open_model(target)
        return LivePlayer(
            Simulation(model, time_step=time_step, threads=threads, leaf_size=leaf_size)
        )

    with Viewer(
        open_live, host=host, port=port, title=Path(target).stem, play=not paused
    ) as viewer:
        console().print(f"{target} at {viewer.url} (Ctrl-C ends it)")
        if not no_browser:
            viewer.open_browser()
        viewer.wait()
