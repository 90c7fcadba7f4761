"""The commands together."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Annotated

import typer

from palpate._core import __version__
from palpate.cli.bench import bench_app
from palpate.cli.output import reporting

#: In the order of --help. Each is the function `command` of a file of that name beside this one.
COMMANDS = (
    "check",
    "tree",
    "detect",
    "simulate",
    "view",
    "render",
    "tune",
    "mesh",
    "convert",
    "format",
)

app = typer.Typer(
    name="palpate",
    help="Contact detection and deformation of soft bodies made of tetrahedra.",
    epilog="A MODEL is a .bml file, or one that comes with palpate: small, case1, case2. "
    "palpate COMMAND --help tells what a command takes.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(asked: bool) -> None:
    if asked:
        typer.echo(f"palpate {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    _version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    pass


for _name in COMMANDS:
    app.command(_name)(reporting(import_module(f"palpate.cli.{_name}").command))
app.add_typer(bench_app)


def main() -> None:
    """Run the command line on ``sys.argv`` and exit: 0 fine, 1 bad input, 2 wrong usage."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            # A terminal that does not know m³ shows m? instead of a traceback.
            stream.reconfigure(errors="replace")
    app()
