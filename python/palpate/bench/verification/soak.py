"""Random pulling, pushing and cutting of case 2 for minutes: nothing breaks, stays inside or grows.

``python -m palpate.bench.verification.soak MINUTES [SEED]`` prints a line every 500 steps and ends
with an error when a promise is broken. Rounds of hands at work begin at the start again, so that
the first and the last of them can be compared.
"""

from __future__ import annotations

import ctypes
import gc
import os
import sys
import time
from pathlib import Path

import numpy as np

from palpate._arrays import Float64Array
from palpate.cutting import Blade
from palpate.errors import SimulationError
from palpate.hands import Pull
from palpate.mesh import Mesh
from palpate.model import Body, Model, read_model
from palpate.results.measures import mean_edge, signed_volumes
from palpate.simulation import Simulation

#: A node deeper than this part of the mean edge inside another body, for as many steps, is stuck.
DEEP, LASTING = 0.01, 600
#: Deeper than this part of the mean edge even once, or faster [m/s], bodies were thrown about.
TOO_DEEP, TOO_FAST = 5.0, 30.0
#: What hands do before the next round begins, and how many of these are cuts at most.
EPISODES, CUTS = 40, 4
#: Where the probe waits, above everything [m].
HOME = np.array([0.0, 0.0, 0.5])
#: How far the probe moves in a step among the organs, in edges; force at which a hand yields [N].
SPEED, HARDEST = 0.5, 10.0
#: Growth that counts between rounds: of memory in use, of that which the process has, and of the
#: median time of a step. The C library keeps what was freed in pieces, so that the second follows
#: the most that was in use at once.
MORE_IN_USE, MORE_RESIDENT, MORE_TIME = 1.1, 1.3, 1.5


def resident() -> float:
    """Memory that the process has [MB]; 0 where the system does not tell."""
    table = Path("/proc/self/statm")
    pages = int(table.read_text().split()[1]) if table.exists() else 0
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


class _Counts(ctypes.Structure):
    """What glibc's ``mallinfo2`` tells [bytes]: ``mapped`` is hblkhd, ``used`` is uordblks."""

    _fields_ = [
        *((name, ctypes.c_size_t) for name in ("arena", "free", "bins", "maps")),
        *((name, ctypes.c_size_t) for name in ("mapped", "most", "fast", "used", "left", "top")),
    ]


def in_use() -> float:
    """Memory that is allocated [MB]; 0 where the C library does not tell."""
    ask = getattr(ctypes.CDLL(None), "mallinfo2", None)
    if ask is None:
        return 0.0
    ask.restype = _Counts
    counts = ask()
    return float(counts.mapped + counts.used) / 1e6


def probe(radius: float) -> Mesh:
    """An octahedron, twice refined, on a sphere [m]."""
    nodes = [np.array(p, dtype=float) for p in
             ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))]  # fmt: skip
    triangles = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4),
                 (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]  # fmt: skip
    for _ in range(2):
        middles: dict[tuple[int, int], int] = {}

        def middle(a: int, b: int, known: dict[tuple[int, int], int] = middles) -> int:
            key = (min(a, b), max(a, b))
            if key not in known:
                known[key] = len(nodes)
                nodes.append((nodes[a] + nodes[b]) / np.linalg.norm(nodes[a] + nodes[b]))
            return known[key]

        finer = []
        for a, b, c in triangles:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            finer += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = finer
    return Mesh(radius * np.array(nodes), triangles=triangles)


class Soak:
    """Hands at work on case 2; ``faults`` says what went wrong."""

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng(seed)
        model = read_model("case2")
        self._soft = [body.name for body in model.bodies if body.rigid is None]
        meshes = [body.mesh for body in model.bodies if body.rigid is None]
        self._edge = float(np.mean([mean_edge(mesh) for mesh in meshes]))
        ball = probe(1.5 * self._edge)
        tool = Body(ball.with_nodes(ball.nodes + HOME), name="probe", rigid=())
        bodies = [*model.bodies, tool]
        self._simulation = Simulation(
            Model(bodies, gravity=model.gravity, attachments=model.attachments), substeps="auto"
        )
        self._tool = self._simulation.tool("probe")
        self.faults: list[str] = []
        self.steps = 0
        self._smaller = 0
        self._deepest = 0.0
        self._deep_since = 0
        self._cuts = 0
        self._seconds: list[float] = []
        #: Of each round: median time of a step [s], and memory in use and resident after it [MB].
        self.rounds: list[tuple[float, float, float]] = []

    def _fault(self, what: str) -> None:
        self.faults.append(f"step {self.steps}: {what}")
        print(self.faults[-1], flush=True)

    def _step(self, count: int = 1) -> None:
        for _ in range(count):
            start = time.process_time()
            report = self._simulation.step()
            self._seconds.append(time.process_time() - start)
            self.steps += 1
            self._smaller += report.substeps > 1
            depth = report.max_depth / self._edge
            self._deepest = max(self._deepest, depth)
            self._deep_since = self._deep_since + 1 if depth > DEEP else 0
            fastest = max(
                float(np.linalg.norm(velocities, axis=1).max())
                for body, velocities in zip(
                    self._simulation.model.bodies, self._simulation.velocities, strict=True
                )
                if body.rigid is None
            )
            if depth > TOO_DEEP or fastest > TOO_FAST:
                self._fault(f"{depth:.1f} edges deep, {fastest:.0f} m/s")
            if self._deep_since == LASTING:
                self._fault(f"a node is stuck {depth:.2f} edges deep")
            if self.steps % 500 == 0:
                self._tell(depth)

    def _tell(self, depth: float) -> None:
        places = self._simulation.positions
        if not all(np.isfinite(x).all() for x in places):
            self._fault("a position is not finite")
        inverted = sum(
            int((signed_volumes(x, body.mesh.tetrahedra) <= 0).sum())
            for x, body in zip(places, self._simulation.model.bodies, strict=True)
            if body.rigid is None
        )
        print(
            f"{self.steps} steps ({self._smaller} in smaller ones), {self._cuts} cuts: "
            f"deepest {self._deepest:.2f} edges, now {depth:.3f}, {inverted} inverted, "
            f"{len(self._simulation.intersections())} pairs, "
            f"{1e3 * float(np.median(self._seconds[-500:])):.1f} ms, "
            f"{in_use():.0f} MB in use of {resident():.0f}",
            flush=True,
        )

    def _node(self) -> tuple[str, int]:
        name = str(self._random.choice(self._soft))
        mesh = self._simulation.model.bodies[self._index(name)].mesh
        return name, int(self._random.choice(mesh.surface_nodes))

    def _index(self, name: str) -> int:
        return self._simulation.model.body_index(name)

    def _direction(self) -> Float64Array:
        way: Float64Array = self._random.normal(size=3)
        return way / float(np.linalg.norm(way))

    def _pull(self) -> None:
        name, node = self._node()
        start = self._simulation.positions[self._index(name)][node]
        target = start + self._random.uniform(0.01, 0.06) * self._direction()
        stiffness = float(self._random.uniform(2.0, 40.0))
        pull: Pull = self._simulation.pull(name, node, target, stiffness)
        self._step(30)
        if pull.is_active:
            pull.release()

    def _push(self) -> None:
        """The probe comes from above towards a node, goes some edges deep, yields, and leaves."""
        name, node = self._node()
        goal = self._simulation.positions[self._index(name)][node]
        way = self._direction()
        way[2] = abs(way[2])
        outside, inside = goal + 0.08 * way, goal - 2.0 * self._edge * way
        above = np.array([*outside[:2], max(0.25, outside[2])])
        path = [above]
        for start, end in ((above, outside), (outside, inside)):
            count = 1 + int(np.linalg.norm(end - start) / (SPEED * self._edge))
            path += [start + (end - start) * k / count for k in range(1, count + 1)]
        reached = 0
        for reached, point in enumerate(path):  # noqa: B007
            self._place(point)
            self._step()
            if float(np.linalg.norm(self._tool.force)) > HARDEST:
                break
        for point in [*reversed(path[:reached]), HOME]:
            self._place(point)
            self._step()

    def _place(self, point: Float64Array) -> None:
        self._tool.set_pose([1.0, 0.0, 0.0, 0.0], point - HOME)

    def _cut(self) -> None:
        name, node = self._node()
        middle = self._simulation.positions[self._index(name)].mean(axis=0)
        goal = self._simulation.positions[self._index(name)][node]
        size = float(self._random.uniform(3.0, 8.0)) * self._edge
        blade = Blade.plane(goal, np.cross(goal - middle, self._direction()), size)
        self._simulation.cut(blade, min_edge=0.1 * self._edge)
        self._cuts += 1

    def round(self, end: float) -> None:
        """Episodes from the start until ``end`` on the clock, at most; then all begins anew."""
        cuts = 0
        self._seconds.clear()
        for _ in range(EPISODES):
            if time.monotonic() > end:
                break
            kind = self._random.random()
            try:
                if kind < 0.6:
                    self._pull()
                elif kind < 0.85 or cuts == CUTS:
                    self._push()
                else:
                    cuts += 1
                    self._cut()
                self._step(30)
            except SimulationError as error:
                self._fault(str(error))
                break
        median = float(np.median(self._seconds)) if self._seconds else 0.0
        self._deep_since = 0
        self._simulation.reset()
        gc.collect()
        self.rounds.append((median, in_use(), resident()))
        print(f"round {len(self.rounds)}: {in_use():.0f} MB in use of {resident():.0f}", flush=True)

    def check_growth(self) -> None:
        """Compare the last rounds with the first ones (but the very first, which fills buffers)."""
        if len(self.rounds) < 4:
            return
        third = max(1, (len(self.rounds) - 1) // 3)
        first, last = np.array(self.rounds[1 : 1 + third]), np.array(self.rounds[-third - 1 : -1])
        before, after = np.median(first, axis=0), np.median(last, axis=0)
        for when, (seconds, used, held) in (("first", before), ("last", after)):
            print(f"rounds at {when}: {1e3 * seconds:.1f} ms, {used:.0f} MB in use of {held:.0f}")
        for what, most, start, end in zip(
            ("time of a step [s]", "memory in use [MB]", "resident memory [MB]"),
            (MORE_TIME, MORE_IN_USE, MORE_RESIDENT),
            before,
            after,
            strict=True,
        ):
            if end > most * start:
                self.faults.append(f"{what}: {start:.4g} at first, {end:.4g} at last")


def soak(minutes: float, seed: int) -> list[str]:
    """What went wrong."""
    hands = Soak(seed)
    end = time.monotonic() + 60 * minutes
    while time.monotonic() < end:
        hands.round(end)
    hands.check_growth()
    print(f"{hands.steps} steps in {len(hands.rounds)} rounds, seed {seed}")
    return hands.faults


if __name__ == "__main__":
    chosen = int(sys.argv[2]) if len(sys.argv) > 2 else int(time.time())
    found = soak(float(sys.argv[1]), chosen)
    sys.exit("\n".join(found) if found else 0)
