"""Surfaces and tetrahedra of labels in a segmented medical image."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from palpate import _arrays
from palpate._arrays import Float64Array, IndexArray
from palpate.errors import MeshError
from palpate.mesh import Mesh
from palpate.meshing import ftetwild
from palpate.meshing.ftetwild import Progress
from palpate.meshing.image_files import read_image
from palpate.meshing.nets import surface_net
from palpate.meshing.surface import mesh_surface


def mesh_image(
    image: str | os.PathLike[str] | npt.ArrayLike,
    label: int | Sequence[int] | None = None,
    *,
    affine: npt.ArrayLike | None = None,
    edge_length: float | None = None,
    nodes: int | None = None,
    tolerance: float | None = None,
    largest: bool = False,
    progress: Progress | None = None,
) -> Mesh:
    """Fill a label of a segmented image with tetrahedra (needs ``pip install palpate[mesh]``).

    Parameters
    ----------
    image : path-like or array_like of int, shape (i, j, k)
        An image file (NIfTI, NRRD, MGH, Analyze, MINC) or the labels of its voxels.
    label : int or sequence of int, optional
        The label; several are one body, each label a region of that number. May be left out of an
        image with one label.
    affine : array_like, shape (4, 4), optional
        For an array: from voxel indices to places [m]. A file has its own.
    edge_length, nodes, tolerance, largest, progress
        As in :func:`mesh_surface`.

    Returns
    -------
    Mesh
        In the image's coordinates, in metres.
    """
    return fill_labels(
        image,
        label,
        affine,
        edge_length=edge_length,
        nodes=nodes,
        tolerance=tolerance,
        largest=largest,
        progress=progress,
    )[0]


def fill_labels(
    image: Any, label: Any, affine: npt.ArrayLike | None = None, **options: Any
) -> tuple[Mesh, Mesh]:
    """The mesh that :func:`mesh_image` makes, and the surface that it fills."""
    ftetwild.require()
    voxels, placement, labels = _opened(image, label, affine)
    surface = _surface(voxels, placement, labels)
    mesh = mesh_surface(surface, **options)
    if len(labels) > 1:
        regions = _regions(mesh, voxels, placement, labels)
        notes = list(mesh.notes)
        mesh = Mesh._from_core(Mesh(mesh.nodes, mesh.tetrahedra, regions=regions)._core, notes)
    return mesh, surface


def label_surface(
    image: str | os.PathLike[str] | npt.ArrayLike,
    label: int | Sequence[int] | None = None,
    *,
    affine: npt.ArrayLike | None = None,
) -> Mesh:
    """The smooth closed surface of a label: for rigid bodies such as bones, or for another mesher.

    Constrained surface nets (Gibson 1998): within a voxel of the label, of its volume, no steps.
    Parameters as in :func:`mesh_image`.
    """
    return _surface(*_opened(image, label, affine))


def _opened(
    image: Any, label: int | Sequence[int] | None, affine: npt.ArrayLike | None
) -> tuple[npt.NDArray[np.int64], Float64Array, tuple[int, ...]]:
    """Labels of the voxels, index to place [m], and the labels that are meant."""
    if isinstance(image, (str, os.PathLike)):
        if affine is not None:
            raise ValueError("affine: an image file has its own")
        values, placement = read_image(Path(image))
        name = f"{image}: "
    else:
        values, name = np.asarray(image), ""
        if affine is None:
            raise ValueError("affine: needed for an array: from voxel indices to places [m]")
        placement = np.asarray(affine, dtype=np.float64)
    if values.ndim == 4 and values.shape[3] == 1:
        values = values[..., 0]
    if values.ndim != 3:
        raise MeshError(
            f"{name}expected an image of three dimensions, got shape {values.shape}; "
            "segments that overlap must be made a label map first"
        )
    if placement.shape != (4, 4) or not np.isfinite(placement).all():
        raise ValueError(f"{name}affine: expected a finite (4, 4) matrix, got {placement}")
    if np.linalg.det(placement[:3, :3]) == 0:
        raise ValueError(f"{name}affine: voxels without volume: {placement[:3, :3].tolist()}")
    if values.dtype.kind not in "iub":
        if not np.isfinite(values).all():
            raise MeshError(f"{name}not a label image: some voxels are not finite")
        if np.any(values != np.round(values)):
            raise MeshError(
                f"{name}not a label image: some values are not whole; "
                "segment it first, for example by a threshold"
            )
    return values, placement, _labels(values, label, name)


def _labels(values: npt.NDArray[Any], label: Any, name: str) -> tuple[int, ...]:
    """The labels that are meant, all there."""
    known, counts = np.unique(values, return_counts=True)
    there = {int(each): int(count) for each, count in zip(known, counts, strict=True) if each}
    listed = ", ".join(f"{each} ({count:,} voxels)" for each, count in list(there.items())[:20])
    if not there:
        raise MeshError(f"{name}the image is empty: every voxel is 0")
    if label is None:
        if len(there) > 1:
            raise MeshError(f"{name}which label (--label)? There are {listed}")
        return tuple(there)
    wanted = label if isinstance(label, Sequence) else (label,)
    labels = tuple(dict.fromkeys(_arrays.count(each, "label", minimum=1) for each in wanted))
    if not labels:
        raise ValueError("label: expected at least one")
    for each in labels:
        if each not in there:
            raise MeshError(f"{name}no voxel has label {each}; there are {listed}")
    return labels


def _surface(values: npt.NDArray[Any], placement: Float64Array, labels: tuple[int, ...]) -> Mesh:
    inside = np.isin(values, labels)
    spans = [np.flatnonzero(inside.any(axis=tuple({0, 1, 2} - {axis}))) for axis in range(3)]
    window = tuple(slice(span[0], span[-1] + 1) for span in spans)
    nodes, triangles = surface_net(inside[window], placement[:3, :3])
    nodes += [span[0] for span in spans]
    return Mesh(nodes @ placement[:3, :3].T + placement[:3, 3], triangles=triangles)


def _regions(
    mesh: Mesh, values: npt.NDArray[Any], placement: Float64Array, labels: tuple[int, ...]
) -> IndexArray:
    """The label of the voxel nearest to each tetrahedron's middle that has one of the labels."""
    axes = placement[:3, :3]
    middles = (mesh.nodes[mesh.tetrahedra].mean(axis=1) - placement[:3, 3]) @ np.linalg.inv(axes).T
    regions = np.zeros(len(middles), dtype=np.int32)
    reach = 0
    while len(unknown := np.flatnonzero(regions == 0)):
        nearest = np.full(len(unknown), np.inf)
        for step in np.ndindex(3 * (2 * reach + 1,)):
            voxels = np.rint(middles[unknown]).astype(np.int64) + step - reach
            voxels = np.clip(voxels, 0, np.array(values.shape) - 1)
            found = values[tuple(voxels.T)]
            away = np.linalg.norm((voxels - middles[unknown]) @ axes.T, axis=1)
            better = np.isin(found, labels) & (away < nearest)
            regions[unknown[better]] = found[better]
            nearest[better] = away[better]
        reach += 1
    return regions


__all__ = ["label_surface", "mesh_image"]
