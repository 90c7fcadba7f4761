"""The loop of `palpate simulate`: step, write frames, stop on Ctrl-C."""

from __future__ import annotations

import json
import platform
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from palpate import _core
from palpate.cli.output import console, plain
from palpate.cutting import Stroke
from palpate.errors import SimulationError
from palpate.results.album import PICTURES, Album
from palpate.results.atomic import remove_leftovers, write_bytes
from palpate.results.drawing import looks_of, upward
from palpate.results.frames import FrameSeries
from palpate.results.record import Record
from palpate.simulation import Simulation

#: Seconds between two checkpoints of a run that saves them.
_CHECKPOINT_INTERVAL = 60.0


@dataclass(frozen=True)
class RunOptions:
    """What the user asked for."""

    model: str | None
    steps: int
    every: int
    threads: int
    leaf_size: int | None
    method: str | None
    checkpoint: bool
    pictures: bool
    cut: str | None = None
    substeps: str = "1"


class Run:
    """One run into one folder; ``files`` are those written, by what they are."""

    def __init__(
        self,
        simulation: Simulation,
        folder: Path,
        options: RunOptions,
        *,
        quiet: bool,
        strokes: Sequence[Stroke] = (),
    ) -> None:
        self._simulation = simulation
        self._folder = folder
        self._options = options
        self._quiet = quiet
        self._waiting = list(strokes)
        self._cuts: list[dict[str, Any]] = []
        self.files: dict[str, Path] = {}
        folder.mkdir(parents=True, exist_ok=True)
        pictures = [folder / "pictures" / f"{name}.png" for name in PICTURES]
        for old in [folder / "report.json", *pictures]:
            old.unlink(missing_ok=True)
        remove_leftovers(folder, "report.json")
        for old in folder.glob("checkpoint.palpate.*.part"):
            old.unlink(missing_ok=True)
        self._saved = time.monotonic()

    def go(self) -> dict[str, Any]:
        """Step to the end or to Ctrl-C and write everything; returns the report."""
        simulation, options = self._simulation, self._options
        record = Record(simulation)
        frames = FrameSeries(self._folder, simulation)
        album = Album(simulation)
        started, start_time = time.perf_counter(), simulation.time
        frames.add(simulation)
        album.add(simulation)
        failure = None
        with _stop_signal() as stop, _progress(options.steps, quiet=self._quiet) as advance:
            for step in range(1, options.steps + 1):
                try:
                    self._cut(step - 1)
                    record.add(simulation.step(), simulation)
                except SimulationError as error:
                    failure = str(error)
                    break
                album.add(simulation)
                if step % options.every == 0:
                    record.observe(simulation)
                    frames.add(simulation)
                advance()
                if stop:
                    break
                if options.checkpoint and time.monotonic() - self._saved > _CHECKPOINT_INTERVAL:
                    self._save()
            if len(record) % options.every:
                record.observe(simulation)
                frames.add(simulation)
            # A second Ctrl-C while these are written must not cut them off.
            frames.finish()
            self.files["frames"] = frames.index
            if options.checkpoint:
                self._save()
            report = {
                "model": options.model,
                "options": {**asdict(options), "time_step": simulation.time_step},
                "versions": versions(),
                "interrupted": bool(stop) and len(record) < options.steps,
                "failure": failure,
                "start_time": start_time,
                "end_time": simulation.time,
                "wall_time": time.perf_counter() - started,
                "frame_count": len(frames),
                "cuts": self._cuts,
                "scene": {
                    "up": upward(simulation.model.gravity),
                    "bodies": [asdict(look) for look in looks_of(simulation.model.bodies)],
                },
                **record.summary(),
            }
            self.files["report"] = self._folder / "report.json"
            text = json.dumps(plain(report), indent=1, allow_nan=False) + "\n"
            write_bytes(self.files["report"], text.encode("utf-8"))
            if options.pictures:
                self.files["pictures"] = album.write(self._folder / "pictures")[-1]
        return report

    def _save(self) -> None:
        self.files["checkpoint"] = self._folder / "checkpoint.palpate"
        self._simulation.save(self.files["checkpoint"])
        self._saved = time.monotonic()

    def _cut(self, step: int) -> None:
        """Make the strokes whose turn it is before this step, counted from 0."""
        now = self._simulation.time + 1e-9 * self._simulation.time_step

        def is_due(stroke: Stroke) -> bool:
            return step >= stroke.step if stroke.step is not None else now >= (stroke.time or 0.0)

        due = [stroke for stroke in self._waiting if is_due(stroke)]
        self._waiting = [stroke for stroke in self._waiting if not is_due(stroke)]
        for stroke in due:
            report = self._simulation.cut(stroke.blade)
            bodies = self._simulation.model.bodies
            self._cuts.append(
                {
                    "line": stroke.line,
                    "step": step,
                    "time": self._simulation.time,
                    "seconds": report.times,
                    "bodies": [
                        {
                            "name": bodies[each.body].name,
                            "new_nodes": each.new_nodes,
                            "new_tetrahedra": each.new_tetrahedra,
                            "pieces": each.pieces,
                            "cut_area": each.cut_area,
                            "smallest_quality": each.smallest_quality,
                        }
                        for each in report.bodies
                    ],
                }
            )


def versions() -> dict[str, str]:
    """What the results were made with."""
    return {
        "palpate": _core.__version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "platform": platform.platform(),
    }


@contextmanager
def _stop_signal() -> Iterator[list[int]]:
    """A list that is empty until Ctrl-C; the step under way is finished first."""
    caught: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _frame: caught.append(number))
    try:
        yield caught
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _progress(steps: int, *, quiet: bool) -> Iterator[Any]:
    """A function to call after each step: moves a bar on a terminal, else does nothing."""
    if quiet or not sys.stderr.isatty():
        yield lambda: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    columns = (BarColumn(), MofNCompleteColumn(), "steps", TimeRemainingColumn())
    with Progress(*columns, console=console(error=True), transient=True) as progress:
        task = progress.add_task("", total=steps)
        yield lambda: progress.advance(task)
