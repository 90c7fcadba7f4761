"""What detection finds, and what finding it cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from palpate._arrays import Float64Array, IndexArray


@dataclass(frozen=True)
class DetectionStats:
    """What a query cost.

    Times [s] per stage: ``object_time`` (which bodies' boxes overlap), ``traversal_time`` (which
    leaves), ``polygon_time`` (exact triangle tests). ``pair_tests`` of ``all_pairs`` triangle pairs
    were tested.
    """

    object_time: float
    traversal_time: float
    polygon_time: float
    object_pairs: int
    nodes_visited: int
    leaf_pairs: int
    box_tests: int
    pair_tests: int
    all_pairs: int

    @property
    def fraction(self) -> float:
        """Fraction of all triangle pairs that was tested."""
        return self.pair_tests / self.all_pairs if self.all_pairs else 0.0


@dataclass(frozen=True, eq=False)
class Intersections:
    """Surface triangles that meet, sorted.

    ``pairs`` has shape (k, 4): body_a, triangle_a, body_b, triangle_b, with
    (body_a, triangle_a) < (body_b, triangle_b); read-only.
    """

    pairs: IndexArray
    stats: DetectionStats

    @property
    def bodies(self) -> IndexArray:
        """The two bodies of each pair, shape (k, 2)."""
        return self.pairs[:, 0::2]

    @property
    def triangles(self) -> IndexArray:
        """The two triangles of each pair, shape (k, 2)."""
        return self.pairs[:, 1::2]

    def __len__(self) -> int:
        return len(self.pairs)

    def __repr__(self) -> str:
        return f"Intersections({len(self)} pairs, {self.stats.fraction:.2g} of all pairs tested)"


@dataclass(frozen=True, eq=False)
class Proximity:
    """Surface elements closer than the asked distance, sorted by (kind, bodies, elements).

    The pair's elements share no node. All arrays are read-only, one row per pair:

    ``kind`` (k,)
        `VERTEX_TRIANGLE` or `EDGE_EDGE`.
    ``bodies`` (k, 2)
        Body of side a (the node, or the first edge) and of side b.
    ``elements`` (k, 2)
        Node and triangle, or two rows of `Mesh.surface_edges`.
    ``nodes`` (k, 4)
        The node and the triangle's three, or the edges' two and two.
    ``weights`` (k, 4)
        Of the closest points: positive on side a, negative on side b, sum 0. They are the contact's
        Jacobian: the gap is the weighted sum of the nodes' positions along the normal.
    ``normals`` (k, 3)
        Unit vectors from side b to side a; a normal of the elements where the distance is 0.
    ``distances`` (k,)
        [m]
    """

    kind: IndexArray
    bodies: IndexArray
    elements: IndexArray
    nodes: IndexArray
    weights: Float64Array
    normals: Float64Array
    distances: Float64Array
    stats: DetectionStats

    #: A node of body a and a triangle of body b.
    VERTEX_TRIANGLE: ClassVar[int] = 0
    #: An edge of each body.
    EDGE_EDGE: ClassVar[int] = 1

    def __len__(self) -> int:
        return len(self.kind)

    def __repr__(self) -> str:
        edges = int((self.kind == self.EDGE_EDGE).sum())
        return f"Proximity({len(self) - edges} vertex-triangle pairs, {edges} edge-edge pairs)"


@dataclass(frozen=True, eq=False)
class Penetration:
    """Surface nodes inside bodies, and their way out, sorted; read-only.

    ``bodies`` (k, 2): body of the node, and the body it is inside of (the same after folding).
    ``nodes`` (k,): the node. ``triangles`` (k,), ``weights`` (k, 3): the surface triangle of the
    second body to leave through, and where on it. ``directions`` (k, 3): unit vector from the node
    to that point. ``depths`` (k,): distance to it [m], positive.
    """

    bodies: IndexArray
    nodes: IndexArray
    triangles: IndexArray
    weights: Float64Array
    directions: Float64Array
    depths: Float64Array
    stats: DetectionStats

    def __len__(self) -> int:
        return len(self.nodes)

    def __repr__(self) -> str:
        deepest = f", deepest {self.depths.max():.3g} m" if len(self) else ""
        return f"Penetration({len(self)} nodes{deepest})"


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """The surface point closest to each given point; read-only.

    ``bodies`` (k,) and ``triangles`` (k,): where it is, -1 where nothing is near enough.
    ``weights`` (k, 3): barycentric, on the triangle. ``positions`` (k, 3) [m]. ``distances`` (k,)
    [m]. Without an answer weights and positions are NaN and the distance is infinite.
    """

    bodies: IndexArray
    triangles: IndexArray
    weights: Float64Array
    positions: Float64Array
    distances: Float64Array

    def __len__(self) -> int:
        return len(self.bodies)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({(self.bodies >= 0).sum()} of {len(self)})"


@dataclass(frozen=True, eq=False, repr=False)
class RayHits(ClosestPoints):
    """Where each ray first meets a surface; fields as those of `ClosestPoints`.

    ``bodies`` is -1 where a ray misses. ``distances`` (k,) [m] are measured along the rays.
    """
