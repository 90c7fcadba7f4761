"""A film as one HTML file: the page, its modules and the frames, for any browser, offline."""

from __future__ import annotations

import gzip
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from palpate.results.atomic import write_bytes
from palpate.viewer.page import single_page
from palpate.viewer.player import Player, Wishes
from palpate.viewer.protocol import PROTOCOL, Arrays, decode, encode, finite

_Fields = dict[str, tuple[float, npt.NDArray[np.uint8]]]

#: Whole steps across the scene: a scene of a metre is kept to 15 micrometres.
_STEPS = 65535
#: What can be told by colours beside the displacement, which the page finds itself.
_FIELDS = ("stress", "depth", "force")
#: Steps from 0 to a frame's largest value, as many as there are colours.
_SHADES = 255


def export_film(player: Player, path: Path, *, count: int | None, title: str) -> int:
    """Write what ``player`` plays, ``count`` steps of it or all; returns the number of frames."""
    scenes: dict[int, bytes] = {}
    frames: list[tuple[dict[str, Any], npt.NDArray[np.float32], _Fields]] = []
    told = [each for each in _FIELDS if each in player.hello()["fields"]]
    for header, arrays, scene in _played(player, count, told):
        scenes.setdefault(header["version"], scene)
        fields = {name: _shades(arrays[f"field/{name}"]) for name in told}
        frames.append((header, arrays["positions"], fields))
    cloud = np.concatenate([[each.min(axis=0), each.max(axis=0)] for _, each, _ in frames])
    low = cloud.min(axis=0).astype(np.float64)
    step = np.maximum(cloud.max(axis=0) - low, 1e-9) / _STEPS
    times = [header["time"] for header, *_ in frames]
    hello = {"protocol": PROTOCOL, "mode": "recording", "title": title, "times": times}
    shown = {"features": ["reset"], "fields": ["displacement", *told]}
    messages = [encode("hello", finite({**hello, **shown})), *scenes.values()]
    before: npt.NDArray[np.uint16] | None = None
    quantised = {"low": low.tolist(), "step": step.tolist()}
    for number, (header, positions, fields) in enumerate(frames):
        whole = np.clip(np.rint((positions - low) / step), 0, _STEPS).astype(np.uint16)
        # Differences of neighbours in time, modulo 65536, compress better than places.
        same = before is not None and before.shape == whole.shape
        values = whole - before if same and before is not None else whole
        high = {name: high for name, (high, _) in fields.items()}
        fresh = {"frame": number, "quantised": {**quantised, "difference": same, "high": high}}
        shades = {f"field/{name}": shades for name, (_, shades) in fields.items()}
        messages.append(encode("frame", {**header, **fresh}, {"positions": values, **shades}))
        before = whole
    packed = b"".join(len(each).to_bytes(4, "little") + each for each in messages)
    page = single_page(gzip.compress(packed, 6), title)
    write_bytes(path, page.encode("utf-8"))
    return len(frames)


def _shades(values: npt.NDArray[np.float32]) -> tuple[float, npt.NDArray[np.uint8]]:
    """Values as parts of the largest one, and that."""
    high = float(values.max(initial=0.0))
    return high, np.rint(values * (_SHADES / (high or 1.0))).astype(np.uint8)


def _played(
    player: Player, count: int | None, fields: list[str]
) -> Iterator[tuple[dict[str, Any], Arrays, bytes]]:
    """Header, positions with fields, and scene message of each moment."""
    scene = player.scene()
    done = 0
    while True:
        header, arrays = decode(player.frame(done, Wishes(frozenset(fields)), {}))
        kept = {name: header[name] for name in ("type", "version", "number", "time")}
        yield kept, arrays, scene
        if player.at_end or done == count:
            return
        player.advance()
        done += 1
        if player.changed():
            scene = player.scene()
