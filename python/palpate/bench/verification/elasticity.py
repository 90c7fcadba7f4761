"""Static elasticity: patch tests, convergence, beams and bars."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from palpate._arrays import Float64Array
from palpate.bench.verification import laws
from palpate.bench.verification.shapes import (
    Field,
    body_loads,
    box,
    bumps,
    l2_distance,
    traction_loads,
)
from palpate.bench.verification.statics import settle
from palpate.mesh import Mesh
from palpate.model import Body, Material

#: Deformation gradients less the identity of the patch tests: small and symmetric for the linear
#: law, whose frame turns with the body, large and with rotation for the others.
SMALL = np.array([[1e-3, 4e-4, -2e-4], [4e-4, -6e-4, 3e-4], [-2e-4, 3e-4, 5e-4]])
LARGE = np.array([[0.2, 0.15, -0.1], [-0.05, -0.1, 0.1], [0.05, -0.1, 0.15]])


def patch(mesh: Mesh, material: Material) -> float:
    """Largest error of a node over the largest displacement: the surface moves affinely.

    The inner nodes start elsewhere and must take the same affine map.
    """
    gradient = SMALL if material.law == "linear" else LARGE
    on = np.zeros(len(mesh.nodes), dtype=bool)
    on[mesh.surface_nodes] = True
    centered = mesh.nodes - mesh.nodes.mean(axis=0)
    exact = mesh.nodes + centered @ gradient.T
    start = np.where(on[:, None], exact, mesh.nodes + 0.9 * centered @ gradient.T)
    body = Body(mesh, name=material.law, material=material, fixed_nodes=np.flatnonzero(on))
    found = settle(body, start=start, tolerance=1e-15)
    return float(np.abs(found - exact).max() / np.abs(exact - mesh.nodes).max())


def deform(x: Float64Array, amplitude: float) -> Float64Array:
    """A smooth displacement that no polynomial is; takes complex places too."""
    a, b, c = x.T
    waves = [
        np.sin(2.1 * a + 0.3) * np.cos(1.7 * b) + 0.4 * c * c,
        np.cos(1.3 * a) * np.sin(1.9 * c + 0.5) - 0.3 * a * b,
        np.sin(1.5 * b + 0.8) * np.cos(2.3 * c) + 0.2 * a * a,
    ]
    return np.stack(waves, axis=-1) * amplitude


def deformation_gradient(x: Float64Array, amplitude: float) -> Float64Array:
    """Of :func:`deform`, by complex steps: exact to round-off."""
    columns = []
    for axis in range(3):
        step = np.zeros(3, dtype=complex)
        step[axis] = 1e-30j
        columns.append(deform(x + step, amplitude).imag / 1e-30)
    return np.stack(columns, axis=-1) + np.eye(3)


def balancing_force(material: Material, amplitude: float) -> Field:
    """Force density [N/m³] that holds :func:`deform`: minus the divergence of the stress."""

    def force(x: Float64Array) -> Float64Array:
        h, total = 1e-3, np.zeros_like(x)
        for axis in range(3):
            step = np.zeros(3)
            step[axis] = h
            for offset, weight in ((-2, 1.0), (-1, -8.0), (1, 8.0), (2, -1.0)):
                f = deformation_gradient(x + offset * step, amplitude)
                total += weight / (12 * h) * laws.stress(material, f)[..., axis]
        return -total

    return force


@dataclass(frozen=True)
class Convergence:
    """Error in L2 [m^2.5] over the cells per edge, and the rate between the last two."""

    cells: tuple[int, ...]
    errors: tuple[float, ...]

    @property
    def rate(self) -> float:
        """Order of the error in the length of a cell."""
        ratio = np.log(self.errors[-2] / self.errors[-1])
        return float(ratio / np.log(self.cells[-1] / self.cells[-2]))


def convergence(material: Material, cells: Sequence[int]) -> Convergence:
    """A manufactured solution on cubes of distorted cells, finer and finer."""
    amplitude = 1e-6 if material.law == "linear" else 0.15
    force = balancing_force(material, amplitude)
    errors = []
    for count in cells:
        mesh = box((count,) * 3, (1.0, 1.0, 1.0), bumps(0.04))
        displaced = deform(mesh.nodes, amplitude)
        on = np.zeros(len(mesh.nodes), dtype=bool)
        on[mesh.surface_nodes] = True
        start = mesh.nodes + np.where(on[:, None], displaced, 0.9 * displaced)
        body = Body(mesh, name=material.law, material=material, fixed_nodes=np.flatnonzero(on))
        found = settle(
            body, forces=body_loads(mesh, force), start=start, tolerance=1e-4 * amplitude / count**2
        )
        errors.append(
            l2_distance(mesh, found - mesh.nodes, lambda x: deform(x, amplitude)) / amplitude
        )
    return Convergence(tuple(cells), tuple(errors))


@dataclass(frozen=True)
class Refinement:
    """A result at falling cell sizes, over theory."""

    cells: tuple[int, ...]
    ratios: tuple[float, ...]

    @property
    def limit(self) -> float:
        """Of cells of no size, from the last two: the mesh adds stiffness with their square."""
        (n, m), (a, b) = self.cells[-2:], (1 / ratio for ratio in self.ratios[-2:])
        return 1 / (b - (a - b) * n**2 / (m**2 - n**2))


def _refine(cells: Sequence[int], solve: Callable[[int], float], exact: float) -> Refinement:
    return Refinement(tuple(cells), tuple(solve(count) / exact for count in cells))


def _beam(
    cells: tuple[int, int, int],
    size: tuple[float, float, float],
    material: Material,
    load: tuple[float, float, float],
    place: Field | None = None,
    stages: int = 1,
) -> Float64Array:
    """Mean displacement [m] of the end of a beam along x that is held at its start."""
    plain = box(cells, size)
    mesh = plain if place is None else box(cells, size, place)
    held = np.flatnonzero(plain.nodes[:, 0] == 0.0)
    end = plain.nodes[:, 0] == size[0]
    area = size[1] * size[2]
    forces = traction_loads(plain, end, lambda n: np.broadcast_to(np.array(load) / area, n.shape))
    body = Body(mesh, name="beam", material=material, fixed_nodes=held)
    found = settle(body, forces=forces, stages=stages, tolerance=1e-9)
    moved: Float64Array = (found - mesh.nodes)[end].mean(axis=0)
    return moved


def cantilever(cells: Sequence[int]) -> Refinement:
    """Sag of a short beam under a load at its end, over Timoshenko's."""
    length, height, load = 1.0, 0.25, 0.5
    material = Material(young=1e6, poisson=0.3, damping=0.0)
    inertia = height**4 / 12
    shear = material.young / (2 * (1 + material.poisson))
    # Cowper (1966), rectangular section.
    kappa = 10 * (1 + material.poisson) / (12 + 11 * material.poisson)
    exact = load * length**3 / (3 * material.young * inertia)
    exact += load * length / (kappa * shear * height**2)

    def sag(count: int) -> float:
        divided = (4 * count, count, count)
        return float(-_beam(divided, (length, height, height), material, (0, 0, -load))[2])

    return _refine(cells, sag, exact)


def bar(cells: int) -> float:
    """Stretch of a bar under its own weight over rho g L² / 2E."""
    length, young = 0.4, 2e5
    mesh = box((2, 2, cells), (0.1, 0.1, length))
    held = np.flatnonzero(mesh.nodes[:, 2] == length)
    material = Material(young=young, poisson=0.0, damping=0.0)
    body = Body(mesh, name="bar", material=material, fixed_nodes=held)
    found = settle(body, gravity=(0, 0, -9.81))
    sunk = -found[mesh.nodes[:, 2] == 0.0][:, 2].mean()
    return float(sunk / (1000 * 9.81 * length**2 / (2 * young)))


#: The twisted beam of MacNeal and Harder (1985): length, width, thickness; E, nu; and the
#: deflections of its end along a unit load in the plane of its end and across it.
TWISTED = (12.0, 1.1, 0.32, 29e6, 0.22)
TWISTED_IN_PLANE, TWISTED_ACROSS = 5.424e-3, 1.754e-3


def twisted_beam(cells: Sequence[int], axis: int) -> Refinement:
    """Deflection of a beam twisted by 90 degrees; ``axis`` 1 or 2 of the load.

    ``cells`` across the thickness. At the end the width lies along z: there a load along z is in
    its plane.
    """
    length, width, thickness, young, poisson = TWISTED

    def place(x: Float64Array) -> Float64Array:
        angle = 0.5 * np.pi * x[:, 0] / length
        y, z = x[:, 1] - width / 2, x[:, 2] - thickness / 2
        c, s = np.cos(angle), np.sin(angle)
        return np.column_stack([x[:, 0], c * y - s * z, s * y + c * z])

    material = Material(young=young, poisson=poisson, damping=0.0)
    load = (0.0, 1.0, 0.0) if axis == 1 else (0.0, 0.0, 1.0)

    def deflection(count: int) -> float:
        divided = (18 * count, 2 * count, count)
        return float(_beam(divided, (length, width, thickness), material, load, place)[axis])

    return _refine(cells, deflection, TWISTED_IN_PLANE if axis == 2 else TWISTED_ACROSS)


def elastica(load: float) -> tuple[float, float]:
    """Sag and shortening over the length, of a slender cantilever; ``load`` is P L² / E I.

    The pendulum equation by Runge-Kutta steps, its start by bisection (Bisshopp, Drucker 1945).
    """
    count = 200
    h = 1.0 / count

    def shoot(slope: float) -> tuple[float, float, float]:
        angle, sag, along = 0.0, 0.0, 0.0
        for _ in range(count):
            # Runge-Kutta-Nystroem, then Simpson's rule.
            k1 = -load * math.cos(angle)
            k2 = -load * math.cos(angle + 0.5 * h * slope + 0.125 * h * h * k1)
            k3 = -load * math.cos(angle + h * slope + 0.5 * h * h * k2)
            middle = angle + 0.5 * h * slope + 0.125 * h * h * k1
            end = angle + h * slope + h * h / 6 * (k1 + 2 * k2)
            slope += h / 6 * (k1 + 4 * k2 + k3)
            sag += h / 6 * (math.sin(angle) + 4 * math.sin(middle) + math.sin(end))
            along += h / 6 * (math.cos(angle) + 4 * math.cos(middle) + math.cos(end))
            angle = end
        return slope, sag, 1.0 - along

    low, high = 0.0, load
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if shoot(middle)[0] > 0 else (middle, high)
    _, sag, short = shoot(middle)
    return sag, short


@dataclass(frozen=True)
class Bending:
    """A cantilever in large rotation.

    ``sag`` over the elastica's under the same load; ``shape_errors`` of the shortening over that
    of the elastica with the same sag, one per refinement.
    """

    sag: Refinement
    shape_errors: tuple[float, ...]
    moved: tuple[tuple[float, float], ...]


def bent_beam(law: str, load: float, cells: Sequence[int]) -> Bending:
    """A slender cantilever of a law, its end loaded by ``load`` E I / L²."""
    slenderness, young = 20, 1e6
    height = 1.0 / slenderness
    material = Material(law=law, young=young, poisson=0.0, damping=0.0)
    force = load * young * height**4 / 12
    size, pull = (1.0, height, height), (0.0, 0.0, -force)
    ends = [
        _beam((slenderness * count // 2, count, count), size, material, pull, stages=4)
        for count in cells
    ]
    moved = tuple((float(-end[2]), float(-end[0])) for end in ends)
    exact = elastica(load)[0]
    errors = tuple(abs(short / elastica(_load_of(sag))[1] - 1) for sag, short in moved)
    return Bending(Refinement(tuple(cells), tuple(sag / exact for sag, _ in moved)), errors, moved)


def _load_of(sag: float) -> float:
    """The load under which an elastica sags by a part of its length."""
    low, high = 0.0, 20.0
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if elastica(middle)[0] > sag else (middle, high)
    return middle
