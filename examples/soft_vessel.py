"""A soft vessel held at one end sags: with the linear law it grows, nonlinear tissue does not."""

import numpy as np

import palpate

vessel = palpate.read_model("case1").bodies[1].mesh
along = np.ptp(vessel.nodes, axis=0).argmax()  # the longest direction
position = vessel.nodes[:, along]
held = np.flatnonzero(position < position.min() + 0.1 * np.ptp(position))
gravity = [0.0, 0.0, 0.0]
gravity[(along + 1) % 3] = -9.81


def volume(nodes: np.ndarray) -> float:
    """Volume [m³] of the vessel with its nodes elsewhere."""
    a, b, c, d = (nodes[corner] for corner in vessel.tetrahedra.T)
    return float(np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)).sum() / 6)


for law in ("linear", "corotated", "neo-hookean"):
    material = palpate.Material(law=law, young=8e3, poisson=0.45, density=1050, damping=0.05)
    body = palpate.Body(vessel, name="vessel", material=material, fixed_nodes=held)
    simulation = palpate.Simulation(palpate.Model([body], gravity=gravity))
    report = simulation.step(45)
    nodes = simulation.positions[0]
    sag = np.linalg.norm(nodes - vessel.nodes, axis=1).max()
    milliseconds = report.times["total"] / 45 * 1e3
    print(
        f"{law:12s} sags {sag * 1e3:4.0f} mm, volume {volume(nodes) / vessel.volume - 1:+6.1%}, "
        f"{milliseconds:5.1f} ms per step"
    )
