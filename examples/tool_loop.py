"""A tool feels tissue a thousand times a second while another thread takes the steps."""

import threading
import time

import numpy as np

import palpate

tissue = palpate.read_model("small").bodies[0].mesh
bottom, top = tissue.nodes[:, 2].min(), tissue.nodes[:, 2].max()
middle = tissue.nodes.mean(axis=0)

# The tool: an octahedron of 8 mm above the tissue; its pose is that of its mesh file's origin.
corners = 8e-3 * np.array([[1, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1], [0, 0, 0], [0, 0, 2]])
sides = [[k, (k + 1) % 4, 5] for k in range(4)] + [[(k + 1) % 4, k, 4] for k in range(4)]
start = np.array([middle[0], middle[1], top + 2e-3])
probe = palpate.Mesh(corners + start, triangles=sides)

simulation = palpate.Simulation(
    [
        palpate.Body(
            tissue,
            name="tissue",
            material=palpate.Material(law="neo-hookean", young=6e3),
            fixed_nodes=np.flatnonzero(tissue.nodes[:, 2] < bottom + 0.004),
        ),
        palpate.Body(probe, name="probe", rigid=()),
    ]
)
loop = simulation.tool("probe").loop()
done = threading.Event()


def take_steps() -> None:
    while not done.is_set():
        began = time.perf_counter()
        simulation.step()  # moves the tool to the pose of the newest tick
        time.sleep(max(0.0, simulation.time_step - (time.perf_counter() - began)))


solver = threading.Thread(target=take_steps)
solver.start()
forces, durations = [], []
began = time.perf_counter()
for tick in range(600):
    depth = 7e-3 * np.sin(np.pi * tick / 599)  # down by 7 mm and back, 0.6 s
    before = time.perf_counter()
    force, torque = loop.tick(np.eye(3), [0.0, 0.0, -depth])  # a tracker's or haptic device's pose
    durations.append(time.perf_counter() - before)
    forces.append(force[2])  # here the force for the device [N]
    time.sleep(max(0.0, began + 1e-3 * (tick + 1) - time.perf_counter()))
done.set()
solver.join()

print(f"{len(forces) / (time.perf_counter() - began):.0f} ticks and ", end="")
print(f"{simulation.time / simulation.time_step / 0.6:.0f} steps per second; a tick took")
print(
    f"{1e3 * np.median(durations):.2f} ms, 99 % below {1e3 * np.percentile(durations, 99):.2f} ms"
)
print(f"largest force {max(forces):.3f} N")
assert max(forces) > 0.01  # it was pushed upward
assert forces[0] == 0  # and nothing touched it at first
