"""Which surface a blade made: what lay inside of the bodies before they were cut."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array
from palpate.mesh import Mesh
from palpate.scene import Scene
from palpate.simulation import Simulation

#: In sizes of the body: what is closer to its surface is on it.
_ROUNDING = 1e-7


class CutFaces:
    """Tells the faces of cuts in bodies that were whole once; ``wholes`` has their meshes by name.

    Pieces are known by the name of what they came off: ``kidney/2`` was part of ``kidney``.
    """

    def __init__(self, wholes: Mapping[str, Mesh]) -> None:
        self._wholes = dict(wholes)
        self._surfaces: dict[str, Scene] = {}
        self._last: dict[str, tuple[Mesh, npt.NDArray[np.uint8]]] = {}

    @classmethod
    def since_the_start(cls, simulation: Simulation) -> CutFaces:
        """Of cuts since the state that `Simulation.reset` returns to."""
        return cls({body.name: body.mesh for body in simulation.initial_model.bodies})

    def of_mesh(self, name: str, mesh: Mesh) -> npt.NDArray[np.uint8] | None:
        """1 for the surface triangles that a blade made, else 0, (m,); None for a whole body."""
        origin = self._origin(name)
        if origin is None or len(mesh.tetrahedra) == len(self._wholes[origin].tetrahedra):
            return None
        known, marks = self._last.get(name, (None, None))
        if mesh is not known or marks is None:
            marks = self.of_triangles(name, mesh.nodes, mesh.triangles)
            assert marks is not None
            self._last[name] = mesh, marks
        return marks

    def of_triangles(
        self,
        name: str,
        rest: Float64Array,
        triangles: npt.NDArray[np.integer],
        *,
        rounding: float = 0.0,
    ) -> npt.NDArray[np.uint8] | None:
        """The same for a surface at rest whose nodes are known to ``rounding`` [m]."""
        origin = self._origin(name)
        if origin is None:
            return None
        whole = self._wholes[origin]
        if origin not in self._surfaces:
            self._surfaces[origin] = Scene([whole])
        size = float(np.linalg.norm(np.ptp(whole.nodes, axis=0)))
        middles = rest[triangles].mean(axis=1)
        far = self._surfaces[origin].closest(middles).distances > _ROUNDING * size + rounding
        return far.astype(np.uint8)

    def _origin(self, name: str) -> str | None:
        return next((each for each in (name, name.split("/")[0]) if each in self._wholes), None)
