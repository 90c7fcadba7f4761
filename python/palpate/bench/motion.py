"""A recorded motion: smooth, deterministic, the same at every mesh resolution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate._arrays import Float64Array
from palpate.mesh import Mesh
from palpate.model import Model

#: What the motion does, for reports.
DESCRIPTION = (
    "every soft body bends to and fro along its longest axis, curls its sides together until "
    "branches meet, carries a wave, and moves towards the scene's centre and away from it: bodies "
    "touch, press in, touch themselves and leave. An analytic field, the same at every mesh "
    "resolution"
)

#: Largest angle [rad] between a body's middle and its ends.
_BEND = 0.9
#: Largest angle [rad] between a body's middle and its sides: a little over a closed ring, less for
#: a thick body, whose inner side then just begins to fold through itself.
_CURL, _CURL_INNER = 3.4, 1.2
#: Amplitude of the wave, in half lengths of the body.
_WAVE = 0.02
#: Distance of a body from the scene's centre, in rest distances: the mean and the swing about it.
_DISTANCE, _SWING = 0.9, 0.12


@dataclass(frozen=True)
class Field:
    """Where one body's points go; rigid bodies stay.

    ``center`` and ``offset`` (from the scene's centre) [m]; ``axes`` (3, 3), rows longest first;
    ``length`` and ``width`` half of the body's extents [m]; ``curl`` the largest angle of its sides
    [rad], towards the thinner side; ``phase`` [rad].
    """

    center: Float64Array
    offset: Float64Array
    axes: Float64Array
    length: float
    width: float
    curl: float
    phase: float
    rigid: bool

    def apply(self, points: Float64Array, time: float) -> Float64Array:
        """Positions [m], shape (n, 3), of rest points at a time in [0, 2 pi)."""
        if self.rigid:
            return np.ascontiguousarray(points)
        along, beside, across = ((points - self.center) @ self.axes.T).T
        beside, across = _arc(beside, across, self.curl * np.sin(time / 2) ** 2 / self.width)
        along, across = _arc(along, across, _BEND * np.sin(time + self.phase) / self.length)
        bent = np.stack([along, beside, across], axis=1)
        wave = _WAVE * self.length * np.sin(2 * np.pi * bent[:, [1, 2, 0]] / self.length + time)
        distance = _DISTANCE - _SWING * np.cos(2 * time)
        moved = (bent + wave) @ self.axes + self.center + (distance - 1.0) * self.offset
        return np.ascontiguousarray(moved)


def _arc(
    along: Float64Array, across: Float64Array, curvature: float
) -> tuple[Float64Array, Float64Array]:
    """A straight line becomes an arc about a point on the side of positive ``across``."""
    turned = curvature * along
    # np.sinc has no trouble with curvature zero.
    on_arc = along * np.sinc(turned / np.pi)
    rise = 0.5 * curvature * along**2 * np.sinc(turned / (2 * np.pi)) ** 2
    return on_arc - across * np.sin(turned), rise + across * np.cos(turned)


def fields(model: Model) -> list[Field]:
    """The motion of a model's bodies, from their rest shapes."""
    soft = [body.mesh.nodes for body in model.bodies if body.rigid is None]
    stacked = np.concatenate(soft or [body.mesh.nodes for body in model.bodies])
    middle = (stacked.min(axis=0) + stacked.max(axis=0)) / 2
    return [
        _field(body.mesh, middle, 1.3 * index, body.rigid is not None)
        for index, body in enumerate(model.bodies)
    ]


def _field(mesh: Mesh, middle: Float64Array, phase: float, rigid: bool) -> Field:
    center = mesh.nodes.mean(axis=0)
    local = mesh.nodes - center
    _, vectors = np.linalg.eigh(local.T @ local)
    axes = vectors.T[::-1].copy()
    # An eigenvector's sign is arbitrary: the largest component is made positive.
    largest = np.abs(axes).argmax(axis=1)
    axes *= np.sign(axes[np.arange(3), largest])[:, None]
    along, beside, across = (local @ axes.T).T
    length, width = np.abs(along).max(), np.abs(beside).max()
    side = 1.0 if across.max() < -across.min() else -1.0
    curl = side * min(_CURL, _CURL_INNER * width / (side * across).max())
    return Field(center, center - middle, axes, float(length), float(width), curl, phase, rigid)


def diagonal(meshes: Sequence[Mesh]) -> float:
    """Diagonal [m] of the box around all bodies at rest."""
    nodes = np.concatenate([mesh.nodes for mesh in meshes])
    return float(np.linalg.norm(np.ptp(nodes, axis=0)))


def record(
    motion: Sequence[Field], meshes: Sequence[Mesh], frames: int
) -> list[list[Float64Array]]:
    """Positions of every body in every frame; the last frame leads on to the first."""
    return [
        [
            field.apply(mesh.nodes, 2 * np.pi * frame / frames)
            for field, mesh in zip(motion, meshes, strict=True)
        ]
        for frame in range(frames)
    ]
