"""Reading energy and momentum: two soft bodies collide in free space."""

import numpy as np

import palpate

organ = palpate.read_model("small").bodies[0].mesh
size = np.ptp(organ.nodes, axis=0)
aside = np.array([1.05, 0.0, 0.1]) * size
other = palpate.Mesh(organ.nodes + aside, organ.tetrahedra)
material = palpate.Material(law="neo-hookean", young=2e4, damping=0.0)
bodies = [
    palpate.Body(organ, name="left", material=material, initial_velocity=(0.5, 0, 0)),
    palpate.Body(other, name="right", material=material),
]
simulation = palpate.Simulation(palpate.Model(bodies, gravity=(0, 0, 0)))


def lumped_masses(mesh: palpate.Mesh) -> np.ndarray:
    """A quarter of each tetrahedron's mass [kg] on each of its nodes, as the simulation has it."""
    a, b, c, d = (mesh.nodes[corner] for corner in mesh.tetrahedra.T)
    quarter = 1000.0 * np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) / 24
    return np.bincount(mesh.tetrahedra.ravel(), np.repeat(quarter, 4), minlength=len(mesh.nodes))


weights = [lumped_masses(body.mesh) for body in bodies]


def momenta() -> tuple[np.ndarray, np.ndarray]:
    """Linear [kg m/s] and angular momentum about the origin [kg m²/s]."""
    states = list(zip(weights, simulation.positions, simulation.velocities, strict=True))
    linear = sum((m[:, None] * v).sum(axis=0) for m, _, v in states)
    angular = sum((m[:, None] * np.cross(x, v)).sum(axis=0) for m, x, v in states)
    return linear, angular


start = momenta()
for _ in range(6):
    report = simulation.step(2)
    energy = simulation.energy()
    linear, angular = momenta()
    print(
        f"t = {report.time:4.2f} s: {report.contacts:2d} contacts, "
        f"kinetic {energy['kinetic']:.2e} J, elastic {energy['elastic']:.2e} J, "
        f"momentum off by {np.abs(linear - start[0]).max():.0e}"
    )
assert np.allclose(angular, start[1], rtol=0, atol=1e-9 * np.abs(start[1]).max())
