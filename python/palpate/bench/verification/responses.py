"""The laws' answer to stretch, shear and rotation, read from simulations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate._arrays import Float64Array
from palpate.bench.verification import laws
from palpate.bench.verification.shapes import box, bumps, masses, traction_loads
from palpate.mesh import Mesh
from palpate.model import Body, Material, Model
from palpate.simulation import Simulation

_SIDE = 0.1


def _block(material: Material) -> tuple[Mesh, Body]:
    mesh = box((3, 3, 3), (1.0, 1.0, 1.0), lambda x: _SIDE * (bumps(0.05)(x) - 0.5))
    return mesh, Body(mesh, name=material.law, material=material)


@dataclass(frozen=True)
class Curve:
    """Stress over a path of deformations: ``measured`` and ``exact`` nominal stress [Pa]."""

    parameters: Float64Array
    measured: Float64Array
    exact: Float64Array

    @property
    def error(self) -> float:
        """Largest difference over the largest stress."""
        return float(np.abs(self.measured - self.exact).max() / np.abs(self.exact).max())


def _curve(material: Material, values: Sequence[float], shape: str) -> Curve:
    mesh, body = _block(material)
    simulation = Simulation(Model([body], gravity=(0, 0, 0)))

    def energy(f: Float64Array) -> float:
        simulation.set_positions(0, mesh.nodes @ f.T)
        return simulation.energy()["elastic"] / mesh.volume

    measured, exact = [], []
    h = 1e-5
    for value in values:
        if shape == "uniaxial":
            lateral, nominal = laws.uniaxial(material, value)
            f, way = np.diag([value, lateral, lateral]), np.diag([1.0, 0.0, 0.0])
        else:
            f, way = np.eye(3), np.zeros((3, 3))
            f[0, 1], way[0, 1] = value, 1.0
            nominal = float(laws.stress(material, f)[0, 1])
        measured.append((energy(f + h * way) - energy(f - h * way)) / (2 * h))
        exact.append(nominal)
    return Curve(np.array(values), np.array(measured), np.array(exact))


def uniaxial(material: Material, stretches: Sequence[float]) -> Curve:
    """Nominal stress of a bar without lateral stress: the slope of the simulation's energy."""
    return _curve(material, stretches, "uniaxial")


def simple_shear(material: Material, shears: Sequence[float]) -> Curve:
    """Shear component xy of the first Piola-Kirchhoff stress in simple shear of x along y."""
    return _curve(material, shears, "shear")


def unbalanced(material: Material, f: Float64Array) -> float:
    """A deformed block under the tractions that closed form says hold it: what force is left over.

    Over the largest traction force on a node; forces are read from the velocities after a step so
    short that only they count.
    """
    mesh, body = _block(material)
    step = 1e-7
    simulation = Simulation(Model([body], gravity=(0, 0, 0)), time_step=step)
    on = np.zeros(len(mesh.nodes), dtype=bool)
    on[mesh.surface_nodes] = True
    pressure = laws.stress(material, f)
    loads = traction_loads(mesh, on, lambda n: n @ pressure.T)
    simulation.set_positions(0, mesh.nodes @ f.T)
    simulation.set_forces(0, loads)
    simulation.step()
    forces = simulation.velocities[0] * masses(mesh)[:, None] / step
    return float(np.abs(forces).max() / np.abs(loads).max())


def turned(axis: Sequence[float], angle: float) -> Float64Array:
    """Rotation matrix (Rodrigues)."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k)


@dataclass(frozen=True)
class Invariance:
    """What a rotation of everything changes, over the size of the body or its energy."""

    energy: float
    positions: float


def rotation_invariance(material: Material, rotation: Float64Array, steps: int = 30) -> Invariance:
    """Two runs of a struck body, everything in the second turned: bodies, speeds, gravity, load."""
    mesh, _ = _block(material)
    # Smooth, so that nothing turns inside out.
    shake = 0.15 * np.sin(np.pi * mesh.nodes[:, [1, 2, 0]] / _SIDE + [0.3, 1.1, 2.0]) * _SIDE
    velocity = np.add(np.cross([3.0, 5.0, -4.0], mesh.nodes), [0.3, 0.1, 0.2])
    held = np.flatnonzero(mesh.nodes[:, 0] < -0.49 * _SIDE)
    energies, ends = [], []
    for turn in (np.eye(3), rotation):
        placed = Mesh(mesh.nodes, mesh.tetrahedra)
        body = Body(placed, name="struck", material=material)
        gravity = tuple(turn @ np.array([0.0, 0.0, -9.81]))
        simulation = Simulation(Model([body], gravity=gravity))
        simulation.set_positions(0, (mesh.nodes + shake) @ turn.T)
        simulation.set_velocities(0, velocity @ turn.T)
        load = np.zeros_like(mesh.nodes)
        load[held] = 0.02 * turn @ np.array([1.0, 0.5, 0.0])
        simulation.set_forces(0, load)
        simulation.step(steps)
        energies.append(simulation.energy()["elastic"])
        ends.append(simulation.positions[0] @ turn)
    return Invariance(
        abs(energies[1] / energies[0] - 1.0), float(np.abs(ends[1] - ends[0]).max() / _SIDE)
    )
