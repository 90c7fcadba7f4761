"""Sphinx extension: appends to pages what can be read off the program.

Commands, their arguments and options to commands.md; the scripts in examples/ to examples.md;
public names that python.md does not place to its end.
"""

import ast
import inspect
import re
from pathlib import Path
from typing import Any

import typer
from sphinx.application import Sphinx

import palpate
from palpate.cli import app

HERE = Path(__file__).parent


def _commands(command: Any, path: str) -> list[tuple[str, Any]]:
    """Every command that does something, with the words that call it, in the order of --help."""
    if not hasattr(command, "commands"):
        return [(path, command)]
    return [
        each
        for name, part in command.commands.items()
        for each in _commands(part, f"{path} {name}")
    ]


def _prose(text: str) -> str:
    """A docstring in Markdown: its examples in one block."""
    text = inspect.cleandoc(text).replace("\\[", "[")  # escaped for the terminal
    examples = re.findall(r"^Example: (.*)$", text, re.MULTILINE)
    prose = re.sub(r"\n*^Example: .*$", "", text, flags=re.MULTILINE)
    prose = re.sub(r"--[a-z-]+", r"`\g<0>`", prose)
    return f"{prose}\n\n```sh\n" + "\n".join(examples) + "\n```\n"


def _usage(path: str, command: Any) -> str:
    arguments = [each for each in command.params if each.param_type_name == "argument"]
    words = []
    for each in arguments:
        name = each.metavar or each.name.upper()
        words.append(name if each.required else f"[{name}]" + "..." * (each.nargs == -1))
    return " ".join([path, "[OPTIONS]", *words])


def _row(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        names = f"`{parameter.metavar or parameter.name.upper()}`"
    else:
        names = ", ".join(f"`{each}`" for each in [*parameter.opts, *parameter.secondary_opts])
        if not parameter.is_flag:
            names += f" {parameter.metavar or parameter.name.upper()}"
    default = getattr(parameter.default, "value", parameter.default)  # of an enumeration
    shown = f"`{default}`" if isinstance(default, (int, float, str, Path)) else ""
    if isinstance(default, float):
        shown = f"`{default:.4g}`"
    if isinstance(default, bool):
        shown = ""
    text = " ".join((parameter.help or "").split()).replace("|", "\\|")
    text = re.sub(r"--[a-z-]+", r"`\g<0>`", text)
    return f"| {names} | {text} | {shown} |"


def commands(_page: str) -> str:
    """The commands in Markdown, a section each."""
    parts = []
    for path, command in _commands(typer.main.get_command(app), "palpate"):
        rows = [_row(each) for each in command.params]
        parts += [
            f"## {path}\n",
            f"```text\n{_usage(path, command)}\n```\n",
            _prose(command.help),
            "| argument, option | | default |\n| --- | --- | --- |",
            *rows,
            "",
        ]
    return "\n".join(parts)


def examples(_page: str) -> str:
    """The scripts in examples/, a section each."""
    parts = []
    for script in sorted((HERE.parent / "examples").glob("*.py")):
        about = ast.get_docstring(ast.parse(script.read_text()))
        if about is None:
            raise ValueError(f"{script} does not say what it is about")
        shown = f"{{literalinclude}} ../examples/{script.name}\n:language: python\n:lines: 2-"
        parts += [f"## {script.name}\n", f"{about}\n", f"```{shown}\n```\n"]
    return "\n".join(parts)


def names_left(page: str) -> str:
    """Public names that the page does not place."""
    placed = set(re.findall(r"^\.\. auto\w+:: (\w+)$", page, re.MULTILINE))
    left = [each for each in palpate.__all__ if each not in placed and not each.startswith("_")]
    if not left:
        return ""
    lines = [
        f".. auto{'class' if inspect.isclass(getattr(palpate, each)) else 'function'}:: {each}"
        for each in left
    ]
    return "## Others\n\n```{eval-rst}\n" + "\n".join(lines) + "\n```\n"


_ADDED = {"commands": commands, "examples": examples, "python": names_left}


def _append(_app: Sphinx, page: str, source: list[str]) -> None:
    if page in _ADDED:
        source[0] += "\n" + _ADDED[page](source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("source-read", _append)
    return {"parallel_read_safe": True}
