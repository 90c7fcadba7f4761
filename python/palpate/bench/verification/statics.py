"""Static solutions: implicit Euler with long steps until nothing moves."""

from __future__ import annotations

import numpy as np

from palpate._arrays import Float64Array
from palpate.model import Body, Model
from palpate.simulation import Simulation

#: Length of a step that has no inertia to speak of [s].
LONG = 1e3


def settle(
    body: Body,
    *,
    forces: Float64Array | None = None,
    start: Float64Array | None = None,
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
    stages: int = 1,
    tolerance: float = 1e-13,
    most: int = 2000,
    time_step: float = LONG,
) -> Float64Array:
    """Positions [m] of a body at rest under ``forces`` [N], applied in ``stages`` equal parts.

    The end is where a step moves no node by more than ``tolerance`` of the body's size.
    """
    simulation = Simulation(Model([body], gravity=gravity), time_step=time_step)
    if start is not None:
        simulation.set_positions(0, start)
    size = float(np.ptp(body.mesh.nodes, axis=0).max())
    for stage in range(1, stages + 1):
        if forces is not None:
            simulation.set_forces(0, forces * (stage / stages))
        for _ in range(most):
            before = simulation.positions[0]
            simulation.step()
            # A long step would carry on what the last one moved.
            simulation.set_velocities(0, np.zeros_like(before))
            if np.abs(simulation.positions[0] - before).max() <= tolerance * size:
                break
        else:
            raise RuntimeError(f"{body.name}: still moving after {most} steps")
    return simulation.positions[0]
