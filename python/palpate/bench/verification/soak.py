"""Random pulling, pushing and cutting of case 2 for minutes: nothing breaks, stays inside or grows.

``python -m palpate.bench.verification.soak MINUTES [SEED] [--steps N]`` prints a line every 500
steps, ends after so many minutes or steps, and with an error when a promise is broken: a number
that is not finite, a node that stays inside another body or an element that stays turned inside
out, bodies thrown about, a step that fails, memory or the time of a step that grow. Rounds of hands
at work begin at the start again, so that the first and the last of them can be compared.
"""

from __future__ import annotations

import argparse
import ctypes
import gc
import os
import sys
import time
from collections.abc import Hashable, Iterable
from pathlib import Path

import numpy as np

from palpate._arrays import Float64Array
from palpate.cutting import Blade
from palpate.errors import SimulationError
from palpate.hands import Pull
from palpate.mesh import Mesh
from palpate.model import Body, Model, read_model
from palpate.results.measures import mean_edge, signed_volumes
from palpate.scene import Scene
from palpate.simulation import Simulation

#: A node deeper than this part of the mean edge inside a body is looked at every so many steps.
DEEP, LOOK = 0.01, 20
#: What is found in every look for as many steps (5 s) lasts: a node so deep inside the same body,
#: an element turned inside out. Hands press and pull for a second at most.
LASTING = 300
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


class Lasting:
    """What stays, by looks at some of the steps."""

    def __init__(self) -> None:
        self._since: dict[Hashable, int] = {}
        self._told = False

    def look(self, step: int, present: Iterable[Hashable]) -> bool:
        """Whether one of ``present`` has now been in every look for `LASTING` steps; once."""
        self._since = {thing: self._since.get(thing, step) for thing in present}
        lasts = step - min(self._since.values(), default=step) >= LASTING
        told, self._told = self._told, lasts
        return lasts and not told


class Soak:
    """Hands at work on case 2; ``faults`` says what went wrong."""

    def __init__(self, seed: int, minutes: float = float("inf"), steps: int | None = None) -> None:
        self._start = time.monotonic()
        self._end = self._start + 60 * minutes
        self._most = steps
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
        self._stuck = Lasting()
        self._turned = Lasting()
        self._inverted = 0
        self._cuts = 0
        self._opened = 0
        self._seconds: list[float] = []
        #: Of each round: median time of a step [s], and memory in use and resident after it [MB].
        self.rounds: list[tuple[float, float, float]] = []

    def _fault(self, what: str) -> None:
        self.faults.append(f"step {self.steps}: {what}")
        print(self.faults[-1], flush=True)

    @property
    def is_over(self) -> bool:
        """Whether the minutes or the steps are at an end."""
        return time.monotonic() > self._end or (self._most is not None and self.steps >= self._most)

    def _step(self, count: int = 1) -> None:
        for _ in range(count):
            start = time.process_time()
            report = self._simulation.step()
            self._seconds.append(time.process_time() - start)
            self.steps += 1
            self._smaller += report.substeps > 1
            self._opened += len(report.cuts)
            depth = report.max_depth / self._edge
            self._deepest = max(self._deepest, depth)
            fastest = max(
                float(np.linalg.norm(velocities, axis=1).max())
                for body, velocities in zip(
                    self._simulation.model.bodies, self._simulation.velocities, strict=True
                )
                if body.rigid is None
            )
            if depth > TOO_DEEP or fastest > TOO_FAST:
                self._fault(f"{depth:.1f} edges deep, {fastest:.0f} m/s")
            if self.steps % LOOK == 0:
                self._look(depth)
            if self.steps % 500 == 0:
                self._tell(depth)

    def _look(self, depth: float) -> None:
        """Whether something is wrong for longer than hands work at it."""
        bodies, places = self._simulation.model.bodies, self._simulation.positions
        if not all(np.isfinite(x).all() for x in places):
            self._fault("a position is not finite")
        # After a cut of a body its nodes and elements are others.
        sizes = [len(x) for x in places]
        turned = [
            (index, sizes[index], int(element))
            for index, (body, x) in enumerate(zip(bodies, places, strict=True))
            if body.rigid is None
            for element in np.flatnonzero(signed_volumes(x, body.mesh.tetrahedra) <= 0)
        ]
        self._inverted = len(turned)
        deep: list[tuple[int, int, int, int]] = []
        if depth > DEEP:
            scene = Scene([body.mesh for body in bodies])
            scene.update(list(places))
            inside = scene.penetration()
            deep = [
                (int(a), int(b), sizes[int(a)], int(node))
                for (a, b), node, depth in zip(
                    inside.bodies, inside.nodes, inside.depths, strict=True
                )
                if depth > DEEP * self._edge
            ]
        if self._stuck.look(self.steps, deep):
            self._fault(f"nodes are stuck deeper than {DEEP} edges: {deep[:5]}")
        if self._turned.look(self.steps, turned):
            self._fault(f"elements stay inside out: {turned[:5]}")

    def _tell(self, depth: float) -> None:
        minutes = (time.monotonic() - self._start) / 60
        of = "" if self._most is None else f" of {self._most}"
        print(
            f"{self.steps} steps{of} in {minutes:.1f} min ({self._smaller} in smaller ones), "
            f"{self._cuts} cuts, {self._opened} of them live: "
            f"deepest {self._deepest:.2f} edges, now {depth:.3f}, {self._inverted} inverted, "
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
        if self._random.random() < 0.5:
            delay = int(self._random.integers(1, 10))
            self._simulation.cut_live(blade, delay=delay, min_edge=0.1 * self._edge)
        else:
            self._simulation.cut(blade, min_edge=0.1 * self._edge)
        self._cuts += 1

    def round(self) -> None:
        """Episodes from the start, until all is over at most; then all begins anew."""
        cuts = 0
        self._seconds.clear()
        for _ in range(EPISODES):
            if self.is_over:
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
        self._simulation.reset()
        self._stuck, self._turned = Lasting(), Lasting()
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


def soak(minutes: float, seed: int, steps: int | None = None) -> list[str]:
    """What went wrong."""
    hands = Soak(seed, minutes, steps)
    while not hands.is_over:
        hands.round()
    hands.check_growth()
    print(f"{hands.steps} steps in {len(hands.rounds)} rounds, seed {seed}")
    return hands.faults


def main(words: list[str]) -> str | None:
    """What went wrong, in lines."""
    parser = argparse.ArgumentParser(prog="soak", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("minutes", type=float)
    parser.add_argument("seed", type=int, nargs="?", default=int(time.time()))
    parser.add_argument("--steps", type=int, help="end after so many, when that is sooner")
    chosen = parser.parse_args(words)
    return "\n".join(soak(chosen.minutes, chosen.seed, chosen.steps)) or None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
