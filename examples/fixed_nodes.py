"""An organ held at one end; afterwards the held end is carried away by hand."""

import numpy as np

import palpate

kidney = palpate.read_model("case1").bodies[0].mesh
along = np.ptp(kidney.nodes, axis=0).argmax()
position = kidney.nodes[:, along]
held = np.flatnonzero(position < position.min() + 0.1 * np.ptp(position))
body = palpate.Body(
    kidney,
    material=palpate.Material(law="neo-hookean", young=100e3, damping=0.02),
    fixed_nodes=held,
)
simulation = palpate.Simulation([body])
simulation.step(60)
sag = (kidney.nodes - simulation.positions[0])[:, 2].max()
print(f"{len(held)} nodes held, the rest sags by {1e3 * sag:.0f} mm")
middle = simulation.positions[0][:, 2].mean()

for _ in range(30):  # fixed nodes stay wherever they are put
    nodes = simulation.positions[0].copy()
    nodes[held] += [0.0, 0.0, 0.001]
    simulation.set_positions(0, nodes)
    simulation.step()
simulation.step(30)
lifted = simulation.positions[0][held, 2].mean() - kidney.nodes[held, 2].mean()
followed = simulation.positions[0][:, 2].mean() - middle
print(
    f"lifted by {1e3 * lifted:.0f} mm, the organ's middle has followed by {1e3 * followed:.0f} mm"
)
assert abs(lifted - 0.03) < 1e-9
