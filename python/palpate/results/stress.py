"""How much tissue is sheared: strain of the mesh alone, and stress of a simulation's bodies."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from palpate import _core
from palpate._arrays import Float64Array
from palpate.mesh import Mesh
from palpate.model import Body, Material
from palpate.simulation import Simulation


def von_mises(stress: Float64Array) -> Float64Array:
    """Von Mises stress (m,) of Cauchy stresses xx, yy, zz, xy, yz, xz of shape (m, 6)."""
    return _core.von_mises(np.ascontiguousarray(stress, dtype=np.float64))


class Strain:
    """Equivalent strain of a body's tetrahedra; with ``seen`` only of those around surface nodes.

    ``sqrt(2/3 e:e)`` of the deviator e of Green and Lagrange's strain; it needs no material, and
    rigid motion has none.
    """

    def __init__(self, mesh: Mesh, *, seen: bool) -> None:
        self._count = len(mesh.nodes)
        surface = np.full(self._count, not seen)
        surface[mesh.triangles] = True
        tetrahedra = mesh.tetrahedra[surface[mesh.tetrahedra].any(axis=1)]
        self._corners = np.ascontiguousarray(tetrahedra.T)
        edges = self._edges(mesh.nodes).astype(np.float64)
        inverse = np.linalg.inv(np.moveaxis(edges, 2, 0))
        self._inverse = np.ascontiguousarray(np.moveaxis(inverse, 0, 2)).astype(np.float32)
        users = np.bincount(self._corners.reshape(-1), minlength=self._count)
        self._share = 1 / np.maximum(users, 1)

    def of(self, positions: Float64Array) -> npt.NDArray[np.float32]:
        """One number per tetrahedron (with ``seen``: of those that are looked at)."""
        edges, inverse = self._edges(positions), self._inverse
        # Rows of the transposed deformation gradient, then its right Cauchy-Green tensor.
        rows = [sum(inverse[i, k] * edges[k] for k in range(3)) for i in range(3)]
        c = {(i, j): (rows[i] * rows[j]).sum(axis=0) for i in range(3) for j in range(i, 3)}
        squared = (c[0, 0] - c[1, 1]) ** 2 + (c[1, 1] - c[2, 2]) ** 2 + (c[2, 2] - c[0, 0]) ** 2
        squared += 6 * (c[0, 1] ** 2 + c[1, 2] ** 2 + c[0, 2] ** 2)
        strain: npt.NDArray[np.float32] = np.sqrt(squared / 18)
        return strain

    def at_nodes(self, positions: Float64Array) -> Float64Array:
        """The mean of a node's tetrahedra, (n,); with ``seen`` right at surface nodes."""
        strain = self.of(positions)
        nodes = self._corners.reshape(-1)
        total = np.bincount(nodes, weights=np.tile(strain, 4), minlength=self._count)
        at_nodes: Float64Array = total * self._share
        return at_nodes

    def _edges(self, nodes: Float64Array) -> npt.NDArray[np.float32]:
        """From the first corner to the three others: edge, coordinate, tetrahedron."""
        points = np.ascontiguousarray(nodes.T)
        corners = points[:, self._corners]
        edges = np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 0)
        return np.ascontiguousarray(edges, dtype=np.float32)


class VonMises:
    """Von Mises stress of a simulation's bodies, made once per topology.

    Of bodies of law ``linear``, whose stress does not turn with the elements, it is that of Hooke's
    law for the strain that is left without the turn: three times the shear modulus times `Strain`.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._linear: dict[int, tuple[Strain, Float64Array]] = {}

    def of(self, index: int) -> Float64Array:
        """One number [Pa] per tetrahedron of a body, (m,); 0 for a rigid one."""
        body = self._simulation.model.bodies[index]
        if body.rigid is not None:
            return np.zeros(len(body.mesh.tetrahedra))
        if body.material.law != "linear":
            return von_mises(self._simulation.stress(index))
        if index not in self._linear:
            self._linear[index] = Strain(body.mesh, seen=False), 3 * shear_moduli(body)
        strain, factors = self._linear[index]
        return factors * strain.of(self._simulation.positions[index])


def shear_moduli(body: Body) -> Float64Array:
    """Shear modulus [Pa] of each tetrahedron, (m,)."""

    def modulus(material: Material) -> float:
        return material.young / (2 * (1 + material.poisson))

    moduli = np.full(len(body.mesh.tetrahedra), modulus(body.material))
    if body.mesh.regions is not None:
        for region, material in body.regions.items():
            moduli[body.mesh.regions == region] = modulus(material)
    return moduli
