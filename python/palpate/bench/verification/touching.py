"""Contact: Hertz, the contact patch test, stick and slip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate._arrays import Float64Array
from palpate.bench.verification.shapes import box, graded, gradients, grid, traction_loads
from palpate.mesh import Mesh
from palpate.model import Body, Contact, Material, Model, RigidKey
from palpate.simulation import Simulation


def sphere_surface(radius: float, rings: int, reach: float) -> Mesh:
    """The lowest part of a sphere that touches the origin from above, a surface of triangles [m].

    ``rings`` of triangles out to the distance ``reach`` from the axis.
    """
    rho = np.linspace(0.0, reach, rings + 1)[1:]
    nodes, rows = [np.zeros((1, 3))], [np.array([0])]
    for ring, distance in enumerate(rho, start=1):
        angle = 2 * np.pi * (np.arange(6 * ring) + 0.0) / (6 * ring)
        height = radius - np.sqrt(radius**2 - distance**2)
        rows.append(sum(map(len, rows)) + np.arange(6 * ring))
        nodes.append(
            np.column_stack(
                [distance * np.cos(angle), distance * np.sin(angle), np.full(6 * ring, height)]
            )
        )
    triangles = []
    for ring in range(1, rings + 1):
        inner, outer = rows[ring - 1], rows[ring]
        for sector in range(6):
            for k in range(ring):
                a = outer[(sector * ring + k) % len(outer)]
                b = outer[(sector * ring + k + 1) % len(outer)]
                c = inner[(sector * (ring - 1) + k) % len(inner)]
                triangles.append([a, c, b])
                if k < ring - 1:
                    d = inner[(sector * (ring - 1) + k + 1) % len(inner)]
                    triangles.append([b, c, d])
    return Mesh(np.concatenate(nodes), triangles=np.array(triangles))


#: Length of a step without inertia [s], and how many of them one load is given.
_LONG, _STEPS = 1e3, 12


@dataclass(frozen=True)
class Hertz:
    """One load of a rigid sphere on a soft half space, and what theory says.

    ``radius`` of the contact and ``depth`` [m] under ``load`` [N]; ``distances`` from the axis [m]
    and ``pressures`` [Pa] at the contact nodes.
    """

    load: float
    radius: float
    depth: float
    exact_radius: float
    exact_depth: float
    exact_pressure: float
    distances: Float64Array
    pressures: Float64Array


def boussinesq(x: Float64Array, load: float, material: Material) -> Float64Array:
    """Displacement [m] of a half space z < 0 at ``x`` under ``load`` [N] along -z at the origin."""
    mu = material.young / (2 * (1 + material.poisson))
    depth = -x[:, 2]
    far = np.linalg.norm(x, axis=1)
    outward = depth / far**3 - (1 - 2 * material.poisson) / (far * (far + depth))
    down = 2 * (1 - material.poisson) / far + depth**2 / far**3
    return load / (4 * np.pi * mu) * np.column_stack([outward[:, None] * x[:, :2], -down])


def hertz(
    cells: int,
    depths: Sequence[float],
    sphere_radius: float = 0.05,
    law: str = "linear",
    reach: float = 6.0,
) -> list[Hertz]:
    """A rigid sphere lowered onto a soft block, ``cells`` to the largest radius of contact.

    The block is fine below the sphere and grows to ``reach`` contact radii on every side.
    """
    young, poisson = 10e3, 0.3
    largest = float(np.sqrt(sphere_radius * max(depths)))
    fine = largest / cells
    half = graded(fine, cells + 2, 1.35, reach * largest)
    across = np.concatenate([-half[:0:-1], half])
    down = -graded(fine, cells + 2, 1.35, reach * largest)[::-1]
    block = grid(across, across, down)
    material = Material(law=law, young=young, poisson=poisson, damping=0.0)
    edge = fine
    contact = Contact(distance=1e-3 * edge, stiffness=40 * young / edge, self_contact=False)
    held = np.flatnonzero(
        (block.nodes[:, 2] == down[0]) | (np.abs(block.nodes[:, :2]).max(axis=1) >= across[-1])
    )
    cap = sphere_surface(sphere_radius, 4 * cells, 1.6 * largest)
    stop = _STEPS * _LONG
    # Down to each depth within the first of its steps, then at rest.
    keys = [RigidKey(0.0)]
    for index, depth in enumerate(depths):
        place = (0.0, 0.0, -depth)
        keys += [RigidKey(index * stop + _LONG, place), RigidKey((index + 1) * stop, place)]
    bodies = [
        Body(block, name="block", material=material, fixed_nodes=held, contact=contact),
        Body(cap, name="sphere", rigid=keys, contact=contact),
    ]
    top = block.nodes[:, 2] == 0.0
    areas = np.linalg.norm(traction_loads(block, top, lambda n: n), axis=1)
    simulation = Simulation(Model(bodies, gravity=(0, 0, 0)), time_step=_LONG)
    effective = young / (1 - poisson**2)
    results = []
    for depth in depths:
        expected = 4 / 3 * effective * np.sqrt(sphere_radius * depth**3)
        moved = simulation.positions[0].copy()
        moved[held] = block.nodes[held] + boussinesq(block.nodes[held], expected, material)
        simulation.set_positions("block", moved)
        for _ in range(_STEPS):
            before = simulation.positions[0]
            simulation.step()
            simulation.set_velocities(0, np.zeros_like(before))
        forces = simulation.contact_forces[0]
        load = float(-forces[:, 2].sum())
        where = np.linalg.norm(block.nodes[:, :2], axis=1)
        touched = np.flatnonzero((forces[:, 2] < 0) & top)
        # The mean square distance of Hertz's pressure is 2/5 of the square of the radius.
        radius = np.sqrt(2.5 * (-forces[:, 2] @ where**2) / load)
        exact_radius = (0.75 * load * sphere_radius / effective) ** (1 / 3)
        results.append(
            Hertz(
                load,
                float(radius),
                depth,
                float(exact_radius),
                float(exact_radius**2 / sphere_radius),
                float(1.5 * load / (np.pi * exact_radius**2)),
                where[touched],
                -forces[touched, 2] / areas[touched],
            )
        )
    return results


@dataclass(frozen=True)
class ContactPatch:
    """Two blocks pressed together across meshes that do not match.

    ``stress`` [Pa] of each tetrahedron along the load, its height [m]; ``pressure`` [Pa] applied.
    """

    pressure: float
    heights: Float64Array
    stress: Float64Array

    @property
    def largest_error(self) -> float:
        """Of the stress in any tetrahedron, over the pressure."""
        return float(np.abs(self.stress / -self.pressure - 1.0).max())

    @property
    def typical_error(self) -> float:
        """Root mean square of the same."""
        return float(np.sqrt(np.mean((self.stress / -self.pressure - 1.0) ** 2)))


def contact_patch(lower: int, upper: int, pressure: float = 100.0) -> ContactPatch:
    """A block on a block that is held below, of ``lower`` and ``upper`` cells per edge.

    Without lateral strain (nu = 0) the exact stress is the pressure, everywhere. Friction holds the
    upper block: without it, it would slide off under a load that does not turn with it.
    """
    young, size = 10e3, 0.1
    material = Material(young=young, poisson=0.0, damping=0.05)
    below = box((lower, lower, lower), (size, size, size))
    above = box((upper, upper, upper), (size, size, size), lambda x: np.add(x, [0, 0, size]))
    contact = Contact(friction=0.3, self_contact=False)
    held = np.flatnonzero(below.nodes[:, 2] == 0.0)
    bodies = [
        Body(below, name="lower", material=material, fixed_nodes=held, contact=contact),
        Body(above, name="upper", material=material, contact=contact),
    ]
    simulation = Simulation(Model(bodies, gravity=(0, 0, 0)))
    top = above.nodes[:, 2] > 2 * size - 1e-9
    simulation.set_forces("upper", traction_loads(above, top, lambda n: -pressure * n))
    for _ in range(400):
        simulation.step()
        if np.abs(simulation.velocities[1]).max() < 1e-6 * size:
            break
    heights, stresses = [], []
    for mesh, x in zip((below, above), simulation.positions, strict=True):
        heights.append(mesh.nodes[mesh.tetrahedra].mean(axis=1)[:, 2])
        stresses.append(young * (gradients(mesh, x)[:, 2, 2] - 1.0))
    return ContactPatch(pressure, np.concatenate(heights), np.concatenate(stresses))


@dataclass(frozen=True)
class Slide:
    """A block on an incline: its acceleration [m/s²] downhill, and Coulomb's."""

    slope: float
    acceleration: float
    exact: float


def incline(slope: float, friction: float, cells: int = 4) -> Slide:
    """A soft block on a rigid incline with tan(angle) = ``slope``; gravity leans instead."""
    size = (0.1, 0.1, 0.04)
    contact = Contact(friction=friction)
    material = Material(young=5e4, poisson=0.3, damping=0.01)
    block = box((cells, cells, cells // 2), size, lambda x: np.add(x, [-0.05, -0.05, 1e-5]))
    plate = Mesh(
        np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * 20.0,
        triangles=[[0, 1, 2], [0, 2, 3]],
    )
    angle = np.arctan(slope)
    g = 9.81
    bodies = [
        Body(block, name="block", material=material, contact=contact),
        Body(plate, name="incline", rigid=(), contact=contact),
    ]
    leaning = (g * np.sin(angle), 0.0, -g * np.cos(angle))
    simulation = Simulation(Model(bodies, gravity=leaning))
    simulation.step(60)
    first = simulation.velocities[0][:, 0].mean()
    simulation.step(60)
    last = simulation.velocities[0][:, 0].mean()
    exact = max(0.0, g * (np.sin(angle) - friction * np.cos(angle)))
    return Slide(slope, float(last - first), float(exact))


def friction_angle(friction: float) -> float:
    """The slope at which the block starts to slide, by bisection, over the friction."""
    low, high = 0.8 * friction, 1.2 * friction
    for _ in range(10):
        middle = 0.5 * (low + high)
        slides = incline(middle, friction).acceleration > 1e-3
        low, high = (low, middle) if slides else (middle, high)
    return middle / friction
