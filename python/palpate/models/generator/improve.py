"""Improves tetrahedra: edge removal, face removal, and node smoothing, each only where it gains.

The measure is the smallest sine of a tetrahedron's dihedral angles. Edge removal follows Freitag and
Ollivier-Gooch (1997): the ring around an edge is triangulated anew, best choice by dynamic programming.
"""

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from itertools import combinations

import numpy as np

from .nodes import Samples
from .shapes import Points
from .tetrahedra import FACES, quality, surface_triangles

Tet = tuple[int, int, int, int]
LONGEST_RING = 7
# A surface edge may be flipped when its two triangles' normals are this close (cosine).
FLAT = 0.94
# A flip of a surface edge must not make a triangle worse than this, unless one was.
GOOD_TRIANGLE = 0.5
LEAST_GAIN = 1e-3
# Weight of the shape of surface triangles (0 to 1) beside the sine of tetrahedra.
TRIANGLE_WEIGHT = 0.8
LEAST_ROUNDS, MOST_ROUNDS = 10, 30
# The smallest sine of a dihedral angle that needs no more work: 23 to 157 degrees.
FINE = 0.39


class Improver:
    """Owns a mesh while it is improved. `surface_count`: nodes below it lie on the surface."""

    def __init__(
        self, nodes: Points, tetrahedra: np.ndarray, surface_count: int, samples: Samples
    ) -> None:
        self.nodes = nodes.copy()
        self.surface_count = surface_count
        self.samples = samples
        self.tets: dict[int, Tet] = {}
        self.around: defaultdict[int, set[int]] = defaultdict(set)
        self.quality: dict[int, float] = {}
        self.next_id = 0
        values = quality(self.nodes[tetrahedra])
        for tet, value in zip(tetrahedra.tolist(), values.tolist(), strict=True):
            self._add(tuple(tet), value)

    def tetrahedra(self) -> np.ndarray:
        return np.array([self.tets[k] for k in sorted(self.tets)], dtype=np.int64)

    def _add(self, tet: Tet, value: float) -> None:
        self.tets[self.next_id] = tet
        self.quality[self.next_id] = value
        for node in tet:
            self.around[node].add(self.next_id)
        self.next_id += 1

    def _remove(self, key: int) -> None:
        for node in self.tets.pop(key):
            self.around[node].discard(key)
        del self.quality[key]

    def _replace(self, old: Iterable[int], new: Sequence[Tet], values: Sequence[float]) -> None:
        for key in list(old):
            self._remove(key)
        for tet, value in zip(new, values, strict=True):
            self._add(tet, value)

    def _sharing(self, nodes: Sequence[int]) -> set[int]:
        found = set(self.around[nodes[0]])
        for node in nodes[1:]:
            found &= self.around[node]
        return found

    def _ring(self, a: int, b: int, shell: Iterable[int]) -> tuple[list[int], bool] | None:
        """Ring of nodes around edge a-b, in the sense that tetrahedra (a, b, p, next p) are positive; closed or not."""
        follow: dict[int, int] = {}
        for key in sorted(shell):
            tet = self.tets[key]
            i, j = tet.index(a), tet.index(b)
            p, q = (tet[k] for k in range(4) if k not in (i, j))
            if _odd((i, j, tet.index(p), tet.index(q))):
                p, q = q, p
            if p in follow:
                return None
            follow[p] = q
        starts = set(follow) - set(follow.values())
        if len(starts) > 1:
            return None
        start = starts.pop() if starts else min(follow)
        ring = [start]
        while ring[-1] in follow and len(ring) <= len(follow):
            following = follow[ring[-1]]
            if following == start:
                break
            ring.append(following)
        closed = not set(follow) ^ set(follow.values())
        if len(ring) != len(follow) + (0 if closed else 1):
            return None
        return ring, closed

    def remove_edge(self, a: int, b: int) -> bool:
        """Triangulates the ring of edge a-b anew without it, if the worst tetrahedron gets better."""
        shell = self._sharing((a, b))
        if not 1 <= len(shell) <= LONGEST_RING:
            return False
        found = self._ring(a, b, shell)
        if found is None:
            return False
        ring, closed = found
        n = len(ring)
        if closed and n < 3:
            return False
        if not closed and not self._may_flip_surface(a, b, ring[0], ring[-1]):
            return False
        worst = min(self.quality[k] for k in shell)
        triples = list(combinations(range(n), 3))
        value: dict[tuple[int, int, int], float] = {}
        if triples:
            picked = np.array([[ring[i] for i in t] for t in triples])
            lower = np.column_stack([np.full(len(picked), a), picked])
            upper = np.column_stack([np.full(len(picked), b), picked[:, [0, 2, 1]]])
            both = np.minimum(quality(self.nodes[lower]), quality(self.nodes[upper]))
            value = dict(zip(triples, both.tolist(), strict=True))
        best: dict[tuple[int, int], float] = {(i, i + 1): math.inf for i in range(n - 1)}
        choice: dict[tuple[int, int], int] = {}
        for span in range(2, n):
            for i in range(n - span):
                j = i + span
                options = [
                    (min(value[i, k, j], best[i, k], best[k, j]), k) for k in range(i + 1, j)
                ]
                best[i, j], choice[i, j] = max(options)
        if best[0, n - 1] <= worst + LEAST_GAIN:
            return False
        new: list[Tet] = []
        stack = [(0, n - 1)]
        while stack:
            i, j = stack.pop()
            if j - i < 2:
                continue
            k = choice[i, j]
            new.append((a, ring[i], ring[k], ring[j]))
            new.append((b, ring[i], ring[j], ring[k]))
            stack += [(i, k), (k, j)]
        if closed and self._known(new, shell):
            return False
        self._replace(shell, new, quality(self.nodes[np.array(new)]).tolist() if new else [])
        return True

    def _known(self, new: Sequence[Tet], shell: set[int]) -> bool:
        """Whether an inner edge to be made already exists outside the shell (then the result would overlap)."""
        return any(self._sharing(tet) - shell for tet in new)

    def _may_flip_surface(self, a: int, b: int, p: int, q: int) -> bool:
        if max(a, b, p, q) >= self.surface_count or self._sharing((p, q)) - self._sharing(
            (a, b, p, q)
        ):
            return False
        x = self.nodes
        old, new = np.array([(a, p, b), (a, b, q)]), np.array([(a, p, q), (b, q, p)])
        shape_before, shape_after = triangle_quality(x[old]).min(), triangle_quality(x[new]).min()
        if shape_after < min(shape_before, GOOD_TRIANGLE):
            return False
        aligned = all(float(_normal(*x[s]) @ _normal(*x[t])) > FLAT for s, t in (old, new))
        return aligned and len(self.around[a]) > 3 and len(self.around[b]) > 3

    def remove_face(self, face: Sequence[int]) -> bool:
        """2-3 flip: the face of two tetrahedra gives way to the edge between their far nodes."""
        pair = sorted(self._sharing(face))
        if len(pair) != 2:
            return False
        d, e = (next(n for n in self.tets[k] if n not in face) for k in pair)
        if self._sharing((d, e)):
            return False
        worst = min(self.quality[k] for k in pair)
        a, b, c = face
        if (
            float(
                np.cross(self.nodes[b] - self.nodes[a], self.nodes[c] - self.nodes[a])
                @ (self.nodes[d] - self.nodes[a])
            )
            < 0
        ):
            b, c = c, b
        new: list[Tet] = [(a, b, e, d), (b, c, e, d), (c, a, e, d)]
        values = quality(self.nodes[np.array(new)])
        if values.min() <= worst + LEAST_GAIN:
            return False
        self._replace(pair, new, values.tolist())
        return True

    def flip(self, bar: float) -> int:
        """Edge and face removal on the tetrahedra below `bar`, worst first, until none gains."""
        count = 0
        fresh = {k for k, v in self.quality.items() if v < bar}
        while fresh:
            before = self.next_id
            for key in sorted(fresh, key=lambda k: (self.quality[k], k)):
                if key in self.tets:
                    self._flip_one(self.tets[key])
            made = [k for k in range(before, self.next_id) if k in self.tets]
            count += len(made)
            # Only where something changed can another attempt succeed.
            nodes = {n for k in made for n in self.tets[k]}
            fresh = {k for n in nodes for k in self.around[n] if self.quality[k] < bar}
        return count

    def _flip_one(self, tet: Tet) -> bool:
        return any(self.remove_edge(a, b) for a, b in combinations(sorted(tet), 2)) or any(
            self.remove_face([tet[i] for i in f]) for f in FACES
        )

    def smooth(self, bar: float, rng: np.random.Generator) -> None:
        """Moves nodes of elements below `bar` to where the worst around is best; surface nodes slide."""
        nodes = {n for k, v in self.quality.items() if v < bar for n in self.tets[k]}
        surface = surface_triangles(self.tetrahedra())
        poor = TRIANGLE_WEIGHT * triangle_quality(self.nodes[surface]) < bar
        nodes.update(surface[poor].ravel().tolist())
        for node in sorted(nodes):
            self._smooth_node(node, rng)

    def _smooth_node(self, node: int, rng: np.random.Generator) -> None:
        keys = sorted(self.around[node])
        tets = np.array([self.tets[k] for k in keys])
        on_surface = node < self.surface_count
        triangles = self._fan(node, tets) if on_surface else np.empty((0, 3), dtype=np.int64)
        start = self.nodes[node].copy()

        def worst(trials: Points) -> np.ndarray:
            value = quality(_moved(self.nodes, tets, node, trials)).min(1)
            if on_surface:
                shape = triangle_quality(_moved(self.nodes, triangles, node, trials)).min(1)
                value = np.minimum(value, TRIANGLE_WEIGHT * shape)
            return value

        edge = float(np.median(np.linalg.norm(self.nodes[tets] - start, axis=2).max(1)))
        before = float(worst(start[None])[0])
        here, best, step = start, before, 0.2 * edge
        for _ in range(7):
            directions = rng.normal(size=(20, 3))
            directions /= np.linalg.norm(directions, axis=1)[:, None]
            trials = here + step * directions
            if on_surface:
                trials = self.samples.project(trials)
            values = worst(trials)
            top = int(values.argmax())
            if values[top] > best:
                here, best = trials[top], float(values[top])
            else:
                step *= 0.5
        if best <= before + 1e-5:
            return
        self.nodes[node] = here
        for key, value in zip(keys, quality(self.nodes[tets]).tolist(), strict=True):
            self.quality[key] = value

    def _fan(self, node: int, tets: np.ndarray) -> np.ndarray:
        """Surface triangles around a surface node: the faces that only one tetrahedron has."""
        faces = np.sort(tets[:, FACES].reshape(-1, 3), axis=1)
        unique, counts = np.unique(faces[(faces == node).any(1)], axis=0, return_counts=True)
        return unique[counts == 1]


def _moved(nodes: Points, elements: np.ndarray, node: int, trials: Points) -> np.ndarray:
    """Corners of the elements for each trial position of `node`, (trials, elements, corners, 3)."""
    corners = nodes[elements]
    moved = np.broadcast_to(corners, (len(trials), *corners.shape)).copy()
    moved[:, np.arange(len(elements)), np.argmax(elements == node, axis=1)] = trials[:, None, :]
    return moved


def triangle_quality(corners: np.ndarray) -> np.ndarray:
    """(..., 3, 3) -> (...): 4 sqrt(3) area / sum of squared sides; 1 when equilateral."""
    a, b, c = (corners[..., k, :] for k in range(3))
    area = np.sqrt((np.cross(b - a, c - a) ** 2).sum(-1)) / 2.0
    squares = ((b - a) ** 2).sum(-1) + ((c - b) ** 2).sum(-1) + ((a - c) ** 2).sum(-1)
    return 4.0 * math.sqrt(3.0) * area / np.maximum(squares, 1e-30)


def _odd(order: tuple[int, int, int, int]) -> bool:
    return sum(order[i] > order[j] for i, j in combinations(range(4), 2)) % 2 == 1


def _normal(a: Points, b: Points, c: Points) -> Points:
    n = np.cross(b - a, c - a)
    return n / max(float(np.linalg.norm(n)), 1e-30)


def improve(
    nodes: Points, tetrahedra: np.ndarray, surface_count: int, samples: Samples, seed: int
) -> tuple[Points, np.ndarray]:
    """Alternates flips and smoothing with a rising bar until the worst tetrahedron is fine."""
    work = Improver(nodes, tetrahedra, surface_count, samples)
    rng = np.random.default_rng(seed)
    for turn in range(MOST_ROUNDS):
        bar = min(0.35 + 0.03 * turn, 0.55)
        work.flip(bar)
        work.smooth(bar, rng)
        if turn >= LEAST_ROUNDS and min(work.quality.values()) > FINE:
            break
    return work.nodes, work.tetrahedra()
