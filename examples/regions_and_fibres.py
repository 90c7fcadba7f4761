"""A strip of two tissues, one of them with fibres: it stretches where nothing holds it."""

import numpy as np

import palpate

cells = np.array([20, 4, 4])
grid = np.stack(np.meshgrid(*[np.arange(n + 1) for n in cells], indexing="ij"), axis=-1)
nodes = grid.reshape(-1, 3) * 0.005
number = np.arange(len(nodes)).reshape(cells + 1)
corner = [
    number[
        b & 1 : cells[0] + (b & 1),
        b >> 1 & 1 : cells[1] + (b >> 1 & 1),
        b >> 2 : cells[2] + (b >> 2),
    ]
    for b in range(8)
]
paths = [(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)]
tetrahedra = np.concatenate([np.stack([corner[c].ravel() for c in p], axis=1) for p in paths])

middle = nodes[tetrahedra].mean(axis=1)
regions = (middle[:, 0] > 0.05).astype(int)  # the far half is region 1
fibres = np.tile([1.0, 0.0, 0.0], (len(tetrahedra), 1))  # along the strip
strip = palpate.Mesh(nodes, tetrahedra, regions=regions, fibres=fibres)

plain = palpate.Material(law="neo-hookean", young=5e3, poisson=0.45, damping=0.05)
fibrous = palpate.Material(law="hgo", young=5e3, poisson=0.45, k1=10e3, k2=2.0)
held = np.flatnonzero(nodes[:, 0] == 0)
end = np.flatnonzero(nodes[:, 0] == nodes[:, 0].max())
body = palpate.Body(strip, material=plain, regions={1: fibrous}, fixed_nodes=held)
simulation = palpate.Simulation(palpate.Model([body], gravity=(0, 0, 0)))
load = np.zeros_like(nodes)
load[end] = [0.6 / len(end), 0.0, 0.0]  # 0.6 N: 1.5 kPa
simulation.set_forces(0, load)
simulation.step(120)
x = simulation.positions[0][:, 0]
half = np.isclose(nodes[:, 0], 0.05)
without = x[half].mean() / 0.05 - 1
with_fibres = (x[end].mean() - x[half].mean()) / 0.05 - 1
print(f"the plain half stretches by {without:.1%}, that with fibres by {with_fibres:.1%}")
assert with_fibres < 0.5 * without
