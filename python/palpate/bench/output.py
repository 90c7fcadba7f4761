"""Files of a benchmark: results.json, CSV, report.md; each whole or absent."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from palpate.bench import machine
from palpate.results.atomic import write_bytes


def write_json(path: Path, command: str, options: Mapping[str, Any], **content: Any) -> None:
    """Results with the machine, the date and the options that they were made with."""
    report = {
        "command": command,
        "machine": machine.describe(),
        "options": dict(options),
        **content,
    }
    text = json.dumps(report, indent=1, allow_nan=False) + "\n"
    write_bytes(path, text.encode("utf-8"))


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """A table with a heading; floats in full, columns in the order of the first row."""
    buffer = io.StringIO()
    writer = csv.DictWriter(buffer, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_bytes(path, buffer.getvalue().encode("utf-8"))


def write_text(path: Path, *paragraphs: str) -> None:
    """A Markdown file of paragraphs."""
    write_bytes(path, ("\n\n".join(part.strip("\n") for part in paragraphs) + "\n").encode("utf-8"))


def markdown_table(headings: str, rows: Iterable[Sequence[Any]]) -> str:
    """A table; ``headings`` are set apart by ``|``, a trailing ``<`` aligns left."""
    names = headings.split("|")
    lines = [
        "| " + " | ".join(name.removesuffix("<") for name in names) + " |",
        "| " + " | ".join("---" if name.endswith("<") else "---:" for name in names) + " |",
    ]
    return "\n".join(lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows])


def milliseconds(seconds: float) -> str:
    """A time in milliseconds with three digits that mean something."""
    value = seconds * 1e3
    if value < 0.01:
        return f"{value:.1g}" if value < 1e-4 else f"{value:.4f}"
    if value >= 100:
        return f"{value:,.0f}"
    return f"{value:.1f}" if value >= 10 else f"{value:.2f}" if value >= 1 else f"{value:.3f}"


def whole(number: float) -> str:
    """A count with its thousands set apart."""
    return f"{number:,.0f}"
