"""What must be kept in motion: momenta, and energy that nothing gives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate._arrays import Float64Array
from palpate.bench.verification.shapes import box, masses
from palpate.mesh import Mesh
from palpate.model import Body, Contact, Material, Model
from palpate.simulation import Simulation


@dataclass(frozen=True)
class Drift:
    """Over time [s]: error of the momenta over their size, energy over that at the start."""

    times: Float64Array
    linear: Float64Array
    angular: Float64Array
    energy: Float64Array

    @property
    def largest_gain(self) -> float:
        """Of the energy over any time before, as a part of that at the start."""
        return float((self.energy - np.minimum.accumulate(self.energy)).max())


def _momenta(
    simulation: Simulation, weights: list[Float64Array]
) -> tuple[Float64Array, Float64Array]:
    linear, angular = np.zeros(3), np.zeros(3)
    for m, x, v in zip(weights, simulation.positions, simulation.velocities, strict=True):
        impulse = m[:, None] * v
        linear += impulse.sum(axis=0)
        angular += np.cross(x, impulse).sum(axis=0)
    return linear, angular


def collision(
    law: str, steps: int = 10_000, every: int = 10, friction: float = 0.0, damping: float = 0.0
) -> Drift:
    """A spinning block is hit by another, off its centre; then both fly on, spinning."""
    material = Material(law=law, young=2e4, poisson=0.3, damping=damping)
    contact = Contact(friction=friction)
    first = box((3, 3, 3), (0.1, 0.1, 0.1))
    second = box((3, 2, 2), (0.1, 0.08, 0.06), lambda x: np.add(x, [0.12, 0.04, 0.03]))
    bodies = [
        Body(first, name="first", material=material, contact=contact, initial_velocity=(0.6, 0, 0)),
        Body(second, name="second", material=material, contact=contact),
    ]
    simulation = Simulation(Model(bodies, gravity=(0, 0, 0)))
    spin = np.cross([0.0, 2.0, 4.0], first.nodes - first.nodes.mean(axis=0))
    simulation.set_velocities("first", np.add(spin, [0.6, 0.0, 0.0]))
    return _record(simulation, [masses(first), masses(second)], steps, every)


def _record(simulation: Simulation, weights: list[Float64Array], steps: int, every: int) -> Drift:
    linear, angular = _momenta(simulation, weights)
    start = sum(simulation.energy().values())
    rows = [(0.0, 0.0, 0.0, 1.0)]
    for _ in range(steps // every):
        simulation.step(every)
        p, spin = _momenta(simulation, weights)
        rows.append(
            (
                simulation.time,
                float(np.linalg.norm(p - linear) / np.linalg.norm(linear)),
                float(np.linalg.norm(spin - angular) / np.linalg.norm(angular)),
                sum(simulation.energy().values()) / start,
            )
        )
    return Drift(*np.array(rows, dtype=np.float64).T)


def prison(law: str, steps: int, damping: float = 0.0) -> Drift:
    """A block that bounces about in a closed rigid box, without gravity: energy only."""
    block = box((3, 3, 3), (0.1, 0.1, 0.1), lambda x: x - 0.05)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * 0.12
    # Six walls that face inward and share no nodes: a closed surface would be a solid body.
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [t for a, b, c, d in faces for t in ((a, c, b), (a, d, c))]
    material = Material(law=law, young=2e4, poisson=0.3, damping=damping)
    bodies = [
        Body(block, name="block", material=material, initial_velocity=(1.0, 0.7, 0.4)),
        Body(
            Mesh(corners[np.array(triangles).ravel()], triangles=np.arange(36).reshape(12, 3)),
            name="room",
            rigid=(),
        ),
    ]
    simulation = Simulation(Model(bodies, gravity=(0, 0, 0)))
    energy = [sum(simulation.energy().values())]
    for _ in range(steps):
        simulation.step()
        energy.append(sum(simulation.energy().values()))
    times = np.linspace(0.0, steps * simulation.time_step, steps + 1)
    zero = np.zeros(steps + 1)
    return Drift(times, zero, zero, np.array(energy) / energy[0])
