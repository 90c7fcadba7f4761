"""A soft box falls onto a tilted plate and comes to rest: a simulation made in Python."""

import numpy as np

import palpate

organ = palpate.read_model("small").bodies[0].mesh
size = np.ptp(organ.nodes, axis=0).max()
centre = organ.nodes.mean(axis=0)
lowest = organ.nodes[:, 2].min()
corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * 4 * size
plate = palpate.Mesh(
    corners + np.array([centre[0], centre[1], lowest - 0.2 * size]),
    triangles=[[0, 1, 2], [0, 2, 3]],
)

simulation = palpate.Simulation(
    palpate.Model(
        [
            palpate.Body(organ, name="organ", material=palpate.Material(young=8e3, damping=0.03)),
            palpate.Body(plate, name="plate", rigid=(), contact=palpate.Contact(friction=0.5)),
        ]
    )
)
for _ in range(8):
    report = simulation.step(15)
    speed = np.linalg.norm(simulation.velocities[0], axis=1).max()
    print(f"t = {report.time:4.2f} s: {report.contacts:3d} contacts, fastest node {speed:.3f} m/s")

weight = organ.volume * 1000 * 9.81
carried = simulation.contact_forces[0].sum(axis=0)[2]
print(f"the plate carries {carried:.4f} N of {weight:.4f} N")
