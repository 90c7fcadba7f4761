"""A soft block on an incline slides when tan(angle) exceeds the friction coefficient."""

import numpy as np

import palpate

organ = palpate.read_model("small").bodies[0].mesh
size = np.ptp(organ.nodes, axis=0).max()
corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * 50 * size
incline = palpate.Mesh(corners, triangles=[[0, 1, 2], [0, 2, 3]])
centre = organ.nodes.mean(axis=0)
lowest = organ.nodes[:, 2].min()
block = palpate.Mesh(organ.nodes - [centre[0], centre[1], lowest - 0.02 * size], organ.tetrahedra)

friction = 0.4  # of two bodies the geometric mean counts
contact = palpate.Contact(friction=friction)
material = palpate.Material(young=2e4, damping=0.02)
for slope in (0.2, 0.36, 0.44, 0.6):
    angle = np.arctan(slope)
    bodies = [
        palpate.Body(block, name="block", material=material, contact=contact),
        palpate.Body(incline, name="incline", rigid=(), contact=contact),
    ]
    leaning = (9.81 * np.sin(angle), 0.0, -9.81 * np.cos(angle))  # gravity turns, not the plane
    simulation = palpate.Simulation(palpate.Model(bodies, gravity=leaning))
    simulation.step(60)
    before = simulation.velocities[0][:, 0].mean()
    simulation.step(30)
    acceleration = (simulation.velocities[0][:, 0].mean() - before) / 0.5
    coulomb = max(0.0, 9.81 * (np.sin(angle) - friction * np.cos(angle)))
    print(f"tan = {slope:4.2f}: {acceleration:6.3f} m/s², Coulomb says {coulomb:6.3f}")
