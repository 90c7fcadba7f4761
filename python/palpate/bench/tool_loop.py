"""A tool's loop at 1 kHz on a pile at rest, while another thread takes the steps in real time."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from palpate.mesh import Mesh
from palpate.model import Body, Model
from palpate.simulation import Simulation

#: Ticks per second that are asked for.
RATE = 1000

#: The tool is a ball of this radius [m]: it comes down to ``_DEPTH`` [m] below the highest place of
#: the last body and goes to and fro there, by ``_STROKE`` [m], ``_STROKES`` times a second.
_RADIUS, _DEPTH, _STROKE, _STROKES = 8e-3, 4e-3, 6e-3, 0.7

#: Frames until the pile is at rest.
_LANDING = 120


@dataclass(frozen=True)
class LoopOutcome:
    """Times [s] of ticks, as their caller sees them; forces [N]."""

    seconds: float
    ticks: int
    median: float
    p99: float
    worst: float
    #: How late ticks began, beyond which one in a hundred did.
    late: float
    steps: int
    step_median: float
    contacts: float
    #: Mean force, and its change from tick to tick beyond which one in a hundred was.
    force: float
    jump: float


def ball(radius: float, divisions: int = 3) -> Mesh:
    """A ball of ``8 * 4**divisions`` triangles around the origin."""
    axes: npt.NDArray[np.float64] = np.concatenate([np.eye(3), -np.eye(3)])
    upper = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2]]
    corners = axes[np.array(upper + [[b, a, 5] for a, b, _ in upper])]
    for _ in range(divisions):
        middles = corners + np.roll(corners, -1, axis=1)
        middles /= np.linalg.norm(middles, axis=2, keepdims=True)
        outer = [
            np.stack([corners[:, k], middles[:, k], middles[:, k - 1]], axis=1) for k in range(3)
        ]
        corners = np.concatenate([*outer, middles])
    points = corners.reshape(-1, 3).round(12)
    nodes, numbers = np.unique(points, axis=0, return_inverse=True)
    return Mesh(radius * nodes, triangles=numbers.reshape(-1, 3))


def measure(model: Model, threads: int, seconds: float) -> LoopOutcome:
    """Let a ball press on the last deformable body and rub it for some seconds of real time."""
    soft = [index for index, body in enumerate(model.bodies) if body.rigid is None]
    mesh = ball(_RADIUS)
    highest = max(float(body.mesh.nodes[:, 2].max()) for body in model.bodies)
    above = np.array([0.0, 0.0, highest + 10 * _RADIUS])
    tool = Body(Mesh(mesh.nodes + above, triangles=mesh.triangles), name="tool", rigid=())
    bodies = [*model.bodies, tool]
    simulation = Simulation(
        Model(bodies, gravity=model.gravity, attachments=model.attachments), threads=threads
    )
    simulation.step(_LANDING)
    positions = simulation.positions[soft[-1]]
    top = positions[positions[:, 2].argmax()]
    upright = np.eye(3)
    simulation.tool("tool").set_pose(upright, top - above + [0.0, 0.0, _RADIUS + _DEPTH])
    simulation.step(2)
    loop = simulation.tool("tool").loop()
    done = threading.Event()
    steps: list[float] = []

    def take_steps() -> None:
        while not done.is_set():
            began = time.perf_counter()
            simulation.step()
            steps.append(time.perf_counter() - began)
            time.sleep(max(0.0, simulation.time_step - steps[-1]))

    durations: list[float] = []
    late: list[float] = []
    forces: list[npt.NDArray[np.float64]] = []
    contacts = 0
    solver = threading.Thread(target=take_steps)
    solver.start()
    try:
        start = time.perf_counter()
        tick = 0
        while (due := tick / RATE) < seconds:
            wait = start + due - time.perf_counter()
            if wait > 0:
                time.sleep(wait)
            began = time.perf_counter()
            now = began - start
            down = _RADIUS - _DEPTH * min(1.0, 2.0 * now / (0.2 * seconds) - 1.0)
            aside = _STROKE * np.sin(2 * np.pi * _STROKES * now)
            force, _ = loop.tick(upright, top - above + np.array([aside, 0.0, down]))
            ended = time.perf_counter()
            durations.append(ended - began)
            late.append(now - due)
            forces.append(force)
            contacts += loop.contacts
            # Ticks that are missed are not made up for.
            tick = max(tick + 1, int((ended - start) * RATE))
        taken = time.perf_counter() - start
    finally:
        done.set()
        solver.join()
    median, p99, worst = np.percentile(durations, [50, 99, 100]).tolist()
    pressing = np.array(forces[len(forces) // 4 :])
    return LoopOutcome(
        seconds=taken,
        ticks=len(durations),
        median=median,
        p99=p99,
        worst=worst,
        late=float(np.percentile(late, 99)),
        steps=len(steps),
        step_median=float(np.median(steps)),
        contacts=contacts / len(durations),
        force=float(np.linalg.norm(pressing, axis=1).mean()),
        jump=float(np.percentile(np.linalg.norm(np.diff(pressing, axis=0), axis=1), 99)),
    )
