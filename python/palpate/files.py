"""Mesh files: ``.seg`` and ``.vtk`` by the core, every other format through meshio."""

from __future__ import annotations

import os
import tempfile
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from palpate import _core
from palpate.errors import MeshError
from palpate.mesh import Mesh
from palpate.results.atomic import naming

#: Extensions that the core reads and writes itself.
CORE_FORMATS = tuple(f".{each}" for each in _core.MESH_EXTENSIONS)

#: meshio's name for cells whose first nodes are the corners of a tetrahedron or triangle.
_TETRAHEDRA = {"tetra": False, "tetra10": True}
_TRIANGLES = {"triangle": False, "triangle6": True}

#: Where an extension stands for several formats, the one that is written. Gmsh 2.2 is what most
#: programs read.
_WRITE_AS = {".msh": "gmsh22"}


def read_mesh(path: str | os.PathLike[str], *, repair: bool = False) -> Mesh:
    """Read a mesh; the extension names the format.

    Parameters
    ----------
    path : path-like
        ``.seg`` and ``.vtk`` are read by the core. Gmsh ``.msh``, ``.vtu``, TetGen
        ``.node``/``.ele``, Abaqus ``.inp``, Medit ``.mesh``, ``.stl``, ``.obj``, ``.ply`` and
        others are read through meshio (``pip install palpate[io]``).
    repair : bool
        Mend inverted, degenerate and duplicate tetrahedra and unused nodes instead of refusing.

    Returns
    -------
    Mesh
        Its ``notes`` say which cells were left out and what was mended.

    Raises
    ------
    MeshError
        With ``.path`` and, for text formats of the core, ``.line``.
    OSError
        If the file cannot be opened.
    """
    path = Path(path)
    if path.suffix.lower() in CORE_FORMATS:
        return Mesh._from_core(*_core.read_mesh_file(str(path), bool(repair)))
    return _read_with_meshio(path, repair)


def write_mesh(path: str | os.PathLike[str], mesh: Mesh) -> None:
    """Write a mesh; the extension names the format, the file is complete or absent.

    Node sets, regions and fibres travel in ``.seg``; other formats keep what they can.
    """
    path = Path(path)
    if path.suffix.lower() in CORE_FORMATS:
        _core.write_mesh_file(str(path), mesh._core)
    else:
        _write_with_meshio(path, mesh)


def _meshio(path: Path) -> Any:
    try:
        import meshio
    except ImportError:
        raise MeshError(
            f"{path}: the core knows {', '.join(CORE_FORMATS)}; "
            "other formats need meshio: pip install 'palpate[io]'",
            str(path),
        ) from None
    return meshio


def _check_extension(known: Any, path: Path) -> None:
    if not any(path.name.lower().endswith(suffix) for suffix in known):
        raise MeshError(
            f"{path}: {path.suffix or 'a name without extension'} is no mesh format known here; "
            "use .seg, .vtk or one of meshio's, such as .msh, .vtu, .stl",
            str(path),
        )


def _read_with_meshio(path: Path, repair: bool) -> Mesh:
    if not path.exists():
        raise FileNotFoundError(2, "No such file or directory", str(path))
    if path.is_dir():
        raise IsADirectoryError(21, "Is a directory", str(path))
    meshio = _meshio(path)
    _check_extension(meshio.extension_to_filetypes, path)
    try:
        with warnings.catch_warnings():  # numpy's, about meshio's own arithmetic
            warnings.simplefilter("ignore")
            raw = meshio.read(path)
    except SystemExit:  # meshio ends the process on some unknown formats
        raise MeshError(f"{path}: not a mesh that meshio can read", str(path)) from None
    except Exception as error:
        raise MeshError(f"{path}: meshio cannot read it: {error}", str(path)) from error
    try:
        return _from_meshio(raw, repair)
    except MeshError as error:
        raise MeshError(f"{path}: {error}", str(path)) from None


def _from_meshio(raw: Any, repair: bool) -> Mesh:
    points = np.asarray(raw.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise MeshError(f"expected points of shape (n, 3), got {points.shape}")
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    solid = any(block.type in _TETRAHEDRA and len(block.data) for block in raw.cells)
    wanted, corners = (_TETRAHEDRA, 4) if solid else (_TRIANGLES, 3)
    cells, regions, fibres, notes = [], [], [], []
    left_out: Counter[str] = Counter()
    for index, block in enumerate(raw.cells):
        if block.type not in wanted:
            left_out[block.type] += len(block.data)
            continue
        if wanted[block.type]:
            notes.append(f"{len(block.data)} {block.type} cells: only their corners are used")
        cells.append(np.asarray(block.data, dtype=np.int64)[:, :corners])
        regions.append(_region_data(raw, index, len(block.data)))
        fibres.append(_fibre_data(raw, index, len(block.data)))
    if not cells:
        found = ", ".join(sorted(left_out)) or "no cells"
        raise MeshError(f"no tetrahedra and no triangles in it (found: {found})")
    notes.extend(f"{total} {kind} cells left out" for kind, total in sorted(left_out.items()))
    elements = np.concatenate(cells)
    points, elements, merged = (
        _merge_equal_points(points, elements)
        if not solid
        else (
            points,
            elements,
            0,
        )
    )
    if merged:
        notes.append(f"{merged} points at equal positions merged")
        a, b, c = elements.T
        flat = (a == b) | (b == c) | (c == a)
        if flat.any():
            notes.append(f"{int(flat.sum())} triangles of merged points left out")
            elements = elements[~flat]
    points, elements, unused, kept = _drop_unused(points, elements)
    if unused:
        notes.append(f"{unused} points that no element uses left out")
    region_numbers = None
    if solid and any(part is not None for part in regions):
        region_numbers = np.concatenate(
            [
                np.zeros(len(part), dtype=np.int64) if numbers is None else numbers
                for part, numbers in zip(cells, regions, strict=True)
            ]
        )
    directions = None
    if solid and any(np.any(part) for part in fibres):
        directions = np.concatenate(fibres)
        if not np.any(directions[:, 1]):
            directions = directions[:, 0]
    node_sets = {}
    for name, members in (getattr(raw, "point_sets", None) or {}).items():
        if not merged:
            renumbered = kept[np.asarray(members, dtype=np.int64)]
            node_sets[str(name)] = np.unique(renumbered[renumbered >= 0])
    mesh = Mesh(
        points,
        elements if solid else None,
        None if solid else elements,
        node_sets=node_sets,
        regions=region_numbers,
        fibres=directions,
        repair=repair,
    )
    return Mesh._from_core(mesh._core, [*notes, *mesh.notes])


def _region_data(raw: Any, block: int, count: int) -> Any:
    """Integer cell data under a name that other programs use for regions, or None."""
    for name in ("region", "regions", "gmsh:physical", "medit:ref", "tetgen:ref", "material"):
        data = raw.cell_data.get(name)
        if data is not None:
            numbers = np.asarray(data[block])
            if numbers.shape == (count,) and np.all(numbers == np.round(numbers)):
                return numbers.astype(np.int64)
    return None


def _fibre_data(raw: Any, block: int, count: int) -> Any:
    """Fibre directions of both families, shape (count, 2, 3), zero where there are none."""
    fibres = np.zeros((count, 2, 3))
    for family, names in enumerate((("fibres", "fibers"), ("fibres_2", "fibers_2"))):
        for name in names:
            data = raw.cell_data.get(name)
            if data is not None and np.shape(data[block]) == (count, 3):
                fibres[:, family] = data[block]
                break
    return fibres


def _merge_equal_points(points: Any, elements: Any) -> tuple[Any, Any, int]:
    """Join points at exactly equal positions: STL gives every triangle its own three."""
    unique, first, inverse = np.unique(points, axis=0, return_index=True, return_inverse=True)
    merged = len(points) - len(unique)
    if merged == 0:
        return points, elements, 0
    order = np.argsort(first)  # keep the file's order
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return unique[order], rank[inverse.reshape(-1)][elements], merged


def _drop_unused(points: Any, elements: Any) -> tuple[Any, Any, int, Any]:
    """Leave out points that no element uses; also the new number of each point, -1 if dropped."""
    in_range = (elements >= 0) & (elements < len(points))
    kept = np.arange(len(points))
    if not in_range.all():
        return points, elements, 0, kept  # Mesh names the index
    used = np.zeros(len(points), dtype=bool)
    used[elements] = True
    kept = np.where(used, np.cumsum(used) - 1, -1)
    return points[used], kept[elements], int((~used).sum()), kept


def _write_with_meshio(path: Path, mesh: Mesh) -> None:
    meshio = _meshio(path)
    _check_extension(meshio.extension_to_filetypes, path)
    solid = len(mesh.tetrahedra) > 0
    cells = [("tetra", mesh.tetrahedra)] if solid else [("triangle", mesh.triangles)]
    if path.suffix.lower() in (".stl", ".obj", ".ply", ".off"):
        cells = [("triangle", mesh.triangles)]
    cell_data: dict[str, list[Any]] = {}
    if mesh.regions is not None and cells[0][0] == "tetra":
        cell_data["region"] = [mesh.regions]
    if mesh.fibres is not None and cells[0][0] == "tetra":
        families = mesh.fibres.reshape(len(mesh.tetrahedra), -1, 3)
        for family, name in zip(np.moveaxis(families, 1, 0), ("fibres", "fibres_2"), strict=False):
            cell_data[name] = [family]
    raw = meshio.Mesh(mesh.nodes, cells, cell_data=cell_data)
    # Written next to its place and renamed, so that the file is complete or absent; some formats
    # (TetGen) are several files, which all move.
    with naming(path), tempfile.TemporaryDirectory(dir=path.parent, prefix=".palpate-") as folder:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                meshio.write(Path(folder) / path.name, raw, _WRITE_AS.get(path.suffix.lower()))
        except SystemExit:
            raise MeshError(f"{path}: meshio cannot write this format", str(path)) from None
        except OSError:
            raise
        except Exception as error:
            raise MeshError(f"{path}: meshio cannot write it: {error}", str(path)) from error
        for part in sorted(Path(folder).iterdir()):
            part.replace(path.parent / part.name)
