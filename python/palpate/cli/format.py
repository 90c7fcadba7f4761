"""`palpate format`: a model file in canonical form."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from palpate import _core
from palpate.cli.output import JsonOption, console, print_json
from palpate.model import find_model
from palpate.results.atomic import write_bytes

#: A quoted name, or the start of a comment.
_QUOTE_OR_COMMENT = re.compile(r'"(?:[^"]|"")*"|(//)')


def command(
    model: Annotated[str, typer.Argument(metavar="MODEL", help="A .bml file.", show_default=False)],
    check: Annotated[
        bool, typer.Option("--check", help="Only tell whether it is canonical: exit status 0 or 1.")
    ] = False,
    stdout: Annotated[
        bool, typer.Option("--stdout", help="Print the canonical form, leave the file.")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Rewrite even if comments are lost.")
    ] = False,
    json_output: JsonOption = False,
) -> None:
    """Rewrite a model file in canonical form: the same model, number for number.

    Comments are not kept, so a file that has some is rewritten only with --force.

    Example: palpate format scene.bml --check
    """
    if stdout and json_output:
        raise typer.BadParameter("give --stdout or --json")
    path = find_model(model)
    try:
        text = path.read_bytes().decode("utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: not UTF-8 text (byte {error.start})") from None
    canonical = _core.format_model(text, str(path))
    if stdout:
        sys.stdout.write(canonical)
        return
    rewrite = text != canonical and not check
    if rewrite:
        _rewrite(model, path, text, canonical, force=force)
    if json_output:
        print_json({"path": str(path), "canonical": text == canonical, "rewritten": rewrite})
    else:
        state = "rewritten" if rewrite else "canonical" if text == canonical else "not canonical"
        console().print(Text(f"{path}: {state}"))
    if check and text != canonical:
        raise typer.Exit(1)


def _rewrite(model: str, path: Path, text: str, canonical: str, *, force: bool) -> None:
    if not Path(model).exists():
        raise ValueError(f"{model} is a bundled model: print its canonical form with --stdout")
    if has_comments(text) and not force:
        raise ValueError(
            f"{path} has comments, which the canonical form does not keep; "
            "rewrite it with --force, or print it with --stdout"
        )
    write_bytes(path, canonical.encode("utf-8"))


def has_comments(text: str) -> bool:
    """Whether a model's text holds a comment; ``//`` in quotes is none."""
    return any(match.group(1) for match in _QUOTE_OR_COMMENT.finditer(text))
