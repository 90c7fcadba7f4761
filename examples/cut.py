"""A scalpel goes through tissue while it is simulated; what comes off falls on its own."""

import itertools

import numpy as np

import palpate

tissue = palpate.read_model("small").bodies[0].mesh
low, high = tissue.nodes.min(axis=0), tissue.nodes.max(axis=0)
middle = (low + high) / 2
simulation = palpate.Simulation(
    [
        palpate.Body(
            tissue,
            name="tissue",
            material=palpate.Material(law="neo-hookean", young=3e4),
            fixed_nodes=np.flatnonzero(tissue.nodes[:, 0] < low[0] + 0.006),
        )
    ],
    time_step=1 / 200,
)

# The scalpel's edge, heel and tip, moves across in y; a stroke is what it sweeps in a few steps.
heel, tip = high[2] + 0.01, low[2] - 0.01
places = np.linspace(low[1] - 0.005, high[1] + 0.005, 6)
for before, after in itertools.pairwise(places):
    edges = [[[middle[0], y, heel], [middle[0], y, tip]] for y in (before, after)]
    report = simulation.cut(palpate.Blade.stroke(edges))
    for cut in report.bodies:
        print(
            f"t = {simulation.time:.3f} s: {1e4 * cut.cut_area:.2f} cm² cut, "
            f"{cut.new_tetrahedra} tetrahedra more, {cut.pieces} piece(s)"
        )
    simulation.step(2)

simulation.separate()
simulation.step(20)
for body, positions in zip(simulation.model.bodies, simulation.positions, strict=True):
    sunk = 1e3 * (body.mesh.nodes[:, 2].mean() - positions[:, 2].mean())
    volume = 1e6 * body.mesh.volume
    print(f"{body.name}: {len(positions)} nodes, {volume:.1f} cm³, sunk by {sunk:.1f} mm")

assert len(simulation.positions) == 2
