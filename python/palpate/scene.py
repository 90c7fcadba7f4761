"""Contact detection alone: what touches, every time the positions change."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import Any, overload

import numpy as np
import numpy.typing as npt

from palpate import _arrays, _core
from palpate._arrays import Float64Array, IndexArray
from palpate.contacts import (
    ClosestPoints,
    DetectionStats,
    Intersections,
    Penetration,
    Proximity,
    RayHits,
)
from palpate.cutting import Blade, BodyCut, MeshChange, as_blade, chosen, cut_options
from palpate.mesh import Mesh, as_mesh
from palpate.model import Body, Model, body_index, read_model, unique_name

#: Ways to find the touching triangles; all give the same pairs.
METHODS = _core.METHODS

#: Where a tree node is split along the longest axis of its box.
SPLITS = ("middle", "count")


class Scene:
    """Finds touching surfaces, between bodies and within each.

    Parameters
    ----------
    bodies : Model, path of a model, or iterable of Mesh or Body
        What is in the scene. A single mesh will do.
    leaf_size : int, optional
        Most tetrahedra in a leaf of the bounding tree (the paper's K).
    split : {"middle", "count"}
        Where a box is split along its longest axis: in the middle of its centroids' space, or so
        that both sides hold equally many.
    method : {"wide", "paper", "all-pairs", "hash"}
        Blocks of eight surface triangles in the tree's order, the paper's tree itself, the double
        loop over all triangles, or spatial hashing (Teschner et al. 2003). All give the same pairs.
    threads : int
        Worker threads; the result does not depend on it.

    Examples
    --------
    >>> import palpate
    >>> scene = palpate.Scene("small")
    >>> len(scene.intersections())
    0
    """

    def __init__(
        self,
        bodies: Model | str | os.PathLike[str] | Mesh | Iterable[Mesh | Body],
        *,
        leaf_size: int | None = None,
        split: str = "middle",
        method: str = "wide",
        threads: int = 1,
    ) -> None:
        meshes, self._names, structure = _scene_parts(bodies)
        self._meshes = meshes
        self._core = _core.Scene(
            [mesh._core for mesh in meshes],
            structure,
            None if leaf_size is None else _arrays.count(leaf_size, "leaf_size"),
            _choice(split, "split", SPLITS),
            _choice(method, "method", METHODS),
            _arrays.count(threads, "threads"),
        )

    def __len__(self) -> int:
        return len(self._meshes)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each body."""
        return tuple(self._names)

    @property
    def meshes(self) -> tuple[Mesh, ...]:
        """Mesh of each body, with its rest positions."""
        return tuple(self._meshes)

    @property
    def node_offsets(self) -> IndexArray:
        """First row of each body in stacked positions, and the total; shape (bodies + 1,)."""
        return _offsets(len(mesh.nodes) for mesh in self._meshes)

    @property
    def triangle_offsets(self) -> IndexArray:
        """First triangle of each body in a stacked numbering, and the total."""
        return _offsets(len(mesh.triangles) for mesh in self._meshes)

    def add(self, body: Mesh | Body, *, name: str | None = None) -> int:
        """Add a body at its mesh's positions; returns its index."""
        mesh = body.mesh if isinstance(body, Body) else as_mesh(body, "body")
        index = self._core.add(mesh._core)
        self._meshes.append(mesh)
        default = body.name if isinstance(body, Body) else f"body_{index + 1}"
        self._names.append(unique_name(name or default, self._names))
        return index

    @overload
    def remove(self, body: int | str) -> None: ...
    @overload
    def remove(self, body: int | str, tetrahedra: npt.ArrayLike) -> MeshChange: ...
    def remove(self, body: int | str, tetrahedra: npt.ArrayLike | None = None) -> MeshChange | None:
        """Remove a body, or some tetrahedra of it.

        Bodies after a removed one move down by one index. ``tetrahedra`` are indices or a mask;
        their nodes stay where they are, and the bounding tree is kept.
        """
        index = body_index(self._names, body)
        if tetrahedra is None:
            self._core.remove(index)
            del self._meshes[index], self._names[index]
            return None
        count = len(self._meshes[index].tetrahedra)
        row = self._core.remove_tetrahedra(index, chosen(tetrahedra, count))
        change = MeshChange._from_core(row)
        self._meshes[index] = change.mesh
        return change

    def cut(
        self,
        blade: Blade,
        *,
        bodies: Iterable[int | str] | None = None,
        snap: float | None = None,
        min_quality: float | None = None,
        min_edge: float | None = None,
        min_piece: float | None = None,
    ) -> tuple[BodyCut, ...]:
        """Cut bodies of tetrahedra along a blade, where they are now.

        A blade may come in steps as short as one likes: faces that it reaches without opening
        them are remembered, until the body is changed otherwise; ``cut_area`` is then 0.
        The bounding trees are kept: tetrahedra stay in their leaves, parts of one in its leaf.
        Ignored pairs stay ignored; groups stay with what is left of a surface triangle, and new
        surface is in none.

        Parameters
        ----------
        blade : Blade
            In the space of the positions [m].
        bodies : iterable of int or str, optional
            All bodies with tetrahedra unless given.
        snap, min_quality, min_edge, min_piece
            As in `Simulation.cut`.

        Returns
        -------
        tuple of BodyCut
            The bodies that changed. Later updates take positions for their new meshes.
        """
        solid = (i for i, mesh in enumerate(self._meshes) if len(mesh.tetrahedra))
        chosen_bodies: list[int] = (
            list(solid) if bodies is None else [body_index(self._names, each) for each in bodies]
        )
        options = cut_options(snap, min_quality, min_edge, min_piece)
        rows = self._core.cut(as_blade(blade)._core, sorted(set(chosen_bodies)), options)
        cuts = tuple(
            BodyCut(body, MeshChange._from_core(change), **report) for body, change, report in rows
        )
        for each in cuts:
            self._meshes[each.body] = each.change.mesh
        return cuts

    def replace(self, body: int | str, mesh: Mesh) -> None:
        """Give a body another mesh (after a change of topology); its positions are the mesh's."""
        index = body_index(self._names, body)
        self._core.replace(index, as_mesh(mesh, "mesh")._core)
        self._meshes[index] = mesh

    def update(self, positions: Sequence[npt.ArrayLike] | npt.ArrayLike) -> None:
        """Move every body and refit the bounding trees.

        Parameters
        ----------
        positions : sequence of (n, 3) arrays, one per body, or one stacked (N, 3) array
            Node positions [m]. C-contiguous float64 is read without conversion. A stacked array
            holds the bodies one after the other, see `node_offsets`.

        Raises
        ------
        ValueError, TypeError
            If shapes, dtypes or values do not fit; the scene then stays as it was.
        """
        self._core.update(split_positions(positions, [len(mesh.nodes) for mesh in self._meshes]))

    def positions(self, body: int | str) -> Float64Array:
        """Current node positions [m] of a body, shape (n, 3), read-only."""
        return self._core.positions(body_index(self._names, body))

    def ignore(self, body_a: int | str, body_b: int | str, ignored: bool = True) -> None:
        """Leave two bodies out of every query, or take them in again.

        The same body twice is its self-contact. `replace` keeps what is ignored.
        """
        index_a, index_b = body_index(self._names, body_a), body_index(self._names, body_b)
        self._core.ignore(index_a, index_b, bool(ignored))

    def set_groups(self, body: int | str, groups: npt.ArrayLike) -> None:
        """Put the surface triangles of a body into groups, within which nothing is tested.

        Two triangles in the same group, whatever their bodies, are no pair in `intersections` and
        `contact_nodes`. A node or an edge is in the groups of all triangles around it, and two
        elements with a group in common are no pair in `proximity`. `replace` ends a body's groups.

        Parameters
        ----------
        groups : (m,) integers
            Group of each surface triangle; 0 for none.
        """
        index = body_index(self._names, body)
        self._core.set_groups(index, _arrays.indices(groups, "groups", None))

    def intersections(
        self, *, self_contact: bool = True, same_leaf: bool = True, shared_nodes: bool = False
    ) -> Intersections:
        """Every pair of surface triangles that meet, decided exactly for the given positions.

        Touching and coplanar overlap count; two triangles of one body that share a node do not,
        unless ``shared_nodes`` is True.

        Parameters
        ----------
        self_contact : bool
            Whether each body is also tested against itself.
        same_leaf : bool
            Whether triangles in one leaf are tested against each other. The paper leaves them out;
            with True the result is complete at any leaf size.
        shared_nodes : bool
            Whether triangles of one body that share nodes count where they meet elsewhere too: in a
            point other than the node they share, or beyond the edge they share (one is then folded
            flat over the other). So folds show, and fronts of cuts that run into themselves.
        """
        options = bool(self_contact), bool(same_leaf), bool(shared_nodes)
        pairs, stats = self._core.intersections(*options)
        return Intersections(pairs, DetectionStats(*stats))

    def proximity(
        self, distance: float, *, self_contact: bool = True, close_at_rest: bool = True
    ) -> Proximity:
        """Every vertex-triangle and edge-edge pair closer than a distance.

        The two elements share no node; the triangles they belong to may. Between two bodies, nodes
        of each are held against triangles of the other.

        Parameters
        ----------
        distance : float
            [m], positive; pairs exactly as far apart do not count.
        self_contact : bool
            Whether pairs within one body count.
        close_at_rest : bool
            Whether pairs count that are closer than ``distance`` in the positions of the meshes
            already, such as the two sides of a thin wall.
        """
        distance = _arrays.scalar(distance, "distance")
        if distance <= 0:
            raise ValueError(f"distance: expected a positive number of metres, got {distance}")
        found = self._core.proximity(distance, bool(self_contact), bool(close_at_rest))
        return Proximity(*found[:-1], DetectionStats(*found[-1]))

    def contact_nodes(self, *, self_contact: bool = True) -> tuple[IndexArray, ...]:
        """Nodes of the triangles that meet, sorted, one array per body: the paper's own output."""
        return self._core.contact_nodes(bool(self_contact))

    def penetration(self, *, self_contact: bool = True) -> Penetration:
        """Every surface node strictly inside another body, or inside its own, with its way out.

        Inside another body is where its closed surface winds around the node; inside its own, where
        tetrahedra cover the node that do not have it, after folding. Both are decided exactly.

        A node leaves through the closest point of the contact patch: those triangles of the other
        surface that cross the node's body or reach into it, and face the node. So the exits of a
        patch agree, also in a thin body pushed in by more than half its thickness. A part that is
        inside as a whole, without crossing, leaves in one direction.

        Known limits: direction and depth jump where a triangle begins or ends to cross, where two
        exits are equally near, and when a part goes under as a whole. A node that came out on the
        far side of a thin body is outside. In a body with tetrahedra turned over, nodes inside
        itself may be missed; so are those of a body in one part whose only triangles that meet
        share nodes.

        Parameters
        ----------
        self_contact : bool
            Whether each body is also tested against itself. Needs tetrahedra.
        """
        arrays, stats = self._core.penetration(bool(self_contact))
        return Penetration(*arrays, DetectionStats(*stats))

    def closest(
        self,
        points: npt.ArrayLike,
        *,
        body: int | str | None = None,
        max_distance: float = np.inf,
    ) -> ClosestPoints:
        """The surface point closest to each point, of one body or of all.

        Of equally close points that of the lowest (body, triangle).

        Parameters
        ----------
        points : (k, 3) array
            Points [m].
        body : int or str, optional
            The only body to look at.
        max_distance : float
            Points farther than this [m] from any surface get no answer; nor do those whose squared
            distance overflows.
        """
        return ClosestPoints(*self._core.closest(*self._query(body, max_distance, points=points)))

    def contains(
        self, points: npt.ArrayLike, *, body: int | str | None = None
    ) -> npt.NDArray[np.bool_]:
        """Whether points [m] (k, 3) are strictly inside bodies: shape (k, bodies), or (k,) for one.

        Inside is where the surface's winding number is not zero, decided exactly: a point on the
        surface is not inside, and nothing is inside a body whose surface is open.
        """
        array = _arrays.points(points, "points")
        if body is not None:
            return self._core.contains(array, body_index(self._names, body))
        return self._core.contains(array, None).reshape(len(array), len(self))

    def cast(
        self,
        origins: npt.ArrayLike,
        directions: npt.ArrayLike,
        *,
        body: int | str | None = None,
        max_distance: float = np.inf,
    ) -> RayHits:
        """Where each ray first meets the surface of one body, or of any.

        Surfaces are hit from both sides and where a ray begins on them; no ray slips through
        between two triangles. Of hits at the same distance that of the lowest (body, triangle).

        Parameters
        ----------
        origins : (k, 3) array
            Where the rays begin [m].
        directions : (k, 3) array
            Of any length but zero.
        body : int or str, optional
            The only body to look at.
        max_distance : float
            Length of the rays [m].
        """
        given = self._query(body, max_distance, origins=origins, directions=directions)
        return RayHits(*self._core.cast(*given))

    def _query(self, body: int | str | None, max_distance: float, **points: Any) -> tuple[Any, ...]:
        arrays = [_arrays.points(array, name) for name, array in points.items()]
        index = None if body is None else body_index(self._names, body)
        distance = _arrays.number(max_distance, "max_distance")
        return (*arrays, index, distance)

    def memory(self) -> dict[str, float]:
        """Bytes that the method keeps beside the meshes, by part; zero for methods without any.

        ``layout`` is the sum of all parts but ``buffers``, which grow with what is found.
        """
        return self._core.memory()

    def boxes(self, body: int | str, level: int = 0) -> Float64Array:
        """Boxes at one level of a body's bounding tree, as they are now.

        Parameters
        ----------
        body : int or str
            The body, by index or name.
        level : int
            How many splits below the root: 0 is the box of the body. Leaves above the level count
            to it, so that the boxes of every level hold the whole surface.

        Returns
        -------
        (k, 2, 3) float64
            Low and high corner [m] of each box.

        Examples
        --------
        >>> import palpate
        >>> scene = palpate.Scene("small")
        >>> scene.boxes("tray").shape
        (1, 2, 3)
        >>> len(scene.boxes("tray", level=3))
        8
        """
        level = _arrays.count(level, "level", minimum=0)
        return self._core.boxes(body_index(self._names, body), level).reshape(-1, 2, 3)

    def tree_stats(self, body: int | str) -> dict[str, Any]:
        """Counts of a body's bounding tree: nodes, leaves, depth, how full the leaves are."""
        return self._core.tree_stats(body_index(self._names, body))

    @property
    def update_time(self) -> float:
        """Duration [s] of the refit in the last `update`."""
        return self._core.update_time

    def __repr__(self) -> str:
        total = sum(len(mesh.triangles) for mesh in self._meshes)
        return f"Scene({len(self)} bodies, {total} surface triangles)"


def split_positions(
    positions: Sequence[npt.ArrayLike] | npt.ArrayLike, counts: Sequence[int]
) -> list[Float64Array]:
    """One (n, 3) array per body from a sequence of them or from a stacked (N, 3) array."""
    total = sum(counts)
    if isinstance(positions, np.ndarray) and positions.ndim == 2:
        array = _arrays.points(positions, "positions", total)
        ends = np.cumsum(counts)
        return [array[end - count : end] for end, count in zip(ends, counts, strict=True)]
    if not isinstance(positions, (list, tuple)):
        raise TypeError(
            "positions: expected a sequence of (n, 3) arrays or one stacked array of shape "
            f"({total}, 3), got {_describe(positions)}"
        )
    if len(positions) != len(counts):
        raise ValueError(
            f"positions: expected {len(counts)} arrays, one per body, got {len(positions)}"
        )
    return [
        _arrays.points(part, f"positions[{index}]", count)
        for index, (part, count) in enumerate(zip(positions, counts, strict=True))
    ]


def _describe(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    return type(value).__name__


def _offsets(counts: Iterable[int]) -> IndexArray:
    offsets = np.concatenate([[0], np.cumsum(list(counts), dtype=np.int64)]).astype(np.int32)
    offsets.setflags(write=False)
    return offsets


def _choice(value: Any, name: str, allowed: Sequence[str]) -> str:
    if value not in allowed:
        raise ValueError(f"{name}: expected one of {', '.join(allowed)}; got {value!r}")
    return str(value)


def _scene_parts(bodies: Any) -> tuple[list[Mesh], list[str], Any]:
    if isinstance(bodies, (str, os.PathLike)):
        bodies = read_model(bodies)
    if isinstance(bodies, Model):
        placed = [body.mesh for body in bodies.bodies]
        return placed, [body.name for body in bodies.bodies], bodies._core.structure
    if isinstance(bodies, (Mesh, Body)):
        bodies = [bodies]
    items = _arrays.sequence(bodies, "bodies", "palpate.Mesh or palpate.Body objects")
    meshes: list[Mesh] = []
    names: list[str] = []
    for index, item in enumerate(items):
        mesh = item.mesh if isinstance(item, Body) else as_mesh(item, f"bodies[{index}]")
        name = item.name if isinstance(item, Body) else f"body_{index + 1}"
        meshes.append(mesh)
        names.append(unique_name(name, names))
    return meshes, names, None
