"""What the commands share: console, JSON, errors, numbers with units."""

from __future__ import annotations

import functools
import json
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from fractions import Fraction
from typing import Annotated, Any, ParamSpec, TypeVar

import numpy as np
import typer
from rich import box
from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from palpate.errors import ModelError, PalpateError

#: Exit status of a command that Ctrl-C ended, as shells report it.
INTERRUPTED = 130

_P = ParamSpec("_P")
_R = TypeVar("_R")

ModelArgument = Annotated[
    str,
    typer.Argument(
        metavar="MODEL",
        help="A .bml file, the name of a bundled model, or a mesh file.",
        show_default=False,
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object, nothing else.")]
RepairOption = Annotated[
    bool, typer.Option("--repair", help="Mend inverted and degenerate tetrahedra in the meshes.")
]
LeafSizeOption = Annotated[
    int | None,
    typer.Option(
        "--leaf-size",
        "-K",
        min=1,
        help="Most tetrahedra in a leaf of the bounding tree (the paper's K).",
    ),
]
ThreadsOption = Annotated[int, typer.Option("--threads", min=1, help="Worker threads.")]


def console(*, error: bool = False) -> Console:
    """A console on stdout or stderr; without a terminal it is plain and wide."""
    stream = sys.stderr if error else sys.stdout
    return Console(
        file=stream,
        width=None if stream.isatty() else 120,
        no_color=None if stream.isatty() else True,
        markup=False,
        highlight=False,
    )


def reporting(command: Callable[_P, _R]) -> Callable[_P, _R]:
    """The command with errors about the input told on stderr, exit status 1, no traceback."""

    @functools.wraps(command)
    def run(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        try:
            return command(*args, **kwargs)
        except BrokenPipeError:
            raise  # the reader of a pipe left; the command line handles it
        except (PalpateError, OSError, ValueError) as error:
            if kwargs.get("json_output"):
                print_json({"error": describe_error(error)})
            print(error_text(error), file=sys.stderr)
            raise typer.Exit(1) from None
        except KeyboardInterrupt:
            raise typer.Exit(INTERRUPTED) from None

    return run


def error_text(error: Exception) -> str:
    """What a user is told: diagnostics of a model as they are, everything else after `error:`."""
    if isinstance(error, ModelError):
        return str(error)
    if isinstance(error, OSError) and error.filename is not None:
        return f"error: {error.filename}: {error.strerror}"
    return f"error: {error}"


def describe_error(error: Exception) -> dict[str, Any]:
    """An error for machines."""
    row: dict[str, Any] = {"kind": type(error).__name__, "message": str(error)}
    if isinstance(error, ModelError):
        row["diagnostics"] = [asdict(each) for each in error.diagnostics]
    elif isinstance(error, OSError):
        row["path"] = error.filename
    elif getattr(error, "path", None) is not None:
        row["path"] = getattr(error, "path", None)
        row["line"] = getattr(error, "line", None)
    return row


def print_json(value: Any) -> None:
    """One JSON object on stdout."""
    sys.stdout.write(json.dumps(plain(value), indent=2, allow_nan=False) + "\n")


def plain(value: Any) -> Any:
    """A value in JSON's types; numbers that are not finite become null."""
    if isinstance(value, dict):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def table(title: str, columns: str, rows: Iterable[Sequence[Any]]) -> Group:
    """A table; ``columns`` are parted by ``|``; those that end in ``<`` are words, else numbers."""
    result = Table(box=box.SIMPLE_HEAD)
    for name in columns.split("|"):
        words = name.endswith("<")
        result.add_column(
            Text(name.rstrip("<")), justify="left" if words else "right", overflow="fold"
        )
    for row in rows:
        result.add_row(*(Text(str(each)) for each in row))
    # A title of the table's own would wrap at its width.
    return Group(Text(title, style="bold"), result)


def whole(number: int) -> str:
    """A count with thousands set apart."""
    return f"{number:,}"


def duration_text(seconds: float) -> str:
    """A duration in the unit that suits it."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e6:.3g} µs"


def volume_text(cubic_meters: float) -> str:
    """A volume in the unit that suits it."""
    for unit, size in (("m³", 1.0), ("cm³", 1e-6)):
        if abs(cubic_meters) >= size:
            return f"{cubic_meters / size:.4g} {unit}"
    return f"{cubic_meters * 1e9:.4g} mm³"


def numbers_text(values: Iterable[float]) -> str:
    """Numbers as the model language writes them."""
    return ",".join(f"{value + 0.0:.4g}" for value in values)


def percent_text(fraction: float) -> str:
    """A fraction in percent, three digits."""
    return f"{100 * fraction:.3g} %"


def parse_seconds(text: str) -> float:
    """Seconds from a decimal or a fraction such as 1/60; positive."""
    try:
        value = float(Fraction(text))
    except (ValueError, ZeroDivisionError, OverflowError):
        raise typer.BadParameter(f"expected seconds such as 0.01 or 1/60, got {text!r}") from None
    if value <= 0:
        raise typer.BadParameter(f"expected a positive number of seconds, got {text!r}")
    return value
