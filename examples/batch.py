"""Many runs side by side: how far tissue of different stiffness gives under its weight."""

import csv
import itertools
import multiprocessing
from pathlib import Path

import numpy as np

import palpate

STIFFNESSES = [2e3, 4e3, 8e3, 16e3]  # [Pa]


def sag(young: float) -> tuple[float, float]:
    """Stiffness [Pa], and by how much [mm] the top of a held body sinks in a second."""
    mesh = palpate.read_model("small").bodies[0].mesh
    height = mesh.nodes[:, 2]
    body = palpate.Body(
        mesh,
        material=palpate.Material(law="neo-hookean", young=young, damping=0.05),
        fixed_nodes=np.flatnonzero(height < height.min() + 0.004),
    )
    simulation = palpate.Simulation([body], time_step=1 / 60)  # one thread each
    simulation.step(60)
    top = height.argmax()
    return young, 1e3 * (height[top] - simulation.positions[0][top, 2])


if __name__ == "__main__":
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        rows = pool.map(sag, STIFFNESSES)
    with Path("sag.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("young_pa", "sag_mm"), *rows])
    for young, sunk in rows:
        print(f"{1e-3 * young:5.1f} kPa: {sunk:.3f} mm")
    assert all(soft[1] > stiff[1] for soft, stiff in itertools.pairwise(rows))
