"""Meshes: tetrahedra and the surface around them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from palpate import _arrays, _core
from palpate._arrays import Float64Array, IndexArray


@dataclass(frozen=True)
class Defect:
    """Something suspicious about a mesh that can still be used.

    ``indices`` are the first few elements concerned out of ``count``.
    """

    kind: str
    count: int
    indices: tuple[int, ...]
    message: str

    def __str__(self) -> str:
        return self.message


class Mesh:
    """Node positions, tetrahedra and their surface; immutable.

    Parameters
    ----------
    nodes : array_like, shape (n, 3)
        Positions [m], finite.
    tetrahedra : array_like of int, shape (m, 4), optional
        Node indices, positive volume. Their surface is extracted.
    triangles : array_like of int, shape (t, 3), optional
        Instead of tetrahedra: a surface (membrane, cloth, rigid tool), outward.
    node_sets : mapping of str to array_like of int, optional
        Named sets of nodes.
    regions : array_like of int, shape (m,), optional
        Region number of each tetrahedron.
    fibres : array_like, shape (m, 3) or (m, 2, 3), optional
        Direction of the fibres of each tetrahedron, of one or two families; any length, zero
        where there is none.
    repair : bool
        Re-orient inverted tetrahedra, drop degenerate and duplicate ones and unused nodes, instead
        of refusing them. What was done is in ``notes``.

    Raises
    ------
    MeshError
        If the arrays do not make a mesh; the message names the element and the fix.
    """

    def __init__(
        self,
        nodes: npt.ArrayLike,
        tetrahedra: npt.ArrayLike | None = None,
        triangles: npt.ArrayLike | None = None,
        *,
        node_sets: Mapping[str, npt.ArrayLike] | None = None,
        regions: npt.ArrayLike | None = None,
        fibres: npt.ArrayLike | None = None,
        repair: bool = False,
    ) -> None:
        if tetrahedra is not None and triangles is not None:
            raise ValueError(
                "triangles: the surface of tetrahedra is extracted; give tetrahedra or triangles"
            )
        sets = {
            str(name): _arrays.indices(members, f"node_sets[{name!r}]", None)
            for name, members in _arrays.mapping(node_sets or {}, "node_sets").items()
        }
        self._core, self._notes = _core.Mesh.build(
            _arrays.points(nodes, "nodes"),
            None if tetrahedra is None else _arrays.indices(tetrahedra, "tetrahedra", 4),
            None if triangles is None else _arrays.indices(triangles, "triangles", 3),
            sets,
            None if regions is None else _arrays.indices(regions, "regions", None),
            [] if fibres is None else _families(fibres),
            bool(repair),
        )

    @classmethod
    def _from_core(cls, core: _core.Mesh, notes: list[str] | None = None) -> Mesh:
        mesh = cls.__new__(cls)
        mesh._core = core
        mesh._notes = notes or []
        return mesh

    @cached_property
    def nodes(self) -> Float64Array:
        """Node positions [m], shape (n, 3), read-only."""
        return self._core.nodes

    @cached_property
    def tetrahedra(self) -> IndexArray:
        """Node indices of the tetrahedra, shape (m, 4), read-only; m = 0 for a surface."""
        return self._core.tetrahedra

    @cached_property
    def triangles(self) -> IndexArray:
        """Surface triangles, shape (t, 3), outward, read-only."""
        return self._core.triangles

    @cached_property
    def triangle_owners(self) -> IndexArray:
        """Tetrahedron that owns each surface triangle, shape (t,); empty for a surface."""
        return self._core.triangle_owners

    @cached_property
    def surface_nodes(self) -> IndexArray:
        """Sorted indices of the nodes on the surface."""
        return self._core.surface_nodes

    @cached_property
    def surface_edges(self) -> IndexArray:
        """Edges of the surface, shape (e, 2), smaller node first, sorted."""
        return self._core.surface_edges

    @property
    def node_sets(self) -> dict[str, IndexArray]:
        """Named node sets, each sorted."""
        return self._core.node_sets

    @cached_property
    def regions(self) -> IndexArray | None:
        """Region number of each tetrahedron, shape (m,), or None."""
        return self._core.regions

    @cached_property
    def fibres(self) -> Float64Array | None:
        """Fibre direction of each tetrahedron, shape (m, 3), of two families (m, 2, 3), or None."""
        first, second = self._core.fibres
        if len(second) == 0:
            return first if len(first) else None
        both = np.stack([first if len(first) else np.zeros_like(second), second], axis=1)
        both.flags.writeable = False
        return both

    @cached_property
    def volume(self) -> float:
        """Volume of the tetrahedra, or enclosed by a closed surface [m³]."""
        return self._core.volume

    @property
    def notes(self) -> tuple[str, ...]:
        """What reading or repair left out or changed."""
        return tuple(self._notes)

    def validate(self) -> list[Defect]:
        """What is allowed but suspicious: unused nodes, non-manifold edges, bad elements."""
        return [
            Defect(kind, total, tuple(first), message)
            for kind, total, first, message in self._core.validate()
        ]

    def with_nodes(self, nodes: npt.ArrayLike) -> Mesh:
        """The same topology with other node positions [m], shape (n, 3)."""
        moved = _arrays.points(nodes, "nodes", len(self.nodes))
        return Mesh._from_core(self._core.with_nodes(moved))

    def __eq__(self, other: Any) -> bool:
        if not isinstance(other, Mesh):
            return NotImplemented
        return self._core.same_as(other._core)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return (
            f"Mesh({len(self.nodes)} nodes, {len(self.tetrahedra)} tetrahedra, "
            f"{len(self.triangles)} surface triangles)"
        )


def _families(fibres: npt.ArrayLike) -> list[Float64Array]:
    """One array of shape (m, 3) for each family."""
    array = np.asarray(fibres)
    if array.ndim == 3 and array.shape[1] in (1, 2):
        return [_arrays.points(array[:, family], "fibres") for family in range(array.shape[1])]
    if array.ndim == 3:
        raise ValueError(f"fibres: expected shape (m, 3) or (m, 2, 3), got {array.shape}")
    return [_arrays.points(fibres, "fibres")]


def as_mesh(value: Any, name: str) -> Mesh:
    """``value`` if it is a mesh, otherwise a TypeError that names the argument."""
    if isinstance(value, Mesh):
        return value
    raise TypeError(f"{name}: expected a palpate.Mesh, got {type(value).__name__}")


__all__ = ["Defect", "Mesh", "as_mesh"]
