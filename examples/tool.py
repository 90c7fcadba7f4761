"""A rigid tool presses into tissue and comes back; its force is read in every step."""

import numpy as np

import palpate

tissue = palpate.read_model("small").bodies[0].mesh
bottom, top = tissue.nodes[:, 2].min(), tissue.nodes[:, 2].max()
middle = tissue.nodes.mean(axis=0)

# The tool: an octahedron of 8 mm, its mesh file's origin at its tip.
corners = 8e-3 * np.array([[1, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1], [0, 0, 0], [0, 0, 2]])
sides = [[k, (k + 1) % 4, 5] for k in range(4)] + [[(k + 1) % 4, k, 4] for k in range(4)]
probe = palpate.Mesh(corners, triangles=sides)

simulation = palpate.Simulation(
    [
        palpate.Body(
            tissue,
            name="tissue",
            material=palpate.Material(law="neo-hookean", young=6e3),
            fixed_nodes=np.flatnonzero(tissue.nodes[:, 2] < bottom + 0.004),
        ),
        palpate.Body(probe, name="probe", rigid=()),
    ],
    time_step=1 / 100,
)
tool = simulation.tool("probe")
upright = np.eye(3)
start = np.array([middle[0], middle[1], top + 2e-3])

forces = []
for step in range(60):
    depth = 9e-3 * np.sin(np.pi * step / 59)  # down by 9 mm and back, 0.6 s
    tool.set_pose(upright, start - [0, 0, depth])  # here a tracker's or a haptic device's pose
    simulation.step()
    forces.append(tool.force[2])  # here the force for the device [N]
    if step % 10 == 9:
        print(f"t = {simulation.time:.2f} s: {1e3 * depth:4.1f} mm down, {forces[-1]:6.3f} N")

assert max(forces) > 0.01  # it is pushed upward
assert abs(forces[-1]) < 1e-9  # and free again
