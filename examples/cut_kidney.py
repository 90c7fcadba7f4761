"""A scalpel opens a kidney held at its side: the lips of the cut gape under gravity."""

from pathlib import Path

import numpy as np

import palpate
from palpate import pictures

mesh = palpate.read_model("case1").bodies[0].mesh
low, high = mesh.nodes.min(axis=0), mesh.nodes.max(axis=0)
middle, size = (low + high) / 2, high - low
along, across, down = np.argsort(-size)  # the longest, the middle, the shortest direction


def place(*parts: float) -> np.ndarray:
    """The point at these parts of the box, along, across and down; 0 is the middle, 1 a side."""
    point: np.ndarray = middle.copy()
    for axis, part in zip((along, across, down), parts, strict=True):
        point[axis] += part * size[axis] / 2
    return point


# It lies on a ridge along its middle, and gravity pulls both sides down.
held = np.flatnonzero(
    (mesh.nodes[:, down] < middle[down] - 0.2 * size[down])
    & (np.abs(mesh.nodes[:, across] - middle[across]) < 0.15 * size[across])
)
gravity = [0.0, 0.0, 0.0]
gravity[down] = -9.81
material = palpate.Material(
    law="neo-hookean", young=1.5e3, poisson=0.45, density=1050, damping=0.05
)
body = palpate.Body(mesh, "kidney", material=material, fixed_nodes=held, color=(0.66, 0.33, 0.25))
simulation = palpate.Simulation(palpate.Model([body], gravity=gravity))
simulation.step(40)

# The edge of the scalpel goes along the middle, from above the surface down to below the middle.
steps = np.linspace(-0.75, 0.75, 25)
places = [
    (place(s, 0.05 * np.sin(4 * s), 1.5), place(s, 0.05 * np.sin(4 * s), -0.2)) for s in steps
]
shown = [(simulation.time, simulation.positions[0], simulation.model.bodies[0].mesh.triangles)]
for step in range(len(places) - 1):
    report = simulation.cut(palpate.Blade.stroke([places[step], places[step + 1]]))
    simulation.step(2)
    if step == len(places) // 2:
        triangles = simulation.model.bodies[0].mesh.triangles
        shown.append((simulation.time, simulation.positions[0], triangles))
simulation.step(60)
body = simulation.model.bodies[0]
shown.append((simulation.time, simulation.positions[0], body.mesh.triangles))
before, after = len(mesh.tetrahedra), len(body.mesh.tetrahedra)
print(
    f"{before} tetrahedra before, {after} after the cut; volume at rest "
    f"{body.mesh.volume / mesh.volume - 1:+.0e}"
)

if pictures.available():
    up = [1.0 if axis == down else 0.0 for axis in range(3)]
    camera = pictures.frame([points for _, points, _ in shown], up=up, elevation=50.0)
    images = [
        pictures.render([pictures.Shape(points, triangles, (0.66, 0.33, 0.25))], camera)
        for _, points, triangles in shown
    ]
    folder = Path("out")
    folder.mkdir(exist_ok=True)
    captions = [f"t = {time:.2f} s" for time, _, _ in shown]
    pictures.save_picture(folder / "cut_kidney.png", images, captions, camera=camera)
