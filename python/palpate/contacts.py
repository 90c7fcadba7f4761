"""What detection finds, and what finding it cost."""

from __future__ import annotations

from dataclasses import dataclass

from palpate._arrays import IndexArray


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
