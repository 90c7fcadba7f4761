"""palpate finds the contacts of a finite element code of your own: explicit, in numpy."""

import numpy as np

import palpate

YOUNG, POISSON, DENSITY = 1e4, 0.3, 1000.0
MU, LAMBDA = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
TIME_STEP, STEPS = 4e-4, 600
REACH, PENALTY = 4e-3, 400.0  # contacts push from 4 mm on [m], by [N/m] for each pair

# Your code's own arrays: an organ above a tray, three times as large as in the bundled model.
bodies = palpate.read_model("small").bodies
organ, tray = (body.mesh.with_nodes(3 * body.mesh.nodes) for body in (bodies[0], bodies[3]))
rest, tetrahedra = organ.nodes, organ.tetrahedra

edges = rest[tetrahedra[:, 1:]] - rest[tetrahedra[:, :1]]  # (m, 3, 3), a row for each edge
inverse = np.linalg.inv(edges)
volume = np.linalg.det(edges) / 6
mass = np.bincount(tetrahedra.ravel(), np.repeat(DENSITY * volume / 4, 4))


def elastic_forces(x: np.ndarray) -> np.ndarray:
    """Forces [N] of St. Venant-Kirchhoff tetrahedra on the nodes."""
    gradient = np.swapaxes(inverse @ (x[tetrahedra[:, 1:]] - x[tetrahedra[:, :1]]), 1, 2)
    strain = (np.swapaxes(gradient, 1, 2) @ gradient - np.eye(3)) / 2
    trace = np.trace(strain, axis1=1, axis2=2)[:, None, None]
    stress = gradient @ (2 * MU * strain + LAMBDA * trace * np.eye(3))
    corner = -volume[:, None, None] * np.swapaxes(stress @ inverse, 1, 2)
    forces = np.zeros_like(x)
    np.add.at(forces, tetrahedra[:, 1:], corner)
    np.add.at(forces, tetrahedra[:, 0], -corner.sum(axis=1))
    return forces


def contact_forces(found: palpate.Proximity) -> np.ndarray:
    """A spring along the normal of each close pair, spread to its four nodes by their weights."""
    edge_edge = (found.kind == found.EDGE_EDGE)[:, None]
    side = np.where(edge_edge, [0, 0, 1, 1], [0, 1, 1, 1])  # whose nodes the four are
    body = np.take_along_axis(found.bodies, side, axis=1)
    nodes = found.nodes + scene.node_offsets[body]
    push = PENALTY * (REACH - found.distances)[:, None] * found.normals
    forces = np.zeros((scene.node_offsets[-1], 3))
    np.add.at(forces, nodes, found.weights[:, :, None] * push[:, None, :])
    return forces[: len(rest)]  # the tray does not move


scene = palpate.Scene([organ, tray])
x, v = rest.copy(), np.zeros_like(rest)
for step in range(1, STEPS + 1):
    scene.update([x, tray.nodes])
    found = scene.proximity(REACH, close_at_rest=False)
    forces = elastic_forces(x) + contact_forces(found)
    v += TIME_STEP * (forces / mass[:, None] - [0, 0, 9.81] - 10 * v)  # damped
    x += TIME_STEP * v
    if step % 100 == 0:
        speed = np.linalg.norm(v, axis=1).max()
        print(f"t = {step * TIME_STEP:.2f} s: {len(found):3d} pairs, fastest node {speed:.2f} m/s")

assert len(found) > 0
assert len(scene.intersections()) == 0
