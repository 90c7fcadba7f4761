"""Snapshots in memory and checkpoints on disk: both continue with the same bits."""

import tempfile
from pathlib import Path

import numpy as np

import palpate

simulation = palpate.Simulation("small")
simulation.step(20)
snapshot = simulation.snapshot()  # in memory, to try something and come back
simulation.step(20)
first = simulation.positions[0]

simulation.restore(snapshot)
simulation.step(20)
assert np.array_equal(simulation.positions[0], first)

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "half_way.palpate"
    simulation.restore(snapshot)
    simulation.save(path)  # model, meshes and state in one file
    continued = palpate.Simulation.load(path, threads=2)
    continued.step(20)
    print(f"{path.stat().st_size / 1e3:.0f} kB, continued at t = {continued.time:.3f} s")
    assert np.array_equal(continued.positions[0], first)
print("the same bits from memory, from disk and on two threads")
