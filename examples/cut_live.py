"""A scalpel is drawn through tissue live: cuts are prepared beside the steps, frames go on."""

import itertools
import time

import numpy as np

import palpate

simulation = palpate.Simulation("small")
simulation.step(20)
points = simulation.positions[simulation.model.body_index("lower")]
low, high = points.min(axis=0), points.max(axis=0)
middle = (low + high) / 2

# Where the scalpel's edge, heel and tip, is before each frame.
places = np.linspace(low[1] - 0.005, middle[1], 25)
heel, tip = high[2] + 0.01, low[2] - 0.01
edges = [[[middle[0], y, heel], [middle[0] + 0.002, y, tip]] for y in places]

marks = points[:, 2].copy()  # a value of yours for each node
seconds, opened = [], 0


def follow(report: palpate.StepReport) -> None:
    """Take the user's own array along with strokes of some steps before, which have opened."""
    global marks, opened
    for cut in report.cuts:
        for body in cut.bodies:
            opened += 1
            if simulation.model.bodies[body.body].name == "lower":
                marks = body.change.at_nodes(marks)


for before, after in itertools.pairwise(edges):
    begin = time.perf_counter()
    simulation.cut_live(palpate.Blade.stroke([before, after]), delay=5)
    report = simulation.step()
    seconds.append(time.perf_counter() - begin)
    follow(report)

follow(simulation.step(10))  # what was still on its way
tetrahedra = len(simulation.model.bodies[simulation.model.body_index("lower")].mesh.tetrahedra)
print(
    f"{opened} times a body came apart; {tetrahedra} tetrahedra in the end; frames took "
    f"{1e3 * np.median(seconds):.1f} ms, the longest {1e3 * max(seconds):.1f} ms"
)

assert opened > 0
assert len(marks) == len(simulation.positions[0])
