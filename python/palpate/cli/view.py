"""`palpate view`: a model in the browser, to look at and to touch."""

from __future__ import annotations

import contextlib
import math
from pathlib import Path
from typing import Annotated

import typer

from palpate.cli.opening import is_mesh, open_model
from palpate.cli.output import LeafSizeOption, ThreadsOption, console, parse_seconds
from palpate.model import Model
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
    host: Annotated[
        str,
        typer.Option(
            help="Address to listen on; 0.0.0.0 lets other machines in, without a password."
        ),
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Another one is taken when this is in use.")
    ] = 8642,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address only.")
    ] = False,
    paused: Annotated[bool, typer.Option("--paused", help="Wait for the play button.")] = False,
    time_step: Annotated[
        float,
        typer.Option(
            parser=parse_seconds, metavar="SECONDS", help="Length of a step.", show_default="1/60"
        ),
    ] = 1 / 60,
    threads: ThreadsOption = 1,
    leaf_size: LeafSizeOption = None,
    export: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write a film as one .html file instead.", show_default=False
        ),
    ] = None,
    duration: Annotated[
        float,
        typer.Option(
            parser=parse_seconds, metavar="SECONDS", help="Length of the film of a model."
        ),
    ] = 2.0,
) -> None:
    """Show a model in the browser: play it, pull at it, change it; or play a recorded run.

    The page needs nothing from the internet, and neither does an exported film. A mesh alone floats
    without gravity. Ctrl-C ends it.

    Example: palpate view case2

    Example: palpate view scene.bml --no-browser --port 8080

    Example: palpate view out --export film.html
    """
    # Here, so that the other commands start without a server.
    from palpate.viewer import Player, Viewer
    from palpate.viewer.export import export_film
    from palpate.viewer.live import LivePlayer
    from palpate.viewer.recorded import RecordedPlayer
    from palpate.viewer.recording import Recording

    path = Path(target)
    recorded = path.is_dir()

    def open_player() -> Player:
        if recorded:
            return RecordedPlayer(Recording(path))
        if path.suffix == ".palpate":
            return LivePlayer(Simulation.load(target, threads=threads))
        model, _, _ = open_model(target)
        if is_mesh(target):  # nothing is there that it could fall on
            model = Model(model.bodies, gravity=(0.0, 0.0, 0.0))
        return LivePlayer(
            Simulation(
                model,
                time_step=time_step,
                threads=threads,
                leaf_size=leaf_size,
                substeps="auto",
            )
        )

    if export is not None:
        player = open_player()
        count = None if recorded else math.ceil(duration / player.interval - 1e-9)
        made = export_film(player, export, count=count, title=path.resolve().stem)
        console().print(f"{export}: {made} frames, {export.stat().st_size / 1e6:.1f} MB")
        return
    title = "" if recorded else path.stem
    watch = path if path.suffix == ".bml" else None
    # Now: a mesh that is read in the session's thread sends stdout elsewhere meanwhile.
    out, notes = console(), console(error=True)
    with (
        Viewer(
            open_player, host=host, port=port, title=title, play=not paused, watch=watch
        ) as viewer,
        contextlib.suppress(KeyboardInterrupt),
    ):
        if host not in ("127.0.0.1", "localhost", "::1"):
            notes.print("note: everyone who reaches this address can use the page")
        out.print(f"{target} at {viewer.url} (Ctrl-C ends it)")
        if not no_browser and not viewer.open_browser():
            notes.print("note: no browser was found here; open the address in one")
        viewer.wait()
