"""Reads back what a run wrote: the index, and frames in our form of VTK's XML files."""

from __future__ import annotations

import base64
import json
import xml.etree.ElementTree as ET
import zlib
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from palpate.errors import PalpateError

_TYPES = {"Float32": "f4", "Float64": "f8", "Int32": "i4", "Int64": "i8", "UInt8": "u1"}


class RecordingError(PalpateError, ValueError):
    """A folder or file that is not a run that palpate wrote."""


def read_series(folder: Path) -> list[tuple[float, Path]]:
    """Times [s] and frame files of a run, from its ``simulation.pvd``."""
    index = folder / "simulation.pvd"
    try:
        root = ET.fromstring(index.read_text("utf-8"))
        frames = [
            (float(each.attrib["timestep"]), folder / each.attrib["file"])
            for each in root.iter("DataSet")
        ]
    except (ET.ParseError, KeyError, UnicodeDecodeError, ValueError) as error:
        raise RecordingError(f"{index}: not an index of frames: {error}") from None
    if not frames:
        raise RecordingError(f"{index}: it names no frame")
    return frames


def read_report(folder: Path) -> dict[str, Any]:
    """What ``report.json`` says; empty while the run has not ended."""
    try:
        report = json.loads((folder / "report.json").read_text("utf-8"))
    except FileNotFoundError:
        return {}
    except ValueError as error:
        raise RecordingError(f"{folder / 'report.json'}: {error}") from None
    return report if isinstance(report, dict) else {}


def read_frame(path: Path, names: Collection[str]) -> dict[str, npt.NDArray[Any]]:
    """The named arrays of a frame; those that it does not have are left out."""
    try:
        root = ET.fromstring(path.read_bytes())
        order = "<" if root.attrib["byte_order"] == "LittleEndian" else ">"
        if root.attrib["compressor"] != "vtkZLibDataCompressor":
            raise KeyError("compressor")
        return {
            each.attrib["Name"]: _decoded(each, order)
            for each in root.iter("DataArray")
            if each.attrib.get("Name") in names
        }
    except (ET.ParseError, KeyError, ValueError, IndexError, zlib.error) as error:
        raise RecordingError(f"{path}: not a frame that palpate wrote: {error!r}") from None


def _decoded(element: ET.Element, order: str) -> npt.NDArray[Any]:
    text = "".join((element.text or "").split())
    dtype = np.dtype(order + _TYPES[element.attrib["type"]])
    # Block count, two sizes and the compressed size of each block, in base64 with padding of its
    # own; then the blocks.
    words = np.dtype(order + "u8")
    count = int(np.frombuffer(base64.b64decode(text[:12]), words, 1)[0])
    end = 4 * -(-8 * (3 + count) // 3)
    sizes = np.frombuffer(base64.b64decode(text[:end]), words, 3 + count)[3:].tolist()
    raw = base64.b64decode(text[end:])
    starts = np.cumsum([0, *sizes]).tolist()
    blocks = [zlib.decompress(raw[at : at + size]) for at, size in zip(starts, sizes, strict=False)]
    values = np.frombuffer(b"".join(blocks), dtype)
    columns = int(element.attrib.get("NumberOfComponents", "1"))
    return values if columns == 1 else values.reshape(-1, columns)
