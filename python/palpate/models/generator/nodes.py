"""Places surface and interior nodes evenly: centroidal Voronoi relaxation over dense samples."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from .shapes import Points, Shape


def gradient(shape: Shape, x: Points, step: float = 1e-5) -> np.ndarray:
    """Central differences, (n, 3)."""
    columns = []
    for axis in range(3):
        offset = np.zeros(3)
        offset[axis] = step
        columns.append((shape(x + offset) - shape(x - offset)) / (2.0 * step))
    return np.stack(columns, axis=1)


def project(shape: Shape, x: Points, rounds: int = 6) -> Points:
    """Newton steps along the gradient to the zero set."""
    x = x.copy()
    for _ in range(rounds):
        g = gradient(shape, x)
        x -= (shape(x) / np.maximum((g * g).sum(1), 1e-12))[:, None] * g
    return x


@dataclass
class Samples:
    """A dense, even cover of a shape: surface points with normals, and volume points with depth [m]."""

    surface: Points
    normals: Points
    volume: Points
    depth: np.ndarray

    def __post_init__(self) -> None:
        self.tree = cKDTree(self.surface)

    def project(self, x: Points) -> Points:
        """Nearest surface sample's tangent plane: second-order accurate, and fast."""
        _, nearest = self.tree.query(x)
        n = self.normals[nearest]
        return x - ((x - self.surface[nearest]) * n).sum(1)[:, None] * n


def surface_area(shape: Shape, low: Points, high: Points, spacing: float = 0.002) -> float:
    """About the area [m^2]: the volume of a thin shell over its thickness."""
    axes = [np.arange(a - spacing, b + spacing, spacing) for a, b in zip(low, high, strict=True)]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    x = x[np.abs(shape(x)) < 4.0 * spacing]
    distance = shape(x) / np.linalg.norm(gradient(shape, x), axis=1)
    return float((np.abs(distance) < 0.75 * spacing).sum() * spacing**3 / (1.5 * spacing))


def sample(shape: Shape, low: Points, high: Points, spacing: float) -> Samples:
    """Samples `shape` within the box `low`..`high` at about `spacing` [m]."""
    coarse = 4.0 * spacing
    axes = [np.arange(a - coarse, b + 2 * coarse, coarse) for a, b in zip(low, high, strict=True)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    value = shape(centres)
    sub = (np.arange(4) - 1.5) * spacing
    offsets = np.stack(np.meshgrid(sub, sub, sub, indexing="ij"), axis=-1).reshape(-1, 3)
    fine = (centres[value < 1.5 * coarse][:, None, :] + offsets).reshape(-1, 3)
    value = shape(fine)
    shell = project(shape, fine[np.abs(value) < spacing])
    shell = shell[np.abs(shape(shell)) < 1e-6]
    normals = gradient(shape, shell)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    inside = value < -0.25 * spacing
    volume = fine[inside]
    depth, _ = cKDTree(shell).query(volume)
    return Samples(shell, normals, volume, depth)


def _centroids(
    samples: Points, weights: np.ndarray, owner: np.ndarray, count: int, old: Points
) -> Points:
    total = np.bincount(owner, weights, count)
    out = np.stack([np.bincount(owner, weights * samples[:, k], count) for k in range(3)], axis=1)
    filled = total > 0
    out[filled] /= total[filled, None]
    out[~filled] = old[~filled]
    return out


def surface_nodes(samples: Samples, shape: Shape, count: int, rng: np.random.Generator) -> Points:
    """`count` points on the surface, spread evenly."""
    seeds = samples.surface[rng.choice(len(samples.surface), count, replace=False)]
    weights = np.ones(len(samples.surface))
    for _ in range(150):
        _, owner = cKDTree(seeds).query(samples.surface)
        goal = _centroids(samples.surface, weights, owner, count, seeds)
        seeds = samples.project(seeds + 1.5 * (goal - seeds))
    return project(shape, seeds)


def interior_nodes(
    samples: Samples,
    surface: Points,
    count: int,
    edge: float,
    growth: float,
    rng: np.random.Generator,
) -> Points:
    """`count` points inside; their spacing grows from `edge` by `growth` per metre of depth."""
    size = edge + growth * samples.depth
    deep = samples.depth > 0.45 * edge
    chance = np.where(deep, size**-3, 0.0)
    seeds = samples.volume[
        rng.choice(len(samples.volume), count, replace=False, p=chance / chance.sum())
    ]
    weights = size**-5
    for _ in range(80):
        _, owner = cKDTree(np.concatenate([surface, seeds])).query(samples.volume)
        mine = owner >= len(surface)
        seeds = _centroids(
            samples.volume[mine], weights[mine], owner[mine] - len(surface), count, seeds
        )
    return seeds
