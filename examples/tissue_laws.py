"""One organ, every tissue law: how far it sags, what a step costs, what holds its volume."""

import numpy as np

import palpate

kidney = palpate.read_model("case1").bodies[0].mesh
top = kidney.nodes[:, 2].max()
held = np.flatnonzero(kidney.nodes[:, 2] > top - 0.2 * np.ptp(kidney.nodes[:, 2]))
along = np.tile([0.0, 0.0, 1.0], (len(kidney.tetrahedra), 1))  # fibres, one per tetrahedron
with_fibres = palpate.Mesh(kidney.nodes, kidney.tetrahedra, fibres=along)

for law in ("linear", "corotated", "stvk", "neo-hookean", "mooney-rivlin", "hgo"):
    mesh = with_fibres if law == "hgo" else kidney
    material = palpate.Material(law=law, young=3e3, poisson=0.45, density=1050, damping=0.05)
    body = palpate.Body(mesh, material=material, fixed_nodes=held)
    simulation = palpate.Simulation([body])
    report = simulation.step(60)
    sag = (mesh.nodes - simulation.positions[0])[:, 2].max()
    milliseconds = report.times["total"] / 60 * 1e3
    print(f"{law:14s} sags {1e3 * sag:5.2f} mm, {milliseconds:5.2f} ms per step")
