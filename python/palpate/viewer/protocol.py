"""What the server and the page say to each other; `page/protocol.js` is the twin.

Server to page: binary messages. Four bytes, little-endian: the length of a JSON header, which is
padded with blanks so that what follows is aligned to four; then the arrays that the header lists as
``"arrays": [[name, dtype, shape], ...]``, little-endian, each padded with zeros to four bytes.
``"type"`` is one of

``hello``
    Who speaks: ``protocol``, ``mode`` (``live``, ``recording``), ``title``, ``features`` (what the
    page may offer), ``duration`` and ``times`` of a recording.
``scene``
    Topology, sent when it changes: ``version``, ``bodies`` (name, look, settings, counts), ``up``,
    ``bounds``; for body i the arrays ``rest/i`` (n, 3) [m] float32, its surface nodes where they
    started, ``triangles/i`` (m, 3) uint32, rows of them, and where a blade went through it
    ``cut/i`` (m,) uint8, 1 for the surface that it made.
``state``
    What the controls show: ``playing``, ``speed``, ``time_step``, ``gravity``, ``undo``, ...
``frame``
    ``version`` of the scene it belongs to, ``number``, ``time`` [s], ``numbers`` (rates, times per
    stage, counts), ``pulls``, ``tool``; arrays ``positions`` (N, 3) float32 of all bodies' surface
    nodes in the order of the scene, and on request ``field/NAME`` (N,), ``contact_points``,
    ``contact_normals`` (k, 3), ``contact_forces`` (k,), ``touching`` (t,) uint32, triangles of all
    bodies in order, ``boxes/LEVEL`` (k, 6), low and high corner of the bounding trees' boxes, and
    ``box_counts/LEVEL``, how many of them each body has.
``notice``, ``problem``
    ``text`` for the user; a problem has a ``title``, and stays until the next ``scene``.

Page to server: JSON text, one command per message, checked by `parse_command`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

#: Raised when a change makes old pages misunderstand new servers.
PROTOCOL = 1

#: Fields of a frame that a page may ask for.
FIELDS = ("displacement", "deformation", "strain", "stress", "depth", "force")

#: Deepest level of the bounding trees that a page may ask for.
DEEPEST = 16

Command: TypeAlias = dict[str, Any]
Arrays: TypeAlias = Mapping[str, npt.NDArray[Any]]

_DTYPES = {"float32": "<f4", "uint32": "<u4", "uint16": "<u2", "uint8": "|u1"}
#: Longest stroke of a cut, in samples of the pointer.
_STROKE = 4096


class ProtocolError(ValueError):
    """A message that is not one of ours; the text says what is wrong."""


def encode(kind: str, header: Mapping[str, Any], arrays: Arrays | None = None) -> bytes:
    """A message to the page."""
    parts: list[bytes] = []
    listed = []
    for name, values in (arrays or {}).items():
        data = np.ascontiguousarray(values, dtype=_DTYPES[values.dtype.name])
        listed.append([name, values.dtype.name, list(values.shape)])
        parts.append(data.tobytes())
        parts.append(b"\0" * (-data.nbytes % 4))
    text = json.dumps(
        {"type": kind, **header, "arrays": listed}, separators=(",", ":"), allow_nan=False
    ).encode()
    text += b" " * (-len(text) % 4)
    return b"".join([len(text).to_bytes(4, "little"), text, *parts])


def decode(message: bytes) -> tuple[dict[str, Any], dict[str, npt.NDArray[Any]]]:
    """Header and arrays of a message; the inverse of `encode`."""
    if len(message) < 4:
        raise ProtocolError("shorter than its length")
    at = 4 + int.from_bytes(message[:4], "little")
    try:
        header = json.loads(message[4:at])
        listed = header["arrays"]
        arrays = {}
        for name, dtype, shape in listed:
            count = math.prod(shape)
            values = np.frombuffer(message, _DTYPES[dtype], count, at)
            arrays[name] = values.reshape(shape)
            at += values.nbytes + -values.nbytes % 4
    except (ValueError, KeyError, TypeError) as error:
        raise ProtocolError(f"not a message: {error}") from None
    return header, arrays


def box_arrays(
    level: int, boxes: Sequence[npt.NDArray[np.floating]]
) -> dict[str, npt.NDArray[Any]]:
    """A frame's arrays of the boxes (k, 2, 3) of each body at a level of its tree."""
    counts = [len(each) for each in boxes]
    return {
        f"boxes/{level}": np.concatenate(boxes).reshape(-1, 6).astype(np.float32),
        f"box_counts/{level}": np.array(counts, dtype=np.uint32),
    }


def finite(value: Any) -> Any:
    """JSON's types with null for numbers that are not finite."""
    if isinstance(value, dict):
        return {key: finite(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def parse_command(text: str | bytes) -> Command:
    """A command from a page, complete and with finite numbers of the right kind.

    Raises
    ------
    ProtocolError
        For anything else.
    """
    try:
        raw = json.loads(text)
    except (ValueError, RecursionError):
        raise ProtocolError("not JSON") from None
    if not isinstance(raw, dict) or not isinstance(raw.get("type"), str):
        raise ProtocolError("expected an object with a type")
    kind = raw["type"]
    if kind not in _COMMANDS:
        raise ProtocolError(f"no command is named {kind[:40]!r}")
    command: Command = {"type": kind}
    for name, check in _COMMANDS[kind].items():
        try:
            command[name] = check(raw.get(name))
        except ProtocolError as error:
            raise ProtocolError(f"{kind}: {name}: {error}") from None
    return command


def _number(low: float = -1e12, high: float = 1e12) -> Callable[[Any], float]:
    def check(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ProtocolError("expected a number")
        if not low <= value <= high:  # also refuses NaN
            raise ProtocolError(f"expected a number from {low:g} to {high:g}")
        return float(value)

    return check


def _whole(low: int, high: int) -> Callable[[Any], int]:
    def check(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise ProtocolError(f"expected a whole number from {low} to {high}")
        return value

    return check


def _boolean(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ProtocolError("expected true or false")
    return value


def _vector(value: Any) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise ProtocolError("expected three numbers")
    number = _number(-1e6, 1e6)
    return number(value[0]), number(value[1]), number(value[2])


def _optional(check: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda value: None if value is None else check(value)


def _choice(*allowed: str) -> Callable[[Any], str]:
    def check(value: Any) -> str:
        if not isinstance(value, str) or value not in allowed:
            raise ProtocolError(f"expected one of {', '.join(allowed)}")
        return value

    return check


def _edges(value: Any) -> list[list[tuple[float, float, float]]]:
    """The blade's edge at each moment: its two ends."""
    if not isinstance(value, list) or not 2 <= len(value) <= _STROKE:
        raise ProtocolError(f"expected 2 to {_STROKE} edges")
    edges = []
    for edge in value:
        if not isinstance(edge, list) or len(edge) != 2:
            raise ProtocolError("expected two ends per edge")
        edges.append([_vector(edge[0]), _vector(edge[1])])
    return edges


_MATERIAL = {
    "young": _number(1e-3, 1e12),
    "poisson": _number(-0.99, 0.499),
    "density": _number(1e-3, 1e6),
    "damping": _number(0, 100),
}
_CONTACT = {
    "friction": _number(0, 100),
    "distance": _optional(_number(1e-9, 1e3)),
    "stiffness": _optional(_number(1e-6, 1e15)),
    "self_contact": _boolean,
}


def _part(checks: Mapping[str, Callable[[Any], Any]]) -> Callable[[Any], dict[str, Any]]:
    """Some of the named values."""

    def check(value: Any) -> dict[str, Any]:
        if value is None:
            return {}
        if not isinstance(value, dict):
            raise ProtocolError("expected an object")
        unknown = [name for name in value if name not in checks]
        if unknown:
            raise ProtocolError(f"nothing is named {str(unknown[0])[:40]!r}")
        result = {}
        for name, each in value.items():
            try:
                result[name] = checks[name](each)
            except ProtocolError as error:
                raise ProtocolError(f"{name}: {error}") from None
        return result

    return check


_BODY = _whole(0, 1_000_000)
_GRIP = _whole(0, 2**53)

_COMMANDS: dict[str, dict[str, Callable[[Any], Any]]] = {
    "ack": {"number": _whole(0, 2**53)},
    "play": {"on": _boolean},
    "step": {"count": _whole(1, 1000)},
    "reset": {},
    "reload": {},
    "undo": {},
    "separate": {},
    "speed": {"value": _optional(_number(1e-3, 1e3))},  # null: as fast as it goes
    "seek": {"frame": _whole(0, 2**31)},
    "show": {
        "field": _optional(_choice(*FIELDS)),
        "contacts": _boolean,
        "touching": _boolean,
        "level": _optional(_whole(0, DEEPEST)),
    },
    "grab": {
        "grip": _GRIP,
        "body": _BODY,
        "node": _whole(0, 2**31),
        "target": _vector,
        "strength": _number(1e-3, 1e3),
        "radius": _optional(_number(0, 1e3)),  # null: that node alone
    },
    "drag": {"grip": _GRIP, "target": _vector},
    "release": {"grip": _GRIP},
    "tool": {"tip": _vector, "direction": _vector, "radius": _number(1e-6, 1e3)},
    "tool_away": {},
    "cut": {"edges": _edges},
    "settings": {
        "time_step": _optional(_number(1e-6, 1.0)),
        "gravity": _optional(_vector),
        "body": _optional(_BODY),
        "material": _part(_MATERIAL),
        "contact": _part(_CONTACT),
    },
}
