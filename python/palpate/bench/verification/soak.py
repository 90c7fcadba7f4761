"""Random pulling of case 2 for minutes: nothing breaks or stays inside, memory is flat.

``python -m palpate.bench.verification.soak MINUTES [SEED]`` prints a line every 500 steps and ends
with an error when a promise is broken.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import numpy as np

from palpate.results.measures import mean_edge, signed_volumes
from palpate.simulation import Simulation

#: A node deeper than this part of the mean edge inside another body, for as many steps, is stuck.
DEEP, LASTING = 0.01, 600


def memory() -> float:
    """Resident memory [MB]; 0 where the system does not tell."""
    table = Path("/proc/self/statm")
    pages = int(table.read_text().split()[1]) if table.exists() else 0
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def soak(minutes: float, seed: int) -> list[str]:
    """What went wrong; pulls a random node somewhere for half a second, rests now and then."""
    random = np.random.default_rng(seed)
    simulation = Simulation("case2")
    bodies = [body for body in simulation.model.bodies if body.rigid is None]
    edge = float(np.mean([mean_edge(body.mesh) for body in bodies]))
    faults: list[str] = []
    deep_since = steps = 0
    settled = 0.0
    deepest = 0.0
    inverted = 0
    end = time.monotonic() + 60 * minutes
    while time.monotonic() < end:
        body = bodies[random.integers(len(bodies))]
        node = int(random.choice(body.mesh.surface_nodes))
        start = simulation.positions[simulation.model.body_index(body.name)]
        way = random.normal(size=3)
        target = start[node] + random.uniform(0.01, 0.06) * way / np.linalg.norm(way)
        pull = simulation.pull(body.name, node, target, float(random.uniform(2.0, 40.0)))
        for pulled in (True, False):
            for _ in range(30):
                report = simulation.step()
                steps += 1
                deepest = max(deepest, report.max_depth / edge)
                deep_since = deep_since + 1 if report.max_depth > DEEP * edge else 0
                if deep_since == LASTING:
                    faults.append(
                        f"step {steps}: a node is stuck {report.max_depth / edge:.2f} deep"
                    )
                if steps == 600:
                    settled = memory()
                if steps % 500 == 0:
                    inverted = sum(
                        int((signed_volumes(x, each.mesh.tetrahedra) <= 0).sum())
                        for x, each in zip(simulation.positions, bodies, strict=False)
                    )
                    print(
                        f"{steps} steps: deepest {deepest:.2f} edges, now "
                        f"{report.max_depth / edge:.3f}, {inverted} inverted, "
                        f"{len(simulation.intersections())} pairs, {memory():.0f} MB",
                        flush=True,
                    )
            if pulled:
                pull.release()
    if settled and memory() > 1.1 * settled:
        faults.append(f"memory grew from {settled:.0f} to {memory():.0f} MB")
    if deep_since:
        print(f"at the end a node has been inside for {deep_since} steps")
    if inverted:
        print(f"at the end {inverted} tetrahedra are inverted")
    print(f"{steps} steps, seed {seed}")
    return faults


if __name__ == "__main__":
    chosen = int(sys.argv[2]) if len(sys.argv) > 2 else int(time.time())
    found = soak(float(sys.argv[1]), chosen)
    sys.exit("\n".join(found) if found else 0)
