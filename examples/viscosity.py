"""Damping: the same organ shaken once, with more and more viscous tissue."""

import numpy as np

import palpate

kidney = palpate.read_model("case1").bodies[0].mesh
bottom = kidney.nodes[:, 2].min()
held = np.flatnonzero(kidney.nodes[:, 2] < bottom + 0.2 * np.ptp(kidney.nodes[:, 2]))

for damping in (0.0, 0.005, 0.02, 0.1):  # [s]: times the stiffness, or viscosity of other laws
    material = palpate.Material(law="neo-hookean", young=8e3, damping=damping)
    body = palpate.Body(
        kidney, material=material, fixed_nodes=held, initial_velocity=(0.3, 0.0, 0.0)
    )
    simulation = palpate.Simulation(palpate.Model([body], gravity=(0, 0, 0)), time_step=1 / 240)
    start = sum(simulation.energy().values())
    left = []
    for _ in range(4):
        simulation.step(15)
        left.append(sum(simulation.energy().values()) / start)
    print(f"damping {damping:5.3f} s: energy left " + ", ".join(f"{part:7.3%}" for part in left))
