"""Real time: whole frames of a simulation, contact and friction included.

A frame is 1/60 s of simulated time. Three situations: bodies that ``land`` on each other, the pile
at ``rest``, and a body ``pulled`` about in the pile by a spring. Every run is a process of its own,
which tells its peak of memory.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from palpate.bench import tool_loop
from palpate.bench.output import (
    markdown_table,
    milliseconds,
    whole,
    write_csv,
    write_json,
    write_text,
)
from palpate.bench.refine import refine
from palpate.model import Material, Model, read_model
from palpate.results.measures import mean_edge, signed_volumes
from palpate.simulation import Simulation

#: Frames of landing, until all is at rest, and of each of the other situations.
LANDING, REST, PULLED = 120, 60, 90

#: How far [m], how often [1/s] and how stiffly [N/m] the pulled node's target goes round.
_PULL_RADIUS, _PULL_RATE, _PULL_STIFFNESS = 0.02, 0.5, 30.0


@dataclass(frozen=True)
class Situation:
    """Frame times [s] of one situation: spread, and the mean by stage."""

    name: str
    frames: int
    median: float
    p90: float
    worst: float
    mean: float
    stages: dict[str, float]
    contacts: float


@dataclass(frozen=True)
class Outcome:
    """One model, law and number of threads."""

    model: str
    law: str
    threads: int
    nodes: int
    tetrahedra: int
    situations: list[Situation]
    #: Peak of the process [bytes], Python and all libraries included.
    peak_memory: int
    start_time: float
    factor_bytes: int
    #: Time [s] to read all factors twice, forward and backward, at the measured bandwidth.
    floor: float
    inverted: int
    deepest: float
    deepest_at_end: float
    mean_edge: float
    speed_at_end: float
    #: A tool's loop at 1 kHz while the pile is stepped; None if it was not measured.
    loop: tool_loop.LoopOutcome | None = None


def with_law(model: Model, law: str) -> Model:
    """The model with one law for all deformable bodies; ``as written`` leaves it as it is."""
    if law == "as written":
        return model

    def changed(material: Material) -> Material:
        return replace(material, law=law)

    bodies = [
        replace(
            body,
            material=changed(body.material),
            regions={number: changed(each) for number, each in body.regions.items()},
        )
        for body in model.bodies
    ]
    return Model(bodies, gravity=model.gravity, attachments=model.attachments)


def refined(model: Model, divisions: int) -> Model:
    """The model with every edge of its deformable bodies in ``divisions`` parts."""
    bodies = [
        body if body.rigid is not None else replace(body, mesh=refine(body.mesh, divisions))
        for body in model.bodies
    ]
    return Model(bodies, gravity=model.gravity)


def bandwidth(size: int) -> float:
    """Bytes per second that one thread reads of ``size`` bytes, again and again; best of 9."""
    data = np.ones(max(size, 1 << 16) // 4, dtype=np.float32)
    best = np.inf
    for _ in range(9):
        start = time.perf_counter()
        data.max()
        best = min(best, time.perf_counter() - start)
    return data.nbytes / best


def measure(name: str, model: Model, law: str, threads: int, frames: Sequence[int]) -> Outcome:
    """Run the three situations, one after the other, in this process."""
    model = with_law(model, law)
    start = time.perf_counter()
    simulation = Simulation(model, threads=threads)
    start_time = time.perf_counter() - start
    soft = [index for index, body in enumerate(model.bodies) if body.rigid is None]
    deepest = [0.0]

    def play(
        situation: str, count: int, before: Callable[[int], None] = lambda _: None
    ) -> Situation:
        times, stages, contacts = [], dict[str, float](), []
        for frame in range(count):
            before(frame)
            report = simulation.step()
            times.append(report.times["total"])
            contacts.append(report.contacts)
            deepest.append(report.max_depth)
            for stage, seconds in report.stages.items():
                stages[stage] = stages.get(stage, 0.0) + seconds / count
        median, p90 = np.percentile(times, [50, 90]).tolist()
        mean = sum(times) / count
        return Situation(
            situation, count, median, p90, max(times), mean, stages, sum(contacts) / count
        )

    situations = []
    landing, rest, pulled = frames
    if landing:
        situations.append(play("landing", landing))
    if rest:
        situations.append(play("at rest", rest))
    at_rest = deepest[-1]
    if pulled:
        # The highest node of the last body: nothing lies on it.
        body = soft[-1]
        node = int(simulation.positions[body][:, 2].argmax())
        home = simulation.positions[body][node].copy()
        pull = simulation.pull(body, node, home, _PULL_STIFFNESS)

        def lead(frame: int) -> None:
            angle = 2 * np.pi * _PULL_RATE * simulation.time_step * frame
            away = [np.sin(angle), 0.0, 1.0 - np.cos(angle)]
            pull.target = home + _PULL_RADIUS * np.array(away)

        situations.append(play("pulled", pulled, lead))
    factors = sum(simulation.factor_bytes)
    speed = max(float(np.abs(simulation.velocities[index]).max()) for index in soft)
    edges = [mean_edge(model.bodies[index].mesh) for index in soft]
    inverted = sum(
        int(
            (
                signed_volumes(simulation.positions[index], model.bodies[index].mesh.tetrahedra)
                <= 0
            ).sum()
        )
        for index in soft
    )
    return Outcome(
        model=name,
        law=law,
        threads=threads,
        nodes=sum(len(model.bodies[index].mesh.nodes) for index in soft),
        tetrahedra=sum(len(model.bodies[index].mesh.tetrahedra) for index in soft),
        situations=situations,
        peak_memory=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        start_time=start_time,
        factor_bytes=factors,
        floor=2 * factors / bandwidth(factors),
        inverted=inverted,
        deepest=max(deepest),
        deepest_at_end=at_rest,
        mean_edge=min(edges),
        speed_at_end=speed,
    )


def run(
    models: Sequence[tuple[str, str, int]],
    folder: Path,
    *,
    laws: Sequence[str],
    threads: Sequence[int],
    frames: Sequence[int] = (LANDING, REST, PULLED),
    loop: float = 0.0,
    advance: Callable[[], None] = lambda: None,
) -> list[Outcome]:
    """Measure every model (name, path, divisions) in processes of their own; write the report.

    ``loop``: seconds for which a tool's loop is measured, at 1 kHz of real time; 0 for none.
    """
    outcomes = []
    for name, path, divisions in models:
        for law in laws:
            for count in threads:
                outcomes.append(_in_process(name, path, divisions, law, count, frames, loop))
                advance()
    folder.mkdir(parents=True, exist_ok=True)
    options = {
        "laws": list(laws),
        "threads": list(threads),
        "frames": list(frames),
        "loop": loop,
    }
    write_json(
        folder / "results.json",
        "bench realtime",
        options,
        outcomes=[asdict(each) for each in outcomes],
    )
    write_csv(folder / "realtime.csv", [row for each in outcomes for row in _flat(each)])
    write_text(folder / "report.md", *_report(outcomes))
    return outcomes


def _in_process(
    name: str,
    path: str,
    divisions: int,
    law: str,
    threads: int,
    frames: Sequence[int],
    loop: float,
) -> Outcome:
    task = json.dumps([name, path, divisions, law, threads, list(frames), loop])
    command = [sys.executable, "-m", "palpate.bench.realtime", task]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        last = done.stderr.strip().splitlines()[-1:] or ["no message"]
        raise RuntimeError(f"{name}, {law}, {threads} threads: {last[0]}")
    values = json.loads(done.stdout)
    values["situations"] = [Situation(**each) for each in values["situations"]]
    if values["loop"] is not None:
        values["loop"] = tool_loop.LoopOutcome(**values["loop"])
    return Outcome(**values)


def rate(seconds: float) -> str:
    """Frames per second."""
    return whole(round(1 / seconds)) if seconds > 0 else "-"


def _flat(outcome: Outcome) -> list[dict[str, Any]]:
    left_out = ("situations", "loop")
    own = {key: value for key, value in asdict(outcome).items() if key not in left_out}
    return [
        {**own, **{key: value for key, value in asdict(each).items() if key != "stages"}}
        | {f"stage_{stage}": seconds for stage, seconds in each.stages.items()}
        for each in outcome.situations
    ]


def _report(outcomes: Sequence[Outcome]) -> list[str]:
    rows = []
    for each in outcomes:
        for situation in each.situations:
            rows.append(
                (
                    each.model,
                    whole(each.nodes),
                    each.law,
                    each.threads,
                    situation.name,
                    milliseconds(situation.median),
                    milliseconds(situation.p90),
                    milliseconds(situation.worst),
                    rate(situation.median),
                    rate(situation.mean),
                    round(situation.contacts),
                    f"{situation.median / each.floor:.0f}",
                )
            )
    frames = markdown_table(
        "model<|nodes|law<|threads|situation<|median ms|90 % ms|worst ms|frames/s median"
        "|frames/s mean|contacts|x factor",
        rows,
    )
    bodies = markdown_table(
        "model<|law<|threads|start s|memory MB|factor MB|inverted|deepest ever mm"
        "|deepest at rest, of the edge|speed at end mm/s",
        [
            (
                each.model,
                each.law,
                each.threads,
                f"{each.start_time:.2f}",
                f"{each.peak_memory / 1e6:.0f}",
                f"{each.factor_bytes / 1e6:.1f}",
                each.inverted,
                f"{1e3 * each.deepest:.2f}",
                f"{100 * each.deepest_at_end / each.mean_edge:.1f} %",
                f"{1e3 * each.speed_at_end:.2f}",
            )
            for each in outcomes
        ],
    )
    stage_names = list(outcomes[0].situations[0].stages) if outcomes else []
    stages = markdown_table(
        "|".join(["model<", "law<", "threads", "situation<", *stage_names]),
        [
            (
                each.model,
                each.law,
                each.threads,
                situation.name,
                *(milliseconds(situation.stages[stage]) for stage in stage_names),
            )
            for each in outcomes
            for situation in each.situations
        ],
    )
    loops = markdown_table(
        "model<|law<|threads|ticks/s|median ms|99 % ms|worst ms|late 99 % ms|steps/s|step ms"
        "|contacts|force N|jump 99 % N",
        [
            (
                each.model,
                each.law,
                each.threads,
                whole(round(each.loop.ticks / each.loop.seconds)),
                *(
                    milliseconds(seconds)
                    for seconds in (
                        each.loop.median,
                        each.loop.p99,
                        each.loop.worst,
                        each.loop.late,
                    )
                ),
                whole(round(each.loop.steps / each.loop.seconds)),
                milliseconds(each.loop.step_median),
                f"{each.loop.contacts:.1f}",
                f"{each.loop.force:.3f}",
                f"{each.loop.jump:.3f}",
            )
            for each in outcomes
            if each.loop is not None
        ],
    )
    loop_part = [
        "Tool loop: a ball of 16 mm presses on the last body and rubs it, 1,000 ticks a second "
        "being asked for, while another thread takes 60 steps a second. Time of a tick as its "
        "caller sees it, how late ticks began, steps meanwhile, mean force and its change from "
        "tick to tick:",
        loops,
    ]
    return [
        "# Real time",
        "A frame is 1/60 s of simulated time: detection, contact, friction and the state after it. "
        "`x factor` is the median over the time to read all factored matrices twice, as one solve "
        "does: no frame can be faster than that.",
        frames,
        bodies,
        *(loop_part if any(each.loop is not None for each in outcomes) else []),
        "Mean time of a frame by stage [ms]:",
        stages,
    ]


def main() -> None:
    """Measure what the only argument says, and print it."""
    name, path, divisions, law, threads, frames, loop = json.loads(sys.argv[1])
    model = read_model(path)
    if divisions > 1:
        model = refined(model, divisions)
    outcome = measure(name, model, law, threads, frames)
    if loop:
        felt = tool_loop.measure(with_law(model, law), threads, loop)
        outcome = replace(outcome, loop=felt)
    print(json.dumps(asdict(outcome)))


if __name__ == "__main__":
    main()
