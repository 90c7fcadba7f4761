"""Tissue that keeps its volume: an organ pressed from above, Poisson's ratio up to 0.49."""

import numpy as np

import palpate

organ = palpate.read_model("small").bodies[0].mesh
low, high = organ.nodes[:, 2].min(), organ.nodes[:, 2].max()
bottom = np.flatnonzero(organ.nodes[:, 2] < low + 0.15 * (high - low))
load = np.zeros_like(organ.nodes)
top = np.flatnonzero(organ.nodes[:, 2] > high - 0.15 * (high - low))


def volume(nodes: np.ndarray) -> float:
    a, b, c, d = (nodes[corner] for corner in organ.tetrahedra.T)
    return float(np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)).sum() / 6)


area = np.prod(np.ptp(organ.nodes, axis=0)[:2])
load[top] = [0.0, 0.0, -150.0 * area / len(top)]  # about 150 Pa from above
for poisson in (0.0, 0.3, 0.45, 0.49):
    material = palpate.Material(law="neo-hookean", young=5e3, poisson=poisson, damping=0.02)
    body = palpate.Body(organ, material=material, fixed_nodes=bottom)
    simulation = palpate.Simulation(palpate.Model([body], gravity=(0, 0, 0)))
    simulation.set_forces(0, load)
    simulation.step(90)
    nodes = simulation.positions[0]
    lower = 1 - (nodes[top, 2].mean() - low) / (organ.nodes[top, 2].mean() - low)
    print(
        f"nu = {poisson:5.3f}: {lower:5.1%} lower, volume {volume(nodes) / organ.volume - 1:+.2%}"
    )
